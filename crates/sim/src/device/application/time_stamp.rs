//! Inputs whose edges the latch unit of the controller gives a time.
//!
//! Read first: S2 2.15.5. The unit sees the edge itself, so its time is that of the signal and not of
//! the frame that fetches it.

use linesman_proto::time::Instant;

use crate::controller::{LatchInput, Pdi};
use crate::device::signal::SignalId;

/// Signals on the inputs of the latch unit.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct TimeStamps(Vec<(LatchInput, SignalId)>);

impl TimeStamps {
    /// The first two of these signals.
    #[must_use]
    pub fn new(signals: &[SignalId]) -> Self {
        Self(LatchInput::ALL.into_iter().zip(signals.iter().copied()).collect())
    }

    /// The signals.
    pub(crate) fn signals(&self) -> impl Iterator<Item = SignalId> {
        self.0.iter().map(|(_, signal)| *signal)
    }

    /// Shows the unit what the signals have done by `now`.
    pub fn sample(&self, now: Instant, pdi: &mut Pdi<'_>) {
        for (input, signal) in &self.0 {
            let (high, since) = (pdi.signals().is_high(*signal), pdi.signals().changed_at(*signal));
            pdi.set_latch_input(*input, high, since.min(now));
        }
    }
}
