//! Gaps between the frames of a MainDevice: the times in which its frame is neither under way nor due.

use std::collections::{BTreeMap, VecDeque};

use linesman_proto::command::Addressing;
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};

use crate::model::CycleTiming;

/// Tasks that are followed.
const TASKS: usize = 16;
/// Frames under way that are followed.
const MOST_OUT: usize = 64;
/// Trips from which the usual one is taken.
const TRIPS: usize = 64;
/// Of these, so many of ten are shorter than what is taken for usual.
const USUAL_OF_TEN: usize = 9;
/// Room that is left before a frame is due, beside the time that a question takes.
const MARGIN: Span = Span::us(30);
/// A frame that is out so many usual trips is lost.
const LOST_TRIPS: u64 = 4;
/// And so long at least: the computer may have stood still.
const LOST_AFTER: Span = Span::ms(2);
/// A task that is overdue by so many cycles, and by [`PAUSE`], has paused.
const PAUSE_CYCLES: u64 = 4;
/// The shortest pause of a task.
const PAUSE: Span = Span::ms(100);
/// Without process data: a MainDevice that sent nothing for so long drives nothing.
const QUIET: Span = Span::ms(2_500);

/// A task: command, logical address and length of a datagram with process data.
type CyclicTask = (u8, u32, u16);

/// What may be done at a time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SendWindow {
    /// A question may leave now.
    Open,
    /// Not now. It is worth looking again at this time, or with the next frame.
    Until(Instant),
    /// Not before a further frame of the MainDevice.
    Closed,
}

/// The ways of a MainDevice, as far as gaps depend on them.
#[derive(Clone, Default, Debug)]
pub struct Gaps {
    tasks: BTreeMap<CyclicTask, CycleTiming>,
    /// When the frames were sent that are under way.
    out: VecDeque<Instant>,
    last_sent: Option<Instant>,
    last_returned: Option<Instant>,
    /// The latest trips, in a circle.
    round_trips: VecDeque<Span>,
}

impl Gaps {
    /// A frame of the MainDevice has left.
    pub fn sent(&mut self, at: Instant, view: &FrameView<'_>) {
        self.last_sent = self.last_sent.max(Some(at));
        if self.out.len() == MOST_OUT {
            self.out.pop_front();
        }
        self.out.push_back(at);
        for datagram in view.datagrams().map_while(Result::ok) {
            let addressing = datagram.command().map(|command| command.effect().addressing);
            if addressing != Some(Addressing::Logical) {
                continue;
            }
            let task = (datagram.code(), datagram.logical().0, datagram.data_len() as u16);
            if self.tasks.len() < TASKS || self.tasks.contains_key(&task) {
                self.tasks.entry(task).or_default().tick(at);
            }
        }
    }

    /// A frame that was sent at `sent` has come back. Frames of one line come back in order, so those before it are not
    /// under way any more, either.
    pub fn returned(&mut self, sent: Instant, at: Instant) {
        self.out.retain(|out| *out > sent);
        self.last_returned = self.last_returned.max(Some(at));
        if self.round_trips.len() == TRIPS {
            self.round_trips.pop_front();
        }
        self.round_trips.push_back(at.since(sent));
    }

    /// Frames were missed: nothing is known of those under way.
    pub fn forget(&mut self) {
        self.out.clear();
        self.tasks.values_mut().for_each(CycleTiming::skip);
    }

    /// The shortest cycle of its process data, once it is known.
    #[must_use]
    pub fn cycle(&self) -> Option<Span> {
        self.tasks.values().filter_map(CycleTiming::cycle).min()
    }

    /// The time within which nine of ten frames come back; `None` before the first one.
    #[must_use]
    pub fn usual_trip(&self) -> Option<Span> {
        let mut round_trips: Vec<Span> = self.round_trips.iter().copied().collect();
        round_trips.sort_unstable();
        let last = round_trips.len().checked_sub(1)?;
        round_trips.get(last * USUAL_OF_TEN / 10).copied()
    }

    /// Whether it drives the line at `now`: it sends, and something comes back.
    #[must_use]
    pub fn is_driven(&self, now: Instant) -> bool {
        let quiet = self.cycle().map_or(QUIET, |cycle| PAUSE.max(cycle * PAUSE_CYCLES));
        let is_recent = |at: Option<Instant>| at.is_some_and(|at| now.since(at) <= quiet);
        is_recent(self.last_sent) && is_recent(self.last_returned)
    }

    /// Whether there is room in its cycle for a question and for what may delay it.
    #[must_use]
    pub fn has_room(&self) -> bool {
        let (Some(cycle), Some(trip)) = (self.cycle(), self.usual_trip()) else { return true };
        // Its own frame, and the question.
        trip * 2 + MARGIN < cycle
    }

