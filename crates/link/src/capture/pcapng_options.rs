//! Options of pcapng blocks that the reader uses.
//!
//! Reference: draft-ietf-opsawg-pcapng, section 3.5 and the option tables of each block.
//! `pcap-parser` takes them apart, but reads on behind the end mark and takes every number for
//! little-endian; those of frames are read here, where they lie. Options that are cut off, or of a length that theirs never is, are left out: they
//! never carry a frame.

use pcap_parser::pcapng::{OptionCode, PcapNGOption};

use super::byte_order::ByteOrder;
use super::frame::{CaptureSection, FrameDirection, TimeResolution};

/// Options of a section header block (section 4.1).
pub(super) fn section(options: &[PcapNGOption<'_>]) -> CaptureSection {
    let mut section = CaptureSection::default();
    for option in before_the_end(options) {
        match option.code {
            OptionCode::ShbHardware => section.hardware = text(option),
            OptionCode::ShbOs => section.operating_system = text(option),
            OptionCode::ShbUserAppl => section.application = text(option),
            _ => {}
        }
    }
    section
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
    /// Of the option `if_fcslen`, which the library has no name for.
    const FCS_LEN: OptionCode = OptionCode(13);

    pub(super) fn read(order: ByteOrder, options: &[PcapNGOption<'_>]) -> Self {
        let mut read = Self {
            name: None,
            description: None,
            resolution: TimeResolution::MICROSECOND,
            offset_s: 0,
            fcs_len: 0,
        };
        for option in before_the_end(options) {
            match option.code {
                OptionCode::IfName => read.name = text(option),
                OptionCode::IfDescription => read.description = text(option),
                OptionCode::IfTsresol => {
                    let value = byte(option);
                    read.resolution = value.map_or(read.resolution, TimeResolution::from_option);
                }
                Self::FCS_LEN => read.fcs_len = byte(option).map_or(0, fcs_bytes),
                OptionCode::IfTsoffset => {
                    read.offset_s = number(order, option).map_or(0, u64::cast_signed);
                }
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
    /// Of the option `epb_flags`, which the library has no name for.
    const FLAGS: OptionCode = OptionCode(2);
    /// Of the option `epb_dropcount`, which the library has no name for.
    const DROP_COUNT: OptionCode = OptionCode(4);

    /// Reads them where they lie: a capture has some in each of its frames.
    #[inline]
    pub(super) fn read(order: ByteOrder, mut options: &[u8]) -> Self {
        let mut read = Self::default();
        while let Some((head, rest)) = options.split_first_chunk::<4>() {
            let code = u16::from_le_bytes([head[0], head[1]]);
            let len = u16::from_le_bytes([head[2], head[3]]);
            let (code, len) = (OptionCode(order.u16(code)), usize::from(order.u16(len)));
            if code == OptionCode::EndOfOpt {
                break;
            }
            // Padded to four bytes; one that is cut off ends them.
            let Some((value, behind)) = rest.split_at_checked(len.next_multiple_of(4)) else {
                break;
            };
            options = behind;
            match (code, len) {
                (Self::FLAGS, 4) => {
                    let flags = value.first_chunk().map_or(0, |word| u32::from_le_bytes(*word));
                    read.take_flags(order.u32(flags));
                }
                (Self::FLAGS, _) => read.take_flags(0),
                (Self::DROP_COUNT, 8) => {
                    let drops = value.first_chunk().map_or(0, |word| u64::from_le_bytes(*word));
                    read.drops = order.u64(drops);
                }
                (Self::DROP_COUNT, _) => read.drops = 0,
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

/// Drops of the card and of the operating system, from the options of an interface statistics block
/// (section 4.6); `None` when it does not say.
pub(super) fn drops(order: ByteOrder, options: &[PcapNGOption<'_>]) -> Option<u64> {
    before_the_end(options)
        .filter(|option| matches!(option.code, OptionCode::IsbIfDrop | OptionCode::IsbOsDrop))
        .filter_map(|option| number(order, option))
        .reduce(u64::saturating_add)
}

#[inline]
fn before_the_end<'o, 'b>(
    options: &'o [PcapNGOption<'b>],
) -> impl Iterator<Item = &'o PcapNGOption<'b>> {
    options.iter().take_while(|option| option.code != OptionCode::EndOfOpt)
}

/// The value as text, without what does not belong there. Its length is bounded by 16 bits.
fn text(option: &PcapNGOption<'_>) -> Option<String> {
    let text = String::from_utf8_lossy(option.as_bytes().ok()?);
    let text = text.trim_end_matches('\0');
    let clean = || text.chars().filter(|c| !c.is_control());
    (!text.is_empty()).then(|| clean().collect())
}

fn byte(option: &PcapNGOption<'_>) -> Option<u8> {
    option.as_bytes().ok()?.first().copied()
}

fn number(order: ByteOrder, option: &PcapNGOption<'_>) -> Option<u64> {
    Some(order.u64(option.as_u64_le().ok()?))
}

#[cfg(test)]
mod tests {
    use pcap_parser::pcapng::{Block, parse_block_le};

    use super::*;

    /// What an interface description with these bytes for options says.
    fn interface(options: &[u8]) -> InterfaceOptions {
        let len = (20 + options.len() as u32).to_le_bytes();
        let block = [&[1, 0, 0, 0], &len, &[1, 0, 0, 0, 0, 0, 0, 0][..], options, &len].concat();
        let (_, Block::InterfaceDescription(block)) = parse_block_le(&block).unwrap() else {
            panic!("an interface description");
        };
        InterfaceOptions::read(ByteOrder::Little, &block.options)
    }

    #[test]
    fn options_end_at_the_end_mark_or_where_they_are_cut() {
        let bytes = [2, 0, 3, 0, b'a', b'b', b'c', 0, 9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0, 3, 0, 1];
        // Behind the end mark, a description; a block's length is a multiple of four.
        let bytes = [bytes.as_slice(), &[0, b'x', 0, 0, 0]].concat();
        for len in (0..=bytes.len()).step_by(4) {
            let read = interface(&bytes[..len]);
            assert_eq!(read.name.as_deref(), (len >= 7).then_some("abc"), "of {len} bytes");
            let nanoseconds = read.resolution == TimeResolution::NANOSECOND;
            assert_eq!(nanoseconds, len >= 13, "of {len} bytes");
            assert_eq!(read.description, None, "of {len} bytes");
        }
    }

    #[test]
    fn the_check_sequence_is_four_bytes_in_bits_or_bytes() {
        assert_eq!((fcs_bytes(0), fcs_bytes(4), fcs_bytes(32)), (0, 4, 4));
    }

    #[test]
    fn options_of_a_frame_are_read_in_both_orders_up_to_the_end_mark() {
        let comment = [0, 1, 0, 3, b'a', b'b', b'c', 0];
        let big = [0, 2, 0, 4, 0, 0, 0, 2, 0, 4, 0, 8, 0, 0, 0, 0, 0, 0, 0, 7];
        let read = FrameOptions::read(ByteOrder::Big, &[&comment[..], &big].concat());
        assert_eq!((read.direction, read.drops), (FrameDirection::Outgoing, 7));
        let little = [2, 0, 4, 0, 1, 0, 0, 0, 0, 0, 0, 0, 2, 0, 4, 0, 2, 0, 0, 0];
        let read = FrameOptions::read(ByteOrder::Little, &little);
        assert_eq!(read.direction, FrameDirection::Incoming, "what is behind the mark is nothing");
        for len in 0..8 {
            let read = FrameOptions::read(ByteOrder::Little, &little[..len]);
            assert_eq!(read.direction, FrameDirection::Unknown, "of {len} bytes");
        }
        let odd = [2, 0, 3, 0, 1, 0, 0, 0, 4, 0, 4, 0, 1, 0, 0, 0];
        let read = FrameOptions::read(ByteOrder::Little, &odd);
        assert_eq!((read.direction, read.drops), (FrameDirection::Unknown, 0), "wrong lengths");
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
