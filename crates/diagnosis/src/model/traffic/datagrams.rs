//! Counts of datagrams, and of those that nobody answered.

use crate::model::Seen;

/// Datagrams, each request once. The learner fills it in.
#[derive(Clone, Default, Debug)]
pub struct DatagramCounts {
    judged: u64,
    answered: u64,
    unanswered: u64,
    unanswered_alone: u64,
    first_unanswered: Option<Seen<()>>,
    lost_addressed: u64,
    lost_logical: u64,
}

impl DatagramCounts {
    /// A datagram is judged, whether or not somebody answered it.
    pub(crate) const fn record_judged(&mut self) {
        self.judged += 1;
    }

    /// Somebody answered one.
    pub(crate) const fn record_answered(&mut self) {
        self.answered += 1;
    }

    /// Nobody answered one. `is_alone` if its frame came back, while process data were exchanged.
    pub(crate) fn record_unanswered(&mut self, seen: Seen<()>, is_alone: bool) {
        self.unanswered += 1;
        self.unanswered_alone += u64::from(is_alone);
        self.first_unanswered.get_or_insert(seen);
    }

    /// The frame of one to a station address or, if it `is_logical`, to a logical address never came back.
    pub(crate) fn record_lost(&mut self, is_logical: bool) {
        self.lost_addressed += 1;
        self.lost_logical += u64::from(is_logical);
    }

    /// Datagrams judged.
    #[must_use]
    pub const fn judged(&self) -> u64 {
        self.judged
    }

    /// Datagrams that somebody answered.
    #[must_use]
    pub const fn answered(&self) -> u64 {
        self.answered
    }

    /// Datagrams that nobody answered: their frame never came back, or came back with working
    /// counter 0 where an answer was expected.
    #[must_use]
    pub const fn unanswered(&self) -> u64 {
        self.unanswered
    }

    /// Datagrams of these whose frame came back, while process data were exchanged: a MainDevice that starts asks for what is
    /// not there.
    #[must_use]
    pub const fn unanswered_alone(&self) -> u64 {
        self.unanswered_alone
    }

    /// The first unanswered one.
    #[must_use]
    pub const fn first_unanswered(&self) -> Option<Seen<()>> {
        self.first_unanswered
    }

    /// Datagrams to station or logical addresses in frames that never came back: a MainDevice gets
    /// that far only when SubDevices answer.
    #[must_use]
    pub const fn lost_addressed(&self) -> u64 {
        self.lost_addressed
    }

    /// Of those the process data.
    #[must_use]
    pub const fn lost_logical(&self) -> u64 {
        self.lost_logical
    }
}
