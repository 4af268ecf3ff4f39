//! Losses and returns of links, from link status and lost-link counters.

use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use crate::model::{CounterTrack, NetworkModel};

/// Both ends of a link tell of the same loss, but are read one after the other.
const SAME_LOSS: Span = Span::ms(500);

/// A loss of at least this length is no flicker of a contact.
const LONG_LOSS: Span = Span::ms(200);

/// A link that stayed up for so long after a long loss was mended.
const CALM_AFTER_LONG: Span = Span::ms(500);

/// A link that stayed up for so long after a short one did not lose it to the same flicker.
const CALM: Span = Span::s(3);

/// Three spells of losses within this time are one that lasts.
const OFTEN_WITHIN: Span = Span::s(6);

/// What is known of one link's losses: those since it was last mended.
#[derive(Clone, PartialEq, Debug)]
pub struct LinkLosses {
    /// Index in [`Tree::links`].
    pub link: usize,
    /// Losses that link status showed, in order of time.
    pub seen: Vec<LinkLoss>,
    /// How often the link was lost at least.
    pub count: u64,
    /// When the first loss was noticed.
    pub first: Instant,
    /// When the latest was.
    pub last: Instant,
    /// Whether it is down now, as an end that answers says.
    pub is_down: bool,
    /// Whether counters alone tell of it whose earlier values nobody knows.
    pub may_be_old: bool,
}

/// One loss.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LinkLoss {
    /// The end that showed it.
    pub end: End,
    /// When link status showed that it is lost.
    pub at: Instant,
    /// The frame that showed it.
    pub frame: Option<u64>,
    /// When it was back; `None` while it is not.
    pub back: Option<Instant>,
}

impl LinkLosses {
    /// All links of a line that were lost at least once.
    #[must_use]
    pub fn all(model: &NetworkModel) -> Vec<Self> {
        let Some(tree) = model.tree.as_ref().filter(|tree| tree.len() <= model.devices.len())
        else {
            return Vec::new();
        };
        (0..tree.links().len()).filter_map(|link| Self::of(model, tree, link)).collect()
    }

    fn of(model: &NetworkModel, tree: &Tree, link: usize) -> Option<Self> {
        let ends = [tree.links()[link].upstream, tree.links()[link].downstream];
        let mut seen: Vec<LinkLoss> = Vec::new();
        for drop in ends.into_iter().flat_map(|end| status_drops(model, end)) {
            match seen.iter_mut().find(|known| is_same(known, &drop)) {
                Some(known) => {
                    // The loss lasted as long as the end says that could be read all the time.
                    known.at = known.at.min(drop.at);
                    known.back = known.back.min(drop.back).or(known.back).or(drop.back);
                }
                None => seen.push(drop),
            }
        }
        seen.sort_by_key(|drop| drop.at);
        let tracks: Vec<&CounterTrack> =
            ends.into_iter().filter_map(|end| lost(model, end)).collect();
        let counted = tracks.iter().flat_map(|track| &track.rises);
        let mut events: Vec<(Instant, Instant)> =
            counted.map(|rise| (rise.after_time, rise.at)).collect();
        events.extend(seen.iter().map(|drop| (drop.at, drop.back.unwrap_or(Instant::MAX))));
        let since = latest_spell(&mut events, &seen);
        seen.retain(|drop| drop.at >= since);
        let rises = |track: &CounterTrack| -> u64 {
            if since == Instant::ZERO {
                return track.total.rise();
            }
            let later = track.rises.iter().filter(|rise| rise.at >= since);
            later.map(|rise| rise.difference.rise).sum()
        };
        let losses = tracks.iter().map(|track| rises(track)).max().unwrap_or(0);
        let noticed = || {
            let rises = tracks.iter().flat_map(|track| &track.rises).map(|rise| rise.at);
            rises.filter(|at| *at >= since).chain(seen.iter().map(|drop| drop.at))
        };
        let (first, last) = (noticed().min()?, noticed().max()?);
        let count = losses.max(seen.len() as u64);
        let is_down = ends.into_iter().any(|end| is_down(model, end));
        let may_be_old = !is_down
            && seen.is_empty()
            && tracks.iter().all(|track| track.may_be_old || track.total.rise() == 0);
        Some(Self { link, seen, count, first, last, is_down, may_be_old })
    }

    /// How long the longest loss lasted, as far as is known: `None` while the link is down, zero for
    /// losses that only a counter shows.
    #[must_use]
    pub fn longest(&self) -> Option<Span> {
        if self.is_down {
            return None;
        }
        let spans = self.seen.iter().filter_map(|drop| Some(drop.back?.since(drop.at)));
        Some(spans.max().unwrap_or(Span::ZERO))
    }

    /// When the link was back for good; `None` while it is down.
    #[must_use]
    pub fn ended(&self) -> Option<Instant> {
        if self.is_down {
            return None;
        }
        let back = self.seen.iter().filter_map(|drop| drop.back).max();
        Some(back.map_or(self.last, |back| back.max(self.last)))
    }

    /// Whether link status of an end showed one of these losses. Of a loss that both ends showed, the list
    /// names one.
    #[must_use]
    pub fn is_shown_by(&self, model: &NetworkModel, end: End) -> bool {
        status_drops(model, end).iter().any(|drop| drop.at >= self.first)
    }

