//! Reads of registers that leave no trace in the controller, and so need no frame to begin and end.
//!
//! Most of what a MainDevice asks for all the time is of this kind: states, identity, counters.
//! Whatever is not listed here is read in the usual way.

use std::ops::Range;

use linesman_proto::register::{self as r, EcatEvents};

use super::access::touches;
use super::core::Core;
use super::memory::Rights;

/// Where reading is without effect on what is read, and the bytes are what memory holds.
const PLAIN: [Range<usize>; 7] = [
    0x0000..0x0160,
    0x0200..0x0230,
    0x0300..0x0320,
    0x0400..0x0450,
    0x0500..0x0510,
    0x0600..0x0700,
    0x0800..0x0880,
];

/// A read without effect.
#[derive(Clone, Debug)]
pub(crate) struct PlainRead {
    range: Range<usize>,
    /// One bit for each bit of a word that it reads; 0 when it reads more than a word.
    mask: u64,
    /// Events that go away with this read. While one stands the read is not without effect.
    clears: u16,
}

/// What became of it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Answer {
    /// The controller has none of these registers.
    Nothing,
    /// Its bytes are in the data.
    Read,
    /// It has an effect here: read in the usual way.
    Effect,
}

impl PlainRead {
    /// The read of `len` bytes from `address`, if it is one without effect.
    #[inline]
    pub(crate) fn of(address: u16, len: usize) -> Option<Self> {
        let range = usize::from(address)..usize::from(address) + len;
        let plain = PLAIN.iter().any(|area| area.start <= range.start && range.end <= area.end);
        if !plain || len == 0 {
            return None;
        }
        let mut clears = 0;
        if touches(&range, &r::DL_STATUS) {
            clears |= EcatEvents::DL_STATUS.0;
        }
        if touches(&range, &r::AL_STATUS) {
            clears |= EcatEvents::AL_STATUS.0;
        }
        let mask = if len > 8 { 0 } else { u64::MAX >> (64 - 8 * len) };
        Some(Self { range, mask, clears })
    }

    /// Whether it reads no more than a word of 8 bytes: [`PlainRead::peek`] can be used.
    #[inline]
    pub(crate) fn is_short(&self) -> bool {
        self.mask != 0
    }

    /// Reads from a controller and ORs its bytes into a word, the first lowest.
    #[inline]
    pub(super) fn peek(&self, core: &Core, gathered: &mut u64) -> Answer {
        // What is plain ends far below the RAM: there is a whole word of registers.
        let word = u64::from_le_bytes(core.memory.array(self.range.start)) & self.mask;
        if core.rights.word(self.range.start) & self.mask & Rights::ANY_READ == 0 {
            return Answer::Nothing;
        }
        if self.clears != 0 && core.memory.u16(&r::ECAT_EVENT_REQUEST) & self.clears != 0 {
            return Answer::Effect;
        }
        *gathered |= word;
        Answer::Read
    }

    /// Reads from a controller, or ORs its bytes in.
    #[inline]
    pub(super) fn read(&self, core: &Core, out: &mut [u8], ors: bool) -> Answer {
        if !core.rights.any(self.range.start, self.range.end, Rights::READ) {
            return Answer::Nothing;
        }
        if self.clears != 0 && core.memory.u16(&r::ECAT_EVENT_REQUEST) & self.clears != 0 {
            return Answer::Effect;
        }
        let bytes = &core.memory.bytes()[self.range.clone()];
        if ors {
            for (out, byte) in out.iter_mut().zip(bytes) {
                *out |= byte;
            }
        } else {
            out.copy_from_slice(bytes);
        }
        Answer::Read
    }
}
