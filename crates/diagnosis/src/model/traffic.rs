//! Counts of frames and datagrams of one network, and of their losses.

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use super::Seen;
use super::cycle_timing::Pause;
use super::host::Tally;
use crate::observe::{Questions, Sender};

/// Times of lost frames kept.
pub const LOST_KEPT: usize = 64;
/// Silences kept.
pub const SILENCES_KEPT: usize = 16;

/// Rise of the number of controllers that answer a broadcast read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CountRise {
    /// The number before, with the first read that had it.
    pub fewer: Seen<u16>,
    /// The number since.
    pub more: Seen<u16>,
}

/// A stretch of time in which requests went out and nothing came back.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Silence {
    /// The first request without a return.
    pub since: Seen<()>,
    /// The latest one.
    pub last: Seen<()>,
    /// How many requests.
    pub frames: u64,
    /// When something came back again.
    pub ended: Option<Instant>,
    /// When the two requests before the latest one were sent, the earlier one first.
    before_last: [Instant; 2],
    returns_before: u64,
}

impl Silence {
    /// Of one request so far.
    const fn begin(seen: Seen<()>, ended: Option<Instant>, returns_before: u64) -> Self {
        let before_last = [seen.at; 2];
        Self { since: seen, last: seen, frames: 1, ended, before_last, returns_before }
    }

    /// One more request is lost.
    const fn goes_on(&mut self, seen: Seen<()>) {
        self.before_last = [self.before_last[1], self.last.at];
        self.last = seen;
        self.frames += 1;
    }

    /// Whether its latest three requests, at least, were sent from `from` on.
    #[must_use]
    pub fn has_three_since(&self, from: Instant) -> bool {
        self.frames >= 3 && self.before_last[0] >= from
    }
}

/// Without any frame for so long nothing was sent, where process data are exchanged in a cycle.
const QUIET: Span = Span::ms(20);
/// A link that was open is missed for so long at least.
const OPEN_LINK: Span = Span::ms(100);
/// Gaps in the recording that are kept.
const UNRECORDED_KEPT: usize = 256;
/// With fewer requests than this it is no silence.
const SHORT: u64 = 3;
/// Returns whose times are kept: a request is known to be lost after so many later ones at most.
const RECENT: u64 = 64;

/// Times of the latest returns, in a circle.
#[derive(Clone, Debug)]
struct RecentReturns([Instant; RECENT as usize]);

impl Default for RecentReturns {
    fn default() -> Self {
        Self([Instant::default(); RECENT as usize])
    }
}

