//! Values of a whole object, bit behind bit.

/// Puts values bit behind bit; whole bytes begin at a byte.
#[derive(Default)]
pub(super) struct BitWriter {
    pub(super) bytes: Vec<u8>,
    at: usize,
}

impl BitWriter {
    pub(super) fn put(&mut self, value: &[u8], bits: u16) {
        if bits.is_multiple_of(8) {
            self.at = self.at.next_multiple_of(8);
        }
        let end = self.at + usize::from(bits);
        self.bytes.resize(end.div_ceil(8), 0);
        for bit in 0..usize::from(bits) {
            let high = value.get(bit / 8).is_some_and(|byte| byte >> (bit % 8) & 1 != 0);
            let to = self.at + bit;
            self.bytes[to / 8] |= u8::from(high) << (to % 8);
        }
        self.at = end;
    }
}

/// Takes them out again.
pub(super) struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> BitReader<'a> {
    /// From the first bit on.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Whether no whole byte is left to begin.
    pub(super) fn is_empty(&self) -> bool {
        self.at.div_ceil(8) >= self.bytes.len()
    }

    /// Whether the bytes end before a value of this length begins.
    pub(super) fn ends_before(&self, bits: u16) -> bool {
        let whole = bits.is_multiple_of(8);
        if whole { self.is_empty() } else { self.at >= self.bytes.len() * 8 }
    }

    /// The next value; `None` when the bytes end within it.
    pub(super) fn take(&mut self, bits: u16) -> Option<Vec<u8>> {
        if bits.is_multiple_of(8) {
            self.at = self.at.next_multiple_of(8);
        }
        let end = self.at + usize::from(bits);
        if end > self.bytes.len() * 8 {
            return None;
        }
        let mut value = vec![0; usize::from(bits).div_ceil(8)];
        for bit in 0..usize::from(bits) {
            let from = self.at + bit;
            value[bit / 8] |= (self.bytes[from / 8] >> (from % 8) & 1) << (bit % 8);
        }
        self.at = end;
        Some(value)
    }
}
