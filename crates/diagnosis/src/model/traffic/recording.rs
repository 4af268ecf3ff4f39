//! Recorded frames of one network, and those that the recording lacks.

use std::collections::VecDeque;

use linesman_proto::time::{Instant, Span};

use crate::model::cycle_timing::Pause;

/// Times without any frame that are kept.
const QUIET_KEPT: usize = 16;
/// Gaps in the recording that are kept.
const GAPS_KEPT: usize = 256;
/// Without any frame for so long nothing was sent, where process data are exchanged in a cycle.
const QUIET: Span = Span::ms(20);
/// A link that was open is missed for so long at least.
const OPEN_LINK: Span = Span::ms(100);

/// Frames that were recorded, and those that were not. The intake of frames fills it in.
#[derive(Clone, Default, Debug)]
pub struct RecordedFrames {
    frames: u64,
    is_direction_known: bool,
    cut: u64,
    missed: u64,
    /// True if frames passed since the latest one that were not shown: the time to the next says nothing.
    is_gap_unknown: bool,
    has_gaps: bool,
    /// Before which recorded requests the latest gaps are, and when the request before each was recorded.
    gaps: VecDeque<Pause>,
    last_request: Option<Instant>,
    first: Option<Instant>,
    last: Option<Instant>,
    /// Time for which the input went on behind its last frame; `None` where that is not known.
    still: Option<Span>,
    clock_back: Span,
    longest_gap: Span,
    quiet: VecDeque<Pause>,
}

impl RecordedFrames {
    // ---- what the intake tells ----

    /// A frame was seen, on its way out or back.
    pub fn record_frame(&mut self, at: Instant) {
        self.frames += 1;
        self.first.get_or_insert(at);
        let last = self.last.unwrap_or(at);
        // Times of two interfaces may run backwards.
        self.last = Some(last.max(at));
        self.clock_back = self.clock_back.max(last.since(at));
        if std::mem::take(&mut self.is_gap_unknown) {
            return;
        }
        self.longest_gap = self.longest_gap.max(at.since(last));
        if at.since(last) >= QUIET {
            if self.quiet.len() == QUIET_KEPT {
                self.quiet.pop_front();
            }
            self.quiet.push_back(Pause { from: last, to: at });
        }
    }

    /// An EtherCAT frame without datagrams was seen: network variables, mailbox.
    pub(crate) const fn record_without_datagrams(&mut self) {
        self.frames += 1;
    }

    /// The direction of a frame was known for sure.
    pub(crate) const fn record_direction(&mut self) {
        self.is_direction_known = true;
    }

    /// Of a frame so little was kept that a datagram, or its working counter, is missing.
    pub(crate) const fn record_cut(&mut self) {
        self.cut += 1;
    }

    /// Counts frames that passed and were not shown.
    pub(crate) const fn record_missed(&mut self, count: u64) {
        self.missed += count;
        self.is_gap_unknown = true;
    }

    /// A request was recorded at `at`, and so many before it were not.
    pub(crate) fn record_unrecorded(&mut self, count: u64, at: Instant) {
        let before = self.last_request.replace(at).unwrap_or(at);
        if count == 0 {
            return;
        }
        self.has_gaps = true;
        let gap = Pause { from: before.min(at), to: at };
        match self.gaps.back_mut() {
            // Gaps that follow one another at once are kept as one.
            Some(last) if gap.from.since(last.to) < QUIET => last.to = gap.to,
            Some(_) | None => {
                if self.gaps.len() == GAPS_KEPT {
                    self.gaps.pop_front();
                }
                self.gaps.push_back(gap);
            }
        }
    }

    /// The input ended at `at`, as far as that is known.
    pub(crate) fn record_end(&mut self, at: Instant) {
        self.still = self.last.filter(|last| *last < at).map(|last| at.since(last));
    }

    // ---- what rules ask ----

    /// EtherCAT frames seen, copies and both directions included; none without a line that was watched.
    #[must_use]
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// When the first frame was seen.
    #[must_use]
    pub const fn first(&self) -> Option<Instant> {
        self.first
    }

    /// When the latest frame was recorded.
    #[must_use]
    pub const fn last(&self) -> Option<Instant> {
        self.last
    }

    /// Time for which the input is known to have gone on behind its last frame.
    #[must_use]
    pub const fn still(&self) -> Option<Span> {
        self.still
    }

    /// True if it is known when the input ended, and not only when its last frame was.
    #[must_use]
    pub const fn is_end_known(&self) -> bool {
        self.still.is_some()
    }

    /// True if any frame's direction was known for sure, as a live socket tells it.
    #[must_use]
    pub const fn is_direction_known(&self) -> bool {
        self.is_direction_known
    }

    /// Frames of which so little was kept that a datagram, or its working counter, is missing.
    #[must_use]
    pub const fn cut(&self) -> u64 {
        self.cut
    }

    /// Frames that passed and were not shown to the diagnosis, because it did not keep up.
    #[must_use]
    pub const fn missed(&self) -> u64 {
        self.missed
    }

    /// True if requests were sent that are not in the recording, as the numbers of the others tell.
    #[must_use]
    pub const fn has_gaps(&self) -> bool {
        self.has_gaps
    }

    /// True if requests that were sent between two times are not in the recording.
    #[must_use]
    pub(super) fn lacks_requests(&self, from: Instant, to: Instant) -> bool {
        self.gaps.iter().any(|gap| gap.from <= to && from <= gap.to)
    }

    /// True if the recording itself lacks frames of a short stretch of time, as the numbers of the others tell: then
    /// it has lost their returns, too. A link that was open would have been missed for longer.
    #[must_use]
    pub fn was_bad(&self, from: Instant, to: Instant) -> bool {
        let overlaps = |gap: &Pause| gap.from <= to && from <= gap.to && gap.span() < OPEN_LINK;
        to.since(from) < OPEN_LINK && self.gaps.iter().any(overlaps)
    }

    /// The largest step by which time stamps ran backwards.
    #[must_use]
    pub const fn clock_back(&self) -> Span {
        self.clock_back
    }

    /// The longest time without any frame.
    #[must_use]
    pub const fn longest_gap(&self) -> Span {
        self.longest_gap
    }

    /// When no frame at all was seen, neither on its way out nor back, oldest first, the latest sixteen. In
    /// a recording it is so while a card takes no frames, as without a link.
    #[must_use]
    pub const fn quiet(&self) -> &VecDeque<Pause> {
        &self.quiet
    }
}
