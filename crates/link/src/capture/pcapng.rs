//! The pcapng format: blocks, of which some carry frames.
//!
//! Reference: draft-ietf-opsawg-pcapng, section 3 (how blocks lie) and 4 (each kind). Blocks that
//! carry no frames are passed over unread, however long; a section starts the numbering of its
//! interfaces anew and may change the byte order.

use super::byte_order::ByteOrder;
use super::end::Damage;
use super::frame::{
    CaptureInterface, CaptureInterfaceId, CaptureSection, FrameDirection, TimeResolution,
};
use super::link_type::LinkType;
use super::pcapng_options::{FrameOptions, InterfaceOptions, Options};
use super::reader::{MAX_FRAME_LEN, Record};
use super::window::Window;
use crate::unix_time::UnixTime;

/// Types of blocks (section 4, and the list of reserved types in section 11.1).
pub(super) const SECTION: u32 = 0x0A0D_0D0A;
pub(super) const INTERFACE: u32 = 1;
const OBSOLETE_PACKET: u32 = 2;
const SIMPLE_PACKET: u32 = 3;
pub(super) const STATISTICS: u32 = 5;
pub(super) const ENHANCED_PACKET: u32 = 6;
const JOURNAL_ENTRY: u32 = 9;
const CUSTOM: [u32; 2] = [0x0000_0BAD, 0x4000_0BAD];

/// What stands behind the length of a section header, to tell the byte order.
pub(super) const BYTE_ORDER_MARK: u32 = 0x1A2B_3C4D;
/// Longest block that is taken as a whole, in bytes; the limit of Wireshark too.
const MAX_BLOCK_LEN: u32 = 16 * 1024 * 1024;
/// Type, and length at the start and the end: what every block has, in bytes.
const BLOCK_OVERHEAD: u32 = 12;
/// A hostile file must not fill memory with interfaces.
const MAX_INTERFACES: u32 = 4096;

/// The state of reading a pcapng file.
pub(super) struct Pcapng {
    order: ByteOrder,
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
}

impl Pcapng {
    /// Reads the first section header.
    pub(super) fn open(window: &mut Window) -> Result<(Self, CaptureSection), Damage> {
        let mut file = Self { order: ByteOrder::Little, section_start: 0, interfaces: Vec::new() };
        let section = file.section(window)?;
        Ok((file, section))
    }

    /// The next frame or the like; `None` at the end. Interfaces that are met on the way are
    /// added to `described`.
    #[inline]
    pub(super) fn next(
        &mut self,
        window: &mut Window,
        described: &mut Vec<CaptureInterface>,
    ) -> Result<Option<Item>, Damage> {
        loop {
            if !window.fill(8) {
                return match window.view().len() {
                    0 => Ok(None),
                    present => Err(cut_off("a block", BLOCK_OVERHEAD, present)),
                };
            }
            let header = &window.view()[..8];
            let (kind, length) = (self.order.u32_at(header, 0), self.order.u32_at(header, 4));
            match kind {
                ENHANCED_PACKET => {
                    let record = self.enhanced(window, length, described)?;
                    return Ok(Some(Item::Frame(record)));
                }
                SIMPLE_PACKET => {
                    let record = self.simple(window, length)?;
                    return Ok(Some(Item::Frame(record)));
                }
                OBSOLETE_PACKET => {
                    let record = self.obsolete(window, length, described)?;
                    return Ok(Some(Item::Frame(record)));
                }
                SECTION => {
                    self.section(window)?;
                }
                INTERFACE => self.interface(window, length, described)?,
                STATISTICS => self.statistics(window, length, described)?,
                _ => {
                    skip(self.order, window, length)?;
                    if kind == JOURNAL_ENTRY || CUSTOM.contains(&kind) {
                        return Ok(Some(Item::Numbered));
                    }
                }
            }
        }
    }