    /// Whether both were lost at the same time, at least once.
    #[must_use]
    pub fn falls_with(&self, other: &Self) -> bool {
        let near = |a: Instant, b: Instant| a <= b + SAME_LOSS && b <= a + SAME_LOSS;
        near(self.first, other.first) || near(self.last, other.last)
    }
}

/// When the latest spell of losses began: those before are trouble of their own. A long loss that was
/// over ends a spell, and so does a time without any.
fn latest_spell(events: &mut [(Instant, Instant)], seen: &[LinkLoss]) -> Instant {
    events.sort_unstable();
    let calm_after = |end: Instant| {
        let mut long = seen.iter().filter(|drop| end.since(drop.at) >= LONG_LOSS);
        if long.any(|drop| drop.back == Some(end)) { CALM_AFTER_LONG } else { CALM }
    };
    let mut spells: Vec<Instant> = events.iter().take(1).map(|(from, _)| *from).collect();
    let mut ended: Option<Instant> = None;
    for &(from, to) in events.iter() {
        if ended.is_some_and(|ended| from > ended + calm_after(ended)) {
            spells.push(from);
        }
        ended = ended.max(Some(to));
    }
    // What is mended again and again is not mended: it is one trouble.
    let mut last = spells.len().saturating_sub(1);
    if last >= 2 && spells[last].since(spells[last - 2]) <= OFTEN_WITHIN {
        while last > 0 && spells[last].since(spells[last - 1]) <= OFTEN_WITHIN {
            last -= 1;
        }
    }
    // Counters may have risen before what is known of times.
    if last == 0 { Instant::ZERO } else { spells[last] }
}

fn is_same(one: &LinkLoss, other: &LinkLoss) -> bool {
    let ended = |drop: &LinkLoss| drop.back.map_or(Instant::MAX, |back| back + SAME_LOSS);
    one.end != other.end
        && one.at <= ended(other).max(other.at + SAME_LOSS)
        && other.at <= ended(one).max(one.at + SAME_LOSS)
}

/// The lost-link counter of an end.
fn lost(model: &NetworkModel, end: End) -> Option<&CounterTrack> {
    let End::Controller(node, port) = end else { return None };
    model.devices[node].counters.track(ErrorCounter::LostLink(port))
}

/// Losses as the link status of an end shows them.
fn status_drops(model: &NetworkModel, end: End) -> Vec<LinkLoss> {
    match end {
        End::Controller(node, port) => port_drops(model, end, node, port),
        End::MainDevice(path) => {
            let card = model.host.card(path);
            let Some(carrier) = card.carrier else { return Vec::new() };
            // Only the latest loss is kept.
            let frame = None;
            match card.carrier_lost {
                None => Vec::new(),
                Some(at) if carrier.value => {
                    vec![LinkLoss { end, at, frame, back: Some(carrier.at) }]
                }
                Some(at) => vec![LinkLoss { end, at, frame, back: None }],
            }
        }
    }
}

fn port_drops(model: &NetworkModel, end: End, node: usize, port: Port) -> Vec<LinkLoss> {
    let dl = &model.devices[node].dl;
    let Some(first) = dl.first else { return Vec::new() };
    let mut drops: Vec<LinkLoss> = Vec::new();
    // A link that was planned and never was there. Without a plan the tree only has links that were.
    if model.tree_is_planned && !first.value.port_state(port).link {
        drops.push(LinkLoss { end, at: first.at, frame: first.frame, back: None });
    }
    for change in &dl.changes {
        let (from, to) = (change.from.port_state(port).link, change.to.port_state(port).link);
        match (from, to) {
            (true, false) => {
                drops.push(LinkLoss { end, at: change.at, frame: change.frame, back: None });
            }
            (false, true) => {
                if let Some(drop) = drops.last_mut() {
                    drop.back.get_or_insert(change.at);
                }
            }
            (true, true) | (false, false) => {}
        }
    }
    drops
}

/// Whether an end that can be asked has no link.
fn is_down(model: &NetworkModel, end: End) -> bool {
    match end {
        End::MainDevice(path) => {
            model.host.card(path).carrier.is_some_and(|carrier| !carrier.value)
        }
        End::Controller(node, port) => {
            let device = &model.devices[node];
            let status = device.dl.last.filter(|_| device.silent.is_none());
            status.is_some_and(|status| !status.value.port_state(port).link)
                && !port_drops(model, end, node, port).is_empty()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_that_are_mended_again_and_again_are_one_trouble() {
        let end = End::Controller(0, Port::B);
        let begin = |ms: u64| {
            let at = Instant::from_nanos(ms * 1_000_000);
            LinkLoss { end, at, frame: None, back: Some(at + Span::ms(300)) }
        };
        let latest = |begins: &[u64]| {
            let seen: Vec<LinkLoss> = begins.iter().copied().map(begin).collect();
            let mut events: Vec<_> =
                seen.iter().map(|drop| (drop.at, drop.back.unwrap_or(Instant::MAX))).collect();
            latest_spell(&mut events, &seen)
        };
        assert_eq!(latest(&[10_000, 11_200]), begin(11_200).at, "mended once");
        assert_eq!(latest(&[10_000, 11_200, 12_400]), Instant::ZERO);
        assert_eq!(latest(&[10_000, 30_000, 50_000]), begin(50_000).at, "far apart");
        assert_eq!(latest(&[2_000, 20_000, 21_200, 22_400]), begin(20_000).at);
    }
}
