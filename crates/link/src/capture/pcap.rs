//! The classic pcap format: one header, then frames.
//!
//! Reference: draft-ietf-opsawg-pcap, sections 4 and 5.

use super::byte_order::ByteOrder;
use super::end::Damage;
use super::fcs::FCS_LEN;
use super::frame::{CaptureInterface, CaptureInterfaceId, FrameDirection, TimeResolution};
use super::link_type::LinkType;
use super::reader::{MAX_FRAME_LEN, Record};
use super::window::Window;
use crate::unix_time::UnixTime;

/// Length of the file header, in bytes.
pub(super) const FILE_HEADER_LEN: usize = 24;
/// Length of the header of a frame, in bytes.
const RECORD_HEADER_LEN: usize = 16;
/// The file header's magic number for time in microseconds.
const MAGIC_MICROS: u32 = 0xA1B2_C3D4;
/// The file header's magic number for time in nanoseconds.
const MAGIC_NANOS: u32 = 0xA1B2_3C4D;
/// The only major version there has been since 1998.
const MAJOR_VERSION: u16 = 2;

/// The state of reading a pcap file behind its header.
#[derive(Debug)]
pub(super) struct Pcap {
    order: ByteOrder,
    resolution: TimeResolution,
    fcs_len: u8,
}

/// Byte order and time step that the magic number tells, if it is one.
pub(super) fn recognize(start: [u8; 4]) -> Option<(ByteOrder, TimeResolution)> {
    [ByteOrder::Little, ByteOrder::Big].into_iter().find_map(|order| match order.u32(start) {
        MAGIC_MICROS => Some((order, TimeResolution::MICROSECOND)),
        MAGIC_NANOS => Some((order, TimeResolution::NANOSECOND)),
        _ => None,
    })
}

impl Pcap {
    /// Reads the file header: the state, and the one interface.
    pub(super) fn open(
        window: &mut Window,
        order: ByteOrder,
        resolution: TimeResolution,
    ) -> Result<(Self, CaptureInterface), Damage> {
        if !window.fill(FILE_HEADER_LEN) {
            return Err(Damage::CutOff {
                what: "the file header",
                expected: FILE_HEADER_LEN as u64,
                present: window.view().len() as u64,
            });
        }
        let at = window.pass(FILE_HEADER_LEN);
        let header = window.passed(at, FILE_HEADER_LEN);
        let (major, minor) = (order.u16_at(header, 4), order.u16_at(header, 6));
        if major != MAJOR_VERSION {
            return Err(Damage::Version { major, minor });
        }
        let (snap_len, network) = (order.u32_at(header, 16), order.u32_at(header, 20));
        // Bit 26 says that the four highest bits count the check sequence, in units of 16 bits.
        let fcs_len = if network & 0x0400_0000 != 0 { (network >> 28) as u8 * 2 } else { 0 };
        let interface = CaptureInterface {
            name: None,
            description: None,
            link_type: LinkType::from_number((network & 0xFFFF) as u16),
            snap_len: (snap_len != 0).then_some(snap_len),
            resolution,
            drops: None,
        };
        Ok((Self { order, resolution, fcs_len }, interface))
    }

    /// The next frame; `None` at the end.
    #[inline]
    pub(super) fn next(&mut self, window: &mut Window) -> Result<Option<Record>, Damage> {
        if !window.fill(RECORD_HEADER_LEN) {
            return match window.view().len() {
                0 => Ok(None),
                present => Err(cut_off(RECORD_HEADER_LEN, present)),
            };
        }
        let header = &window.view()[..RECORD_HEADER_LEN];
        let [seconds, fraction, captured, original_len] =
            [0, 4, 8, 12].map(|at| self.order.u32_at(header, at));
        if captured > MAX_FRAME_LEN {
            return Err(Damage::FrameLength { captured, most: MAX_FRAME_LEN });
        }
        let len = RECORD_HEADER_LEN + captured as usize;
        if !window.fill(len) {
            return Err(cut_off(len, window.view().len()));
        }
        let nanos = i128::from(seconds) * 1_000_000_000 + self.resolution.nanos(fraction.into());
        Ok(Some(Record {
            at: window.pass(len) + RECORD_HEADER_LEN,
            len: captured as usize,
            original_len,
            interface: CaptureInterfaceId(0),
            time: Some(UnixTime::from_nanos(nanos)),
            direction: FrameDirection::Unknown,
            fcs_len: self.fcs_len,
            crc_error: false,
        }))
    }
}

fn cut_off(expected: usize, present: usize) -> Damage {
    Damage::CutOff { what: "a frame", expected: expected as u64, present: present as u64 }
}

/// The network field of a file header: link type and length of the check sequence.
fn network_field(link_type: LinkType, with_fcs: bool) -> u32 {
    let fcs = if with_fcs { 0x0400_0000 | (FCS_LEN as u32 / 2) << 28 } else { 0 };
    u32::from(link_type.number()) | fcs
}

/// The file header of what is written here: little-endian, nanoseconds, no limit to a frame.
pub(super) fn file_header(link_type: LinkType, with_fcs: bool) -> [u8; FILE_HEADER_LEN] {
    let mut header = [0; FILE_HEADER_LEN];
    header[0..4].copy_from_slice(&MAGIC_NANOS.to_le_bytes());
    header[4..6].copy_from_slice(&MAJOR_VERSION.to_le_bytes());
    header[6..8].copy_from_slice(&4_u16.to_le_bytes());
    header[16..20].copy_from_slice(&MAX_FRAME_LEN.to_le_bytes());
    header[20..24].copy_from_slice(&network_field(link_type, with_fcs).to_le_bytes());
    header
}
