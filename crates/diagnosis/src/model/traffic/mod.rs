//! Counts of frames and datagrams of one network, and of their losses, by subject.
//!
//! Each subject says who fills it in; rules only ask.

pub mod broadcasts;
pub mod datagrams;
pub mod foreign;
pub mod in_flight;
pub mod losses;
pub mod recording;
pub mod returns;
pub mod silence;

use linesman_proto::time::Instant;

pub use broadcasts::{BroadcastReads, CountRise};
pub use datagrams::DatagramCounts;
pub use foreign::ForeignFrames;
pub use in_flight::FramesInFlight;
pub use losses::LostFrames;
pub use recording::RecordedFrames;
pub use returns::{Requests, Returns};
pub use silence::Silence;

use super::Seen;
use crate::observe::Questions;

/// Frames that passed the observer.
///
/// Frames that the second card of a ring sends only to see which way they come back are in the recording alone.
#[derive(Clone, Default, Debug)]
pub struct Traffic {
    /// Frames that were recorded, and those that the recording lacks.
    pub recording: RecordedFrames,
    /// Frames on their way out, each once.
    pub requests: Requests,
    /// Frames on their way.
    pub in_flight: FramesInFlight,
    /// Frames that came back.
    pub returns: Returns,
    /// Frames that did not come back, or came back damaged or in one copy alone.
    pub losses: LostFrames,
    /// Frames that are not EtherCAT.
    pub foreign: ForeignFrames,
    /// Datagrams, and those that nobody answered.
    pub datagrams: DatagramCounts,
    /// Results of broadcast reads.
    pub broadcasts: BroadcastReads,
    /// Questions of Linesman beside this MainDevice; they are in no other count.
    pub questions: Questions,
}

impl Traffic {
    // ---- what intake and learner tell, where more than one subject hears it ----

    /// A request was lost that went out when `returns_before` frames had come back; `by_order`, if ports were opened or
    /// closed on purpose meanwhile.
    pub(crate) fn record_lost(
        &mut self,
        at: Instant,
        frame: u64,
        returns_before: u64,
        by_order: bool,
    ) {
        let ended = self.returns.after(returns_before, at);
        self.losses.record(Seen::new((), at, Some(frame)), returns_before, by_order, ended);
    }

    /// In a ring, of a request the copy alone came back that nobody had processed.
    pub(crate) fn record_swallowed(&mut self, at: Instant, frame: u64) {
        // That it is lost is known some time later only.
        let ended = self.returns.latest_processed().filter(|processed| *processed > at);
        let seen = Seen::new((), at, Some(frame));
        self.losses.record_swallowed(seen, self.returns.count(), ended);
    }

    /// A frame came back that somebody had processed.
    pub(crate) fn record_processed(&mut self, at: Instant) {
        self.returns.record_processed(at);
        self.losses.end_swallowing(at);
    }

    /// A frame came back.
    pub(crate) fn record_returned(&mut self, at: Instant, frame: u64) {
        self.returns.record(Seen::new((), at, Some(frame)));
        self.losses.end_silence(at);
    }

    /// Counts frames again as returns whose request was not seen; they were taken for requests.
    pub(crate) const fn record_mistaken(&mut self, count: u64) {
        self.requests.take_back(count);
        self.returns.take_over(count);
    }

    // ---- what rules ask ----

    /// True if something may have been said between two times that is not in the recording: requests that were left
    /// out, frames that were cut off, or one direction only.
    #[must_use]
    pub fn may_lack(&self, from: Instant, to: Instant) -> bool {
        let recording = &self.recording;
        recording.cut() > 0 || self.is_one_sided() || recording.lacks_requests(from, to)
    }

    /// True if frames were seen in one direction only, though the other one must have been there:
    /// returns without a request, or requests that a MainDevice makes only after answers.
    #[must_use]
    pub const fn is_one_sided(&self) -> bool {
        if self.recording.is_direction_known() {
            return false;
        }
        let (sent, returned) = (self.requests.sent(), self.returns.count());
        let only_returned = sent == 0 && self.returns.alone() > 0;
        // A copy for a ring's second card may be taken for a return now and then.
        let is_unanswered = returned == 0
            || (self.datagrams.answered() == 0
                && self.returns.processed() == 0
                && returned * 20 < sent);
        let only_sent = is_unanswered && sent > 0 && self.datagrams.lost_addressed() > 0;
        only_returned || only_sent
    }
}
