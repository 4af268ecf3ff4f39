//! Timer queue: an instant for each of many nodes, in a heap. The earliest is found at once; moving
//! one costs the depth of the heap.

use linesman_proto::time::Instant;

/// Not in the heap.
const NOWHERE: u32 = u32::MAX;

/// One instant for each of so many, or none. What is noted may be earlier than the truth, never
/// later: whoever takes the first asks it anew.
#[derive(Clone, Default, Debug)]
pub(super) struct TimerQueue {
    /// A heap: each is not before the one at half its place.
    heap: Vec<(Instant, u32)>,
    /// Where each is in the heap.
    places: Vec<u32>,
}

impl TimerQueue {
    /// An empty one for `count` of them.
    pub(super) fn new(count: usize) -> Self {
        Self { heap: Vec::new(), places: vec![NOWHERE; count] }
    }

    /// The earliest, if it is not after `until`.
    #[inline]
    pub(super) fn first_until(&self, until: Instant) -> Option<u32> {
        self.heap.first().filter(|(at, _)| *at <= until).map(|(_, index)| *index)
    }

    /// Notes that something is due at `at`, unless something earlier is noted.
    #[inline]
    pub(super) fn bring_forward(&mut self, index: u32, at: Instant) {
        let place = self.places[index as usize];
        let noted = self.heap.get(place as usize).map_or(Instant::MAX, |(noted, _)| *noted);
        if at < noted {
            self.put(place, index, at);
        }
    }

    /// Notes that nothing is due before `at`; [`Instant::MAX`] for never.
    pub(super) fn put_off(&mut self, index: u32, at: Instant) {
        let place = self.places[index as usize];
        if at != Instant::MAX {
            self.put(place, index, at);
            return;
        }
        if place == NOWHERE {
            return;
        }
        self.places[index as usize] = NOWHERE;
        if let Some(last) = self.heap.pop()
            && (place as usize) < self.heap.len()
        {
            self.heap[place as usize] = last;
            self.settle(place as usize);
        }
    }

    fn put(&mut self, place: u32, index: u32, at: Instant) {
        let place = place as usize;
        if place < self.heap.len() {
            self.heap[place].0 = at;
            self.settle(place);
        } else {
            self.heap.push((at, index));
            self.settle(self.heap.len() - 1);
        }
    }

    /// Moves what is at a place to where it belongs.
    fn settle(&mut self, mut place: usize) {
        let moved = self.heap[place];
        while place > 0 && moved < self.heap[(place - 1) / 2] {
            self.fill(place, self.heap[(place - 1) / 2]);
            place = (place - 1) / 2;
        }
        loop {
            let (left, right) = (2 * place + 1, 2 * place + 2);
            let Some(mut first) = self.heap.get(left).copied() else { break };
            let mut from = left;
            if let Some(other) = self.heap.get(right).copied().filter(|other| *other < first) {
                (first, from) = (other, right);
            }
            if moved <= first {
                break;
            }
            self.fill(place, first);
            place = from;
        }
        self.fill(place, moved);
    }

    fn fill(&mut self, place: usize, entry: (Instant, u32)) {
        self.heap[place] = entry;
        self.places[entry.1 as usize] = place as u32;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_earliest_comes_first_and_of_two_the_lower() {
        let at = Instant::from_nanos;
        let mut timer_queue = TimerQueue::new(4);
        assert_eq!(timer_queue.first_until(Instant::MAX), None);
        timer_queue.bring_forward(3, at(5));
        timer_queue.bring_forward(1, at(5));
        timer_queue.bring_forward(2, at(9));
        timer_queue.bring_forward(2, at(20));
        assert_eq!(timer_queue.first_until(at(4)), None);
        assert_eq!(timer_queue.first_until(at(5)), Some(1));
        timer_queue.put_off(1, at(30));
        timer_queue.put_off(3, Instant::MAX);
        assert_eq!(timer_queue.first_until(at(8)), None);
        assert_eq!(timer_queue.first_until(at(9)), Some(2));
    }

    proptest! {
        /// It is a list of instants from which the least is taken.
        #[test]
        fn it_is_as_good_as_a_list(steps in prop::collection::vec((0..12u32, 0..40u64, any::<bool>()), 1..200)) {
            let mut timer_queue = TimerQueue::new(12);
            let mut list = [Instant::MAX; 12];
            for (index, at, forward) in steps {
                let at = if at == 0 { Instant::MAX } else { Instant::from_nanos(at) };
                if forward {
                    timer_queue.bring_forward(index, at);
                    list[index as usize] = list[index as usize].min(at);
                } else {
                    timer_queue.put_off(index, at);
                    list[index as usize] = at;
                }
                let first = list.iter().zip(0..).min().filter(|(at, _)| **at != Instant::MAX);
                let found = timer_queue.first_until(Instant::from_nanos(u64::MAX - 1));
                prop_assert_eq!(found, first.map(|(_, index)| index));
            }
        }
    }
}
