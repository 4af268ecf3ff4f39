//! Gaps in the numbers of frames: requests that were sent and not recorded.
//!
//! A MainDevice numbers its frames in the index field of their first datagram, to know them again. Most count on by
//! one with each frame, or by the number of datagrams in it, up to a power of two. Where one is seen to do so, an
//! index that was left out is a frame that the recorder lost, or that no card took. Others reuse the index of what
//! came back; of those nothing is told.

/// So many frames that followed the rule make it one.
const LEARNT_FROM: u32 = 64;
/// Of so many, in percent.
const REGULAR_PERCENT: u32 = 80;

/// The way in which a sender counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum IndexStep {
    /// One with each frame.
    Frame,
    /// One with each datagram.
    Datagram,
}

/// The indexes of one sender.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct IndexSequence {
    last: Option<(u8, u8)>,
    highest: u8,
    frames: u32,
    /// How often each of the two ways of counting would have been right.
    by_frame: u32,
    by_datagram: u32,
    /// How often nothing at all was missing by either way.
    exact: [u32; 2],
}

impl IndexSequence {
    /// Takes the index of a frame's first datagram, and how many datagrams there are. Gives how many frames are
    /// missing before it at least, as far as that can be told.
    pub(super) fn take(&mut self, index: u8, datagrams: u8) -> u64 {
        self.highest = self.highest.max(index);
        let Some((last, count)) = self.last.replace((index, datagrams)) else { return 0 };
        let modulus = u16::from(self.highest).checked_add(1).map_or(256, u16::next_power_of_two);
        let ahead = |by: u8| {
            let expected = (u16::from(last) + u16::from(by)) % modulus;
            (u16::from(index) + modulus - expected) % modulus
        };
        let (by_frame, by_datagram) = (ahead(1), ahead(count));
        let step = self.step();
        self.frames += 1;
        // Where some are missing the next ones are a little ahead; those of no sequence are anywhere.
        let few = (modulus / 8).max(1);
        self.by_frame += u32::from(by_frame < few);
        self.by_datagram += u32::from(by_datagram < few);
        self.exact[0] += u32::from(by_frame == 0);
        self.exact[1] += u32::from(by_datagram == 0);
        match step {
            Some(IndexStep::Frame) => u64::from(by_frame),
            Some(IndexStep::Datagram) => u64::from(by_datagram.min(1)),
            None => 0,
        }
    }

    fn step(&self) -> Option<IndexStep> {
        if self.frames < LEARNT_FROM {
            return None;
        }
        let is_rule = |right: u32| right * 100 >= self.frames * REGULAR_PERCENT;
        match (is_rule(self.by_frame), is_rule(self.by_datagram)) {
            (true, true) if self.exact[1] > self.exact[0] => Some(IndexStep::Datagram),
            (true, _) => Some(IndexStep::Frame),
            (false, true) => Some(IndexStep::Datagram),
            (false, false) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn missed(indexes: impl IntoIterator<Item = (u8, u8)>) -> u64 {
        let mut sequence = IndexSequence::default();
        indexes.into_iter().map(|(index, datagrams)| sequence.take(index, datagrams)).sum()
    }

    #[test]
    fn frames_counted_one_by_one_miss_what_was_left_out() {
        let all = (0..1_000_u32).map(|number| (number as u8, 3));
        assert_eq!(missed(all.clone()), 0);
        let gaps = all.enumerate().filter(|(at, _)| *at != 700 && *at != 701).map(|(_, one)| one);
        assert_eq!(missed(gaps), 2);
    }

    #[test]
    fn sixteen_buffers_wrap_at_sixteen() {
        let all = (0..1_000_u32).map(|number| ((number % 16) as u8, 1));
        assert_eq!(missed(all.clone()), 0);
        let gap = all.enumerate().filter(|(at, _)| *at != 900).map(|(_, one)| one);
        assert_eq!(missed(gap), 1);
    }

    #[test]
    fn datagrams_counted_one_by_one_tell_that_a_frame_is_missing() {
        let mut index = 0_u8;
        let mut all = Vec::new();
        for number in 0..600_u32 {
            let datagrams = if number % 7 == 0 { 3 } else { 2 };
            all.push((index, datagrams));
            index = index.wrapping_add(datagrams);
        }
        assert_eq!(missed(all.iter().copied()), 0);
        all.remove(500);
        assert_eq!(missed(all), 1);
    }

    #[test]
    fn one_index_for_all_tells_nothing() {
        assert_eq!(missed((0..1_000).map(|_| (0, 2))), 0);
        assert_eq!(missed((0..1_000_u32).map(|number| ((number * 37 % 251) as u8, 2))), 0);
    }
}
