//! Reading a frame in place: [`FrameView`] is the frame, [`Datagrams`] walks what is in it.
//!
//! The walk follows the "more follows" bit as controllers do; the length field of the EtherCAT
//! header is reported, not believed, since some MainDevices count padding in.
//! Reference: S1 chapter 2; ETG.1000.4.

use std::ops::Range;

use super::{DATAGRAM_HEADER_LEN, DATAGRAM_OVERHEAD, ETHERCAT_HEADER_LEN, FrameType, WKC_LEN};
use crate::address::{LogicalAddress, RegisterAddress, WorkingCounter};
use crate::command::Command;
use crate::ethernet::{self, MacAddress, Wrapping};

/// Why bytes are not an EtherCAT frame with datagrams.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FrameError {
    /// Neither EtherType 0x88A4 nor UDP port 0x88A4, or cut off before either.
    #[error("no EtherCAT: neither EtherType 0x88A4 nor UDP port 0x88A4 within {len} bytes")]
    NotEtherCat {
        /// Bytes there were.
        len: usize,
    },
    /// The frame ends inside the two-byte EtherCAT header.
    #[error("frame of {len} bytes ends inside the EtherCAT header")]
    CutOff {
        /// Bytes there were.
        len: usize,
    },
    /// The EtherCAT header announces something other than datagrams.
    #[error("EtherCAT header type {found:?}, expected datagrams (type 1)")]
    OtherType {
        /// The type found.
        found: FrameType,
    },
}

/// Why the walk over datagrams stopped early.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum DatagramError {
    /// The frame ends inside a datagram's header.
    #[error("datagram {number}: needs {needed} bytes for header and counter, {left} are left")]
    HeaderCutOff {
        /// Which datagram of the frame, counted from 1.
        number: usize,
        /// Bytes an empty datagram needs.
        needed: usize,
        /// Bytes left in the frame.
        left: usize,
    },
    /// The frame ends inside a datagram's data or working counter.
    #[error("datagram {number}: announces {announced} bytes of data, {left} are left")]
    DataCutOff {
        /// Which datagram of the frame, counted from 1.
        number: usize,
        /// Data length in its header.
        announced: usize,
        /// Bytes left for data.
        left: usize,
    },
}

/// An Ethernet frame that carries EtherCAT datagrams.
#[derive(Clone, Copy, Debug)]
pub struct FrameView<'a> {
    frame: &'a [u8],
    wrapping: Wrapping,
    header_at: usize,
}

impl<'a> FrameView<'a> {
    /// Looks for EtherCAT datagrams in an Ethernet frame without its check sequence.
    ///
    /// # Errors
    /// [`FrameError`] when there are none; what the datagrams themselves look like is left to
    /// [`FrameView::datagrams`].
    #[inline]
    pub fn parse(frame: &'a [u8]) -> Result<Self, FrameError> {
        let len = frame.len();
        let (wrapping, header_at) =
            ethernet::locate(frame).ok_or(FrameError::NotEtherCat { len })?;
        let view = Self { frame, wrapping, header_at };
        let Some(word) = view.header() else {
            return Err(FrameError::CutOff { len });
        };
        match FrameType::from_bits((word >> 12) as u8) {
            FrameType::Datagrams => Ok(view),
            found @ (FrameType::NetworkVariables | FrameType::Mailbox | FrameType::Other(_)) => {
                Err(FrameError::OtherType { found })
            }
        }
    }

    #[inline]
    fn header(&self) -> Option<u16> {
        read_u16(self.frame, self.header_at)
    }

    /// Source address.
    #[must_use]
    #[inline]
    pub fn source(&self) -> MacAddress {
        ethernet::source(self.frame).unwrap_or_default()
    }

    /// Destination address.
    #[must_use]
    #[inline]
    pub fn destination(&self) -> MacAddress {
        ethernet::destination(self.frame).unwrap_or_default()
    }

    /// How the data are wrapped.
    #[must_use]
    pub const fn wrapping(&self) -> Wrapping {
        self.wrapping
    }

    /// The length field of the EtherCAT header, in bytes. Controllers ignore it; it may count
    /// padding.
    #[must_use]
    pub fn announced_len(&self) -> usize {
        usize::from(self.header().unwrap_or(0) & 0x07FF)
    }

    /// The datagrams, first to last.
    #[must_use]
    #[inline]
    pub fn datagrams(&self) -> Datagrams<'a> {
        Datagrams::new(self.frame, self.header_at + ETHERCAT_HEADER_LEN)
    }
}

/// Iterator over the datagrams of a frame, from the first header on.
///
/// After an error it ends.
#[derive(Clone, Debug)]
pub struct Datagrams<'a> {
    frame: &'a [u8],
    next_at: Option<usize>,
    number: usize,
    cut_at: Option<usize>,
}

/// Header of a datagram of whose data, or working counter, a part is missing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CutHeader {
    /// Command code as sent.
    pub code: u8,
    /// The index byte.
    pub index: u8,
    /// Both address words, as a logical address.
    pub address: u32,
    /// Announced length of the data.
    pub len: u16,
}

impl<'a> Datagrams<'a> {
    /// Walks the datagrams of `frame` whose first header lies at offset `first_at`.
    #[must_use]
    #[inline]
    pub const fn new(frame: &'a [u8], first_at: usize) -> Self {
        Self { frame, next_at: Some(first_at), number: 0, cut_at: None }
    }

