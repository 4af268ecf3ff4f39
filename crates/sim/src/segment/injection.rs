//! Faults that are put into a segment while it runs, and healed.

use linesman_proto::time::{Instant, Span};

use super::Segment;
use crate::fault::{self, FaultError};
use crate::segment_file::FaultEntry;
use crate::truth::FaultId;

impl Segment {
    /// Injects a fault. It begins at its `from_ms`, or just after `now`: behind all that has been
    /// worked out already, some 0.1 ms.
    ///
    /// # Errors
    /// [`FaultError`] names the key that cannot be, and what can.
    pub fn inject(&mut self, now: Instant, entry: &FaultEntry) -> Result<FaultId, FaultError> {
        self.inject_with_hits(now, entry, None)
    }

    /// The same with a number of hits that fall on moments and bytes by the chance with this name, so that faults of
    /// several kinds can be given the same hits.
    ///
    /// # Errors
    /// As of [`Self::inject`].
    pub fn inject_with_hits(
        &mut self,
        now: Instant,
        entry: &FaultEntry,
        hits: Option<&str>,
    ) -> Result<FaultId, FaultError> {
        self.now = self.now.max(now);
        let earliest = self.now.max(self.world.horizon) + Span::ns(1);
        let label = format!("fault {}", self.world.truth.faults().len() + 1);
        if entry.kind.parse().ok().and_then(fault::kind).is_some_and(fault::Kind::is_built_in) {
            return Err(FaultError::BuiltIn { entry: label, kind: entry.kind.clone() });
        }
        self.schedule(&label, entry, earliest, hits)
    }

    pub(super) fn schedule(
        &mut self,
        label: &str,
        entry: &FaultEntry,
        earliest: Instant,
        hits: Option<&str>,
    ) -> Result<FaultId, FaultError> {
        let context = fault::FaultContext {
            names: &self.names,
            nodes: &self.nodes,
            tree: &self.tree,
            world: &self.world,
            ebus_ma: &self.ebus_ma,
            fed_anew: &self.fed_anew,
            groups: &self.groups,
            supplies: &self.supplies,
        };
        let number = self.world.truth.faults().len();
        let stream = format!("fault {number} {}", entry.kind);
        let planned = fault::plan(label, entry, &context, earliest, self.seed, (&stream, hits))?;
        let id = self.world.truth.declare(planned.name, planned.places.clone());
        self.world.running.push(planned.run(id));
        Ok(id)
    }

    /// Ends a fault: just after `now`, behind all that has been worked out already. Of a fault that is
    /// over, hits that still wait for a frame do not come any more; one that is built in stays.
    pub fn heal(&mut self, now: Instant, fault: FaultId) {
        self.now = self.now.max(now);
        let at = self.now.max(self.world.horizon) + Span::ns(1);
        if let Some(running) = self.world.running.iter_mut().find(|running| running.id == fault) {
            running.heal_at(at);
        } else {
            self.world.disarm(fault);
        }
    }
}
