//! The pcapng format: blocks, of which some carry frames.
//!
//! Reference: draft-ietf-opsawg-pcapng, section 3 (how blocks lie) and 4 (each kind). `pcap-parser`
//! reads the blocks and their options, but for those of frames, which are read where they lie; what is here makes whole
//! blocks of a stream, and does what that library does not:
//!
//! * it passes over blocks that carry no frames unread, however long, so that they need no memory;
//! * it compares the two lengths of each block, and finds a frame that is longer than its block;
//! * it takes blocks whose length leaves out the padding, and the obsolete packet block;
//! * it stops at the end mark of options, and minds their byte order;
//! * it keeps time stamps of any step, offset and century (the library: seconds in 32 bits).
//!
//! The library lists the options of a block, with 32 bytes for each: a block that is made to do harm,
//! of nothing but empty options, takes up to 13 times its own length while it is read.

use pcap_parser::PcapError;
use pcap_parser::nom::IResult;
use pcap_parser::pcapng::{
    BOM_MAGIC, CB_MAGIC, DCB_MAGIC, EPB_MAGIC, IDB_MAGIC, ISB_MAGIC, SHB_MAGIC, SJE_MAGIC,
    SPB_MAGIC, parse_interfacedescriptionblock_be, parse_interfacedescriptionblock_le,
    parse_interfacestatisticsblock_be, parse_interfacestatisticsblock_le, parse_sectionheaderblock,
    parse_simplepacketblock_be, parse_simplepacketblock_le,
};

use super::byte_order::ByteOrder;
use super::end::Damage;
use super::frame::{
    CaptureInterface, CaptureInterfaceId, CaptureSection, FrameDirection, TimeResolution,
};
use super::link_type::LinkType;
use super::pcapng_options::{FrameOptions, InterfaceOptions, drops, section};
use super::reader::{MAX_FRAME_LEN, Record};
use super::window::Window;
use crate::unix_time::UnixTime;

/// Type of the packet block of drafts before 2011.
const OBSOLETE_PACKET: u32 = 2;
/// What a section header is called, and the least length it needs, in bytes.
const SECTION_HEADER: (&str, u32) = ("a section header", 28);
/// Longest block that is taken as a whole, in bytes; the limit of Wireshark too.
const MAX_BLOCK_LEN: u32 = 16 * 1024 * 1024;
/// Type, and length at the start and the end: what every block has, in bytes.
const BLOCK_OVERHEAD: u32 = 12;
/// A hostile file must not fill memory with interfaces.
const MAX_INTERFACES: u32 = 4096;
/// Where in a packet block the frame begins: an enhanced one, and a simple one.
const ENHANCED_DATA: usize = 28;
const SIMPLE_DATA: usize = 12;

/// The state of reading a pcapng file.
pub(super) struct Pcapng {
    order: ByteOrder,
    /// What the present section says about its maker.
    pub(super) section: CaptureSection,
    /// Where in `interfaces` those of the present section begin.
    section_start: usize,
    interfaces: Vec<Interface>,
}

/// What a frame needs to know of its interface.
struct Interface {
    resolution: TimeResolution,
    offset_nanos: i128,
    fcs_len: u8,
    snap_len: u32,
    /// Frames lost, as told frame by frame.
    drops: u64,
}

/// What a block gave.
pub(super) enum Item {
    /// A frame.
    Frame(Record),
    /// Something that counts as a frame in Wireshark without being one.
    Numbered,
    /// Anything else.
    Other,
}

impl Pcapng {
    /// Reads the first section header.
    pub(super) fn open(window: &mut Window) -> Result<Self, Damage> {
        let mut file = Self {
            order: byte_order(window)?,
            section: CaptureSection::default(),
            section_start: 0,
            interfaces: Vec::new(),
        };
        file.next(window, &mut Vec::new())?;
        Ok(file)
    }

