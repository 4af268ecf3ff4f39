//! Frames that were on their way when the input ended.

/// Requests whose return had no time to come. The learner and the end of the input fill it in.
#[derive(Clone, Copy, Default, Debug)]
pub struct FramesInFlight {
    unsettled: u64,
    is_end_known: bool,
}

impl FramesInFlight {
    // ---- what learner and engine tell ----

    /// A request was not back when the input ended, and had no time to be.
    pub(crate) const fn record_unsettled(&mut self) {
        self.unsettled += 1;
    }

    /// The input is known to have gone on for a while after its last frame.
    pub(crate) const fn record_known_end(&mut self) {
        self.is_end_known = true;
    }

    // ---- what rules ask ----

    /// Requests that were not back when the input ended, and may have been on their way.
    #[must_use]
    pub const fn unsettled(&self) -> u64 {
        self.unsettled
    }

    /// True if it is known when the input ended, and not only when its last frame was.
    #[must_use]
    pub const fn is_end_known(&self) -> bool {
        self.is_end_known
    }
}
