//! Fragments put together again.

use super::message::{Fragment, FragmentPlace};

/// The longest Ethernet frame, with a VLAN tag and without check sequence.
const LONGEST: usize = 1_518;
/// A time stamp behind the data.
const TIME_STAMP: usize = 4;

/// A frame of which not all pieces are there yet.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Assembly {
    data: Vec<u8>,
    frame: u8,
    next: u8,
    begun: bool,
}

/// Why a fragment was not taken; what had come of its frame is forgotten.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
pub enum Refused {
    /// It does not follow the one before.
    #[error("fragment {number} of frame {frame}, expected {expected}")]
    OutOfOrder {
        /// Its number.
        number: u8,
        /// Number of its frame.
        frame: u8,
        /// The number that was due.
        expected: u8,
    },
    /// Its place is not where the one before ended.
    #[error("a fragment for byte {offset}, expected byte {expected}")]
    Misplaced {
        /// Its place in bytes.
        offset: usize,
        /// Where it should begin.
        expected: usize,
    },
    /// The frame gets longer than Ethernet frames are.
    #[error("a frame of more than {LONGEST} bytes")]
    TooLong,
}

impl Assembly {
    /// True if a frame has begun whose last fragment is still to come.
    #[must_use]
    pub const fn is_begun(&self) -> bool {
        self.begun
    }

    /// Takes a fragment; gives the frame when it was the last one.
    ///
    /// # Errors
    /// [`Refused`].
    pub fn take(&mut self, fragment: &Fragment<'_>) -> Result<Option<Vec<u8>>, Refused> {
        let result = self.add(fragment);
        if !matches!(result, Ok(None)) {
            *self = Self::default();
        }
        result
    }

    fn add(&mut self, fragment: &Fragment<'_>) -> Result<Option<Vec<u8>>, Refused> {
        match fragment.place {
            // A first one begins anew, whatever was before.
            FragmentPlace::First { .. } => {
                *self = Self { frame: fragment.frame, begun: true, ..Self::default() };
            }
            FragmentPlace::Further { number, .. } => {
                if !self.begun || number != self.next || fragment.frame != self.frame {
                    let (frame, expected) = (fragment.frame, self.next);
                    return Err(Refused::OutOfOrder { number, frame, expected });
                }
                if fragment.offset() != self.data.len() {
                    let expected = self.data.len();
                    return Err(Refused::Misplaced { offset: fragment.offset(), expected });
                }
            }
        }
        self.data.extend_from_slice(fragment.data);
        self.next += 1;
        if fragment.last && fragment.time_appended {
            self.data.truncate(self.data.len().saturating_sub(TIME_STAMP));
        }
        if self.data.len() > LONGEST {
            return Err(Refused::TooLong);
        }
        Ok(fragment.last.then(|| std::mem::take(&mut self.data)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::fragments;
    use super::*;

    #[test]
    fn frames_come_together_in_order_only() {
        let frame: Vec<u8> = (0..200u8).collect();
        let pieces: Vec<_> = fragments(&frame, 0, 3, 68).collect();
        assert_eq!(pieces.len(), 4);
        let mut assembly = Assembly::default();
        for piece in &pieces[..3] {
            assert_eq!(assembly.take(piece), Ok(None));
        }
        assert_eq!(assembly.take(&pieces[3]), Ok(Some(frame.clone())));
        let alone = assembly.take(&pieces[1]).unwrap_err();
        assert_eq!(alone, Refused::OutOfOrder { number: 1, frame: 3, expected: 0 });
        assert_eq!(assembly.take(&pieces[0]), Ok(None));
        let skipped = assembly.take(&pieces[2]).unwrap_err();
        assert_eq!(skipped, Refused::OutOfOrder { number: 2, frame: 3, expected: 1 });
        let mut wrong = pieces[1];
        wrong.place = FragmentPlace::Further { number: 1, offset_units: 3 };
        assert_eq!(assembly.take(&pieces[0]), Ok(None));
        let misplaced = assembly.take(&wrong).unwrap_err();
        assert_eq!(misplaced, Refused::Misplaced { offset: 96, expected: 64 });
    }

    #[test]
    fn a_time_stamp_is_no_part_of_the_frame_and_no_frame_is_endless() {
        let mut assembly = Assembly::default();
        let frame = [7; 64];
        let mut only = fragments(&frame, 0, 0, 100).next().unwrap();
        only.time_appended = true;
        assert_eq!(assembly.take(&only), Ok(Some(vec![7; 60])));
        let long = [0; 1_600];
        let mut piece = fragments(&long, 0, 0, 2_000).next().unwrap();
        piece.last = false;
        assert_eq!(assembly.take(&piece), Err(Refused::TooLong));
    }
}
