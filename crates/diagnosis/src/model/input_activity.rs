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
    /// Changes by words of eight bytes, the last one filled up.
    words: Vec<[ByteActivity; WORD]>,
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
    /// Time of the latest change, and the number of its frame.
    at: Instant,
    frame: u64,
}

/// Records which bits of the bytes that `mask` names have changed in `frame`, the frame of number `number`.
#[inline]
fn record_word(
    bytes: &mut [ByteActivity; WORD],
    (mut mask, changed): (u64, u64),
    frame: u64,
    (at, number): (Instant, u64),
) {
    while mask != 0 {
        let bit = mask.trailing_zeros() & !7;
        mask &= mask - 1;
        let byte = &mut bytes[bit as usize / 8 % WORD];
        if byte.changes == 0 {
            byte.first = frame;
        }
        byte.changes = byte.changes.saturating_add(1);
        byte.flipped |= (changed >> bit) as u8;
        (byte.last, byte.at, byte.frame) = (frame, at, number);
    }
}

/// Up to eight bytes as a number, the first one lowest.
#[inline]
fn word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

/// The highest bit of each byte that is not 0.
#[inline]
const fn nonzero_bytes(word: u64) -> u64 {
    const HIGHEST: u64 = 0x8080_8080_8080_8080;
    (((word & !HIGHEST) + !HIGHEST) | word) & HIGHEST
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
            self.words = vec![Default::default(); back.len().div_ceil(WORD)];
            return is_time;
        }
        if self.last == back {
            return is_time;
        }
        let (frames, len) = (self.frames, sent.len().min(back.len()));
        let (sent, sent_rest) = sent[..len].as_chunks::<WORD>();
        let (back, back_rest) = back[..len].as_chunks::<WORD>();
        let (last, last_rest) = self.last[..len].as_chunks_mut::<WORD>();
        let compare = |last: u64, back: u64, sent: u64, word: &mut _| {
            let changed = last ^ back;
            // What came back as it went out is an output, or nobody's.
            let mask = nonzero_bytes(changed) & nonzero_bytes(back ^ sent);
            if mask != 0 {
                record_word(word, (mask, changed), frames, (at, frame));
            }
        };
        let mut words = self.words.iter_mut();
        for (((last, back), sent), word) in last.iter_mut().zip(back).zip(sent).zip(&mut words) {
            let [before, now, sent] = [*last, *back, *sent].map(u64::from_le_bytes);
            if before != now {
                compare(before, now, sent, word);
                *last = *back;
            }
        }
        if let Some(rest) = words.next()
            && last_rest != back_rest
        {
            compare(word(last_rest), word(back_rest), word(sent_rest), rest);
            last_rest.copy_from_slice(back_rest);
        }
        is_time
    }

    /// Signs of life in a part of the datagram that stand still at `now`: one for each group of bytes that flipped
    /// together.
    #[must_use]
    pub fn stopped(&self, offset: u16, len: u16, now: Instant) -> Option<LifeSign> {
        let part = usize::from(offset)..usize::from(offset + len);
        if part.start > part.end || part.end > self.last.len() {
            return None;
        }
        let part = part.map(|index| self.words[index / WORD][index % WORD]);
        let flips = |motion: &ByteActivity| {
            motion.changes >= FLIPS
                && motion.flipped.is_power_of_two()
                && u64::from(motion.changes) * ONE_IN >= motion.last - motion.first
        };
        let (first, motion) = part.clone().enumerate().find(|(_, motion)| flips(motion))?;
        let together = part.filter(|other| {
            flips(other) && (other.changes, other.last) == (motion.changes, motion.last)
        });
        let bytes = together.count() as u16;
        let last = Seen::new((), motion.at, Some(motion.frame));
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