    fn section(&mut self, window: &mut Window) -> Result<CaptureSection, Damage> {
        const WHAT: &str = "a section header";
        const LEAST: u32 = 28;
        if !window.fill(12) {
            return Err(cut_off(WHAT, LEAST, window.view().len()));
        }
        let header = &window.view()[..12];
        let mark = [header[8], header[9], header[10], header[11]];
        let orders = [ByteOrder::Little, ByteOrder::Big];
        let Some(order) = orders.into_iter().find(|order| order.u32(mark) == BYTE_ORDER_MARK)
        else {
            return Err(Damage::ByteOrder { mark: u32::from_be_bytes(mark) });
        };
        let length = order.u32_at(header, 4);
        let block = whole(order, window, WHAT, length, LEAST)?;
        let (major, minor) = (order.u16_at(block, 12), order.u16_at(block, 14));
        if major != 1 {
            return Err(Damage::Version { major, minor });
        }
        let mut section = CaptureSection::default();
        for option in Options::new(order, &block[24..block.len() - 4]) {
            match option.code {
                2 => section.hardware = option.text(),
                3 => section.operating_system = option.text(),
                4 => section.application = option.text(),
                _ => {}
            }
        }
        let len = block.len();
        window.pass(len);
        self.order = order;
        self.section_start = self.interfaces.len();
        Ok(section)
    }

    fn interface(
        &mut self,
        window: &mut Window,
        length: u32,
        described: &mut Vec<CaptureInterface>,
    ) -> Result<(), Damage> {
        if self.interfaces.len() >= MAX_INTERFACES as usize {
            return Err(Damage::TooManyInterfaces { most: MAX_INTERFACES });
        }
        let order = self.order;
        let block = whole(order, window, "an interface description", length, 20)?;
        let link_type = LinkType::from_number(order.u16_at(block, 8));
        let snap_len = order.u32_at(block, 12);
        let options = InterfaceOptions::read(Options::new(order, &block[16..block.len() - 4]));
        let len = block.len();
        window.pass(len);
        self.interfaces.push(Interface {
            resolution: options.resolution,
            offset_nanos: i128::from(options.offset_s) * 1_000_000_000,
            fcs_len: options.fcs_len,
            snap_len,
            drops: 0,
        });
        described.push(CaptureInterface {
            name: options.name,
            description: options.description,
            link_type,
            snap_len: (snap_len != 0).then_some(snap_len),
            resolution: options.resolution,
            drops: None,
        });
        Ok(())
    }

    /// Interface statistics: drops of the card and of the operating system, up to this block.
    fn statistics(
        &mut self,
        window: &mut Window,
        length: u32,
        described: &mut [CaptureInterface],
    ) -> Result<(), Damage> {
        let order = self.order;
        let block = whole(order, window, "interface statistics", length, 24)?;
        let interface = order.u32_at(block, 8);
        let mut drops: Option<u64> = None;
        for option in Options::new(order, &block[20..block.len() - 4]) {
            if let (5 | 7, Some(count)) = (option.code, option.u64()) {
                drops = Some(drops.unwrap_or(0).saturating_add(count));
            }
        }
        let len = block.len();
        window.pass(len);
        let described_here = described.get_mut(self.section_start..).unwrap_or_default();
        if let (Some(drops), Some(interface)) = (drops, described_here.get_mut(interface as usize))
        {
            interface.drops = interface.drops.max(Some(drops));
        }
        Ok(())
    }

    #[inline]
    fn enhanced(
        &mut self,
        window: &mut Window,
        length: u32,
        described: &mut [CaptureInterface],
    ) -> Result<Record, Damage> {
        let order = self.order;
        let block = whole(order, window, "an enhanced packet", length, 32)?;
        let interface = order.u32_at(block, 8);
        let packet = Packet::read(order, block)?;
        let id = self.find(interface)?;
        self.count_drops(id, packet.options.drops, described);
        Ok(self.record(window, id, &packet))
    }

    /// The packet block of drafts before 2011: as the enhanced one, with 16 bits for the interface
    /// and 16 for the drops before it.
    fn obsolete(
        &mut self,
        window: &mut Window,
        length: u32,
        described: &mut [CaptureInterface],
    ) -> Result<Record, Damage> {
        const DROPS_UNKNOWN: u16 = 0xFFFF;
        let order = self.order;
        let block = whole(order, window, "an obsolete packet", length, 32)?;
        let (interface, drops) = (order.u16_at(block, 8), order.u16_at(block, 10));
        let packet = Packet::read(order, block)?;
        let id = self.find(interface.into())?;
        if drops != DROPS_UNKNOWN {
            self.count_drops(id, drops.into(), described);
        }
        Ok(self.record(window, id, &packet))
    }

