//! Byte ranges copied between a frame and the process image: neighbours are copied together.

use std::ops::Range;

use linesman_config::plan::Ownership;

/// Bytes that lie side by side in a frame and in the process image.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
struct CopyRange {
    /// Offset in the frame.
    frame_at: u32,
    /// Offset in the outputs or inputs of the process image.
    image_at: u32,
    len: u32,
    /// Which bits of a single byte are meant; all of a longer run.
    mask: u8,
}

impl CopyRange {
    const WHOLE: u8 = 0xFF;

    #[inline]
    fn frame(&self) -> Range<usize> {
        let at = self.frame_at as usize;
        at..at + self.len as usize
    }

    #[inline]
    fn image(&self) -> Range<usize> {
        let at = self.image_at as usize;
        at..at + self.len as usize
    }
}

/// The runs of a frame or a datagram. Most have one, of whole bytes: it lies apart.
#[derive(Debug, Default)]
pub(super) struct CopyRanges {
    first: CopyRange,
    others: Vec<CopyRange>,
}

impl CopyRanges {
    /// None yet, and room for so many.
    pub(super) fn with_room(runs: usize) -> Self {
        Self { first: CopyRange::default(), others: Vec::with_capacity(runs) }
    }

    pub(super) fn clear(&mut self) {
        self.first = CopyRange::default();
        self.others.clear();
    }

    /// Appends the bytes that `owned` has of a datagram whose data begin at `data_at` of the frame.
    pub(super) fn push(&mut self, owned: &Ownership, data_at: usize) {
        let len = owned.range.len();
        let mut add = |at: usize, len: usize, mask: u8| {
            self.add(CopyRange {
                frame_at: (data_at + owned.range.start + at) as u32,
                image_at: (owned.image_at + at) as u32,
                len: len as u32,
                mask,
            });
        };
        if owned.is_bytewise() {
            add(0, len, CopyRange::WHOLE);
            return;
        }
        for at in 0..len {
            add(at, 1, owned.mask_of(at));
        }
    }

    fn add(&mut self, run: CopyRange) {
        let is_first = self.others.is_empty() && run.mask == CopyRange::WHOLE;
        let last = match self.others.last_mut() {
            Some(last) => last,
            None if is_first && self.first.len == 0 => {
                self.first = run;
                return;
            }
            None => &mut self.first,
        };
        if last.mask == run.mask
            && run.mask == CopyRange::WHOLE
            && last.frame().end == run.frame().start
            && last.image().end == run.image().start
        {
            last.len += run.len;
        } else {
            self.others.push(run);
        }
    }

    /// Copies outputs into a frame.
    #[inline]
    pub(super) fn fill(&self, image: &[u8], frame: &mut [u8]) {
        if let Some(to) = frame.get_mut(self.first.frame()) {
            match image.get(self.first.image()) {
                Some(from) => copy_whole(from, to),
                // What was there before is of another frame.
                None => to.fill(0),
            }
        }
        if !self.others.is_empty() {
            self.fill_others(image, frame);
        }
    }

    #[inline(never)]
    fn fill_others(&self, image: &[u8], frame: &mut [u8]) {
        for run in &self.others {
            if let Some(to) = frame.get_mut(run.frame()) {
                match image.get(run.image()) {
                    Some(from) => copy(from, to, run.mask),
                    None => to.fill(0),
                }
            }
        }
    }

    /// Copies inputs out of a frame.
    #[inline(always)]
    pub(super) fn take(&self, frame: &[u8], image: &mut [u8]) {
        if !self.others.is_empty() {
            self.take_others(frame, image);
        }
        if let Some(from) = frame.get(self.first.frame())
            && let Some(to) = image.get_mut(self.first.image())
        {
            copy_whole(from, to);
        }
    }

    #[inline(never)]
    fn take_others(&self, frame: &[u8], image: &mut [u8]) {
        for run in &self.others {
            if let (Some(from), Some(to)) = (frame.get(run.frame()), image.get_mut(run.image())) {
                copy(from, to, run.mask);
            }
        }
    }

    /// Sets the bytes of the image to zero.
    pub(super) fn clear_image(&self, image: &mut [u8]) {
        for run in self.all() {
            for byte in image.get_mut(run.image()).into_iter().flatten() {
                *byte &= !run.mask;
            }
        }
    }

    /// Sets the bytes of the frame to zero.
    pub(super) fn clear_frame(&self, frame: &mut [u8]) {
        for run in self.all() {
            for byte in frame.get_mut(run.frame()).into_iter().flatten() {
                *byte &= !run.mask;
            }
        }
    }

    fn all(&self) -> impl Iterator<Item = &CopyRange> {
        std::iter::once(&self.first).chain(&self.others)
    }
}

/// Copies as many bytes as both have: both are as long as the run, and saying so spares a comparison.
#[inline]
fn copy_whole(from: &[u8], to: &mut [u8]) {
    let len = from.len().min(to.len());
    to[..len].copy_from_slice(&from[..len]);
}

#[inline]
fn copy(from: &[u8], to: &mut [u8], mask: u8) {
    if mask == CopyRange::WHOLE {
        copy_whole(from, to);
    } else if let ([from], [to]) = (from, to) {
        *to = (*to & !mask) | (from & mask);
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::address::DeviceId;
    use linesman_proto::sii::Direction;

    use super::*;

    fn owned(range: Range<usize>, image_at: usize, masks: [u8; 2]) -> Ownership {
        Ownership { device: DeviceId(0), direction: Direction::Inputs, range, image_at, masks }
    }

    #[test]
    fn neighbours_are_one_run_and_bits_leave_the_others_alone() {
        let mut runs = CopyRanges::with_room(4);
        runs.push(&owned(0..2, 0, Ownership::WHOLE), 26);
        runs.push(&owned(2..5, 2, Ownership::WHOLE), 26);
        assert_eq!((runs.first.len, runs.others.len()), (5, 0));
        runs.push(&owned(5..6, 5, [0x0F, 0x0F]), 26);
        runs.push(&owned(5..6, 5, [0x30, 0x30]), 26);
        assert_eq!((runs.first.len, runs.others.len()), (5, 2));
        let frame: Vec<u8> = (0..40).map(|at| 0x80 | at).collect();
        let mut image = [0xC0; 6];
        runs.take(&frame, &mut image);
        assert_eq!(image, [0x9A, 0x9B, 0x9C, 0x9D, 0x9E, 0xC0 | (frame[31] & 0x3F)]);
        runs.clear_image(&mut image);
        assert_eq!(image, [0, 0, 0, 0, 0, 0xC0]);
    }
    #[test]
    fn outputs_that_the_image_has_not_are_sent_as_zero() {
        let mut runs = CopyRanges::with_room(1);
        runs.push(&owned(0..2, 0, Ownership::WHOLE), 0);
        runs.push(&owned(3..5, 4, Ownership::WHOLE), 0);
        let mut frame = [0xEE; 6];
        runs.fill(&[1, 2, 3, 4], &mut frame);
        assert_eq!(frame, [1, 2, 0xEE, 0, 0, 0xEE]);
    }

    #[test]
    fn bits_that_come_first_are_no_run_of_whole_bytes() {
        let mut runs = CopyRanges::with_room(3);
        runs.push(&owned(0..1, 0, [0x03, 0x03]), 0);
        runs.push(&owned(1..3, 1, Ownership::WHOLE), 0);
        let mut image = [0xF0; 3];
        runs.take(&[0xFF, 5, 6], &mut image);
        assert_eq!(image, [0xF3, 5, 6]);
    }
}
