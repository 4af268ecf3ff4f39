//! Statistics of the frames that were sent and came back.

/// Counts since the MainDevice was made.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Statistics {
    /// Frames handed out to be sent; both copies of a ring count.
    pub frames_sent: u64,
    /// Of those, frames with process data.
    pub cyclic_sent: u64,
    /// Frames of ours that came back in time.
    pub frames_received: u64,
    /// Frames that did not come back in time. Of these [`frames_late`](Self::frames_late) came after
    /// all.
    pub frames_lost: u64,
    /// Frames with process data that did not come back in time, or came back without their end.
    pub cyclic_lost: u64,
    /// Frames of procedures that did not come back in time: state changes, registers, mailboxes.
    pub queued_lost: u64,
    /// Frames that came back after they had been given up.
    pub frames_late: u64,
    /// Frames that came back once more.
    pub frames_duplicate: u64,
    /// Further copies of cyclic frames that are sent more than once.
    pub frames_spare: u64,
    /// Frames from our address that match nothing which is out: an unknown index, or other datagrams
    /// than were sent.
    pub frames_stray: u64,
    /// Frames of ours that came back without their end.
    pub frames_truncated: u64,
    /// Frames from other addresses.
    pub frames_foreign: u64,
    /// Datagrams of procedures that were sent again because their frame was lost.
    pub repeats: u64,
    /// Cycles begun.
    pub cycles: u64,
    /// Cycles left out because the MainDevice was called too late.
    pub cycles_missed: u64,
    /// Cycles that began without new outputs of the application, where that is watched.
    pub deadlines_missed: u64,
    /// Of those, cycles in which outputs were withheld.
    pub cycles_withheld: u64,
    /// Cyclic frames that were not sent because too many were out.
    pub cyclic_unsent: u64,
    /// Cyclic datagrams whose working counter was not the expected one.
    pub working_counter_errors: u64,
}

impl Statistics {
    /// Frames of procedures that were handed out: state changes, registers, mailboxes (HW-32).
    #[must_use]
    pub const fn queued_sent(&self) -> u64 {
        self.frames_sent - self.cyclic_sent
    }
}
