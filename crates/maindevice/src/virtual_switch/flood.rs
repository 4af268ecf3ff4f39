//! Limit of frames that go to all ports.

use linesman_proto::time::{Instant, Span};

/// Frames to all that may come from one port: so many in a second, and as many at once after a pause.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FloodLimit {
    per_second: u32,
    /// What is left, in billionths of a frame.
    left: u64,
    at: Instant,
}

const BILLION: u64 = 1_000_000_000;

impl FloodLimit {
    /// A limit of so many frames a second, all of them left.
    #[must_use]
    pub fn new(per_second: u32, now: Instant) -> Self {
        Self { per_second, left: u64::from(per_second) * BILLION, at: now }
    }

    /// True if one more may go; it counts then.
    pub fn admit(&mut self, now: Instant) -> bool {
        let passed = if now > self.at { now.since(self.at) } else { Span::ZERO };
        self.at = now;
        // What passes in a second fills it up, and more than that is of no use.
        let passed = passed.as_nanos().min(BILLION);
        let full = u64::from(self.per_second) * BILLION;
        self.left = (self.left + passed * u64::from(self.per_second)).min(full);
        let has_one = self.left >= BILLION;
        if has_one {
            self.left -= BILLION;
        }
        has_one
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_at_once_and_so_many_a_second() {
        let mut limit = FloodLimit::new(100, Instant::ZERO);
        let mut admitted =
            |at: Instant, asked: usize| (0..asked).filter(|_| limit.admit(at)).count();
        assert_eq!(admitted(Instant::ZERO, 1_000), 100);
        assert_eq!(admitted(Instant::ZERO + Span::ms(100), 1_000), 10);
        assert_eq!(admitted(Instant::ZERO + Span::s(1_000), 1_000), 100);
        let later = Instant::ZERO + Span::s(2_000);
        assert_eq!(admitted(later, 1_000), 100);
        let slowly = (1..=2_000).filter(|ms| admitted(later + Span::ms(*ms), 1) == 1);
        assert_eq!(slowly.count(), 200);
    }
}
