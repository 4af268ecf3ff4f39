//! The audit: every movement of an error counter has a logged cause.
//!
//! Whenever the physics make a controller see an error they enter it here, with the fault behind
//! it. The audit reads the controllers themselves: a counter that moved further than was entered,
//! or an entry without a cause, is a hole in the model.

use linesman_proto::address::DeviceId;
use linesman_proto::register::ErrorCounter;

use super::{FaultId, TruthLog};
use crate::controller::WatchdogKind;

/// Why a controller sees an error.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Cause {
    /// A fault of the log.
    Fault(FaultId),
    /// What the MainDevice itself put into a frame.
    Content,
    /// Nobody knows: a hole in the model.
    Unknown,
}

impl From<Option<FaultId>> for Cause {
    fn from(fault: Option<FaultId>) -> Self {
        fault.map_or(Self::Unknown, Self::Fault)
    }
}

impl Cause {
    pub(crate) fn fault(self) -> Option<FaultId> {
        match self {
            Self::Fault(fault) => Some(fault),
            Self::Content | Self::Unknown => None,
        }
    }
}

/// A counter that is audited.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum AuditedCounter {
    /// Of errors on the wires.
    Error(ErrorCounter),
    /// Of a watchdog that ran out.
    Watchdog(WatchdogKind),
}

impl From<ErrorCounter> for AuditedCounter {
    fn from(counter: ErrorCounter) -> Self {
        Self::Error(counter)
    }
}

/// What one counter may have counted.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(crate) struct Ledger {
    /// Errors that the controller was made to see.
    seen: u64,
    /// Those of them without a cause.
    without_cause: u64,
    /// The fault behind the last.
    last: Option<FaultId>,
    /// What the counter showed at the last audit.
    shown: u8,
    /// How many had been seen then.
    seen_then: u64,
}

/// A counter that moved without a cause.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Unexplained {
    /// Whose.
    pub device: DeviceId,
    /// Which.
    pub counter: AuditedCounter,
    /// How far it moved since the audit before.
    pub moved: u64,
    /// How many causes the log holds for that time.
    pub causes: u64,
}

impl TruthLog {
    /// A controller is made to see an error.
    pub(crate) fn may_move(
        &mut self,
        device: DeviceId,
        counter: impl Into<AuditedCounter>,
        cause: Cause,
    ) {
        let ledger = self.ledger.entry((device, counter.into())).or_default();
        ledger.seen += 1;
        match cause {
            Cause::Fault(fault) => ledger.last = Some(fault),
            Cause::Content => {}
            Cause::Unknown => ledger.without_cause += 1,
        }
    }

    /// A counter is given a value.
    pub(crate) fn set(&mut self, device: DeviceId, counter: ErrorCounter, value: u8) {
        self.ledger.entry((device, counter.into())).or_default().shown = value;
    }

    /// The fault behind the last error that a counter was made to see.
    #[must_use]
    pub fn last_cause(&self, device: DeviceId, counter: ErrorCounter) -> Option<FaultId> {
        self.ledger.get(&(device, counter.into())).and_then(|ledger| ledger.last)
    }

    /// Compares what counters show with what was entered since the audit before.
    pub(crate) fn audit(
        &mut self,
        shown: impl Iterator<Item = (DeviceId, AuditedCounter, u8)>,
    ) -> Vec<Unexplained> {
        let mut holes = Vec::new();
        for (device, counter, value) in shown {
            let ledger = self.ledger.entry((device, counter)).or_default();
            // A counter that was cleared in between counts from 0.
            let moved = match value.checked_sub(ledger.shown) {
                Some(moved) => u64::from(moved),
                None => u64::from(value),
            };
            let entered = ledger.seen - ledger.seen_then;
            let causes = entered - ledger.without_cause.min(entered);
            if moved > entered || ledger.without_cause > 0 {
                holes.push(Unexplained { device, counter, moved, causes });
            }
            ledger.shown = value;
            ledger.seen_then = ledger.seen;
            ledger.without_cause = 0;
        }
        holes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use linesman_proto::port::Port;

    const DEVICE: DeviceId = DeviceId(3);
    const COUNTER: ErrorCounter = ErrorCounter::InvalidFrame(Port::B);

    fn audit(log: &mut TruthLog, shown: u8) -> Vec<(u64, u64)> {
        let holes = log.audit([(DEVICE, COUNTER.into(), shown)].into_iter());
        holes.iter().map(|hole| (hole.moved, hole.causes)).collect()
    }

    #[test]
    fn counter_that_moves_without_an_entry_is_found() {
        let mut log = TruthLog::default();
        assert_eq!(audit(&mut log, 0), []);
        log.may_move(DEVICE, COUNTER, Cause::Fault(FaultId(0)));
        assert_eq!(audit(&mut log, 1), []);
        assert_eq!(audit(&mut log, 2), [(1, 0)], "nothing was entered since");
        log.may_move(DEVICE, COUNTER, Cause::Fault(FaultId(0)));
        assert_eq!(audit(&mut log, 4), [(2, 1)]);
        log.may_move(DEVICE, COUNTER, Cause::Unknown);
        assert_eq!(audit(&mut log, 5), [(1, 0)], "an error without a cause");
        assert_eq!(audit(&mut log, 5), []);
    }

    #[test]
    fn counters_that_were_cleared_or_stood_still_are_no_holes() {
        let mut log = TruthLog::default();
        log.set(DEVICE, COUNTER, 200);
        assert_eq!(audit(&mut log, 200), [], "old errors");
        log.may_move(DEVICE, COUNTER, Cause::Fault(FaultId(1)));
        assert_eq!(audit(&mut log, 200), [], "seen at a closed port: not counted");
        log.may_move(DEVICE, COUNTER, Cause::Fault(FaultId(1)));
        assert_eq!(audit(&mut log, 1), [], "cleared in between");
        log.may_move(DEVICE, COUNTER, Cause::Content);
        assert_eq!(audit(&mut log, 2), []);
        assert_eq!(log.last_cause(DEVICE, COUNTER), Some(FaultId(1)));
    }
}
