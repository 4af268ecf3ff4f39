//! The processing unit: executes the datagrams of a frame while it passes.
//!
//! Read first: S1 chapters 2 (frames, commands, working counter) and 3 (frame processing), 14.1
//! (frame errors). What each command does comes from [`Command::effect`]; nothing here allocates.

use linesman_proto::address::LogicalAddress;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{self, SOURCE_MARK, Wrapping};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, FrameType, WKC_LEN};
use linesman_proto::port::Port;
use linesman_proto::register::{self as r, DlControl, EcatEvents, Features, FmmuConfig};
use linesman_proto::time::Instant;

use super::core::{Core, FrameProgress};
use super::esc::Forwarding;
use super::port_event::CountKind;
use super::rx_code::UnitError;
use crate::frame::WireFrame;

/// Bit of a datagram's second length byte: it has come round a ring (S1 3.5).
const CIRCULATED: u8 = 0x40;
/// Bit of the same byte: another datagram follows.
const MORE: u8 = 0x80;

/// The part of a datagram's header that a controller looks at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Header {
    pub(crate) command: Option<Command>,
    pub(crate) adp: u16,
    pub(crate) ado: u16,
    pub(crate) len: usize,
    pub(crate) more: bool,
}

impl Header {
    #[inline]
    pub(crate) fn read(bytes: &[u8; DATAGRAM_HEADER_LEN]) -> Self {
        let [code, _index, p0, p1, o0, o1, l0, l1, _irq0, _irq1] = *bytes;
        Self {
            command: Command::from_code(code),
            adp: u16::from_le_bytes([p0, p1]),
            ado: u16::from_le_bytes([o0, o1]),
            len: usize::from(u16::from_le_bytes([l0, l1]) & 0x07FF),
            more: l1 & MORE != 0,
        }
    }

    pub(crate) fn logical(&self) -> LogicalAddress {
        LogicalAddress(u32::from(self.adp) | u32::from(self.ado) << 16)
    }
}

impl Core {
    /// Executes the datagrams of a frame whose first bit enters at `when`.
    pub(super) fn process(&mut self, when: Instant, frame: &mut WireFrame) -> Forwarding {
        let destroys_foreign = DlControl(self.memory.u32(&r::DL_CONTROL)).destroys_foreign_frames();
        let Some((wrapping, header_at)) = ethernet::locate(&frame.bytes) else {
            return self.pass_foreign(destroys_foreign, frame);
        };
        if destroys_foreign {
            frame.bytes[6] |= SOURCE_MARK;
        }
        if wrapping == Wrapping::Udp {
            // The data change: a checksum of 0 says that there is none.
            frame.bytes[header_at - 2..header_at].fill(0);
        }
        let first_at = header_at + ETHERCAT_HEADER_LEN;
        let kind = frame.bytes.get(header_at + 1).map(|byte| FrameType::from_bits(byte >> 4));
        match kind {
            Some(FrameType::Datagrams) => {}
            Some(FrameType::NetworkVariables | FrameType::Mailbox | FrameType::Other(_)) => {
                return Forwarding::Forward;
            }
            None => {
                self.begin(when, frame.number);
                return self.finish(when, frame, false);
            }
        }
        let closes_ring = self.ports.loops.port_zero_closes_ring();
        if closes_ring && frame.bytes.get(first_at + 7).is_some_and(|byte| byte & CIRCULATED != 0) {
            self.count(Port::A, CountKind::ProcessingUnitError, when);
            self.note_unit_error(Port::A, UnitError::Circulating);
            return Forwarding::Destroy;
        }
        self.begin(when, frame.number);
        let whole = self.walk(&mut frame.bytes[first_at..], closes_ring);
        self.finish(when, frame, whole)
    }

    /// A frame with datagrams begins to pass.
    #[inline]
    pub(super) fn begin(&mut self, when: Instant, number: u64) {
        self.passing = FrameProgress { began: when, number, ..FrameProgress::default() };
    }

    /// A frame without EtherCAT in it, or a piece of one.
    fn pass_foreign(&mut self, destroys: bool, frame: &WireFrame) -> Forwarding {
        if !destroys {
            return Forwarding::Forward;
        }
        // Of a damaged frame nobody can say what it was; the wire has counted it.
        if frame.damage.is_intact() {
            self.count(Port::A, CountKind::ProcessingUnitError, Instant::ZERO);
            self.note_unit_error(Port::A, UnitError::Foreign);
        }
        Forwarding::Destroy
    }

