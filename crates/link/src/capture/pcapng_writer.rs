//! Writing pcapng: one section, any number of interfaces, times in nanoseconds.
//!
//! Reference: draft-ietf-opsawg-pcapng, section 4. The bytes depend on the arguments alone: always
//! little-endian, no clock, no host name. The encoder is a page of our own, because those of
//! `pcap-parser` and `pcap-file` allocate for each frame, which recording beside a cycle must not,
//! and would save less than the half of it.

use std::io::Write;

use pcap_parser::pcapng::{BOM_MAGIC, EPB_MAGIC, IDB_MAGIC, ISB_MAGIC, SHB_MAGIC};

use super::error::CaptureWriteError;
use super::frame::{CaptureInterfaceId, FrameDirection};
use super::link_type::LinkType;
use super::reader::MAX_FRAME_LEN;
use crate::unix_time::UnixTime;

/// Longest text of an option that is written, in bytes: what a name or a version may need.
const MAX_TEXT_LEN: usize = 1024;

/// A pcapng capture that is being written.
///
/// Give it a buffered writer: it writes block by block.
pub struct PcapngWriter<W: Write> {
    sink: W,
    interfaces: Vec<LinkType>,
    /// The block that is being put together; kept, so that frames allocate nothing.
    block: Vec<u8>,
}

/// An interface to be described in a capture.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct InterfaceToWrite<'a> {
    /// Its name, cut at 1,024 bytes; empty for none.
    pub name: &'a str,
    /// What people call it, cut at 1,024 bytes; empty for none.
    pub description: &'a str,
    /// What its frames begin with.
    pub link_type: LinkType,
}

/// A frame to be put into a capture.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameToWrite<'a> {
    /// The interface that saw it. In pcap, which has one interface, it is ignored.
    pub interface: CaptureInterfaceId,
    /// When it was seen.
    pub time: UnixTime,
    /// Which way it went. In pcap, it is lost.
    pub direction: FrameDirection,
    /// Whether `bytes` end with the check sequence. In pcap, the header says it for all frames and
    /// this is ignored.
    pub with_fcs: bool,
    /// Whether the card reported a wrong check sequence. In pcap, it is lost.
    pub crc_error: bool,
    /// Length on the wire, if `bytes` are less than the whole frame.
    pub original_len: Option<u32>,
    /// The frame.
    pub bytes: &'a [u8],
}

impl<'a> FrameToWrite<'a> {
    /// A whole and sound frame without check sequence.
    #[must_use]
    pub const fn new(
        interface: CaptureInterfaceId,
        time: UnixTime,
        direction: FrameDirection,
        bytes: &'a [u8],
    ) -> Self {
        let (with_fcs, crc_error, original_len) = (false, false, None);
        Self { interface, time, direction, with_fcs, crc_error, original_len, bytes }
    }

    /// Captured and original length, both within what the formats hold.
    pub(super) fn lengths(&self) -> Result<(u32, u32), CaptureWriteError> {
        let (len, most) = (self.bytes.len(), MAX_FRAME_LEN as usize);
        let captured = u32::try_from(len).ok().filter(|len| *len <= MAX_FRAME_LEN);
        let captured = captured.ok_or(CaptureWriteError::FrameLength { len, most })?;
        Ok((captured, self.original_len.unwrap_or(captured)))
    }
}

impl<W: Write> PcapngWriter<W> {
    /// Begins a capture, written by `application` (its name and version; empty for none).
    ///
    /// # Errors
    /// When the sink fails.
    pub fn new(sink: W, application: &str) -> Result<Self, CaptureWriteError> {
        let mut writer = Self { sink, interfaces: Vec::new(), block: Vec::with_capacity(2048) };
        writer.begin(SHB_MAGIC);
        writer.put(BOM_MAGIC.to_le_bytes());
        writer.put(1_u16.to_le_bytes());
        writer.put(0_u16.to_le_bytes());
        // The section's length is not known when it begins.
        writer.put(u64::MAX.to_le_bytes());
        writer.text(4, application);
        writer.end_of_options();
        writer.finish_block()?;
        Ok(writer)
    }