    /// What may be done at `now`.
    #[must_use]
    pub fn look(&self, now: Instant) -> SendWindow {
        let Some(trip) = self.usual_trip().filter(|_| self.is_driven(now)) else {
            return SendWindow::Closed;
        };
        let lost_after = LOST_AFTER.max(trip * LOST_TRIPS);
        if self.out.iter().any(|sent| now.since(*sent) < lost_after) {
            return SendWindow::Closed;
        }
        let needed = trip + MARGIN;
        for beat in self.tasks.values() {
            let (Some(cycle), Some(last)) = (beat.cycle(), beat.last()) else { continue };
            let due = last + cycle;
            if now + needed < due {
                continue;
            }
            let paused_at = due + PAUSE.max(cycle * PAUSE_CYCLES);
            if now < paused_at {
                return SendWindow::Until(paused_at);
            }
        }
        SendWindow::Open
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::frame::{Frame, fprd, lrw};
    use super::*;

    fn at_us(us: u64) -> Instant {
        Instant::ZERO + Span::us(us)
    }

    /// Cycles of 2 ms whose frames are back after 100 µs.
    fn driven(gaps: &mut Gaps, cycles: u64) {
        for cycle in 0..cycles {
            let sent = at_us(cycle * 2_000);
            let frame = Frame::of(&[lrw(0, &[0; 4])]);
            gaps.sent(sent, &frame.view());
            gaps.returned(sent, sent + Span::us(100));
        }
    }

    #[test]
    fn question_leaves_between_the_return_and_the_next_frame() {
        let mut gaps = Gaps::default();
        driven(&mut gaps, 50);
        let last = 49 * 2_000;
        assert_eq!(gaps.cycle(), Some(Span::ms(2)));
        assert_eq!(gaps.look(at_us(last + 200)), SendWindow::Open);
        assert_eq!(gaps.look(at_us(last + 1_800)), SendWindow::Open);
        assert_ne!(
            gaps.look(at_us(last + 1_900)),
            SendWindow::Open,
            "it would meet the next frame"
        );
        assert_ne!(
            gaps.look(at_us(last + 2_050)),
            SendWindow::Open,
            "the next frame is late, and due"
        );
        let frame = Frame::of(&[lrw(0, &[0; 4])]);
        gaps.sent(at_us(last + 2_100), &frame.view());
        assert_eq!(gaps.look(at_us(last + 2_150)), SendWindow::Closed, "its frame is under way");
        gaps.returned(at_us(last + 2_100), at_us(last + 2_200));
        assert_eq!(gaps.look(at_us(last + 2_250)), SendWindow::Open);
    }

    #[test]
    fn lost_frame_does_not_close_the_gap_for_good() {
        let mut gaps = Gaps::default();
        driven(&mut gaps, 50);
        let frame = Frame::of(&[fprd(0x1001, 0x0130, 2)]);
        gaps.sent(at_us(98_500), &frame.view());
        assert_eq!(gaps.look(at_us(98_600)), SendWindow::Closed);
        // The next one comes back: frames keep their order.
        let frame = Frame::of(&[lrw(0, &[0; 4])]);
        gaps.sent(at_us(100_000), &frame.view());
        gaps.returned(at_us(100_000), at_us(100_100));
        assert_eq!(gaps.look(at_us(100_200)), SendWindow::Open);
    }

    #[test]
    fn nothing_is_asked_while_nobody_drives() {
        let mut gaps = Gaps::default();
        assert_eq!(gaps.look(at_us(5)), SendWindow::Closed);
        driven(&mut gaps, 50);
        assert!(gaps.is_driven(at_us(98_000 + 50_000)));
        assert!(!gaps.is_driven(at_us(98_000 + 200_000)));
        assert_eq!(gaps.look(at_us(98_000 + 200_000)), SendWindow::Closed);
    }

    #[test]
    fn without_process_data_a_question_leaves_behind_any_frame() {
        let mut gaps = Gaps::default();
        for poll in 0..30 {
            let sent = at_us(poll * 100_000);
            let frame = Frame::of(&[fprd(0x1001, 0x0130, 2)]);
            gaps.sent(sent, &frame.view());
            assert_ne!(gaps.look(sent + Span::us(50)), SendWindow::Open, "it is under way");
            gaps.returned(sent, sent + Span::us(100));
        }
        assert_eq!((gaps.cycle(), gaps.has_room()), (None, true));
        assert_eq!(gaps.look(at_us(2_900_000 + 50_000)), SendWindow::Open);
        assert!(!gaps.is_driven(at_us(2_900_000 + 3_000_000)));
    }

    #[test]
    fn cycle_that_is_filled_has_no_room() {
        let mut gaps = Gaps::default();
        for cycle in 0..50 {
            let sent = at_us(cycle * 250);
            let frame = Frame::of(&[lrw(0, &[0; 4])]);
            gaps.sent(sent, &frame.view());
            gaps.returned(sent, sent + Span::us(150));
        }
        assert!(!gaps.has_room());
        assert!((150..250).all(|us| gaps.look(at_us(49 * 250 + us)) != SendWindow::Open));
    }
}
