//! Search for the place where frames vanish though every port shows a link: ports are closed one after the other, for a
//! moment, until frames come back.
//!
//! What is written still reaches all that lie before the hole. So a port is told to close (DL control,
//! 0x0101), for temporary use (0x0100 bit 1): after about a second the controller itself goes back to what
//! was, whatever happens to us (S2 2.4.1). If frames come back, the hole lies behind that port; if not, it
//! does not. Each try halves what is left.
//!
//! One frame decides nothing: where frames are lost at random, one comes through now and then. So those that
//! are sent from the first return on must come back, most of them, while the port is closed, and none when it
//! is open again; else the hole has gone by itself, or there never was one.
//!
//! In a ring it is the frames of card A that are followed: they are processed on their way. Those of card B may
//! still come round untouched, if the hole takes one direction only, or lies beside the ring.

use linesman_proto::address::{DeviceId, Network, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::register::{DlControl, LoopMode, table};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::{Asked, Probe, ProbeEffect};
use crate::model::search::behind;
use crate::model::{Device, HoleSearch, LoopWrite, NetworkModel, Seen};

/// So long nothing must have come back before ports are closed.
const SILENT: Span = Span::ms(100);
/// So long a closed port gets to show that it helps: longer than lost requests are repeated.
const PATIENCE: Span = Span::ms(60);
/// An order to close that was not on its way by then is given again: a line with a long cycle has much to send.
const UNSENT: Span = Span::ms(500);
/// After a port was opened again, frames that were turned back at it may still be on their way.
const SETTLE: Span = Span::ms(15);
/// A port that was told to open, and seems not to have heard it, is told again after so long.
const TOLD_AGAIN: Span = Span::ms(100);
/// When something came back, requests that were lost before have been sent again after so long, and come back.
const REPEATED: Span = Span::ms(25);
/// So many requests, sent after a port was closed or opened, decide what that has changed.
const SEVERAL: u64 = 6;
/// They must have had so much time to come back.
const ROUND: Span = Span::ms(10);
/// A silence that follows so soon upon a search belongs to it.
const AGAIN: Span = Span::s(1);
/// Frames that go on coming back for so long, when every port has opened by itself: the hole has gone.
const HEALED: Span = Span::ms(1_200);

/// A search that is going on.
#[derive(Clone, Debug)]
pub(super) struct Bisect {
    /// Links (index in the tree) that may hold the hole.
    left: Vec<usize>,
    /// The same as it was before the latest port helped: whether it did is only sure when frames vanish again.
    before: Vec<usize>,
    step: SearchStep,
}

#[derive(Clone, Copy, Debug)]
enum SearchStep {
    /// The port before this link was told to open; when.
    Open(usize, Instant),
    /// Nothing should be closed, and it is watched whether frames vanish again.
    NetworkWatch(FrameMark, Option<Opened>),
    /// The port before this link is closed; since when.
    Closed(usize, Instant),
    /// The port before this link is closed, and something came back.
    Helps(usize, FrameMark),
}

/// A port that was told to open.
#[derive(Clone, Copy, Debug)]
struct Opened {
    /// The link behind it.
    link: usize,
    /// When it was first told to.
    since: Instant,
    /// When it was last told to.
    told: Instant,
}

/// What had been sent and had come back at a time.
#[derive(Clone, Copy, Debug)]
struct FrameMark {
    at: Instant,
    sent: u64,
    processed: u64,
}

impl FrameMark {
    const fn of(model: &NetworkModel, at: Instant) -> Self {
        Self {
            at,
            sent: model.traffic.requests.sent(),
            processed: model.traffic.returns.processed(),
        }
    }

    /// How many requests were sent since, and how many frames came back, processed; `None` while these are too
    /// few to tell.
    fn since(&self, model: &NetworkModel, now: Instant) -> Option<(u64, u64)> {
        let sent = model.traffic.requests.sent() - self.sent;
        let is_enough = sent >= SEVERAL && now >= self.at + ROUND;
        is_enough.then(|| (sent, model.traffic.returns.processed() - self.processed))
    }
}

/// What a line whose ports may be closed must tell while it is well: how DL control stands, to be brought
/// back.
pub(super) const CONTROL: (RegisterAddress, u16) = (table::DL_CONTROL.address, 4);

impl Bisect {
    /// Begins a search, if the line has gone silent though the card has a link, and enough is known of it.
    pub(super) fn begin(model: &mut NetworkModel, now: Instant) -> Option<Self> {
        let traffic = &model.traffic;
        let latest = [traffic.losses.silences().back(), traffic.losses.swallowed().back()];
        let silence = latest.into_iter().flatten().find(|silence| silence.ended.is_none())?;
        let since = silence.since;
        let card = model.host.card(linesman_proto::address::Path::A);
        let has_link = card.carrier.is_some_and(|carrier| carrier.value);
        let tree = model.tree.as_ref()?;
        let was_searched =
            model.hole.and_then(|hole| hole.ended).is_some_and(|ended| since.at < ended + AGAIN);
        if now < since.at + SILENT
            || !has_link
            || was_searched
            || model.traffic.datagrams.answered() == 0
        {
            return None;
        }
        let left: Vec<usize> = (0..tree.links().len()).collect();
        model.hole = Some(HoleSearch { since, found: None, has_helped: false, ended: None });
        // That nothing comes back is known already.
        let nothing = FrameMark { at: now.before(ROUND), sent: 0, ..FrameMark::of(model, now) };
        Some(Self { before: left.clone(), left, step: SearchStep::NetworkWatch(nothing, None) })
    }

    /// Goes on. Gives what is to be written next; the search is over when the line says so.
    pub(super) fn go_on(&mut self, model: &mut NetworkModel, now: Instant) -> Option<Probe> {
        let came_back = model.traffic.returns.latest_processed();
        match self.step {
            SearchStep::Closed(link, at) if came_back.is_some_and(|back| back > at) => {
                self.step = SearchStep::Helps(link, FrameMark::of(model, now));
                None
            }
            SearchStep::Closed(link, at) => {
                let Some(sent) = close_sent(model, link, at) else {
                    if now < at + UNSENT {
                        return None;
                    }
                    self.step = SearchStep::Closed(link, now);
                    return set(model, link, Some(LoopMode::Closed), now);
                };
                // The request may be sent again for a while: what is written before that is over would be undone.
                if now < sent + PATIENCE {
                    return None;
                }
                let behind = behind(model.tree.as_ref()?, link);
                self.left.retain(|one| !behind.contains(one));
                self.close_next(model, now)
            }
            SearchStep::Helps(_, mark) if now < mark.at + REPEATED => None,
            SearchStep::Helps(link, mark) => {
                let (sent, processed) = mark.since(model, now)?;
                if processed * 4 < sent {
                    // Frames come and go: this is noise, not a hole. (In a ring each card has sent its copy, and half of
                    // what was sent may come back untouched.)
                    let all = (0..model.tree.as_ref()?.links().len()).collect();
                    end(model, all, false, now);
                    return set(model, link, None, now);
                }
                let behind = behind(model.tree.as_ref()?, link);
                self.before = self.left.clone();
                self.left.retain(|one| behind.contains(one));
                self.step = SearchStep::Open(link, now);
                // It would open by itself; but the next port may lie behind it.
                set(model, link, None, now)
            }
            SearchStep::Open(_, at) if now < at + SETTLE => None,
            SearchStep::Open(link, at) => {
                let opened = Opened { link, since: at, told: at };
                self.step = SearchStep::NetworkWatch(FrameMark::of(model, now), Some(opened));
                None
            }
            SearchStep::NetworkWatch(mark, opened)
                if came_back.is_some_and(|back| back > mark.at) =>
            {
                let mark = FrameMark::of(model, now);
                let Some(opened) = opened.filter(|opened| now < opened.since + HEALED) else {
                    // Whether the latest port helped, or the hole went just then, nobody knows.
                    end(model, std::mem::take(&mut self.before), false, now);
                    return None;
                };
                // With a long cycle the order is later on its way, and it may be lost: the port then opens by itself
                // some time later.
                let is_late = now >= opened.told + TOLD_AGAIN;
                let told = if is_late { now } else { opened.told };
                self.step = SearchStep::NetworkWatch(mark, Some(Opened { told, ..opened }));
                if is_late { set(model, opened.link, None, now) } else { None }
            }
            SearchStep::NetworkWatch(mark, _) => {
                mark.since(model, now)?;
                if self.before.len() > self.left.len()
                    && let Some(hole) = &mut model.hole
                {
                    hole.has_helped = true;
                }
                self.close_next(model, now)
            }
        }
    }

    /// Closes the port before the link that halves what is left best.
    fn close_next(&mut self, model: &mut NetworkModel, now: Instant) -> Option<Probe> {
        self.before = self.left.clone();
        if self.left.len() == 1 {
            end(model, std::mem::take(&mut self.left), true, now);
            return None;
        }
        let tree = model.tree.as_ref()?;
        let half = self.left.len() / 2;
        let share = |link: usize| {
            let behind = behind(tree, link);
            self.left.iter().filter(|one| behind.contains(one)).count()
        };
        let splits = |link: &usize| {
            // Who has the whole rest behind it tells nothing.
            near(model, *link).is_some() && share(*link) < self.left.len()
        };
        let best = self
            .left
            .iter()
            .copied()
            .filter(splits)
            .min_by_key(|link| (share(*link).abs_diff(half), *link));
        let Some(link) = best else {
            end(model, std::mem::take(&mut self.left), false, now);
            return None;
        };
        self.step = SearchStep::Closed(link, now);
        set(model, link, Some(LoopMode::Closed), now)
    }
}

/// The search is over, with these links left: the only one is found if that is certain.
fn end(model: &mut NetworkModel, left: Vec<usize>, is_certain: bool, now: Instant) {
    if let Some(hole) = &mut model.hole {
        let found = left.first().filter(|_| is_certain);
        hole.found = found.map(|link| Seen::new(*link, now, None));
        hole.ended = Some(now);
    }
    model.hole_left = left;
    model.touch();
}

/// When the order to close the port before a link was last on its way, since `at`; `None`: not yet. One that does not
/// come back is heard of only when it is given up.
fn close_sent(model: &NetworkModel, link: usize, at: Instant) -> Option<Instant> {
    let (device, port, _) = near(model, link)?;
    let is_it = |write: &&LoopWrite| {
        write.device == device && write.closed == Some(port) && write.seen.at >= at
    };
    model.loop_writes.iter().rev().find(is_it).map(|write| write.seen.at)
}

/// The port before a link, with how DL control of its controller stands.
fn near(model: &NetworkModel, link: usize) -> Option<(DeviceId, Port, DlControl)> {
    let End::Controller(node, port) = model.tree.as_ref()?.links().get(link)?.upstream else {
        return None;
    };
    let device = model.devices.get(node)?;
    device.station?;
    Some((device.id, port, device.dl_control?))
}

/// Sets the loop of the port before a link for a moment; `None` sets what was.
fn set(model: &NetworkModel, link: usize, mode: Option<LoopMode>, now: Instant) -> Option<Probe> {
    let (device, port, stands) = near(model, link)?;
    let mode = mode.unwrap_or_else(|| stands.loop_mode(port));
    let [low, loops, ..] = stands.with_loop_mode(port, mode).with_temporary(true).to_bytes();
    Some(Probe {
        network: model.network,
        device,
        station: model.device(device)?.station?,
        what: Asked::Written { address: CONTROL.0, data: [low, loops] },
        deadline: now + PATIENCE,
        effect: ProbeEffect::Writes,
    })
}

/// Asks how DL control stands.
pub(super) fn ask(network: Network, device: &Device, now: Instant) -> Option<Probe> {
    let (address, len) = CONTROL;
    let (what, deadline) = (Asked::Register { address, len }, now + Span::s(1));
    let (device, station) = (device.id, device.station?);
    Some(Probe { network, device, station, what, deadline, effect: ProbeEffect::Reads })
}
