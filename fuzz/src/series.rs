//! A series of frames in one input.

/// One frame of a series.
pub struct Item<'a> {
    /// Bits that steer what the target does with it.
    pub flags: u8,
    /// Time since the frame before, in µs: 1 to 32,768.
    pub pause_us: u64,
    /// The frame.
    pub bytes: &'a [u8],
}

/// Splits an input: each frame has a head of four bytes (length as 16 bits, flags, pause as a power
/// of two), and the last one is what is left.
pub fn series(mut data: &[u8]) -> impl Iterator<Item = Item<'_>> {
    std::iter::from_fn(move || {
        let (&[low, high, flags, pause], rest) = data.split_first_chunk()?;
        let len = usize::from(u16::from_le_bytes([low, high])).min(rest.len());
        let (bytes, rest) = rest.split_at(len);
        data = rest;
        Some(Item { flags, pause_us: 1 << (pause % 16), bytes })
    })
}