    /// A frame of the section's first interface, without time, cut to that interface's limit.
    fn simple(&mut self, window: &mut Window, length: u32) -> Result<Record, Damage> {
        let order = self.order;
        let block = whole(order, window, "a simple packet", length, 16)?;
        let original_len = order.u32_at(block, 8);
        let block_len = block.len();
        let id = self.find(0)?;
        let interface = &self.interfaces[id];
        let limit = if interface.snap_len == 0 { u32::MAX } else { interface.snap_len };
        let captured = original_len.min(limit);
        let most = (block_len as u32 - 16).min(MAX_FRAME_LEN);
        if captured > most {
            return Err(Damage::FrameLength { captured, most });
        }
        Ok(Record {
            at: window.pass(block_len) + 12,
            len: captured as usize,
            original_len,
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

    #[inline]
    fn record(&self, window: &mut Window, id: usize, packet: &Packet) -> Record {
        let interface = &self.interfaces[id];
        let nanos = interface.resolution.nanos(packet.ticks) + interface.offset_nanos;
        Record {
            at: window.pass(packet.block_len) + PACKET_DATA,
            len: packet.captured as usize,
            original_len: packet.original_len,
            interface: CaptureInterfaceId(id as u32),
            time: Some(UnixTime::from_nanos(nanos)),
            direction: packet.options.direction,
            fcs_len: packet.options.fcs_len.unwrap_or(interface.fcs_len),
            crc_error: packet.options.crc_error,
        }
    }
}

/// Where in an enhanced, or obsolete, packet block the frame begins.
const PACKET_DATA: usize = 28;

/// What enhanced and obsolete packet blocks have in common.
struct Packet {
    ticks: u64,
    captured: u32,
    original_len: u32,
    options: FrameOptions,
    block_len: usize,
}

impl Packet {
    #[inline]
    fn read(order: ByteOrder, block: &[u8]) -> Result<Self, Damage> {
        let [high, low, captured, original_len] =
            [12, 16, 20, 24].map(|at| order.u32_at(block, at));
        let end = block.len() - 4;
        let most = ((end - PACKET_DATA) as u32).min(MAX_FRAME_LEN);
        if captured > most {
            return Err(Damage::FrameLength { captured, most });
        }
        // The block's length is a multiple of four, so the padded frame ends in it too.
        let options = PACKET_DATA + (captured as usize).next_multiple_of(4);
        Ok(Self {
            ticks: u64::from(high) << 32 | u64::from(low),
            captured,
            original_len,
            options: FrameOptions::read(Options::new(order, &block[options..end])),
            block_len: block.len(),
        })
    }
}

/// The whole block in front of the window, padded to a multiple of four as some writers do not say
/// in its length. The window stays where it is, so that a damage is reported at the block's start.
#[inline]
fn whole<'w>(
    order: ByteOrder,
    window: &'w mut Window,
    what: &'static str,
    length: u32,
    least: u32,
) -> Result<&'w [u8], Damage> {
    if length < least || length > MAX_BLOCK_LEN {
        return Err(Damage::BlockLength { what, length, least, most: MAX_BLOCK_LEN });
    }
    let len = length.next_multiple_of(4) as usize;
    if !window.fill(len) {
        return Err(cut_off(what, length, window.view().len()));
    }
    let block = &window.view()[..len];
    let last = order.u32_at(block, len - 4);
    if last != length {
        return Err(Damage::LengthsDiffer { first: length, last });
    }
    Ok(block)
}

/// Passes over a block of any length.
fn skip(order: ByteOrder, window: &mut Window, length: u32) -> Result<(), Damage> {
    const WHAT: &str = "a block";
    if length < BLOCK_OVERHEAD {
        let (least, most) = (BLOCK_OVERHEAD, u32::MAX);
        return Err(Damage::BlockLength { what: WHAT, length, least, most });
    }
    let start = window.offset();
    let before_last = u64::from(length).next_multiple_of(4) - 4;
    let skipped = window.skip(before_last);
    if skipped < before_last || !window.fill(4) {
        let present = skipped as usize + window.view().len();
        window.end_at(start);
        return Err(cut_off(WHAT, length, present));
    }
    let last = order.u32_at(window.view(), 0);
    if last != length {
        window.end_at(start);
        return Err(Damage::LengthsDiffer { first: length, last });
    }
    window.pass(4);
    Ok(())
}

fn cut_off(what: &'static str, expected: u32, present: usize) -> Damage {
    Damage::CutOff { what, expected: u64::from(expected), present: present as u64 }
}
