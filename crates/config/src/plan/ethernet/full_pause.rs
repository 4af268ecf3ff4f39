//! Pauses before a fragment of an Ethernet frame that found its mailbox full is tried again.
//!
//! A SubDevice that works on one message while the next one waits in its mailbox takes messages at even intervals. Too long
//! a pause leaves it idle, and each try that comes too early takes one of the frames that a cycle has room for. So the
//! interval is learnt, and the next try comes when the mailbox should be free.

use linesman_proto::time::{Instant, Span};

/// The interval that is expected before one is learnt.
const FIRST: Span = Span::us(500);
/// The shortest interval that is learnt.
const SHORTEST: Span = Span::us(100);
/// The longest pause, and the longest interval that is learnt.
const LONGEST: Span = Span::ms(10);

/// Interval at which a SubDevice takes fragments, as far as it is learnt.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FullPause {
    /// Time from one fragment that is taken to the next.
    interval: Span,
    /// Time when the last one was taken.
    taken: Instant,
    /// Tries at which the one that waits found the mailbox full.
    refusals: u32,
}

impl Default for FullPause {
    fn default() -> Self {
        Self { interval: FIRST, taken: Instant::ZERO, refusals: 0 }
    }
}

impl FullPause {
    /// Notes that the mailbox was full at `now`, and gives the pause before the next try.
    pub fn refused(&mut self, now: Instant) -> Span {
        let step = part(self.interval, 1, 4);
        self.refusals = self.refusals.saturating_add(1);
        match self.refusals {
            1 => {
                let due = self.taken + self.interval;
                due.since(now).max(step)
            }
            tries => {
                if tries == 2 {
                    self.interval = part(self.interval, 17, 16).min(LONGEST);
                }
                (step * (1 << (tries - 2).min(8))).min(LONGEST)
            }
        }
    }

    /// Notes that the fragment was taken at `now`.
    pub fn accepted(&mut self, now: Instant) {
        // The first try after a pause may have come later than it could. The interval shrinks more slowly than it grows: one of
        // eight fragments or so takes a try more.
        if self.refusals == 1 {
            self.interval = part(self.interval, 127, 128).max(SHORTEST);
        }
        (self.taken, self.refusals) = (now, 0);
    }
}

/// A part of a span: `of` out of `all`.
fn part(span: Span, of: u64, all: u64) -> Span {
    Span::ns(span.as_nanos() * of / all)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAGMENTS: u64 = 1_000;

    /// Number of tries that 1,000 fragments take at a SubDevice that takes one in each interval, and the time of all.
    fn tries(interval: Span) -> (u64, Span) {
        let (mut pause, mut now, mut free, mut count) =
            (FullPause::default(), Instant::ZERO, Instant::ZERO, 0);
        for _ in 0..FRAGMENTS {
            loop {
                count += 1;
                now += Span::us(40);
                if now >= free {
                    pause.accepted(now);
                    free = free.max(now.before(interval)) + interval;
                    break;
                }
                now += pause.refused(now);
            }
        }
        (count, now.since(Instant::ZERO))
    }

    #[test]
    fn interval_of_a_subdevice_is_learnt() {
        for us in [150, 300, 600, 1_000, 3_000, 9_000] {
            let (count, took) = tries(Span::us(us));
            let least = Span::us(us * FRAGMENTS).as_nanos();
            assert!(count < FRAGMENTS * 3, "{us} us: {count} tries");
            assert!(took.as_nanos() * 10 < least * 11, "{us} us: {took}");
        }
    }

    #[test]
    fn pauses_of_a_mailbox_that_stays_full_grow_to_10_ms() {
        let mut pause = FullPause::default();
        let pauses: Vec<Span> = (0..12).map(|_| pause.refused(Instant::ZERO)).collect();
        assert!(pauses.iter().all(|one| (Span::us(100)..=LONGEST).contains(one)), "{pauses:?}");
        assert_eq!(pauses.last(), Some(&LONGEST));
    }
}
