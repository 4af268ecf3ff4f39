//! Reachability of SubDevices, told from the truth log alone: links without signal, devices without
//! supply. It knows nothing of frames, and so checks what the walk and the MainDevice made of them.

use std::collections::BTreeSet;

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};
use linesman_sim::truth::{Effect, Entry, Place, TruthLog};

/// How long after a change frames of before it may still arrive, and loops move.
const SETTLE: Span = Span::ms(15);

/// The line as the truth log tells it.
#[derive(Clone, Debug, Default)]
pub struct Reach {
    read: usize,
    down: BTreeSet<(End<DeviceId>, End<DeviceId>)>,
    off: BTreeSet<DeviceId>,
    changed: Instant,
}

impl Reach {
    /// Reads what has come to the log since the last call.
    pub fn update(&mut self, log: &TruthLog) {
        for entry in &log.entries()[self.read..] {
            let Entry::Effect { at, place, effect, .. } = entry else { continue };
            match (place, effect) {
                (Place::Link(one, other), Effect::SignalLost) => {
                    self.down.insert((*one, *other));
                }
                (Place::Link(one, other), Effect::SignalBack) => {
                    self.down.remove(&(*one, *other));
                }
                (Place::Device(id), Effect::PowerLost) => {
                    self.off.insert(*id);
                }
                (Place::Device(id), Effect::PowerBack) => {
                    self.off.remove(id);
                }
                _ => continue,
            }
            self.changed = self.changed.max(*at);
        }
        self.read = log.entries().len();
    }

    /// Whether nothing has changed for so long that frames which arrive from `from` on have seen
    /// the line as it is.
    #[must_use]
    pub fn is_settled(&self, from: Instant) -> bool {
        from > self.changed + SETTLE || self.changed == Instant::ZERO
    }

    /// By node: whether frames of either card get there.
    #[must_use]
    pub fn reached(&self, tree: &Tree) -> Vec<bool> {
        let mut reached = vec![false; tree.len()];
        // Links are walked from either end, since a ring may be entered from both cards.
        let mut front: Vec<End> = Path::ALL.into_iter().map(End::MainDevice).collect();
        while let Some(end) = front.pop() {
            let Some(far) = tree.opposite(end).filter(|far| !self.is_down(end, *far)) else {
                continue;
            };
            let End::Controller(node, _) = far else { continue };
            if !reached[node] && !self.off.contains(&DeviceId(node as u32)) {
                reached[node] = true;
                front.extend(tree.open_ports(node).map(|port| End::Controller(node, port)));
            }
        }
        reached
    }

    fn is_down(&self, one: End, other: End) -> bool {
        let named = |end: End| end.map(|node| DeviceId(node as u32));
        let (one, other) = (named(one), named(other));
        self.down.contains(&(one, other)) || self.down.contains(&(other, one))
    }
}
