//! Error counters as totals.
//!
//! The registers hold eight bits and stop at 255, others may clear them, and a restart does. What a
//! person wants is one number that only rises. It is made of the differences between readings, so
//! that nothing has to be cleared for it.

use linesman_proto::port::Port;
use linesman_proto::register::counter::Total;
use linesman_proto::register::{ErrorCounter, ErrorCounters};

/// The counters of one SubDevice, summed up.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct CounterTotals {
    last: Option<ErrorCounters>,
    totals: [Total; ErrorCounter::ALL.len()],
    /// What stood in the totals when they were cleared last.
    base: [u64; ErrorCounter::ALL.len()],
}

impl CounterTotals {
    /// By how much each counter rose from the last reading to this one, those that did not left out.
    /// A first reading is history: what happened while the power came counts for nothing.
    #[must_use]
    pub fn rises(&self, reading: &ErrorCounters) -> Vec<(ErrorCounter, u64)> {
        let Some(last) = &self.last else { return Vec::new() };
        let risen = reading.since(last).filter(|(_, difference)| difference.rise > 0);
        risen.map(|(counter, difference)| (counter, difference.rise)).collect()
    }

    /// Takes a reading.
    pub fn record(&mut self, reading: &ErrorCounters) {
        let differences: Vec<_> = self.last.iter().flat_map(|last| reading.since(last)).collect();
        for (counter, total) in ErrorCounter::ALL.into_iter().zip(&mut self.totals) {
            let Some(value) = reading.value(counter) else { continue };
            let cleared = differences.iter().any(|(one, found)| *one == counter && found.cleared);
            if cleared {
                total.record_after_clear(value);
            } else {
                total.record(value);
            }
        }
        self.last = Some(*reading);
    }

    /// We cleared all of them ourselves right after the last reading, in the same frame: the next one
    /// counts from 0, and nothing is lost.
    pub fn cleared_by_us(&mut self) {
        self.begin_at_zero();
    }

    /// The SubDevice was without power: its counters begin at 0, and nobody cleared them.
    pub fn restarted(&mut self) {
        self.begin_at_zero();
    }

    fn begin_at_zero(&mut self) {
        for total in &mut self.totals {
            if total.last().is_some() {
                total.note_own_clear();
            }
        }
        if let Some(last) = &mut self.last {
            let zero = ErrorCounters::from_bytes(&[0; ErrorCounters::LEN], ErrorCounters::START);
            *last = zero;
        }
    }

    /// All begin at 0 again; no register is touched.
    pub fn clear(&mut self) {
        self.base = self.totals.map(|total| total.rise());
    }

    /// How many since the start or the last clear; `None` when the SubDevice does not have it, or was not read.
    #[must_use]
    pub fn count(&self, counter: ErrorCounter) -> Option<u64> {
        self.last?.value(counter)?;
        let index = ErrorCounter::ALL.iter().position(|other| *other == counter)?;
        Some(self.totals.get(index)?.rise() - self.base.get(index)?)
    }

    /// Whether counts may have been lost, since a register stood at 255 or somebody cleared it between two readings.
    #[must_use]
    pub fn is_lower_bound(&self) -> bool {
        self.totals.iter().any(Total::is_lower_bound)
    }

    /// What the registers themselves hold, as they were read last.
    #[must_use]
    pub fn registers(&self) -> Option<&ErrorCounters> {
        self.last.as_ref()
    }

    /// Frame and symbol errors of all ports together.
    #[must_use]
    pub fn sum(&self) -> u64 {
        Port::ALL.into_iter().filter_map(|port| self.at_port(port)).sum()
    }

    /// What the online list shows for a port: damaged frames, whoever marked them, and symbols.
    #[must_use]
    pub fn at_port(&self, port: Port) -> Option<u64> {
        let frames = self.count(ErrorCounter::InvalidFrame(port))?;
        Some(frames + self.count(ErrorCounter::PhysicalLayer(port)).unwrap_or(0))
    }
}
