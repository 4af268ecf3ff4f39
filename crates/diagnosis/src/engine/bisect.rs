//! Where frames vanish though every port shows a link: ports are closed one after the other, for a moment,
//! until frames come back.
//!
//! What is written still reaches all that lie before the hole. So a port is told to close (DL control,
//! 0x0101), for temporary use (0x0100 bit 1): after about a second the controller itself goes back to what
//! was, whatever happens to us (S2 2.4.1). If frames come back, the hole lies behind that port; if not, it
//! does not. Each try halves what is left.
//!
//! In a ring it is the frames of card A that are followed: they are processed on their way. Those of card B may
//! still come round untouched, if the hole takes one direction only, or lies beside the ring.

use linesman_proto::address::{DeviceId, Network, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::register::{DlControl, LoopMode, table};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::{Asked, Probe, ProbeEffect};
use crate::line::search::behind;
use crate::line::{Device, HoleSearch, Line, Seen};

/// So long nothing must have come back before ports are closed.
const SILENT: Span = Span::ms(100);
/// So long a closed port gets to show that it helps: longer than lost requests are repeated.
const PATIENCE: Span = Span::ms(60);
/// After a port was opened again, frames that were turned back at it may still be on their way.
const SETTLE: Span = Span::ms(30);
/// A silence that follows so soon upon a search belongs to it.
const AGAIN: Span = Span::s(1);
/// Frames that go on coming back after that, with all ports open: the hole has gone by itself.
const HEALED: Span = Span::ms(1_200);

/// A search that is going on.
#[derive(Clone, Debug)]
pub(super) struct Bisect {
    /// Links (index in the tree) that may hold the hole.
    left: Vec<usize>,
    step: Step,
}

#[derive(Clone, Copy, Debug)]
enum Step {
    /// Nothing is closed; since when.
    Open(Instant),
    /// The port before this link is closed; since when.
    Closed(usize, Instant),
}

/// What a line whose ports may be closed must tell while it is well: how DL control stands, to be brought
/// back.
pub(super) const CONTROL: (RegisterAddress, u16) = (table::DL_CONTROL.address, 4);

impl Bisect {
    /// Begins a search, if the line has gone silent though the card has a link, and enough is known of it.
    pub(super) fn begin(line: &mut Line, now: Instant) -> Option<Self> {
        let traffic = &line.traffic;
        let latest = [traffic.silences.back(), traffic.swallowed.back()];
        let silence = latest.into_iter().flatten().find(|silence| silence.ended.is_none())?;
        let since = silence.since;
        let card = line.host.card(linesman_proto::address::Path::A);
        let has_link = card.carrier.is_some_and(|carrier| carrier.value);
        let tree = line.tree.as_ref()?;
        let was_searched =
            line.hole.and_then(|hole| hole.ended).is_some_and(|ended| since.at < ended + AGAIN);
        if now < since.at + SILENT || !has_link || was_searched || line.traffic.answered == 0 {
            return None;
        }
        let left = (0..tree.links().len()).collect();
        line.hole = Some(HoleSearch { since, found: None, ended: None });
        Some(Self { left, step: Step::Open(now.before(SETTLE)) })
    }

    /// Goes on. Gives what is to be written next; the search is over when the line says so.
    pub(super) fn go_on(&mut self, line: &mut Line, now: Instant) -> Option<Probe> {
        let came_back = line.traffic.latest_processed;
        match self.step {
            // The request may be sent again for a while: what is written before that is over would be undone.
            Step::Closed(_, at) if now < at + PATIENCE => None,
            Step::Closed(link, at) if came_back.is_some_and(|back| back > at) => {
                let behind = behind(line.tree.as_ref()?, link);
                self.left.retain(|one| behind.contains(one));
                self.step = Step::Open(now);
                // It would open by itself; but the next port may lie behind it.
                set(line, link, None, now)
            }
            Step::Closed(link, _) => {
                let behind = behind(line.tree.as_ref()?, link);
                self.left.retain(|one| !behind.contains(one));
                self.close_next(line, now)
            }
            Step::Open(at) if now < at + SETTLE => None,
            Step::Open(at) if came_back.is_some_and(|back| back > at + SETTLE) => {
                if now >= at + HEALED {
                    end(line, None, now);
                }
                None
            }
            Step::Open(_) => self.close_next(line, now),
        }
    }

    /// Closes the port before the link that halves what is left best.
    fn close_next(&mut self, line: &mut Line, now: Instant) -> Option<Probe> {
        if let [only] = self.left[..] {
            end(line, Some(only), now);
            return None;
        }
        let tree = line.tree.as_ref()?;
        let half = self.left.len() / 2;
        let share = |link: usize| {
            let behind = behind(tree, link);
            self.left.iter().filter(|one| behind.contains(one)).count()
        };
        let splits = |link: &usize| {
            // Who has the whole rest behind it tells nothing.
            near(line, *link).is_some() && share(*link) < self.left.len()
        };
        let best = self
            .left
            .iter()
            .copied()
            .filter(splits)
            .min_by_key(|link| (share(*link).abs_diff(half), *link));
        let Some(link) = best else {
            end(line, None, now);
            return None;
        };
        self.step = Step::Closed(link, now);
        set(line, link, Some(LoopMode::Closed), now)
    }
}

fn end(line: &mut Line, found: Option<usize>, now: Instant) {
    if let Some(hole) = &mut line.hole {
        hole.found = found.map(|link| Seen::new(link, now, None));
        hole.ended = Some(now);
    }
    line.touch();
}

/// The port before a link, with how DL control of its controller stands.
fn near(line: &Line, link: usize) -> Option<(DeviceId, Port, DlControl)> {
    let End::Controller(node, port) = line.tree.as_ref()?.links().get(link)?.upstream else {
        return None;
    };
    let device = line.devices.get(node)?;
    device.station?;
    Some((device.id, port, device.dl_control?))
}

/// Sets the loop of the port before a link for a moment; `None` sets what was.
fn set(line: &Line, link: usize, mode: Option<LoopMode>, now: Instant) -> Option<Probe> {
    let (device, port, stands) = near(line, link)?;
    let mode = mode.unwrap_or_else(|| stands.loop_mode(port));
    let [low, loops, ..] = stands.with_loop_mode(port, mode).with_temporary(true).to_bytes();
    Some(Probe {
        network: line.network,
        device,
        station: line.device(device)?.station?,
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
