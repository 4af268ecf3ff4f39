//! Missing outputs: cards that are silent, watchdogs that are short.

use linesman_proto::address::Path;
use linesman_proto::register::WatchdogTime;
use linesman_proto::time::{Instant, Span};

use super::node::NodeAction;
use super::world::World;
use crate::controller::WatchdogExpiry;
use crate::truth::{AuditedCounter, Cause, Effect, FaultId, Place};

impl World {
    /// A card sends nothing for a while.
    pub(super) fn silence(&mut self, at: Instant, fault: FaultId, path: Path, until: Instant) {
        self.cards[path.index()].mute(at, until, fault);
        self.truth.effect(at, Some(fault), Place::Host(path), Effect::CardSilent);
    }

    /// The watchdog of a controller gets another time, or the former one.
    pub(super) fn set_watchdog(
        &mut self,
        at: Instant,
        fault: FaultId,
        node: usize,
        time: Option<WatchdogTime>,
    ) {
        self.nodes[node].watchdog_by = time.map(|_| fault);
        self.nodes[node].act_at(at, NodeAction::Watchdog(time));
        let place = Place::Device(self.id(node));
        self.truth.effect(at, Some(fault), place, Effect::WatchdogSet { time });
    }

    /// Watchdogs that ran out go into the log: what they waited for did not come, because of a fault
    /// of theirs or because nobody sent it.
    pub(crate) fn enter_expiries(&mut self) {
        for index in 0..self.nodes.len() {
            if !self.nodes[index].controller.has_watchdog_expiries() {
                continue;
            }
            let node = &mut self.nodes[index];
            let (device, fault) = (node.controller.id(), node.watchdog_by);
            for WatchdogExpiry { kind, at, silence } in node.controller.take_watchdog_expiries() {
                let cause = match fault {
                    // What has just come is no cause to run out.
                    _ if silence == Span::ZERO => Cause::Unknown,
                    Some(fault) => Cause::Fault(fault),
                    None => Cause::Content,
                };
                self.truth.may_move(device, AuditedCounter::Watchdog(kind), cause);
                let effect = Effect::WatchdogExpired { kind, silence };
                self.truth.effect(at, fault, Place::Device(device), effect);
            }
        }
    }

    /// A fault is over: cards send again, watchdogs have their time again.
    pub(super) fn release_starved(&mut self, at: Instant, fault: FaultId) {
        for card in &mut self.cards {
            card.unmute(at, fault);
        }
        for node in 0..self.nodes.len() {
            if self.nodes[node].watchdog_by == Some(fault) {
                self.set_watchdog(at, fault, node, None);
            }
        }
    }
}
