//! The classic pcap format: one header, then frames.
//!
//! Reference: draft-ietf-opsawg-pcap, sections 4 and 5. `pcap-parser` reads header and frames; here
//! is what makes them whole out of a stream, with a limit to what a frame may ask for.

use pcap_parser::nom::{Err, Needed};
use pcap_parser::pcap::{PcapHeader, parse_pcap_frame, parse_pcap_frame_be, parse_pcap_header};

use super::end::Damage;
use super::frame::{CaptureInterface, CaptureInterfaceId, FrameDirection, TimeResolution};
use super::link_type::LinkType;
use super::reader::{MAX_FRAME_LEN, Record};
use super::window::Window;
use crate::unix_time::UnixTime;

/// Length of the file header, in bytes.
const FILE_HEADER_LEN: usize = 24;
/// Length of the header of a frame, in bytes.
const RECORD_HEADER_LEN: usize = 16;
/// The only major version there has been since 1998.
pub(super) const MAJOR_VERSION: u16 = 2;
/// In the network field: the four highest bits count the check sequence, in units of 16 bits.
pub(super) const FCS_LEN_PRESENT: u32 = 0x0400_0000;

/// The state of reading a pcap file behind its header.
pub(super) struct Pcap {
    big_endian: bool,
    resolution: TimeResolution,
    fcs_len: u8,
}

impl Pcap {
    /// Reads the file header: the state, and the one interface. `None` when this is no pcap file.
    pub(super) fn open(window: &mut Window) -> Result<Option<(Self, CaptureInterface)>, Damage> {
        window.fill(FILE_HEADER_LEN);
        match parse_pcap_header(window.view()) {
            Ok((_, header)) => {
                let opened = Self::from_header(&header)?;
                window.pass(FILE_HEADER_LEN);
                Ok(Some(opened))
            }
            Err(Err::Incomplete(_)) => {
                Err(cut_off("the file header", FILE_HEADER_LEN, window.view().len()))
            }
            Err(Err::Error(_) | Err::Failure(_)) => Ok(None),
        }
    }

    fn from_header(header: &PcapHeader) -> Result<(Self, CaptureInterface), Damage> {
        let (major, minor) = (header.version_major, header.version_minor);
        if major != MAJOR_VERSION {
            return Err(Damage::Version { major, minor });
        }
        let resolution = if header.is_nanosecond_precision() {
            TimeResolution::NANOSECOND
        } else {
            TimeResolution::MICROSECOND
        };
        let network = header.network.0.cast_unsigned();
        let fcs_len = if network & FCS_LEN_PRESENT != 0 { (network >> 28) as u8 * 2 } else { 0 };
        let interface = CaptureInterface {
            name: None,
            description: None,
            link_type: LinkType::from_number((network & 0xFFFF) as u16),
            snap_len: (header.snaplen != 0).then_some(header.snaplen),
            resolution,
            drops: None,
            ended: None,
        };
        Ok((Self { big_endian: header.is_bigendian(), resolution, fcs_len }, interface))
    }

    /// The next frame; `None` at the end.
    #[inline]
    pub(super) fn next(&mut self, window: &mut Window) -> Result<Option<Record>, Damage> {
        loop {
            let view = window.view();
            let parsed =
                if self.big_endian { parse_pcap_frame_be(view) } else { parse_pcap_frame(view) };
            let expected = match parsed {
                Ok((_, frame)) => {
                    check_len(frame.caplen as usize)?;
                    let nanos = i128::from(frame.ts_sec) * 1_000_000_000
                        + self.resolution.nanos(frame.ts_usec.into());
                    let (len, original_len) = (frame.data.len(), frame.origlen);
                    return Ok(Some(Record {
                        at: window.pass(RECORD_HEADER_LEN + len) + RECORD_HEADER_LEN,
                        len,
                        original_len,
                        interface: CaptureInterfaceId(0),
                        time: Some(UnixTime::from_nanos(nanos)),
                        direction: FrameDirection::Unknown,
                        fcs_len: self.fcs_len,
                        crc_error: false,
                    }));
                }
                Err(Err::Incomplete(Needed::Size(more))) => view.len() + more.get(),
                // Nothing else is known that the library would say of a frame.
                Err(Err::Incomplete(Needed::Unknown) | Err::Error(_) | Err::Failure(_)) => {
                    view.len() + 1
                }
            };
            check_len(expected.saturating_sub(RECORD_HEADER_LEN))?;
            if !window.fill(expected) {
                return match window.view().len() {
                    0 => Ok(None),
                    present => Err(cut_off("a frame", expected, present)),
                };
            }
        }
    }
}

fn check_len(captured: usize) -> Result<(), Damage> {
    if captured > MAX_FRAME_LEN as usize {
        return Err(Damage::FrameLength { captured: captured as u32, most: MAX_FRAME_LEN });
    }
    Ok(())
}

fn cut_off(what: &'static str, expected: usize, present: usize) -> Damage {
    Damage::CutOff { what, expected: expected as u64, present: present as u64 }
}
