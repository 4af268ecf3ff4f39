//! Counts of controllers that single frames show, and which of them to believe.
//!
//! A frame counts controllers twice: by what they add to its address, and, where all answer, by its working counter.
//! One odd frame, such as a damaged one or one that a tool sends to try a line, must not make a line of 65,535.

/// A first count that is not larger is believed, though nothing else says the same.
const PLAUSIBLE: u16 = 512;

/// So many frames in a row that count the same are believed, whatever else they say.
const AGAIN: u32 = 8;

/// A count that is not believed yet, and how many frames in a row said so.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct CountDoubt {
    doubted: Option<(u16, u32)>,
}

impl CountDoubt {
    /// Takes a count; `most` is the largest that was believed before. A larger one is believed when another field of
    /// its frame says the same, or several frames in a row do.
    pub(super) fn is_believed(&mut self, count: u16, most: u16, is_confirmed: bool) -> bool {
        let is_first = most == 0 && count <= PLAUSIBLE;
        let times = match self.doubted {
            Some((doubted, times)) if doubted == count => times + 1,
            Some(_) | None => 1,
        };
        let is_believed = count <= most || is_first || is_confirmed || times >= AGAIN;
        self.doubted = (!is_believed).then_some((count, times));
        is_believed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_count_is_believed_when_it_is_seen_again_and_again_or_confirmed() {
        let mut doubt = CountDoubt::default();
        assert!(doubt.is_believed(5, 0, false), "the first one");
        assert!(doubt.is_believed(4, 5, false), "fewer");
        assert!(doubt.is_believed(6, 5, true), "both fields say so");
        assert!(!doubt.is_believed(0x8005, 6, false));
        assert!(!doubt.is_believed(0x4005, 6, false));
        assert!(doubt.is_believed(6, 6, false));
        for _ in 1..AGAIN {
            assert!(!doubt.is_believed(7, 6, false));
        }
        assert!(doubt.is_believed(7, 6, false), "again and again");
    }

    #[test]
    fn first_count_that_no_line_has_needs_another_frame() {
        let mut doubt = CountDoubt::default();
        assert!(!doubt.is_believed(0xFFFF, 0, false));
        assert!(doubt.is_believed(3, 0, false));
    }
}
