//! Walk from category header to category header: the rules by which both parser and reader walk an
//! image, and where they stop.

use super::word::{self, WordAddress};

/// Words of a category header: type and length.
pub(crate) const HEADER_WORDS: u32 = 2;
/// Empty headers in a row after which the rest is taken as zeros that fill the EEPROM. A few of
/// them may stand between categories; type 0 is defined as "nothing".
pub(crate) const MAX_EMPTY_HEADERS: usize = 8;

const END: u16 = 0xFFFF;

/// Where the walk stands: at a header that has not been looked at yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Walk {
    header_at: u32,
    empty: usize,
}

/// What a header means for the walk.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Step {
    /// The end marker.
    End,
    /// The last of too many empty headers in a row.
    EmptyHeaders,
    /// A category whose data lie from `start` up to but not including `end`.
    Category { start: WordAddress, end: WordAddress },
}

impl Walk {
    /// At the first category.
    pub(crate) const fn new() -> Self {
        Self { header_at: word::FIRST_CATEGORY.value(), empty: 0 }
    }

    /// The word of the header to look at next.
    pub(crate) const fn header_at(&self) -> WordAddress {
        WordAddress(self.header_at)
    }

    /// Takes the header there and moves on to the next one. The position cannot overflow: images
    /// are held in memory, and each step is preceded by reading the header it stands at.
    pub(crate) const fn step(&mut self, kind: u16, len: u16) -> Step {
        if kind == END {
            return Step::End;
        }
        self.empty = if kind == 0 && len == 0 { self.empty + 1 } else { 0 };
        if self.empty >= MAX_EMPTY_HEADERS {
            return Step::EmptyHeaders;
        }
        let start = self.header_at + HEADER_WORDS;
        self.header_at = start + len as u32;
        Step::Category { start: WordAddress(start), end: WordAddress(self.header_at) }
    }
}
