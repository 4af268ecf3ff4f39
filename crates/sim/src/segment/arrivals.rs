//! Frames on their way to a card.

use std::collections::VecDeque;

use linesman_proto::address::Path;
use linesman_proto::time::Instant;

use crate::frame::WireFrame;

/// Frames by time of arrival, those of the same instant in the order of sending.
#[derive(Clone, Default, Debug)]
pub(super) struct Arrivals(VecDeque<(Instant, Path, WireFrame)>);

impl Arrivals {
    pub(super) fn push(&mut self, at: Instant, path: Path, frame: WireFrame) {
        // Nearly always the last to be sent is the last to arrive.
        let behind = self.0.iter().rev().take_while(|(other, _, _)| *other > at).count();
        if behind == 0 {
            self.0.push_back((at, path, frame));
        } else {
            self.0.insert(self.0.len() - behind, (at, path, frame));
        }
    }

    pub(super) fn next_at(&self) -> Option<Instant> {
        self.0.front().map(|(at, _, _)| *at)
    }

    /// The next frame, if it has arrived by `now`.
    pub(super) fn pop_until(&mut self, now: Instant) -> Option<(Instant, Path, WireFrame)> {
        if self.next_at()? <= now { self.0.pop_front() } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_come_by_time_then_in_the_order_of_sending() {
        let mut arrivals = Arrivals::default();
        for (number, at) in [(1, 5), (2, 9), (3, 5), (4, 1)] {
            let frame = WireFrame { number, ..WireFrame::default() };
            arrivals.push(Instant::from_nanos(at), Path::A, frame);
        }
        assert_eq!(arrivals.next_at(), Some(Instant::from_nanos(1)));
        let came = std::iter::from_fn(|| arrivals.pop_until(Instant::from_nanos(8)));
        assert_eq!(came.map(|(_, _, frame)| frame.number).collect::<Vec<_>>(), [4, 1, 3]);
    }
}