/// What passed the observer.
#[derive(Clone, Default, Debug)]
pub struct Traffic {
    /// EtherCAT frames seen, copies and both directions included.
    pub frames: u64,
    /// Frames that are not EtherCAT.
    pub foreign: u64,
    /// Those of them that came in, as a live socket tells.
    pub foreign_received: u64,
    /// The first of them, by its EtherType or length.
    pub first_foreign: Option<Seen<u16>>,
    /// When the latest was seen.
    pub latest_foreign: Option<Instant>,
    /// Requests: frames on their way out, each once.
    pub sent: u64,
    /// Frames that came back.
    pub returned: u64,
    /// Frames whose way out was seen and whose return was not, though others came back later.
    pub lost: Tally,
    /// Frames that did not come back because ports were opened or closed on purpose; they are not among `lost`.
    pub lost_by_order: u64,
    /// Of those of which the copy of one card came back: how many did not come to this card.
    pub copies_lost: [Tally; 2],
    /// In a ring that was whole before, frames of which one copy alone came back, with none after them of which both
    /// did: some of them at least.
    pub copies_gone: Tally,
    /// When the first of each row of them was sent between two returns, in the order in which that was known, at most
    /// [`LOST_KEPT`].
    pub lost_at: VecDeque<Instant>,
    /// The first lost frame.
    pub first_lost: Option<Seen<()>>,
    /// The latest lost frame.
    pub latest_lost: Option<Seen<()>>,
    /// The latest frame that came back.
    pub latest_returned: Option<Seen<()>>,
    /// When nothing at all came back, oldest first, at most [`SILENCES_KEPT`].
    pub silences: VecDeque<Silence>,
    /// In a ring, when what card B had sent came round untouched, and nothing of what card A had sent came back:
    /// oldest first, at most [`SILENCES_KEPT`].
    pub swallowed: VecDeque<Silence>,
    /// The latest time at which a frame came back that somebody had processed.
    pub latest_processed: Option<Instant>,
    /// Frames that came back so.
    pub processed: u64,
    recent_returns: RecentReturns,
    /// Who sent requests, at most four.
    pub senders: Vec<Sender>,
    /// Requests that were sent and are not in the recording, as their numbers tell.
    pub unrecorded: Tally,
    /// When: before which recorded requests, the latest ones, and when the request before each was recorded.
    pub unrecorded_at: VecDeque<Pause>,
    last_noted: Option<Instant>,
    /// Returns whose request was not seen.
    pub returned_alone: u64,
    /// Frames recorded twice.
    pub duplicates: u64,
    /// Frames that came back a second time, as a live socket tells.
    pub doubled: u64,
    /// EtherCAT frames without datagrams: network variables, mailbox.
    pub without_datagrams: u64,
    /// Whether any frame's direction was known for sure.
    pub direction_known: bool,
    /// Datagrams to station or logical addresses in frames that never came back: a MainDevice gets
    /// that far only when SubDevices answer.
    pub lost_addressed: u64,
    /// Of those the process data.
    pub lost_logical: u64,
    /// Frames that came back with a wrong check sequence.
    pub damaged: Tally,
    /// The first of those.
    pub first_damaged: Option<Seen<()>>,
    /// Frames of which the recorder kept only the beginning.
    pub truncated: u64,
    /// Frames of which the recorder kept so little that a datagram, or its working counter, is missing.
    pub datagrams_cut: u64,
    /// Frames that end before their last datagram does, though they were recorded whole.
    pub cut_short: u64,
    /// Frames that the second card of a ring sent only to see which way they come back; they are not among `sent` and
    /// `returned`.
    pub companions: u64,
    /// Questions of Linesman beside this MainDevice; they are not among `frames`, `sent` and `returned`.
    pub questions: Questions,
    /// The latest of those that controllers have processed, by how many: the ring was open, and so many are reached from
    /// the second card.
    pub companion_processed: Option<Seen<u16>>,
    /// Frames that passed and were not shown to the diagnosis, because it did not keep up.
    pub missed: u64,
    /// The largest step by which time stamps ran backwards.
    pub clock_back: Span,
    /// The longest time without any frame.
    pub longest_gap: Span,
    /// Datagrams judged: each request once.
    pub datagrams: u64,
    /// Datagrams that nobody answered: their frame never came back, or came back with working
    /// counter 0 where an answer was expected.
    pub unanswered: u64,
    /// Those of them whose frame came back, while process data were exchanged: a MainDevice that starts asks for what is
    /// not there.
    pub unanswered_alone: u64,
    /// Datagrams that somebody answered.
    pub answered: u64,
    /// The first unanswered one.
    pub first_unanswered: Option<Seen<()>>,
    /// The largest working counter of a broadcast read: how many controllers answered at most.
    pub broadcast_answers: u16,
    /// The working counter of the latest broadcast read, with when it last changed.
    pub broadcast_now: Option<Seen<u16>>,
    /// The latest time that more controllers answered a broadcast read than ever before though process data were exchanged
    /// already.
    pub broadcast_rose: Option<CountRise>,
    /// When a broadcast read that all controllers answer last came back.
    pub broadcast_read: Option<Instant>,
    /// In a ring, the latest broadcast read ever whose copies were both processed by somebody: by how many
    /// each, in the order in which they came back. Who is reached by card B alone gets no time of a reference
    /// clock that card A reaches.
    pub broadcast_split: Option<Seen<(u16, u16)>>,
    /// Whether a broadcast read came back in two copies, and one of them alone was processed by anybody.
    pub was_processed_by_one: bool,
    /// The latest broadcast read whose copies both came back, and of which one alone was processed by anybody:
    /// the card that had sent that one. In a closed ring that is card A, unless all are plugged in the wrong
    /// way round.
    pub processed_alone: Option<Seen<Path>>,
    /// The first broadcast read that fewer controllers answered than one before.
    pub broadcast_first_low: Option<Seen<u16>>,
    /// Most controllers that a frame passed, by what they add to positions.
    pub positions_seen: u16,
    /// The highest state that broadcast reads of AL status prove.
    pub al_highest: Option<AlState>,
    /// When no frame at all was seen, neither on its way out nor back, oldest first, at most [`SILENCES_KEPT`]. In
    /// a recording it is so while a card takes no frames, as without a link.
    pub quiet: VecDeque<Pause>,
    /// Whether frames passed since the latest one that were not shown: the time to the next says nothing.
    is_gap_unknown: bool,
    /// The first frame.
    pub first: Option<Instant>,
    /// The latest frame.
    pub last: Option<Instant>,
}