    /// What the next block gives; `None` at the end. An interface that it describes is added to
    /// `described`.
    #[inline]
    pub(super) fn next(
        &mut self,
        window: &mut Window,
        described: &mut Vec<CaptureInterface>,
    ) -> Result<Option<Item>, Damage> {
        if !window.fill(8) {
            return match window.view().len() {
                0 => Ok(None),
                present => Err(cut_off("a block", BLOCK_OVERHEAD, present)),
            };
        }
        let kind = self.order.u32_at(window.view(), 0);
        let Some((what, least)) = taken_whole(kind) else {
            self.skip(window)?;
            let numbered = matches!(kind, SJE_MAGIC | CB_MAGIC | DCB_MAGIC);
            return Ok(Some(if numbered { Item::Numbered } else { Item::Other }));
        };
        if kind == SHB_MAGIC {
            self.order = byte_order(window)?;
        }
        let len = self.whole(window, what, least)?;
        let mut drops = None;
        if kind == OBSOLETE_PACKET {
            drops = modernize(self.order, window.view_mut());
        }
        let block = &window.view()[..len];
        let mut item = Item::Other;
        match kind {
            EPB_MAGIC | OBSOLETE_PACKET => {
                item = Item::Frame(self.enhanced(block, drops, described)?);
            }
            SPB_MAGIC => item = Item::Frame(self.simple(block)?),
            SHB_MAGIC => self.begin_section(block)?,
            IDB_MAGIC => self.interface(block, described)?,
            _ => self.statistics(block, described)?,
        }
        let at = window.pass(len);
        if let Item::Frame(record) = &mut item {
            record.at += at;
        }
        Ok(Some(item))
    }

    fn begin_section(&mut self, block: &[u8]) -> Result<(), Damage> {
        let header = read(parse_sectionheaderblock(block))?;
        let (major, minor) = (header.major_version, header.minor_version);
        if major != 1 {
            return Err(Damage::Version { major, minor });
        }
        self.section = section(&header.options);
        self.section_start = self.interfaces.len();
        Ok(())
    }

    fn interface(
        &mut self,
        block: &[u8],
        described: &mut Vec<CaptureInterface>,
    ) -> Result<(), Damage> {
        if self.interfaces.len() >= MAX_INTERFACES as usize {
            return Err(Damage::TooManyInterfaces { most: MAX_INTERFACES });
        }
        let block = read(match self.order {
            ByteOrder::Little => parse_interfacedescriptionblock_le(block),
            ByteOrder::Big => parse_interfacedescriptionblock_be(block),
        })?;
        let options = InterfaceOptions::read(self.order, &block.options);
        self.interfaces.push(Interface {
            resolution: options.resolution,
            offset_nanos: i128::from(options.offset_s) * 1_000_000_000,
            fcs_len: options.fcs_len,
            snap_len: block.snaplen,
            drops: 0,
        });
        described.push(CaptureInterface {
            name: options.name,
            description: options.description,
            // 16 bits in the file.
            link_type: LinkType::from_number(block.linktype.0 as u16),
            snap_len: (block.snaplen != 0).then_some(block.snaplen),
            resolution: options.resolution,
            drops: None,
            ended: None,
        });
        Ok(())
    }

    /// Interface statistics: the time that they are of, and drops of the card and of the operating system until then.
    fn statistics(&self, block: &[u8], described: &mut [CaptureInterface]) -> Result<(), Damage> {
        let block = read(match self.order {
            ByteOrder::Little => parse_interfacestatisticsblock_le(block),
            ByteOrder::Big => parse_interfacestatisticsblock_be(block),
        })?;
        let ticks = u64::from(block.ts_high) << 32 | u64::from(block.ts_low);
        let known = self.interfaces.get(self.section_start..).unwrap_or_default();
        let time = known.get(block.if_id as usize).filter(|_| ticks != 0).map(|interface| {
            UnixTime::from_nanos(interface.resolution.nanos(ticks) + interface.offset_nanos)
        });
        let described_here = described.get_mut(self.section_start..).unwrap_or_default();
        if let Some(interface) = described_here.get_mut(block.if_id as usize) {
            interface.drops = interface.drops.max(drops(self.order, &block.options));
            interface.ended = time.or(interface.ended);
        }
        Ok(())
    }