    /// The header of the datagram at which the walk ended because the frame does, where the header is there.
    #[must_use]
    pub fn cut_header(&self) -> Option<CutHeader> {
        let bytes = self.frame.get(self.cut_at?..)?.first_chunk::<8>()?;
        let [code, index, a, b, c, d, low, high] = *bytes;
        let address = u32::from_le_bytes([a, b, c, d]);
        Some(CutHeader { code, index, address, len: u16::from_le_bytes([low, high]) & 0x07FF })
    }

    #[inline]
    fn read(&mut self, at: usize) -> Result<Datagram<'a>, DatagramError> {
        let bytes = self.frame.get(at..).unwrap_or_default();
        if bytes.len() < DATAGRAM_OVERHEAD {
            return Err(self.cut_off(at));
        }
        let datagram = Datagram { bytes, at };
        let len = datagram.data_len() + DATAGRAM_OVERHEAD;
        let Some(bytes) = bytes.get(..len) else { return Err(self.cut_off(at)) };
        self.next_at = datagram.more_follow().then_some(at + len);
        Ok(Datagram { bytes, at })
    }

    /// Ends the walk at a datagram that is not there as a whole.
    #[cold]
    fn cut_off(&mut self, at: usize) -> DatagramError {
        self.cut_at = Some(at);
        let (number, needed) = (self.number, DATAGRAM_OVERHEAD);
        let bytes = self.frame.get(at..).unwrap_or_default();
        match bytes.len().checked_sub(needed) {
            None => DatagramError::HeaderCutOff { number, needed, left: bytes.len() },
            Some(left) => {
                let announced = Datagram { bytes, at }.data_len();
                DatagramError::DataCutOff { number, announced, left }
            }
        }
    }
}

impl<'a> Iterator for Datagrams<'a> {
    type Item = Result<Datagram<'a>, DatagramError>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let at = self.next_at.take()?;
        self.number += 1;
        Some(self.read(at))
    }
}

/// One datagram in place: header, data, working counter, all known to be there.
#[derive(Clone, Copy, Debug)]
pub struct Datagram<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Datagram<'a> {
    /// Offset of its header in the frame.
    #[must_use]
    pub const fn offset(&self) -> usize {
        self.at
    }

    /// Where its data lie in the frame.
    #[must_use]
    pub fn data_range(&self) -> Range<usize> {
        let start = self.at + DATAGRAM_HEADER_LEN;
        start..start + self.data_len()
    }

    /// Command code as sent; [`Datagram::command`] gives its meaning.
    #[must_use]
    #[inline]
    pub fn code(&self) -> u8 {
        self.bytes[0]
    }

    /// The command, when the code is not reserved.
    #[must_use]
    #[inline]
    pub fn command(&self) -> Option<Command> {
        Command::from_code(self.code())
    }

    /// The index byte: the MainDevice's own mark, which no controller changes.
    #[must_use]
    #[inline]
    pub fn index(&self) -> u8 {
        self.bytes[1]
    }

    /// ADP: position or station address, depending on the command.
    #[must_use]
    #[inline]
    pub fn adp(&self) -> u16 {
        u16::from_le_bytes([self.bytes[2], self.bytes[3]])
    }

    /// ADO: the offset in the controller's memory.
    #[must_use]
    #[inline]
    pub fn ado(&self) -> RegisterAddress {
        RegisterAddress(u16::from_le_bytes([self.bytes[4], self.bytes[5]]))
    }

    /// The 32-bit logical address, for LRD, LWR and LRW.
    #[must_use]
    #[inline]
    pub fn logical(&self) -> LogicalAddress {
        let b = self.bytes;
        LogicalAddress(u32::from_le_bytes([b[2], b[3], b[4], b[5]]))
    }

    #[inline]
    fn len_word(&self) -> u16 {
        u16::from_le_bytes([self.bytes[6], self.bytes[7]])
    }

    /// Length of the data in bytes, 0..=2047.
    #[must_use]
    #[inline]
    pub fn data_len(&self) -> usize {
        usize::from(self.len_word() & 0x07FF)
    }

    /// The round-trip bit: set by a controller whose port 0 is closed, a frame that comes by with
    /// it set is destroyed there (S1, circulating frames).
    #[must_use]
    pub fn circulated(&self) -> bool {
        self.len_word() & 0x4000 != 0
    }

    /// Whether another datagram follows.
    #[must_use]
    #[inline]
    pub fn more_follow(&self) -> bool {
        self.len_word() & 0x8000 != 0
    }

    /// The interrupt field: every controller ORs its unmasked ECAT events into it.
    #[must_use]
    #[inline]
    pub fn irq(&self) -> u16 {
        u16::from_le_bytes([self.bytes[8], self.bytes[9]])
    }

    /// The data.
    #[must_use]
    #[inline]
    pub fn data(&self) -> &'a [u8] {
        &self.bytes[DATAGRAM_HEADER_LEN..self.bytes.len() - WKC_LEN]
    }

    /// The working counter.
    #[must_use]
    #[inline]
    pub fn wkc(&self) -> WorkingCounter {
        let at = self.bytes.len() - WKC_LEN;
        WorkingCounter(u16::from_le_bytes([self.bytes[at], self.bytes[at + 1]]))
    }
}

#[inline]
fn read_u16(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]))
}
