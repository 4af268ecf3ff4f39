//! Runs of bytes between a frame and the process image: neighbours are copied together.

use std::ops::Range;

use linesman_config::plan::Ownership;

/// Bytes that lie side by side in a frame and in the process image.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Run {
    /// Offset in the frame.
    frame_at: u32,
    /// Offset in the outputs or inputs of the process image.
    image_at: u32,
    len: u32,
    /// Which bits of a single byte are meant; all of a longer run.
    mask: u8,
}

impl Run {
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

/// Appends the bytes that `owned` has of a datagram whose data begin at `data_at` of the frame.
pub(super) fn push(runs: &mut Vec<Run>, owned: &Ownership, data_at: usize) {
    let len = owned.range.len();
    let mut add = |at: usize, len: usize, mask: u8| {
        let run = Run {
            frame_at: (data_at + owned.range.start + at) as u32,
            image_at: (owned.image_at + at) as u32,
            len: len as u32,
            mask,
        };
        match runs.last_mut() {
            Some(last)
                if last.mask == mask
                    && mask == Run::WHOLE
                    && last.frame().end == run.frame().start
                    && last.image().end == run.image().start =>
            {
                last.len += run.len;
            }
            Some(_) | None => runs.push(run),
        }
    };
    if owned.is_bytewise() {
        add(0, len, Run::WHOLE);
        return;
    }
    for at in 0..len {
        add(at, 1, owned.mask_of(at));
    }
}

/// Copies outputs into a frame.
#[inline]
pub(super) fn fill(runs: &[Run], image: &[u8], frame: &mut [u8]) {
    for run in runs {
        if let (Some(from), Some(to)) = (image.get(run.image()), frame.get_mut(run.frame())) {
            copy(from, to, run.mask);
        }
    }
}

/// Copies inputs out of a frame.
#[inline]
pub(super) fn take(runs: &[Run], frame: &[u8], image: &mut [u8]) {
    for run in runs {
        if let (Some(from), Some(to)) = (frame.get(run.frame()), image.get_mut(run.image())) {
            copy(from, to, run.mask);
        }
    }
}

/// Sets the bytes of the image to zero.
pub(super) fn clear_image(runs: &[Run], image: &mut [u8]) {
    for run in runs {
        for byte in image.get_mut(run.image()).into_iter().flatten() {
            *byte &= !run.mask;
        }
    }
}

/// Sets the bytes of the frame to zero.
pub(super) fn clear_frame(runs: &[Run], frame: &mut [u8]) {
    for run in runs {
        for byte in frame.get_mut(run.frame()).into_iter().flatten() {
            *byte &= !run.mask;
        }
    }
}

#[inline]
fn copy(from: &[u8], to: &mut [u8], mask: u8) {
    if mask == Run::WHOLE {
        // Both are as long as the run; saying so spares a comparison.
        let len = from.len().min(to.len());
        to[..len].copy_from_slice(&from[..len]);
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
        let mut runs = Vec::with_capacity(4);
        push(&mut runs, &owned(0..2, 0, Ownership::WHOLE), 26);
        push(&mut runs, &owned(2..5, 2, Ownership::WHOLE), 26);
        assert_eq!(runs.len(), 1);
        push(&mut runs, &owned(5..6, 5, [0x0F, 0x0F]), 26);
        push(&mut runs, &owned(5..6, 5, [0x30, 0x30]), 26);
        let frame: Vec<u8> = (0..40).map(|at| 0x80 | at).collect();
        let mut image = [0xC0; 6];
        take(&runs, &frame, &mut image);
        assert_eq!(image, [0x9A, 0x9B, 0x9C, 0x9D, 0x9E, 0xC0 | (frame[31] & 0x3F)]);
        clear_image(&runs, &mut image);
        assert_eq!(image, [0, 0, 0, 0, 0, 0xC0]);
    }
}