    /// A frame with all that can be told of it. `drops` are the frames lost before it, where that
    /// stands outside of the options.
    #[inline]
    fn enhanced(
        &mut self,
        block: &[u8],
        drops: Option<u64>,
        described: &mut [CaptureInterface],
    ) -> Result<Record, Damage> {
        let word = |at| self.order.u32_at(block, at);
        let (interface, ticks_high, ticks_low) = (word(8), word(12), word(16));
        let (len, original_len) = (word(20), word(24));
        let room = block.len() - 4 - ENHANCED_DATA;
        check_frame_len(len, room)?;
        let id = self.find(interface)?;
        let padded = (len as usize).next_multiple_of(4).min(room);
        let options = &block[ENHANCED_DATA + padded..block.len() - 4];
        let options = FrameOptions::read(self.order, options);
        self.count_drops(id, drops.unwrap_or(options.drops), described);
        let interface = &self.interfaces[id];
        let ticks = u64::from(ticks_high) << 32 | u64::from(ticks_low);
        let nanos = interface.resolution.nanos(ticks) + interface.offset_nanos;
        Ok(Record {
            at: ENHANCED_DATA,
            len: len as usize,
            original_len,
            interface: CaptureInterfaceId(id as u32),
            time: Some(UnixTime::from_nanos(nanos)),
            direction: options.direction,
            fcs_len: options.fcs_len.unwrap_or(interface.fcs_len),
            crc_error: options.crc_error,
        })
    }

    /// A frame of the section's first interface, without time, cut to that interface's limit.
    fn simple(&self, block: &[u8]) -> Result<Record, Damage> {
        let packet = read(match self.order {
            ByteOrder::Little => parse_simplepacketblock_le(block),
            ByteOrder::Big => parse_simplepacketblock_be(block),
        })?;
        let id = self.find(0)?;
        let interface = &self.interfaces[id];
        let limit = if interface.snap_len == 0 { u32::MAX } else { interface.snap_len };
        let captured = packet.origlen.min(limit);
        check_frame_len(captured, packet.data.len())?;
        Ok(Record {
            at: SIMPLE_DATA,
            len: captured as usize,
            original_len: packet.origlen,
            interface: CaptureInterfaceId(id as u32),
            time: None,
            direction: FrameDirection::Unknown,
            fcs_len: interface.fcs_len,
            crc_error: false,
        })
    }

    /// The index of an interface which the present section numbers so.
    #[inline]
    fn find(&self, interface: u32) -> Result<usize, Damage> {
        let described = self.interfaces.len() - self.section_start;
        if (interface as usize) < described {
            Ok(self.section_start + interface as usize)
        } else {
            Err(Damage::UnknownInterface { interface, described: described as u32 })
        }
    }

    #[inline]
    fn count_drops(&mut self, id: usize, drops: u64, described: &mut [CaptureInterface]) {
        if drops != 0 {
            let total = &mut self.interfaces[id].drops;
            *total = total.saturating_add(drops);
            if let Some(interface) = described.get_mut(id) {
                // The statistics block at the end counts the same drops once more.
                interface.drops = interface.drops.max(Some(*total));
            }
        }
    }

    /// Brings the whole block to the front of the window, and gives how long it is there. A length
    /// that leaves out the padding, as some writers have it, is put right in place.
    #[inline]
    fn whole(&self, window: &mut Window, what: &'static str, least: u32) -> Result<usize, Damage> {
        let length = self.order.u32_at(window.view(), 4);
        if length < least || length > MAX_BLOCK_LEN {
            return Err(Damage::BlockLength { what, length, least, most: MAX_BLOCK_LEN });
        }
        let len = length.next_multiple_of(4) as usize;
        if !window.fill(len) {
            return Err(cut_off(what, length, window.view().len()));
        }
        let last = self.order.u32_at(window.view(), len - 4);
        if last != length {
            return Err(Damage::LengthsDiffer { first: length, last });
        }
        if length as usize != len {
            self.order.put_u32(window.view_mut(), 4, len as u32);
            self.order.put_u32(window.view_mut(), len - 4, len as u32);
        }
        Ok(len)
    }

