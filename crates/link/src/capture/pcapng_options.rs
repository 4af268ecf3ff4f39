//! Options at the end of pcapng blocks, and what is taken from them.
//!
//! Reference: draft-ietf-opsawg-pcapng, section 3.5 and the option tables of each block. Options
//! that are cut off, or of a length that theirs never is, are left out: they never carry a frame.

use super::byte_order::ByteOrder;
use super::frame::{FrameDirection, TimeResolution};

/// Option codes that mean the same in every block.
const END: u16 = 0;

/// Options of a block, one after the other.
#[derive(Clone, Copy)]
pub(super) struct Options<'a> {
    order: ByteOrder,
    rest: &'a [u8],
}

/// An option: its code and its value without padding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PcapngOption<'a> {
    pub(super) code: u16,
    pub(super) value: &'a [u8],
    order: ByteOrder,
}

impl<'a> Options<'a> {
    pub(super) fn new(order: ByteOrder, bytes: &'a [u8]) -> Self {
        Self { order, rest: bytes }
    }
}

impl<'a> Iterator for Options<'a> {
    type Item = PcapngOption<'a>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let (header, rest) = self.rest.split_first_chunk::<4>()?;
        let code = self.order.u16([header[0], header[1]]);
        let len = usize::from(self.order.u16([header[2], header[3]]));
        if code == END {
            return None;
        }
        let value = rest.get(..len)?;
        self.rest = rest.get(len.next_multiple_of(4)..).unwrap_or_default();
        Some(PcapngOption { code, value, order: self.order })
    }
}

impl PcapngOption<'_> {
    /// The value as text, without what does not belong there. Its length is bounded by 16 bits.
    pub(super) fn text(&self) -> Option<String> {
        let text = String::from_utf8_lossy(self.value);
        let text = text.trim_end_matches('\0');
        let clean = || text.chars().filter(|c| !c.is_control());
        (!text.is_empty()).then(|| clean().collect())
    }

    pub(super) fn byte(&self) -> Option<u8> {
        self.value.first().copied()
    }

    pub(super) fn u32(&self) -> Option<u32> {
        Some(self.order.u32(self.value.try_into().ok()?))
    }

    pub(super) fn u64(&self) -> Option<u64> {
        Some(self.order.u64(self.value.try_into().ok()?))
    }
}

/// Options of an interface description block (section 4.2).
pub(super) struct InterfaceOptions {
    pub(super) name: Option<String>,
    pub(super) description: Option<String>,
    pub(super) resolution: TimeResolution,
    /// Seconds to add to each time stamp.
    pub(super) offset_s: i64,
    /// Length of the check sequence of each frame, in bytes.
    pub(super) fcs_len: u8,
}

impl InterfaceOptions {
    pub(super) fn read(options: Options<'_>) -> Self {
        let mut read = Self {
            name: None,
            description: None,
            resolution: TimeResolution::MICROSECOND,
            offset_s: 0,
            fcs_len: 0,
        };
        for option in options {
            match option.code {
                2 => read.name = option.text(),
                3 => read.description = option.text(),
                9 => {
                    let value = option.byte();
                    read.resolution = value.map_or(read.resolution, TimeResolution::from_option);
                }
                13 => read.fcs_len = option.byte().map_or(0, fcs_bytes),
                14 => read.offset_s = option.u64().map_or(0, u64::cast_signed),
                _ => {}
            }
        }
        read
    }
}

/// The option `if_fcslen` is in bits by its text and in bytes by its example; recorders do both.
fn fcs_bytes(value: u8) -> u8 {
    if value >= 8 && value.is_multiple_of(8) { value / 8 } else { value }
}

/// Options of an enhanced packet block (section 4.3) or of its obsolete ancestor.
#[derive(Default)]
pub(super) struct FrameOptions {
    pub(super) direction: FrameDirection,
    /// Length of this frame's check sequence in bytes, when this frame says so.
    pub(super) fcs_len: Option<u8>,
    pub(super) crc_error: bool,
    /// Frames lost by the recorder before this one.
    pub(super) drops: u64,
}

impl FrameOptions {
    #[inline]
    pub(super) fn read(options: Options<'_>) -> Self {
        let mut read = Self::default();
        for option in options {
            match option.code {
                2 => read.take_flags(option.u32().unwrap_or(0)),
                4 => read.drops = option.u64().unwrap_or(0),
                _ => {}
            }
        }
        read
    }

    /// The flags word: bits 0-1 direction, 5-8 length of the check sequence, 24 CRC error.
    fn take_flags(&mut self, flags: u32) {
        self.direction = match flags & 0b11 {
            1 => FrameDirection::Incoming,
            2 => FrameDirection::Outgoing,
            _ => FrameDirection::Unknown,
        };
        let fcs_len = (flags >> 5 & 0xF) as u8;
        self.fcs_len = (fcs_len != 0).then_some(fcs_len);
        self.crc_error = flags & 1 << 24 != 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_end_at_the_end_mark_or_where_they_are_cut() {
        let bytes = [2, 0, 3, 0, b'a', b'b', b'c', 0, 9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0, 2, 0];
        for len in 0..bytes.len() {
            let options = Options::new(ByteOrder::Little, &bytes[..len]);
            let expected = usize::from(len >= 7) + usize::from(len >= 13);
            assert_eq!(options.count(), expected, "of {len} bytes");
        }
        let read = InterfaceOptions::read(Options::new(ByteOrder::Little, &bytes));
        assert_eq!(read.name.as_deref(), Some("abc"));
        assert_eq!(read.resolution, TimeResolution::NANOSECOND);
    }

    #[test]
    fn the_check_sequence_is_four_bytes_in_bits_or_bytes() {
        assert_eq!((fcs_bytes(0), fcs_bytes(4), fcs_bytes(32)), (0, 4, 4));
    }

    #[test]
    fn flags_tell_direction_check_sequence_and_error() {
        let mut options = FrameOptions::default();
        options.take_flags(0x0100_0082);
        assert_eq!(options.direction, FrameDirection::Outgoing);
        assert_eq!(options.fcs_len, Some(4));
        assert!(options.crc_error);
        options.take_flags(1);
        assert_eq!(options.direction, FrameDirection::Incoming);
        assert_eq!((options.fcs_len, options.crc_error), (None, false));
    }
}
