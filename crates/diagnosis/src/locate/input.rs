//! Input of the locator: wiring, routes of the frames, counters, and link changes.

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Route, Tree};

use crate::model::{Absence, AlChange, CounterTrack, DlChange, NetworkModel, Rise};

/// How far apart the readings that show a link's change and those that show the noise of that change
/// may lie: link status and counters are read one after the other.
const SAME_EVENT: Span = Span::ms(500);

/// Readings further apart than this say nothing of what fell together between them.
const LONGEST_EVENT: Span = Span::s(5);

/// Frames that a link cuts off when it goes and when it comes, both ways.
const CUT_BY_CHANGE: u64 = 4;

/// A controller whose counters were not read for this long no longer holds up a judgement.
const STALE: Span = Span::s(10);

/// A line with its wiring, ready to be searched.
#[derive(Clone, Debug)]
pub struct LocateInput<'a> {
    model: &'a NetworkModel,
    tree: &'a Tree,
    routes: Vec<Route>,
    has_ended: bool,
    /// By link: from when to when it may have changed.
    changes: Vec<Vec<(Instant, Instant)>>,
}

impl<'a> LocateInput<'a> {
    /// Prepares the search; `None` while the wiring is not known.
    ///
    /// `has_ended` says that no further reading will come: then everything is judged as it stands.
    #[must_use]
    pub fn of(model: &'a NetworkModel, has_ended: bool) -> Option<Self> {
        let tree = model.tree.as_ref().filter(|tree| tree.len() <= model.devices.len())?;
        let mut routes = Vec::with_capacity(2);
        if tree.closes_at().is_some() {
            let broken: Vec<usize> =
                (0..tree.links().len()).filter(|link| is_down(model, tree, *link)).collect();
            routes.extend(Path::ALL.map(|path| Route::of(tree, path, &broken)));
        } else {
            // What was counted before a link broke was counted on the whole way, so the whole way it
            // is. What lies behind the break is simply not read any more.
            let paths = Path::ALL.into_iter().filter(|path| tree.first(*path).is_some());
            routes.extend(paths.map(|path| Route::of(tree, path, &[])));
        }
        let changes = (0..tree.links().len()).map(|link| changes(model, tree, link)).collect();
        Some(Self { model, tree, routes, has_ended, changes })
    }