    /// Passes over a block of any length.
    fn skip(&self, window: &mut Window) -> Result<(), Damage> {
        const WHAT: &str = "a block";
        let length = self.order.u32_at(window.view(), 4);
        if length < BLOCK_OVERHEAD {
            let (least, most) = (BLOCK_OVERHEAD, u32::MAX);
            return Err(Damage::BlockLength { what: WHAT, length, least, most });
        }
        let before_last = u64::from(length).next_multiple_of(4) - 4;
        let skipped = window.skip(before_last);
        if skipped < before_last || !window.fill(4) {
            return Err(cut_off(WHAT, length, skipped as usize + window.view().len()));
        }
        let last = self.order.u32_at(window.view(), 0);
        if last != length {
            return Err(Damage::LengthsDiffer { first: length, last });
        }
        window.pass(4);
        Ok(())
    }
}

/// What a block is called that is taken as a whole, and the least length it needs, in bytes.
#[inline]
const fn taken_whole(kind: u32) -> Option<(&'static str, u32)> {
    match kind {
        EPB_MAGIC => Some(("an enhanced packet", 32)),
        SPB_MAGIC => Some(("a simple packet", 16)),
        OBSOLETE_PACKET => Some(("an obsolete packet", 32)),
        SHB_MAGIC => Some(SECTION_HEADER),
        IDB_MAGIC => Some(("an interface description", 20)),
        ISB_MAGIC => Some(("interface statistics", 24)),
        _ => None,
    }
}

/// The byte order that a section header tells: that of its own length, too.
fn byte_order(window: &mut Window) -> Result<ByteOrder, Damage> {
    if !window.fill(12) {
        let (what, least) = SECTION_HEADER;
        return Err(cut_off(what, least, window.view().len()));
    }
    match ByteOrder::Big.u32_at(window.view(), 8) {
        BOM_MAGIC => Ok(ByteOrder::Big),
        mark if mark.swap_bytes() == BOM_MAGIC => Ok(ByteOrder::Little),
        mark => Err(Damage::ByteOrder { mark }),
    }
}

/// What the library read. With both lengths of the block and that of the frame in order, nothing is
/// known that it would refuse.
#[inline]
fn read<'b, B>(parsed: IResult<&'b [u8], B, PcapError<&'b [u8]>>) -> Result<B, Damage> {
    parsed.map(|(_, block)| block).map_err(|_| Damage::Unreadable {
        text: "a block is not built as the format says".to_owned(),
    })
}

/// Makes the packet block of drafts before 2011 the enhanced one that took its place, and gives
/// the frames lost before it. They differ in one word: here, 16 bits for the interface, 16 for the
/// drops.
fn modernize(order: ByteOrder, block: &mut [u8]) -> Option<u64> {
    const DROPS_UNKNOWN: u32 = 0xFFFF;
    let word = order.u32_at(block, 8);
    let (interface, drops) = match order {
        ByteOrder::Little => (word & 0xFFFF, word >> 16),
        ByteOrder::Big => (word >> 16, word & 0xFFFF),
    };
    order.put_u32(block, 0, EPB_MAGIC);
    order.put_u32(block, 8, interface);
    (drops != DROPS_UNKNOWN).then_some(drops.into())
}

#[inline]
fn check_frame_len(captured: u32, room: usize) -> Result<(), Damage> {
    let most = (room as u32).min(MAX_FRAME_LEN);
    if captured > most { Err(Damage::FrameLength { captured, most }) } else { Ok(()) }
}

fn cut_off(what: &'static str, expected: u32, present: usize) -> Damage {
    Damage::CutOff { what, expected: u64::from(expected), present: present as u64 }
}
