//! Frames that were on their way when the input ended.

/// Requests whose return had no time to come. The learner fills it in.
#[derive(Clone, Copy, Default, Debug)]
pub struct FramesInFlight {
    unsettled: u64,
}

impl FramesInFlight {
    // ---- what the learner tells ----

    /// A request was not back when the input ended, and had no time to be.
    pub(crate) const fn record_unsettled(&mut self) {
        self.unsettled += 1;
    }

    // ---- what rules ask ----

    /// Requests that were not back when the input ended, and may have been on their way.
    #[must_use]
    pub const fn unsettled(&self) -> u64 {
        self.unsettled
    }
}
