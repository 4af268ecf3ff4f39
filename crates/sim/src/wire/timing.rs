//! Timing faults: quartzes that run away, SYNC signals that do not arrive, work that takes too
//! long, frames that leave late.

use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

use super::node::NodeAction;
use super::world::World;
use crate::controller::LocalClock;
use crate::truth::{Effect, FaultId, Place};

/// What can be done to the time of a device.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TimingChange {
    /// Its quartz has another speed.
    Drift {
        /// Parts per thousand million too fast; [`LocalClock::STOPPED`] stands.
        ppb: i64,
        /// How that changes in each second.
        ramp_ppb_per_s: i64,
        /// For how long it changes.
        ramp: Span,
    },
    /// Its clock starts anew.
    RestartClock,
    /// The line from its SYNC unit to its processor breaks.
    CutSync,
    /// The line from its SYNC unit to its processor carries each edge twice.
    BounceSync,
    /// Its work in each cycle takes so long.
    SlowDown(Span),
}

/// What a fault holds and what is given back at its end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct ActiveTimingChange {
    by: FaultId,
    what: TimingKind,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum TimingKind {
    Speed,
    Sync,
    Bounce,
    Work,
}

impl World {
    pub(super) fn change_timing(
        &mut self,
        at: Instant,
        fault: FaultId,
        node: usize,
        change: TimingChange,
    ) {
        let (what, act, effect) = match change {
            TimingChange::Drift { ppb, ramp_ppb_per_s, ramp } => {
                let effect = if ppb == LocalClock::STOPPED {
                    Effect::ClockStopped
                } else {
                    Effect::ClockDrifts { ppb }
                };
                (Some(TimingKind::Speed), NodeAction::Drift { ppb, ramp_ppb_per_s, ramp }, effect)
            }
            TimingChange::RestartClock => (None, NodeAction::RestartClock, Effect::ClockRestarted),
            TimingChange::CutSync => {
                (Some(TimingKind::Sync), NodeAction::CutSync(true), Effect::SyncCut)
            }
            TimingChange::BounceSync => {
                (Some(TimingKind::Bounce), NodeAction::BounceSync(true), Effect::SyncBounces)
            }
            TimingChange::SlowDown(takes) => (
                Some(TimingKind::Work),
                NodeAction::SlowDown(Some(takes)),
                Effect::WorkTakes { takes },
            ),
        };
        if let Some(what) = what {
            self.nodes[node].timing.push(ActiveTimingChange { by: fault, what });
        }
        self.nodes[node].act_at(at, act);
        self.truth.effect(at, Some(fault), Place::Device(self.id(node)), effect);
    }

    /// A card sends later than it should from now on.
    pub(super) fn make_late(&mut self, at: Instant, fault: FaultId, path: Path, by: Span) {
        self.cards[path.index()].make_late(at, by, fault);
    }

    /// A fault is over: clocks have their own speed again, SYNC arrives, work is as quick as before,
    /// frames leave in time. What another fault holds stays.
    pub(super) fn release_timing(&mut self, at: Instant, fault: FaultId) {
        for card in &mut self.cards {
            card.be_in_time(at, fault);
        }
        for index in 0..self.nodes.len() {
            let node = &mut self.nodes[index];
            if node.timing.iter().all(|held| held.by != fault) {
                continue;
            }
            let mut given_back = Vec::new();
            for what in [TimingKind::Speed, TimingKind::Sync, TimingKind::Bounce, TimingKind::Work]
            {
                let mine = ActiveTimingChange { by: fault, what };
                let is_held = node.timing.contains(&mine);
                let by_others =
                    node.timing.iter().any(|held| held.what == what && held.by != fault);
                if is_held && !by_others {
                    let (act, effect) = match what {
                        TimingKind::Speed => (NodeAction::RestoreDrift, Effect::ClockRestored),
                        TimingKind::Sync => (NodeAction::CutSync(false), Effect::SyncBack),
                        TimingKind::Bounce => (NodeAction::BounceSync(false), Effect::SyncBack),
                        TimingKind::Work => (NodeAction::SlowDown(None), Effect::WorkRestored),
                    };
                    node.act_at(at, act);
                    given_back.push(effect);
                }
            }
            node.timing.retain(|held| held.by != fault);
            let place = Place::Device(self.id(index));
            for effect in given_back {
                self.truth.effect(at, Some(fault), place, effect);
            }
        }
    }
}
