//! Writing pcap with times in nanoseconds, for tools that read nothing newer.
//!
//! Reference: draft-ietf-opsawg-pcap. One interface, no direction, seconds in 32 bits: whoever can,
//! writes pcapng. The few numbers are put down by hand, because the serializer of `pcap-parser`
//! allocates for each frame.

use std::io::Write;

use super::error::CaptureWriteError;
use super::fcs::FCS_LEN;
use super::link_type::LinkType;
use super::pcap::{FCS_LEN_PRESENT, MAJOR_VERSION};
use super::pcapng_writer::FrameToWrite;
use super::reader::MAX_FRAME_LEN;

/// A pcap capture that is being written. The bytes depend on the arguments alone.
pub struct PcapWriter<W: Write> {
    sink: W,
}

impl<W: Write> PcapWriter<W> {
    /// Begins a capture of frames that begin as `link_type` says, and end with a check sequence or
    /// not.
    ///
    /// # Errors
    /// When the sink fails.
    pub fn new(
        mut sink: W,
        link_type: LinkType,
        with_fcs: bool,
    ) -> Result<Self, CaptureWriteError> {
        sink.write_all(&file_header(link_type, with_fcs))?;
        Ok(Self { sink })
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// When its length or time (1970 to 2106) does not fit, with nothing written; or when the sink
    /// fails.
    pub fn write_frame(&mut self, frame: &FrameToWrite<'_>) -> Result<(), CaptureWriteError> {
        let (captured, original_len) = frame.lengths()?;
        let nanos = frame.time.as_nanos();
        let seconds = u32::try_from(nanos.div_euclid(1_000_000_000))
            .map_err(|_| CaptureWriteError::Time { time: frame.time })?;
        let fraction = nanos.rem_euclid(1_000_000_000) as u32;
        let mut header = [0; 16];
        for (at, word) in [seconds, fraction, captured, original_len].into_iter().enumerate() {
            header[at * 4..at * 4 + 4].copy_from_slice(&word.to_le_bytes());
        }
        self.sink.write_all(&header)?;
        self.sink.write_all(frame.bytes)?;
        Ok(())
    }

    /// Writes out what the sink holds, so that a reader of the growing file sees it.
    ///
    /// # Errors
    /// When the sink fails.
    pub fn flush(&mut self) -> Result<(), CaptureWriteError> {
        self.sink.flush()?;
        Ok(())
    }

    /// Writes out what the sink holds and gives it back.
    ///
    /// # Errors
    /// When the sink fails.
    pub fn finish(mut self) -> Result<W, CaptureWriteError> {
        self.flush()?;
        Ok(self.sink)
    }
}

/// The file header: little-endian, nanoseconds, no limit to a frame.
fn file_header(link_type: LinkType, with_fcs: bool) -> [u8; 24] {
    const MAGIC_NANOS: u32 = 0xA1B2_3C4D;
    const MINOR_VERSION: u16 = 4;
    let fcs = if with_fcs { FCS_LEN_PRESENT | (FCS_LEN as u32 / 2) << 28 } else { 0 };
    let mut header = [0; 24];
    header[0..4].copy_from_slice(&MAGIC_NANOS.to_le_bytes());
    header[4..6].copy_from_slice(&MAJOR_VERSION.to_le_bytes());
    header[6..8].copy_from_slice(&MINOR_VERSION.to_le_bytes());
    header[16..20].copy_from_slice(&MAX_FRAME_LEN.to_le_bytes());
    header[20..24].copy_from_slice(&(u32::from(link_type.number()) | fcs).to_le_bytes());
    header
}
