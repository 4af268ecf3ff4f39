//! Ethernet frames that a SubDevice sends through its mailbox (EoE), as far as they tell of trouble.
//!
//! Reference: ETG.1000.6, EoE fragment: fragments of a frame are numbered from 0, frames from 0 to 15; ETG.1000.4: messages of
//! a mailbox are counted from 1 to 7. Where a counter of the mailbox is skipped, a message was lost on its way or fetched by
//! somebody unseen, and its fragment is not the fault of the EoE stack.

use std::collections::VecDeque;

use linesman_proto::mailbox::Counter;
use linesman_proto::mailbox::eoe::{Fragment, FragmentPlace};
use linesman_proto::mailbox::error_reply::ErrorReplyCode;
use linesman_proto::time::Instant;

use super::{Seen, push_kept};

/// What a SubDevice sends, and what it refuses.
#[derive(Clone, Default, Debug)]
pub struct EthernetHistory {
    /// The frame of which fragments come.
    frame: Option<FrameInParts>,
    /// Counter of the latest message of the mailbox, of whichever protocol.
    counter: Option<Counter>,
    /// A message may be missing since the latest fragment.
    may_lack: bool,
    /// Its frames are numbered: not all have the same number.
    is_numbered: bool,
    /// Frames that came whole.
    pub whole: u64,
    /// Frames whose fragments did not come as they should, oldest first.
    pub spoiled: VecDeque<Seen<SpoiledFrame>>,
    /// Fragments of the MainDevice that it refused, oldest first.
    pub refused: VecDeque<Seen<ErrorReplyCode>>,
}

/// A frame whose fragments did not come as they should.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SpoiledFrame {
    /// Its number, 0 to 15.
    pub frame: u8,
    /// The fragment that is concerned, 0 to 63.
    pub fragment: u8,
    /// What became of it.
    pub how: FragmentFate,
    /// When the first fragment of the frame came.
    pub since: Instant,
}

/// What became of a fragment.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum FragmentFate {
    /// It did not come, though no message of the mailbox is missing.
    Missing,
    /// It came twice, in two messages.
    Doubled,
    /// It came behind one with a higher number.
    Overtaken,
}

impl FragmentFate {
    /// The words that follow "fragment 3 of frame 5".
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Missing => "does not come",
            Self::Doubled => "comes twice",
            Self::Overtaken => "comes behind a later one",
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct FrameInParts {
    number: u8,
    /// Which fragments have come, bit by bit: there are 64 at most.
    came: u64,
    highest: u8,
    last: Option<u8>,
    since: Instant,
    /// A message may be missing among its fragments, or it was told already what is wrong.
    is_settled: bool,
    /// Check number of the first fragment.
    first: u32,
}

impl EthernetHistory {
    /// A message of the mailbox came, of whichever protocol. False when it is the same one once more, as a MainDevice asks for
    /// it whose frame was lost.
    pub fn count(&mut self, counter: Counter) -> bool {
        let before = self.counter.replace(counter);
        let Some(before) = before else { return true };
        if counter.repeats(before) {
            return false;
        }
        self.may_lack |= counter == Counter::NONE || counter != before.next();
        true
    }

    /// A fragment came. True if it tells of trouble.
    pub fn take(&mut self, fragment: &Fragment<'_>, at: Instant, frame: u64) -> bool {
        let number = match fragment.place {
            FragmentPlace::First { .. } => 0,
            FragmentPlace::Further { number, .. } => number & 0x3F,
        };
        let bit = 1_u64 << number;
        let may_lack = std::mem::take(&mut self.may_lack);
        let first = if number == 0 { check_number(fragment.data) } else { 0 };
        let is_same = self.frame.as_ref().is_some_and(|open| {
            let begins_anew = number == 0
                && open.came & 1 != 0
                && (!self.is_numbered || open.first != first || open.highest > 0);
            open.number == fragment.frame && !begins_anew
        });
        let mut news = false;
        if !is_same {
            if let Some(former) = self.frame.take() {
                self.is_numbered |= former.number != fragment.frame;
                news |= self.conclude(&former, may_lack, at, frame);
            }
            self.frame = Some(FrameInParts {
                number: fragment.frame,
                came: 0,
                highest: 0,
                last: None,
                since: at,
                // What came before the first fragment that was seen is not known.
                is_settled: may_lack,
                first,
            });
        }
        let Some(open) = &mut self.frame else { return news };
        open.is_settled |= may_lack;
        let how = if open.came & bit != 0 {
            Some(FragmentFate::Doubled)
        } else if open.came != 0 && number < open.highest {
            Some(FragmentFate::Overtaken)
        } else {
            None
        };
        open.came |= bit;
        open.highest = open.highest.max(number);
        if number == 0 {
            open.first = first;
        }
        if fragment.last {
            open.last = Some(number);
        }
        if let Some(how) = how
            && !open.is_settled
        {
            open.is_settled = true;
            let spoiled =
                SpoiledFrame { frame: open.number, fragment: number, how, since: open.since };
            push_kept(&mut self.spoiled, Seen::new(spoiled, at, Some(frame)));
            news = true;
        }
        news
    }

