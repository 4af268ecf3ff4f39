//! The order in which a file keeps the bytes of its numbers: that of the machine that wrote it.

/// The order in which a file keeps the bytes of its numbers.
#[derive(Clone, Copy)]
pub(super) enum ByteOrder {
    Little,
    Big,
}

impl ByteOrder {
    /// # Panics
    /// When `bytes` ends before: callers have checked the length of a block.
    #[inline]
    pub(super) fn u32_at(self, bytes: &[u8], at: usize) -> u32 {
        self.u32(u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]))
    }

    /// # Panics
    /// As [`u32_at`](Self::u32_at).
    pub(super) fn put_u32(self, bytes: &mut [u8], at: usize, number: u32) {
        bytes[at..at + 4].copy_from_slice(&self.u32(number).to_le_bytes());
    }

    /// A number that was read as little-endian.
    #[inline]
    pub(super) const fn u16(self, number: u16) -> u16 {
        match self {
            Self::Little => number,
            Self::Big => number.swap_bytes(),
        }
    }

    /// A number that was read as little-endian.
    #[inline]
    pub(super) const fn u32(self, number: u32) -> u32 {
        match self {
            Self::Little => number,
            Self::Big => number.swap_bytes(),
        }
    }

    /// A number that was read as little-endian.
    pub(super) const fn u64(self, number: u64) -> u64 {
        match self {
            Self::Little => number,
            Self::Big => number.swap_bytes(),
        }
    }
}
