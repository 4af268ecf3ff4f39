//! A search for the place where frames vanish, as frames show it: ports that somebody closes for a moment,
//! and whether frames come back meanwhile.
//!
//! While nothing comes back, what is written still reaches all that lie before the hole. Who closes a port
//! for temporary use (DL control, 0x0100 bit 1) and sees frames again knows that the hole lies behind it;
//! where nothing changes it does not. A recording of such a search tells the same. Reference: S2 2.4.1.

use std::collections::VecDeque;

use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::{DlControl, LoopMode};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use super::{Device, HoleSearch, NetworkModel, Seen, Silence};

/// Writes that are kept: a search among 200 SubDevices takes some 20, each sent anew a few times.
const KEPT: usize = 128;
/// Writes of one search follow each other within this time: a port that was closed opens by itself after it.
pub(super) const TOGETHER: Span = Span::s(1);
/// A port that is closed shows within this time whether that helps.
const PATIENCE: Span = Span::ms(100);

/// A request that was sent so shortly before a port opens again may still be lost.
const IN_FLIGHT: Span = Span::ms(2);

/// Whoever has a link when a silence begins searches within this time.
pub const BEGINS_WITHIN: Span = Span::ms(300);

/// DL control of a controller was written for temporary use, whether or not the frame came back.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LoopWrite {
    /// Whose.
    pub device: DeviceId,
    /// The port that it closes; `None` when all are as they usually are.
    pub closed: Option<Port>,
    /// When it was sent, in which frame.
    pub seen: Seen<()>,
}

impl LoopWrite {
    /// What the first two bytes of DL control mean for a controller.
    #[must_use]
    pub fn of(device: &Device, bytes: [u8; 2], seen: Seen<()>) -> Option<Self> {
        let written = DlControl::from_bytes([bytes[0], bytes[1], 0, 0]);
        let stands = device.dl_control.unwrap_or(DlControl::RESET);
        let is_closed = |port: &Port| {
            written.loop_mode(*port) == LoopMode::Closed
                && stands.loop_mode(*port) != LoopMode::Closed
        };
        let closed = Port::ALL.into_iter().find(is_closed);
        written.temporary().then_some(Self { device: device.id, closed, seen })
    }
}

/// Notes a write. What was lost is heard of later than what came back.
pub(super) fn note(writes: &mut VecDeque<LoopWrite>, write: LoopWrite) {
    let at = writes.partition_point(|known| known.seen.at <= write.seen.at);
    writes.insert(at, write);
    if writes.len() > KEPT {
        writes.pop_front();
    }
}

/// The latest search that was seen, and what it has found. That the hole is before the first SubDevice no
/// search shows: nothing helps then, as it would with a cable that is out. With it the links that are left over.
#[must_use]
pub fn seen(model: &NetworkModel) -> Option<(HoleSearch, Vec<usize>)> {
    let tree = model.tree.as_ref()?;
    let writes: Vec<&LoopWrite> = model.loop_writes.iter().collect();
    let is_apart = |pair: &[&LoopWrite]| pair[0].seen.at + TOGETHER < pair[1].seen.at;
    let first = writes.windows(2).rposition(is_apart).map_or(0, |before| before + 1);
    let mut writes = writes[first..].to_vec();
    let last = writes.last()?.seen;
    // What does not come back is sent again.
    writes.dedup_by_key(|write| (write.device, write.closed));
    let begin = writes.iter().find(|write| write.closed.is_some())?.seen.at;
    let traffic = &model.traffic;
    let silences = || traffic.losses.silences().iter().chain(traffic.losses.swallowed());
    let is_on = |silence: &&Silence| {
        silence.since.at <= begin && silence.ended.is_none_or(|ended| ended > begin)
    };
    let silence = silences().filter(is_on).max_by_key(|silence| silence.since.at)?;
    let came_back = |from: Instant, to: Instant| {
        silences().filter_map(|one| one.ended).any(|ended| from < ended && ended <= to)
    };
    let mut left: Vec<usize> = (0..tree.links().len()).collect();
    let mut has_helped = false;
    for (index, write) in writes.iter().enumerate() {
        let Some(link) = write.closed.and_then(|port| link_below(tree, write.device, port)) else {
            continue;
        };
        let from = write.seen.at;
        let next = writes.get(index + 1).map_or(Instant::MAX, |next| next.seen.at);
        let behind = behind(tree, link);
        if !came_back(from, next.min(from + PATIENCE)) {
            left.retain(|one| !behind.contains(one));
            continue;
        }
        let vanished = || silences().map(|silence| silence.since.at).filter(|at| *at > from);
        if vanished().any(|at| at + IN_FLIGHT < next.min(from + TOGETHER)) {
            // Frames come and go though nothing is changed: this is noise, not a hole.
            left = (0..tree.links().len()).collect();
            has_helped = false;
            break;
        }
        // It was the port, if they vanish again when that is open: a hole may also have gone by itself.
        if vanished().next().is_none() {
            break;
        }
        left.retain(|one| behind.contains(one));
        has_helped = true;
    }
    let found = match left[..] {
        [only] if has_helped => Some(Seen::new(only, last.at, last.frame)),
        _ => None,
    };
    let ended = Some(last.at + PATIENCE);
    Some((HoleSearch { since: silence.since, found, has_helped, ended }, left))
}

/// When ports were first closed in a silence, to find the place where frames vanish: whoever does so has a link,
/// and begins a tenth of a second after the silence, or as soon as the link is there.
#[must_use]
pub fn began(model: &NetworkModel, silence: &Silence) -> Option<Seen<()>> {
    let is_in =
        |at: Instant| at >= silence.since.at && silence.ended.is_none_or(|ended| at < ended);
    let mut writes = model.loop_writes.iter();
    writes.find(|write| write.closed.is_some() && is_in(write.seen.at)).map(|write| write.seen)
}

/// The link at a port that leads away from the MainDevice.
fn link_below(tree: &Tree, device: DeviceId, port: Port) -> Option<usize> {
    let near = End::Controller(device.index(), port);
    tree.link_at(near).filter(|link| tree.links()[*link].upstream == near)
}

/// Whether somebody searched as soon as there was a silence about a stretch of time: then there was a link all the
/// time, since nobody searches without one.
#[must_use]
pub fn began_at_once(model: &NetworkModel, (from, to): (Instant, Instant)) -> bool {
    let ended = |silence: &Silence| silence.ended.unwrap_or(Instant::MAX);
    let mut silences = model.traffic.losses.silences().iter().rev();
    let about = silences.find(|silence| silence.since.at <= to && ended(silence) >= from);
    about.is_some_and(|silence| {
        // Before it nothing may have been sent: in a recording without a link nothing is.
        let since = model.quiet_before(silence).map_or(silence.since.at, |pause| pause.from);
        let since = since.min(silence.since.at);
        began(model, silence).is_some_and(|began| began.at.since(since) < BEGINS_WITHIN)
    })
}

/// A link and all behind it, as frames of card A go: in a ring the way on to card B, too.
#[must_use]
pub fn behind(tree: &Tree, link: usize) -> Vec<usize> {
    let Some(node) = tree.links().get(link).and_then(|link| link.downstream.node()) else {
        return vec![link];
    };
    let closes = |(last, _): &(usize, Port)| tree.subtree(node).contains(last);
    let to_card_b = tree.closes_at().filter(closes).and_then(|_| tree.ring_link());
    let above = tree.subtree(node).iter().filter_map(|node| tree.link_above(*node));
    above.chain(to_card_b).collect()
}