    /// The network.
    #[must_use]
    pub const fn model(&self) -> &'a NetworkModel {
        self.model
    }

    /// The wiring.
    #[must_use]
    pub const fn tree(&self) -> &'a Tree {
        self.tree
    }

    /// The ways of the frames: one for each card in use.
    #[must_use]
    pub fn routes(&self) -> &[Route] {
        &self.routes
    }

    /// Whether no further reading will come.
    #[must_use]
    pub const fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// A counter of the controller at `node` of the tree; `None` when it was never read.
    #[must_use]
    pub fn track(&self, node: usize, counter: ErrorCounter) -> Option<&'a CounterTrack> {
        self.model.devices.get(node)?.counters.track(counter)
    }

    /// The rises of a counter in the present spell of errors, as far as they are kept.
    pub fn rises(&self, track: &'a CounterTrack) -> impl Iterator<Item = &'a Rise> + use<'a> {
        let began = self.model.spell_began;
        track.rises.iter().filter(move |rise| rise.at >= began)
    }

    /// Whether a rise falls together with a change of the link, as noise and cut-off frames do.
    #[must_use]
    pub fn falls_with_link_change(&self, link: usize, rise: &Rise) -> bool {
        let Some(changes) = self.changes.get(link) else { return false };
        if self.has_end_restarted(link, rise) {
            return true;
        }
        if rise.at.since(rise.after_time) > LONGEST_EVENT {
            return false;
        }
        changes.iter().any(|(from, to)| *from <= rise.at && rise.after_time <= *to)
    }

    /// Most frames that the changes of a link may have cut off, on each side of each of them one or two.
    #[must_use]
    pub fn cut_off_at_most(&self, link: usize) -> u64 {
        let ends = [self.tree.links()[link].upstream, self.tree.links()[link].downstream];
        let of_end = |end: End| match end {
            End::MainDevice(path) => self.model.host.card(path).carrier_changes,
            End::Controller(node, port) => {
                let device = &self.model.devices[node];
                let lost = device.counters.rise(ErrorCounter::LostLink(port));
                lost.saturating_add(device.dl.changes.len() as u64)
            }
        };
        ends.into_iter().map(of_end).fold(1, u64::saturating_add).saturating_mul(CUT_BY_CHANGE)
    }

    /// Whether a device at either end of the link started anew between the two readings of a rise: its
    /// links went and came with it, however long nobody could read it.
    fn has_end_restarted(&self, link: usize, rise: &Rise) -> bool {
        let link = self.tree.links()[link];
        let devices = [link.upstream, link.downstream].into_iter().filter_map(|end| end.node());
        devices.filter_map(|node| self.model.devices.get(node)).any(|device| {
            let was_gone = |absence: &Absence| {
                absence.since.at <= rise.at
                    && absence.ended.is_none_or(|ended| rise.after_time <= ended + SAME_EVENT)
            };
            // Who starts anew again and again is missed by nobody, who asks it by its address only when it has one.
            let since_then = |change: &&AlChange| rise.after_time <= change.at;
            let fell_then =
                |change: &AlChange| change.at <= rise.at + SAME_EVENT && change.is_own_fall();
            device.al.changes.iter().rev().take_while(since_then).any(fell_then)
                || device.absences.iter().any(was_gone) && device.has_restarted()
        })
    }

    /// Whether any link changed between two times: then frames were lost for that reason.
    #[must_use]
    pub fn any_link_changed(&self, from: Instant, to: Instant) -> bool {
        self.changes.iter().flatten().any(|(began, ended)| *began <= to && from <= *ended)
    }

    /// When the counters at `port` of `node` were last read, if that reading is still waited for: not
    /// of a controller that is gone, nor of one that is no longer read.
    #[must_use]
    pub fn last_read(&self, node: usize, port: Port) -> Option<Instant> {
        let device = self.model.devices.get(node)?;
        let at = device.counters.track(ErrorCounter::InvalidFrame(port))?.last.at;
        (device.silent.is_none() && at + STALE >= self.model.now).then_some(at)
    }

    /// A link's end with its controller by identity.
    #[must_use]
    pub fn name(&self, end: End) -> End<DeviceId> {
        end.map(|node| DeviceId(node as u32))
    }
}

/// Whether either end of a link is known to have no link.
fn is_down(model: &NetworkModel, tree: &Tree, link: usize) -> bool {
    let ends = [tree.links()[link].upstream, tree.links()[link].downstream];
    ends.into_iter().any(|end| match end {
        End::MainDevice(path) => {
            model.host.card(path).carrier.is_some_and(|carrier| !carrier.value)
        }
        End::Controller(node, port) => model.devices[node].dl.is_active(port) == Some(false),
    })
}

/// When a link may have changed, as its two ends tell.
fn changes(model: &NetworkModel, tree: &Tree, link: usize) -> Vec<(Instant, Instant)> {
    let around = |from: Instant, to: Instant| (from.before(SAME_EVENT), to + SAME_EVENT);
    let mut changes = Vec::new();
    for end in [tree.links()[link].upstream, tree.links()[link].downstream] {
        match end {
            End::MainDevice(path) => {
                let card = model.host.card(path);
                let changed = card.carrier.filter(|_| card.carrier_changes > 0);
                changes.extend(changed.map(|carrier| around(carrier.at, carrier.at)));
            }
            End::Controller(node, port) => {
                let device = &model.devices[node];
                // A port that was closed to find where frames vanish keeps its link.
                let was_closed = |change: &DlChange| {
                    let is_same =
                        change.from.port_state(port).link == change.to.port_state(port).link;
                    is_same && model.hole.is_some_and(|hole| change.at >= hole.since.at)
                };
                let moved = device.dl.changes.iter().filter(|change| {
                    change.from.port_state(port) != change.to.port_state(port)
                        && !was_closed(change)
                });
                changes.extend(moved.map(|change| around(change.at, change.at)));
                let lost = device.counters.track(ErrorCounter::LostLink(port));
                let rises = lost.into_iter().flat_map(|track| &track.rises);
                // What was lost for a moment is back soon; readings may come between.
                changes.extend(rises.map(|rise| around(rise.after_time, rise.at)));
            }
        }
    }
    changes
}