    /// Describes the next interface.
    ///
    /// # Errors
    /// When the sink fails.
    pub fn add_interface(
        &mut self,
        interface: &InterfaceToWrite<'_>,
    ) -> Result<CaptureInterfaceId, CaptureWriteError> {
        const NANOSECONDS: u8 = 9;
        self.begin(IDB_MAGIC);
        self.put(interface.link_type.number().to_le_bytes());
        self.put(0_u16.to_le_bytes());
        self.put(MAX_FRAME_LEN.to_le_bytes());
        self.text(2, interface.name);
        self.text(3, interface.description);
        self.option(9, &[NANOSECONDS]);
        self.end_of_options();
        self.finish_block()?;
        self.interfaces.push(interface.link_type);
        Ok(CaptureInterfaceId(self.interfaces.len() as u32 - 1))
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// When its interface was not described, its length or time does not fit, or the sink fails.
    /// Nothing is written in the first three cases.
    pub fn write_frame(&mut self, frame: &FrameToWrite<'_>) -> Result<(), CaptureWriteError> {
        self.write_commented(frame, "")
    }

    /// Writes a frame with a comment, cut at 1,024 bytes; empty for none.
    ///
    /// # Errors
    /// As [`write_frame`](Self::write_frame).
    pub fn write_commented(
        &mut self,
        frame: &FrameToWrite<'_>,
        comment: &str,
    ) -> Result<(), CaptureWriteError> {
        const COMMENT: u16 = 1;
        self.check(frame.interface)?;
        let (captured, original_len) = frame.lengths()?;
        let time = u64::try_from(frame.time.as_nanos())
            .map_err(|_| CaptureWriteError::Time { time: frame.time })?;
        self.begin(EPB_MAGIC);
        self.put(frame.interface.0.to_le_bytes());
        self.put(((time >> 32) as u32).to_le_bytes());
        self.put((time as u32).to_le_bytes());
        self.put(captured.to_le_bytes());
        self.put(original_len.to_le_bytes());
        self.block.extend_from_slice(frame.bytes);
        self.pad();
        let flags = flags(frame);
        if flags != 0 {
            self.option(2, &flags.to_le_bytes());
        }
        self.text(COMMENT, comment);
        if flags != 0 || !comment.is_empty() {
            self.end_of_options();
        }
        self.finish_block()
    }

    /// Writes how many frames an interface has received and how many of them the recorder lost, up
    /// to `time`. A reader then knows which frames are missing in the file only, and that nothing came after the last one.
    ///
    /// # Errors
    /// As [`write_frame`](Self::write_frame).
    pub fn write_statistics(
        &mut self,
        interface: CaptureInterfaceId,
        time: UnixTime,
        received: u64,
        lost: u64,
    ) -> Result<(), CaptureWriteError> {
        self.check(interface)?;
        let nanos = u64::try_from(time.as_nanos()).map_err(|_| CaptureWriteError::Time { time })?;
        self.begin(ISB_MAGIC);
        self.put(interface.0.to_le_bytes());
        self.put(((nanos >> 32) as u32).to_le_bytes());
        self.put((nanos as u32).to_le_bytes());
        self.option(4, &received.to_le_bytes());
        self.option(5, &lost.to_le_bytes());
        self.end_of_options();
        self.finish_block()
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

    fn check(&self, interface: CaptureInterfaceId) -> Result<(), CaptureWriteError> {
        let described = self.interfaces.len() as u32;
        if interface.0 < described {
            return Ok(());
        }
        Err(CaptureWriteError::UnknownInterface { interface: interface.0, described })
    }

    fn begin(&mut self, kind: u32) {
        self.block.clear();
        self.put(kind.to_le_bytes());
        // The length, known at the end.
        self.put([0; 4]);
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        self.block.extend_from_slice(&bytes);
    }

    fn pad(&mut self) {
        self.block.resize(self.block.len().next_multiple_of(4), 0);
    }

    fn text(&mut self, code: u16, text: &str) {
        if !text.is_empty() {
            let end = text.floor_char_boundary(MAX_TEXT_LEN);
            self.option(code, &text.as_bytes()[..end]);
        }
    }

    fn option(&mut self, code: u16, value: &[u8]) {
        self.put(code.to_le_bytes());
        self.put((value.len() as u16).to_le_bytes());
        self.block.extend_from_slice(value);
        self.pad();
    }

    fn end_of_options(&mut self) {
        self.put([0; 4]);
    }

    fn finish_block(&mut self) -> Result<(), CaptureWriteError> {
        let len = (self.block.len() as u32 + 4).to_le_bytes();
        self.put(len);
        self.block[4..8].copy_from_slice(&len);
        self.sink.write_all(&self.block)?;
        Ok(())
    }
}

/// The flags word: bits 0-1 direction, 5-8 length of the check sequence, 24 CRC error.
fn flags(frame: &FrameToWrite<'_>) -> u32 {
    let direction = match frame.direction {
        FrameDirection::Unknown => 0,
        FrameDirection::Incoming => 1,
        FrameDirection::Outgoing => 2,
    };
    let fcs_len = if frame.with_fcs { 4 << 5 } else { 0 };
    let error = if frame.crc_error { 1 << 24 } else { 0 };
    direction | fcs_len | error
}