    /// Walks the datagrams; false when the frame ends before they do.
    fn walk(&mut self, bytes: &mut [u8], closes_ring: bool) -> bool {
        let mut rest = bytes;
        loop {
            let Some((header, body)) = rest.split_first_chunk_mut::<DATAGRAM_HEADER_LEN>() else {
                return false;
            };
            let read = Header::read(header);
            if closes_ring {
                header[7] |= CIRCULATED;
            }
            if self.irq != 0 {
                let irq = u16::from_le_bytes([header[8], header[9]]) | self.irq;
                header[8..10].copy_from_slice(&irq.to_le_bytes());
            }
            let whole = body.len() >= read.len + WKC_LEN;
            let len = read.len.min(body.len());
            let (data, behind) = body.split_at_mut(len);
            if let Some(command) = read.command {
                if command.increments_position() {
                    header[2..4].copy_from_slice(&read.adp.wrapping_add(1).to_le_bytes());
                }
                let increment = self.execute(command, &read, data);
                if let Some(counter) = behind.first_chunk_mut::<WKC_LEN>()
                    && increment != 0
                {
                    *counter = u16::from_le_bytes(*counter).wrapping_add(increment).to_le_bytes();
                }
            }
            if !whole {
                return false;
            }
            if !read.more {
                return true;
            }
            rest = &mut behind[WKC_LEN..];
        }
    }

    /// Does what a command asks of this controller and says what to add to the working counter.
    #[inline]
    pub(super) fn execute(&mut self, command: Command, header: &Header, data: &mut [u8]) -> u16 {
        let addressed = match command.addressing() {
            Addressing::None => return 0,
            Addressing::Position => header.adp == 0,
            Addressing::Station => self.is_station(header.adp),
            Addressing::Broadcast => true,
            Addressing::Logical => {
                let start = header.logical();
                if !self.fmmus.concerns(start, data.len()) {
                    return 0;
                }
                return self.execute_logical(command, start, data);
            }
        };
        let effect = command.effect();
        if !addressed && !effect.multiple_write {
            return 0;
        }
        if !self.supports(command) {
            return 0;
        }
        let (read, write) = if effect.multiple_write {
            if addressed {
                (self.read(header.ado, data, false), false)
            } else {
                (false, self.write(header.ado, data, false))
            }
        } else if effect.reads && effect.writes {
            self.read_write(header.ado, data, effect.ors)
        } else if effect.reads {
            (self.read(header.ado, data, effect.ors), false)
        } else {
            let latches = matches!(command, Command::Bwr | Command::Fpwr);
            (false, self.write(header.ado, data, latches))
        };
        command.increment(read, write)
    }

    fn is_station(&self, adp: u16) -> bool {
        adp == self.memory.u16(&r::STATION_ADDRESS)
            || (adp == self.memory.u16(&r::STATION_ALIAS)
                && DlControl(self.memory.u32(&r::DL_CONTROL)).alias_enabled())
    }

    /// Some controllers leave out commands that read and write.
    fn supports(&self, command: Command) -> bool {
        let features = Features(self.hardware.features);
        match command {
            Command::Lrw => !features.no_lrw(),
            Command::Aprw | Command::Fprw | Command::Brw => !features.no_read_write(),
            Command::Nop
            | Command::Aprd
            | Command::Apwr
            | Command::Fprd
            | Command::Fpwr
            | Command::Brd
            | Command::Bwr
            | Command::Lrd
            | Command::Lwr
            | Command::Armw
            | Command::Frmw => true,
        }
    }

    /// Reads into the data what was in memory, and takes for memory what was in the data. The write
    /// address is off by what 0x0108 says.
    fn read_write(&mut self, ado: u16, data: &mut [u8], ors: bool) -> (bool, bool) {
        let mut incoming = std::mem::take(&mut self.scratch);
        incoming.clear();
        incoming.extend_from_slice(data);
        let read = self.read(ado, data, ors);
        let offset = self.memory.u16(&r::PHYSICAL_READ_WRITE_OFFSET);
        let write = self.write(ado.wrapping_add(offset), &incoming, false);
        self.scratch = incoming;
        (read, write)
    }

    /// LRD, LWR and LRW through the FMMUs. Reads come before writes; what is written is what came
    /// in.
    fn execute_logical(&mut self, command: Command, start: LogicalAddress, data: &mut [u8]) -> u16 {
        if !self.supports(command) {
            return 0;
        }
        let effect = command.effect();
        let (mut read, mut write) = (false, false);
        let keeps_incoming = effect.reads && effect.writes && self.fmmus.crossed();
        let mut incoming = std::mem::take(&mut self.scratch);
        if keeps_incoming {
            incoming.clear();
            incoming.extend_from_slice(data);
        }
        if effect.reads {
            for index in 0..self.fmmus.count() {
                if self.fmmus.mapping(index).config.reads {
                    read |= self.read_mapped(index, start, data);
                }
            }
        }
        if effect.writes {
            let data = if keeps_incoming { &incoming[..] } else { data };
            for index in 0..self.fmmus.count() {
                if self.fmmus.mapping(index).config.writes {
                    write |= self.write_mapped(index, start, data);
                }
            }
        }
        self.scratch = incoming;
        command.increment(read, write)
    }