impl Traffic {
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
            if self.quiet.len() == SILENCES_KEPT {
                self.quiet.pop_front();
            }
            self.quiet.push_back(Pause { from: last, to: at });
        }
    }

    /// So many frames passed and were not shown.
    pub const fn record_missed(&mut self, count: u64) {
        self.missed += count;
        self.is_gap_unknown = true;
    }

    /// A frame was seen that the second card of a ring sends only to see which way it comes back, and so many
    /// controllers had processed it.
    pub fn record_companion(&mut self, seen: Seen<u16>) {
        self.companions += 1;
        if seen.value > 0 {
            self.companion_processed = Some(seen);
        }
    }

    /// A request was recorded at `at`, and so many before it were not.
    pub fn note_unrecorded(&mut self, count: u64, at: Instant) {
        let before = self.last_noted.replace(at).unwrap_or(at);
        if count == 0 {
            return;
        }
        self.unrecorded.add(count, at);
        let gap = Pause { from: before.min(at), to: at };
        match self.unrecorded_at.back_mut() {
            // Gaps that follow one another at once are kept as one.
            Some(last) if gap.from.since(last.to) < QUIET => last.to = gap.to,
            Some(_) | None => {
                if self.unrecorded_at.len() == UNRECORDED_KEPT {
                    self.unrecorded_at.pop_front();
                }
                self.unrecorded_at.push_back(gap);
            }
        }
    }

    /// Whether something may have been said between two times that is not in the recording: requests that were left
    /// out, frames that were cut off, or one direction only.
    #[must_use]
    pub fn may_lack(&self, from: Instant, to: Instant) -> bool {
        let overlaps = |gap: &Pause| gap.from <= to && from <= gap.to;
        self.datagrams_cut > 0 || self.is_one_sided() || self.unrecorded_at.iter().any(overlaps)
    }

    /// Whether the recording itself lacks frames of a short stretch of time, as the numbers of the others tell: then
    /// it has lost their returns, too. A link that was open would have been missed for longer.
    #[must_use]
    pub fn was_badly_recorded(&self, from: Instant, to: Instant) -> bool {
        let overlaps = |gap: &Pause| gap.from <= to && from <= gap.to && gap.span() < OPEN_LINK;
        to.since(from) < OPEN_LINK && self.unrecorded_at.iter().any(overlaps)
    }

    /// A request was lost that went out when `returns_before` frames had come back; `by_order`, if ports were opened or
    /// closed on purpose meanwhile.
    pub fn record_lost(&mut self, at: Instant, frame: u64, returns_before: u64, by_order: bool) {
        let seen = Seen::new((), at, Some(frame));
        if by_order {
            self.lost_by_order += 1;
        } else {
            self.lost.add(1, at);
            let in_a_row =
                self.silences.back().map(|row| row.returns_before) == Some(returns_before);
            if !in_a_row {
                if self.lost_at.len() == LOST_KEPT {
                    self.lost_at.pop_front();
                }
                self.lost_at.push_back(at);
            }
            self.first_lost.get_or_insert(seen);
            self.latest_lost = Some(seen);
        }
        let ended = self.return_after(returns_before, at);
        if let Some(silence) = self.silences.back_mut() {
            if silence.returns_before == returns_before {
                silence.goes_on(seen);
                silence.ended = ended;
                return;
            }
            if silence.frames < SHORT {
                // A few frames lost among others are no silence worth keeping.
                self.silences.pop_back();
            } else if self.silences.len() == SILENCES_KEPT {
                self.silences.pop_front();
            }
        }
        self.silences.push_back(Silence::begin(seen, ended, returns_before));
    }

    /// In a ring, of a request the copy alone came back that nobody had processed.
    pub fn record_swallowed(&mut self, at: Instant, frame: u64) {
        let seen = Seen::new((), at, Some(frame));
        if let Some(silence) = self.swallowed.back_mut() {
            if silence.ended.is_none_or(|ended| ended >= at) {
                silence.goes_on(seen);
                return;
            }
            if silence.frames < SHORT {
                self.swallowed.pop_back();
            } else if self.swallowed.len() == SILENCES_KEPT {
                self.swallowed.pop_front();
            }
        }
        // That it is lost is known some time later only.
        let ended = self.latest_processed.filter(|processed| *processed > at);
        self.swallowed.push_back(Silence::begin(seen, ended, self.returned));
    }

    /// A frame came back that somebody had processed.
    pub fn record_processed(&mut self, at: Instant) {
        // Each datagram of a frame tells it.
        self.processed += u64::from(self.latest_processed != Some(at));
        self.latest_processed = Some(at);
        if let Some(silence) = self.swallowed.back_mut() {
            silence.ended.get_or_insert(at);
        }
    }

    /// A frame that is not EtherCAT was seen. Says whether it is news.
    pub fn record_foreign(&mut self, seen: Seen<u16>, is_received: bool) -> bool {
        self.foreign += 1;
        self.foreign_received += u64::from(is_received);
        self.first_foreign.get_or_insert(seen);
        self.latest_foreign = self.latest_foreign.max(Some(seen.at));
        // The thousandth is none.
        self.foreign.is_power_of_two() || self.foreign_received == 1
    }

    /// A frame came back.
    pub fn record_returned(&mut self, at: Instant, frame: u64) {
        self.recent_returns.0[(self.returned % RECENT) as usize] = at;
        self.returned += 1;
        self.latest_returned = Some(Seen::new((), at, Some(frame)));
        if let Some(silence) = self.silences.back_mut() {
            silence.ended.get_or_insert(at);
        }
    }

    /// When the first frame came back after so many others; `sent`, if that is long ago.
    fn return_after(&self, returns_before: u64, sent: Instant) -> Option<Instant> {
        match self.returned.checked_sub(returns_before) {
            None | Some(0) => None,
            Some(later) if later <= RECENT => {
                Some(self.recent_returns.0[(returns_before % RECENT) as usize])
            }
            Some(_) => Some(sent),
        }
    }

    /// Whether frames were seen in one direction only, though the other one must have been there:
    /// returns without a request, or requests that a MainDevice makes only after answers.
    #[must_use]
    pub fn is_one_sided(&self) -> bool {
        if self.direction_known {
            return false;
        }
        let only_returned = self.sent == 0 && self.returned_alone > 0;
        // A copy for a ring's second card may be taken for a return now and then.
        let is_unanswered = self.returned == 0
            || (self.answered == 0 && self.processed == 0 && self.returned * 20 < self.sent);
        let only_sent = is_unanswered && self.sent > 0 && self.lost_addressed > 0;
        only_returned || only_sent
    }
}