    /// No more fragments of a frame come: it is whole, or one is missing.
    fn conclude(&mut self, former: &FrameInParts, may_lack: bool, at: Instant, frame: u64) -> bool {
        let missing = former.came.trailing_ones() as u8;
        let is_whole = former.last.is_some_and(|last| missing == last + 1);
        if is_whole {
            self.whole += u64::from(!former.is_settled);
            return false;
        }
        // Who listens from amid a frame on has not seen its beginning.
        if former.is_settled || may_lack || self.whole == 0 {
            return false;
        }
        let spoiled = SpoiledFrame {
            frame: former.number,
            fragment: missing,
            how: FragmentFate::Missing,
            since: former.since,
        };
        push_kept(&mut self.spoiled, Seen::new(spoiled, at, Some(frame)));
        true
    }

    /// A fragment of the MainDevice was refused.
    pub fn refuse(&mut self, code: ErrorReplyCode, at: Instant, frame: u64) {
        push_kept(&mut self.refused, Seen::new(code, at, Some(frame)));
    }
}

/// A number that tells one content from another: FNV-1a.
fn check_number(data: &[u8]) -> u32 {
    data.iter().fold(0x811C_9DC5, |sum, byte| (sum ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests {
    use linesman_proto::mailbox::eoe::fragments;

    use super::*;

    /// What is told of frames of four fragments each, of which these come; `skip` leaves out a counter of the mailbox.
    fn told(orders: &[&[usize]], skips: Option<usize>) -> (u64, Vec<(u8, u8, FragmentFate)>) {
        let mut history = EthernetHistory::default();
        let mut counter = Counter::NONE.next();
        let mut sent = 0;
        for (frame, order) in orders.iter().enumerate() {
            let bytes = vec![frame as u8; 400];
            let pieces: Vec<_> = fragments(&bytes, 0, frame as u8, 132).collect();
            assert_eq!(pieces.len(), 4);
            for at in *order {
                if skips == Some(sent) {
                    counter = counter.next();
                }
                sent += 1;
                assert!(history.count(counter));
                history.take(&pieces[*at], Instant::from_nanos(sent as u64), sent as u64);
                assert!(!history.count(counter), "fetched again");
                counter = counter.next();
            }
        }
        let told = history
            .spoiled
            .iter()
            .map(|seen| (seen.value.frame, seen.value.fragment, seen.value.how));
        (history.whole, told.collect())
    }

    const ALL: &[usize] = &[0, 1, 2, 3];

    #[test]
    fn each_way_that_fragments_go_wrong_is_told_apart() {
        use FragmentFate::{Doubled, Missing, Overtaken};
        assert_eq!(told(&[ALL, ALL, ALL], None), (2, vec![]));
        assert_eq!(told(&[ALL, &[0, 2, 3], ALL, ALL], None), (2, vec![(1, 1, Missing)]));
        assert_eq!(told(&[ALL, &[1, 2, 3], ALL], None), (1, vec![(1, 0, Missing)]));
        assert_eq!(told(&[ALL, &[0, 1, 2], ALL], None), (1, vec![(1, 3, Missing)]));
        assert_eq!(told(&[ALL, &[0, 1, 1, 2, 3], ALL], None), (1, vec![(1, 1, Doubled)]));
        assert_eq!(told(&[ALL, &[0, 0, 1, 2, 3], ALL], None), (1, vec![(1, 0, Doubled)]));
        assert_eq!(told(&[ALL, &[0, 1, 2, 3, 3], ALL], None), (1, vec![(1, 3, Doubled)]));
        assert_eq!(told(&[ALL, &[0, 2, 1, 3], ALL], None), (1, vec![(1, 1, Overtaken)]));
        assert_eq!(told(&[ALL, &[1, 0, 2, 3], ALL], None), (1, vec![(1, 0, Overtaken)]));
        assert_eq!(told(&[ALL, &[0, 1, 3, 2], ALL], None), (1, vec![(1, 2, Overtaken)]));
    }

    #[test]
    fn fragment_that_was_lost_with_its_message_is_not_the_fault_of_the_stack() {
        // A counter of the mailbox is missing where the fragment is, amid the frame and at its end.
        assert_eq!(told(&[ALL, &[0, 2, 3], ALL], Some(5)).1, []);
        assert_eq!(told(&[ALL, &[0, 1, 2], ALL], Some(7)).1, []);
        // Who listens from amid a frame on has not seen its beginning.
        assert_eq!(told(&[&[2, 3], ALL, ALL], None).1, []);
    }

    #[test]
    fn equal_frames_without_numbers_are_no_doubled_fragments() {
        let mut history = EthernetHistory::default();
        let bytes = [7; 60];
        let piece = fragments(&bytes, 0, 0, 132).next().unwrap();
        let mut counter = Counter::NONE;
        for at in 0..20 {
            counter = counter.next();
            assert!(history.count(counter));
            assert!(!history.take(&piece, Instant::from_nanos(at), at));
        }
        assert_eq!(history.whole, 19);
    }
}
