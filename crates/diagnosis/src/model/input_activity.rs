//! Movement of inputs: which bytes of a datagram change, and which have stopped.
//!
//! Inputs may stand still because nothing moves. A sign of life does not: a bit that a SubDevice flips with each new
//! value (TxPDO toggle, ETG.5001 and ETG.1020), in several bytes at once. Where all flips of a byte are of one bit, and
//! those of another byte came in the same frames, it is one; when it stops, the application behind it has.

use linesman_proto::time::{Instant, Span};

use super::Seen;

/// Between two looks whether something stands still, in frames.
const LOOK_EVERY: u64 = 1_024;
/// So many flips are no accident …
const FLIPS: u32 = 64;
/// … if one frame in so many had one.
const ONE_IN: u64 = 20;
/// Bytes that are compared at once: most stand still.
const WORD: usize = 8;
/// A sign of life stands still when it was missed so many times …
const MISSED: u64 = 30;
/// … and for so long.
const STILL: Span = Span::ms(500);

/// Movement of one datagram's inputs.
#[derive(Clone, Default, Debug)]
pub struct InputActivity {
    last: Vec<u8>,
    bytes: Vec<ByteActivity>,
    frames: u64,
}

/// Changes of one byte.
#[derive(Clone, Copy, Default, Debug)]
struct ByteActivity {
    changes: u32,
    /// Bits that have changed.
    flipped: u8,
    /// The first and the latest frame with a change, as they are counted here.
    first: u64,
    last: u64,
    /// When the latest change came, in which frame.
    seen: Option<Seen<()>>,
}

impl ByteActivity {
    /// Some bits have changed in a frame.
    #[inline]
    fn record(&mut self, flipped: u8, frame: u64, seen: Seen<()>) {
        if self.changes == 0 {
            self.first = frame;
        }
        self.changes = self.changes.saturating_add(1);
        self.flipped |= flipped;
        self.last = frame;
        self.seen = Some(seen);
    }
}

/// Up to eight bytes as a number, the first one lowest.
#[inline]
fn word(bytes: &[u8]) -> u64 {
    if let Some(whole) = bytes.first_chunk() {
        return u64::from_le_bytes(*whole);
    }
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

/// A sign of life of a SubDevice.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LifeSign {
    /// The first of its bytes, counted from the begin of the datagram.
    pub offset: u16,
    /// How many bytes flip together.
    pub bytes: u16,
    /// How often they flipped.
    pub flips: u32,
    /// In so many frames, from the first flip to the last.
    pub frames: u64,
    /// The last flip.
    pub last: Seen<()>,
    /// How many frames came since.
    pub still: u64,
}

impl InputActivity {
    /// Takes the data of a datagram that came back, with those that went out. Says now and then that it is worth a look:
    /// standing still is no news by itself.
    pub fn record(&mut self, sent: &[u8], back: &[u8], at: Instant, frame: u64) -> bool {
        self.frames += 1;
        let is_time = self.frames.is_multiple_of(LOOK_EVERY);
        if self.last.len() != back.len() {
            self.last = back.to_vec();
            self.bytes = vec![ByteActivity::default(); back.len()];
            return is_time;
        }
        if self.last == back {
            return is_time;
        }
        let seen = Seen::new((), at, Some(frame));
        let (frames, len) = (self.frames, sent.len().min(back.len()));
        let (sent, back) = (&sent[..len], &back[..len]);
        let words = self.last[..len].chunks(WORD).zip(back.chunks(WORD)).zip(sent.chunks(WORD));
        for (((last, back), sent), motions) in words.zip(self.bytes.chunks_mut(WORD)) {
            let (last, back, sent) = (word(last), word(back), word(sent));
            let mut changed = last ^ back;
            // What came back as it went out is an output, or nobody's.
            let inputs = back ^ sent;
            while changed != 0 {
                let bit = changed.trailing_zeros() & !7;
                let (flipped, is_input) = ((changed >> bit) as u8, (inputs >> bit) as u8 != 0);
                changed &= !(0xFF << bit);
                if is_input && let Some(motion) = motions.get_mut(bit as usize / 8) {
                    motion.record(flipped, frames, seen);
                }
            }
        }
        self.last[..len].copy_from_slice(back);
        is_time
    }

    /// Signs of life in a part of the datagram that stand still at `now`: one for each group of bytes that flipped
    /// together.
    #[must_use]
    pub fn stopped(&self, offset: u16, len: u16, now: Instant) -> Option<LifeSign> {
        let part = self.bytes.get(usize::from(offset)..usize::from(offset + len))?;
        let flips = |motion: &&ByteActivity| {
            motion.changes >= FLIPS
                && motion.flipped.is_power_of_two()
                && u64::from(motion.changes) * ONE_IN >= motion.last - motion.first
        };
        let first = part.iter().position(|motion| flips(&motion))?;
        let motion = part.get(first)?;
        let together = part.iter().filter(|other| {
            flips(other) && (other.changes, other.last) == (motion.changes, motion.last)
        });
        let bytes = together.count() as u16;
        let last = motion.seen?;
        let (frames, still) = (motion.last - motion.first + 1, self.frames - motion.last);
        let missed = still.saturating_mul(motion.changes.into()) / frames;
        let is_still = bytes > 1 && missed >= MISSED && now.since(last.at) >= STILL;
        let sign = LifeSign {
            offset: offset + first as u16,
            bytes,
            flips: motion.changes,
            frames,
            last,
            still,
        };
        is_still.then_some(sign)
    }

    /// Notes that what is in the datagram is set up otherwise: what moved before tells nothing any more.
    pub fn forget(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames, one each ms: two status bytes that flip in each, a value, and an output.
    fn play(frames: std::ops::Range<u64>, still_from: u64, motion: &mut InputActivity) {
        for frame in frames {
            let moving = frame.min(still_from) as u8;
            let toggle = (moving & 1) << 7;
            let output = frame as u8;
            let sent = [0x55, 0x55, 0x55, output];
            let back = [toggle, moving, toggle | 1, output];
            motion.record(&sent, &back, Instant::from_nanos(frame * 1_000_000), frame);
        }
    }

    fn stopped(motion: &InputActivity, frame: u64) -> Option<LifeSign> {
        motion.stopped(0, 4, Instant::from_nanos(frame * 1_000_000))
    }

    #[test]
    fn bits_that_flip_together_and_stop_are_a_sign_of_life() {
        let mut motion = InputActivity::default();
        play(0..1_000, 1_000, &mut motion);
        assert_eq!(stopped(&motion, 1_000), None);
        play(1_000..1_400, 1_000, &mut motion);
        assert_eq!(stopped(&motion, 1_400), None, "not for long enough");
        play(1_400..2_000, 1_000, &mut motion);
        let sign = stopped(&motion, 2_000).unwrap();
        assert_eq!((sign.offset, sign.bytes, sign.last.frame), (0, 2, Some(1_000)));
        assert_eq!(
            motion.stopped(1, 1, Instant::from_nanos(2_000_000_000)),
            None,
            "the value alone"
        );
    }

    #[test]
    fn value_that_moved_and_stands_is_none() {
        let mut motion = InputActivity::default();
        for frame in 0..3_000_u64 {
            let value = (frame.min(1_000) as u16).to_le_bytes();
            motion.record(&[0xFF; 2], &value, Instant::from_nanos(frame * 1_000_000), frame);
        }
        assert_eq!(motion.stopped(0, 2, Instant::from_nanos(3_000_000_000)), None);
    }
}