    fn read_mapped(&mut self, index: usize, start: LogicalAddress, data: &mut [u8]) -> bool {
        let mapping = *self.fmmus.mapping(index);
        let config = mapping.config;
        let Some(overlap) = config.overlap(start, data.len() as u16) else { return false };
        let from = usize::from(overlap.datagram_offset);
        if mapping.simple {
            let Some(physical) = physical(&config, overlap.fmmu_offset) else { return false };
            return self.read(physical, &mut data[from..from + usize::from(overlap.length)], false);
        }
        let mut any = false;
        for part in self.fmmus.bytes(index, overlap) {
            if self.fmmus.bits(index, part, start, true).next().is_none() {
                continue;
            }
            let mut byte = [0];
            if self.read(part.byte, &mut byte, false) {
                any = true;
                for (bit, offset, logical_bit) in self.fmmus.bits(index, part, start, true) {
                    let value = byte[0] >> bit & 1;
                    data[offset] = data[offset] & !(1 << logical_bit) | value << logical_bit;
                }
            }
        }
        any
    }

    fn write_mapped(&mut self, index: usize, start: LogicalAddress, data: &[u8]) -> bool {
        let mapping = *self.fmmus.mapping(index);
        let config = mapping.config;
        let Some(overlap) = config.overlap(start, data.len() as u16) else { return false };
        let from = usize::from(overlap.datagram_offset);
        if mapping.simple {
            let Some(physical) = physical(&config, overlap.fmmu_offset) else { return false };
            let data = &data[from..from + usize::from(overlap.length)];
            return self.write(physical, data, false);
        }
        let mut any = false;
        for part in self.fmmus.bytes(index, overlap) {
            // Bits that are not mapped stay as they are in the digital outputs; elsewhere the data
            // sheet calls them undefined, and they become 0 (S2 2.13, S1 7).
            let mut byte = self.outputs_at(part.byte);
            let mut mapped = false;
            for (bit, offset, logical_bit) in self.fmmus.bits(index, part, start, false) {
                mapped = true;
                byte = byte & !(1 << bit) | (data[offset] >> logical_bit & 1) << bit;
            }
            any |= mapped && self.write(part.byte, &[byte], false);
        }
        any
    }

    /// The digital output byte at an address, with what this frame has already written; 0 elsewhere.
    fn outputs_at(&self, address: u16) -> u8 {
        let address = usize::from(address);
        let outputs = usize::from(r::DIGITAL_OUTPUT.address.0);
        if !(outputs..usize::from(r::DIGITAL_OUTPUT.end().0)).contains(&address) {
            return 0;
        }
        let written = self
            .shadow
            .iter()
            .filter_map(|(write, data)| data.get(address.checked_sub(write.address)?).copied());
        written.last().unwrap_or(self.memory.bytes()[address])
    }

    /// The frame has passed. If it was good, what it wrote and touched takes effect at its end.
    fn finish(&mut self, when: Instant, frame: &mut WireFrame, whole: bool) -> Forwarding {
        let intact = frame.damage.is_intact();
        if intact && !whole {
            // The unit finds out that the frame ends too early, and marks it as bad (S1 14.1).
            self.count(Port::A, CountKind::ProcessingUnitError, when);
            self.note_unit_error(Port::A, UnitError::Short);
            frame.damage.fcs_bad = true;
            frame.damage.marked = true;
        }
        self.settle(when + frame.duration(), intact && whole);
        Forwarding::Forward
    }

    /// The frame that was passing ended at `end`: what it did counts if it was good.
    pub(super) fn settle(&mut self, end: Instant, good: bool) {
        let passing = self.passing;
        self.rescheduled |= good && (passing.touched != 0 || !self.shadow.is_empty());
        if passing.touched != 0 {
            self.settle_sync_managers(passing.touched, good, end);
        }
        if !good {
            self.shadow.clear();
            return;
        }
        if passing.read_dl_status {
            self.clear_ecat_events(EcatEvents::DL_STATUS);
        }
        if passing.read_al_status {
            self.clear_ecat_events(EcatEvents::AL_STATUS);
        }
        if passing.read_latches != 0 {
            self.end_latch_reads(passing.read_latches);
        }
        if !self.shadow.is_empty() {
            self.commit(end);
        }
    }

    fn settle_sync_managers(&mut self, touched: u16, good: bool, end: Instant) {
        let (mut written, mut watchdog) = (false, false);
        let mut left = touched;
        while left != 0 {
            let index = left.trailing_zeros() as usize;
            left &= left - 1;
            let settled = self.sync_managers.settle(index, good, &mut self.memory);
            if good {
                written |= settled.written;
                watchdog |= settled.watchdog;
                self.refresh_sync_manager_events(index, end);
            }
        }
        if watchdog {
            self.trigger_process_data_watchdog(end);
        }
        if written {
            self.call_firmware(end);
        }
    }
}

/// Where a whole byte of an FMMU lies; `None` behind the end of the address space.
fn physical(config: &FmmuConfig, offset: u16) -> Option<u16> {
    config.physical_start.0.checked_add(offset)
}
