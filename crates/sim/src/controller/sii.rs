//! The EEPROM with the SII, and the unit that reads, writes and loads it.
//!
//! Read first: S1 chapter 11 (SII EEPROM), S2 2.11; times from the ET1100 data sheet, section III,
//! table "SII EEPROM timing characteristics" (an EEPROM of up to 16 Kbit; larger ones take 60 µs
//! more for their second address byte).

use std::collections::VecDeque;

use linesman_proto::register::{self as r, ControllerType, SiiCommand, SiiControl};
use linesman_proto::time::{Instant, Span};

use super::implemented;
use super::memory::Memory;
use crate::hardware::Hardware;

/// From power-on to the first access to the EEPROM.
pub const STARTUP_DELAY: Span = Span::ms(168);
/// A read of four words.
pub const READ_TIME: Span = Span::us(680);
/// A read of two words, in controllers that read no more at once: 36 clocks of 6.72 µs less.
const SHORT_READ_TIME: Span = Span::us(440);
/// A read of the eight words of the configuration area.
pub const LOAD_TIME: Span = Span::us(1_160);
/// A write of one word, as seen by the controller.
pub const WRITE_TIME: Span = Span::us(250);
/// How long the EEPROM itself is busy behind a write: it then acknowledges nothing. Data sheets of
/// 24Cxx parts say 2 ms typically and 5 ms at most; MainDevices that work with real ones try again
/// for no more than 4 ms.
pub const PROGRAMMING_TIME: Span = Span::ms(2);
/// Until it is clear that the EEPROM does not acknowledge: a start condition and a byte.
const NO_ANSWER_TIME: Span = Span::us(70);
/// More for the second address byte.
const SECOND_ADDRESS_BYTE: Span = Span::us(60);
/// Bit 4 of the status, where a controller has it.
const FIRST_OWNER: u16 = 1 << 4;
/// Largest EEPROM with one address byte, in bytes.
const SMALL: usize = 2_048;
/// Largest EEPROM there is: 4 Mbit.
const LARGEST: usize = 512 * 1024;
/// The checksum of a configuration area that is not to be checked: a help for developers.
const UNCHECKED: u16 = 0x88A4;

/// The EEPROM and what the controller does with it.
#[derive(Clone, Debug)]
pub(super) struct Sii {
    image: Vec<u8>,
    capacity: usize,
    reads_eight: bool,
    takes_a5: bool,
    /// The small controller shows bit 4 of its status until it is in SAFEOP with the SII offered to
    /// the PDI: so recordings of real terminals have it; the data sheet calls the bit reserved.
    marks_first_owner: bool,
    running: Option<RunningOperation>,
    programming_until: Instant,
    /// Write enable was given in the frame that is ending.
    write_enabled: bool,
    /// Alias and link detection are taken over at the first load only.
    loaded_once: bool,
    /// The first generation takes the alias over at each load (S2 2.2.2).
    alias_each_load: bool,
    /// The SubDevice's processor plays the EEPROM.
    pub(super) emulated: bool,
    programming_time: Span,
    /// How long the next commands take, where that is known.
    expected: VecDeque<Span>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct RunningOperation {
    done_at: Instant,
    operation: EepromOperation,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum EepromOperation {
    Load { retries: u8 },
    Read { word: u32 },
    Write { word: u32, value: u16 },
    Unanswered,
}

/// What the end of an operation means to the rest of the controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Outcome {
    /// Nothing but the SII's own registers changed, or a load is tried again.
    None,
    /// The configuration area was loaded.
    Loaded,
    /// It could not be loaded.
    NotLoaded,
}

impl Sii {
    pub(super) fn new(image: Vec<u8>, hardware: &Hardware) -> Self {
        let capacity = capacity(&image);
        // ET1100 and ET1200 bring four words at once, the other types two (S2 2.11.3).
        let reads_eight = matches!(
            ControllerType(hardware.controller_type),
            ControllerType::ET1100 | ControllerType::ET1200
        );
        Self {
            image,
            capacity,
            reads_eight,
            takes_a5: implemented::has_configuration_a5(hardware),
            marks_first_owner: ControllerType(hardware.controller_type) == ControllerType::ET1200,
            running: None,
            programming_until: Instant::ZERO,
            write_enabled: false,
            loaded_once: false,
            alias_each_load: ControllerType(hardware.controller_type) == ControllerType::ESC20,
            emulated: false,
            programming_time: PROGRAMMING_TIME,
            expected: VecDeque::new(),
        }
    }

    pub(super) fn image(&self) -> &[u8] {
        &self.image
    }

    /// From now on the SubDevice's processor plays the EEPROM, or does not.
    pub(super) fn emulate(&mut self, emulated: bool) {
        self.emulated = emulated;
    }

    /// How long the EEPROM is busy behind a write.
    pub(super) fn set_programming_time(&mut self, time: Span) {
        self.programming_time = time;
    }

    /// The device exchanges process data while the SII is offered to the PDI.
    pub(super) fn forget_first_owner(&self, memory: &mut Memory) {
        if self.marks_first_owner && memory.u8(&r::SII_ACCESS_ECAT) & 1 != 0 {
            put(SiiControl(read(memory).0 & !FIRST_OWNER), memory);
        }
    }

    /// The next commands take these times.
    pub(super) fn expect(&mut self, times: impl IntoIterator<Item = Span>) {
        self.expected.extend(times);
    }

    /// The supply came: the configuration area will be loaded.
    pub(super) fn power_on(&mut self, at: Instant, memory: &mut Memory) {
        self.loaded_once = false;
        self.write_enabled = false;
        let control = SiiControl::default()
            .with_reads_eight_bytes(self.reads_eight)
            .with_two_address_bytes(self.capacity > SMALL)
            .with_emulated(self.emulated)
            .with_eeprom_missing(self.image.is_empty())
            .with_not_loaded(true);
        let mark = if self.marks_first_owner { FIRST_OWNER } else { 0 };
        put(SiiControl(control.0 | mark), memory);
        self.run(
            at + STARTUP_DELAY,
            self.load_time(),
            EepromOperation::Load { retries: 1 },
            memory,
        );
    }

    pub(super) fn power_off(&mut self) {
        self.running = None;
    }

    /// When the running operation ends.
    pub(super) fn done_at(&self) -> Option<Instant> {
        self.running.map(|running| running.done_at)
    }

    /// Whether the EtherCAT side may write to the interface now.
    pub(super) fn is_free(&self, memory: &Memory) -> bool {
        let to_ecat = memory.u8(&r::SII_ACCESS_ECAT) & 1 == 0;
        to_ecat && memory.u8(&r::SII_ACCESS_PDI) & 1 == 0 && !read(memory).busy()
    }

    /// 0x0500 was written.
    pub(super) fn assign(&mut self, value: u8, memory: &mut Memory) {
        memory.set_u8(&r::SII_ACCESS_ECAT, value & 0b11);
        if value & 0b10 != 0 {
            memory.set_u8(&r::SII_ACCESS_PDI, 0);
        }
    }

    /// Bytes of 0x0502 were written, `low` or `high` or both, in a frame that ended at `at`.
    pub(super) fn control(
        &mut self,
        low: Option<u8>,
        high: Option<u8>,
        at: Instant,
        memory: &mut Memory,
    ) {
        if let Some(low) = low {
            self.write_enabled = SiiControl(u16::from(low)).write_enable();
        }
        let Some(high) = high else { return };
        if read(memory).busy() {
            return;
        }
        let control = read(memory).with_acknowledge_error(false).with_write_enable_error(false);
        put(control, memory);
        let word = memory.u32(&r::SII_ADDRESS);
        let value = memory.u64(&r::SII_DATA) as u16;
        match SiiCommand::from_bits(high) {
            SiiCommand::None => {}
            SiiCommand::Read => {
                let time = self.expected.pop_front().unwrap_or_else(|| self.read_time());
                self.run(at, time, EepromOperation::Read { word }, memory);
            }
            SiiCommand::Write if self.write_enabled => {
                let time = WRITE_TIME + self.second_address_byte();
                let time = self.expected.pop_front().unwrap_or(time);
                self.run(at, time, EepromOperation::Write { word, value }, memory);
            }
            SiiCommand::Write => put(control.with_write_enable_error(true), memory),
            SiiCommand::Reload => {
                let time = self.expected.pop_front().unwrap_or_else(|| self.load_time());
                self.run(at, time, EepromOperation::Load { retries: 1 }, memory);
            }
            SiiCommand::Reserved(_) => put(control.with_acknowledge_error(true), memory),
        }
    }

    /// The frame has ended: write enable was for it alone.
    pub(super) fn end_frame(&mut self) {
        self.write_enabled = false;
    }

    /// The running operation ends.
    pub(super) fn finish(&mut self, memory: &mut Memory) -> Outcome {
        let Some(running) = self.running.take() else { return Outcome::None };
        let control = read(memory).with_busy(false).with_command(SiiCommand::None);
        put(control, memory);
        match running.operation {
            EepromOperation::Load { retries } => self.finish_load(retries, running.done_at, memory),
            EepromOperation::Read { word } => {
                let len = control.read_len();
                let mut data = [0; 8];
                for (offset, byte) in data[..len].iter_mut().enumerate() {
                    *byte = self.byte(word as usize * 2 + offset);
                }
                memory.set_u64(&r::SII_DATA, u64::from_le_bytes(data));
                Outcome::None
            }
            EepromOperation::Write { word, value } => {
                self.write(word, value);
                self.programming_until = running.done_at + self.programming_time;
                Outcome::None
            }
            EepromOperation::Unanswered => {
                put(control.with_acknowledge_error(true), memory);
                Outcome::None
            }
        }
    }

    fn run(&mut self, from: Instant, time: Span, operation: EepromOperation, memory: &mut Memory) {
        let command = match operation {
            EepromOperation::Load { .. } => SiiCommand::Reload,
            EepromOperation::Read { .. } => SiiCommand::Read,
            EepromOperation::Write { .. } => SiiCommand::Write,
            EepromOperation::Unanswered => SiiCommand::None,
        };
        if self.emulated && !matches!(operation, EepromOperation::Load { .. } if !self.loaded_once)
        {
            // The processor hears of it and answers; until then the interface is busy.
            put(read(memory).with_busy(true).with_command(command), memory);
            return;
        }
        let answers = !self.image.is_empty() && from >= self.programming_until;
        let running = match operation {
            // A load has its own way to fail.
            EepromOperation::Load { .. } => RunningOperation { done_at: from + time, operation },
            _ if answers => RunningOperation { done_at: from + time, operation },
            EepromOperation::Read { .. }
            | EepromOperation::Write { .. }
            | EepromOperation::Unanswered => RunningOperation {
                done_at: from + NO_ANSWER_TIME,
                operation: EepromOperation::Unanswered,
            },
        };
        self.running = Some(running);
        put(read(memory).with_busy(true).with_command(command), memory);
    }

    fn finish_load(&mut self, retries: u8, at: Instant, memory: &mut Memory) -> Outcome {
        let answers = !self.image.is_empty() && at >= self.programming_until;
        let area: [u8; 16] = std::array::from_fn(|index| self.byte(index));
        let stored = u16::from_le_bytes([area[14], area[15]]);
        let fits = stored == UNCHECKED || area[14] == checksum(&area[..14]);
        if (!answers || !fits) && retries > 0 {
            self.run(at, self.load_time(), EepromOperation::Load { retries: retries - 1 }, memory);
            return Outcome::None;
        }
        let control =
            read(memory).with_checksum_error(answers && !fits).with_acknowledge_error(!answers);
        if !answers || !fits {
            // What was loaded before stays, and so does the word that it was (S1 11.2.1).
            put(control, memory);
            return Outcome::NotLoaded;
        }
        put(control.with_not_loaded(false), memory);
        self.take_over(&area, memory);
        Outcome::Loaded
    }

    /// The configuration area goes to its registers (S1 table 37).
    fn take_over(&mut self, area: &[u8; 16], memory: &mut Memory) {
        /// Bits of 0x0141 for enhanced link detection.
        const LINK_DETECTION: u8 = 0b1111_0010;
        memory.set_u8(&r::PDI_CONTROL, area[0]);
        let kept = if self.loaded_once { LINK_DETECTION } else { 0 };
        let before = memory.u8(&r::ESC_CONFIGURATION_A0);
        memory.set_u8(&r::ESC_CONFIGURATION_A0, area[1] & !kept | before & kept);
        memory.set_u8(&r::PDI_CONFIGURATION, area[2]);
        memory.set_u8(&r::SYNC_LATCH_CONFIGURATION, area[3]);
        memory.set_u16(&r::SYNC_PULSE_LENGTH, u16::from_le_bytes([area[4], area[5]]));
        memory.set_u16(&r::PDI_CONFIGURATION_EXTENDED, u16::from_le_bytes([area[6], area[7]]));
        // With emulation the alias comes from the processor (S1 11.2.4).
        if (!self.loaded_once || self.alias_each_load) && !self.emulated {
            memory.set_u16(&r::STATION_ALIAS, u16::from_le_bytes([area[8], area[9]]));
        }
        if self.takes_a5 {
            memory.set_u16(&r::ESC_CONFIGURATION_A5, u16::from_le_bytes([area[10], area[11]]));
        }
        self.loaded_once = true;
    }

    /// A byte of the EEPROM: 0xFF where nothing was written, the beginning again behind its end.
    fn byte(&self, address: usize) -> u8 {
        self.image.get(address % self.capacity.max(1)).copied().unwrap_or(0xFF)
    }

    fn write(&mut self, word: u32, value: u16) {
        let at = word as usize * 2 % self.capacity.max(2);
        if self.image.len() < at + 2 {
            self.image.resize(at + 2, 0xFF);
        }
        self.image[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }

    fn second_address_byte(&self) -> Span {
        if self.capacity > SMALL { SECOND_ADDRESS_BYTE } else { Span::ZERO }
    }

    fn read_time(&self) -> Span {
        let time = if self.reads_eight { READ_TIME } else { SHORT_READ_TIME };
        time + self.second_address_byte()
    }

    fn load_time(&self) -> Span {
        LOAD_TIME + self.second_address_byte()
    }
}

pub(super) fn read(memory: &Memory) -> SiiControl {
    SiiControl(memory.u16(&r::SII_CONTROL_STATUS))
}

pub(super) fn put(control: SiiControl, memory: &mut Memory) {
    memory.set_u16(&r::SII_CONTROL_STATUS, control.0);
}

/// Size of the EEPROM that holds an image: what word 0x3E says, at least what there is; a power of
/// two, since EEPROMs are.
fn capacity(image: &[u8]) -> usize {
    const SIZE_WORD: usize = 0x3E * 2;
    let said = match image.get(SIZE_WORD..SIZE_WORD + 2) {
        Some(&[low, high]) => (usize::from(u16::from_le_bytes([low, high])) + 1) * 128,
        _ => 0,
    };
    // A blank EEPROM says 0xFFFF, which is more than there is.
    let said = if said > LARGEST { 0 } else { said };
    said.max(image.len()).max(128).next_power_of_two()
}

/// The checksum of the configuration area: CRC-8 with polynomial 0x07, from 0xFF (S1 table 37).
fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0xFF, |crc, byte| {
        (0..8).fold(
            crc ^ byte,
            |crc: u8, _| {
                if crc & 0x80 != 0 { crc << 1 ^ 0x07 } else { crc << 1 }
            },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_of_real_devices() {
        let table: [(&[u8], u8); 2] =
            [(&[0x00, 0x0D], 0x46), (&[0x04, 0x01, 0, 0, 0, 0, 0xFF], 0xE2)];
        for (start, expected) in table {
            let mut area = [0; 14];
            area[..start.len()].copy_from_slice(start);
            assert_eq!(checksum(&area), expected);
        }
    }

    #[test]
    fn the_size_of_the_eeprom_follows_its_content() {
        let mut image = vec![0; 256];
        image[0x7C] = 15;
        assert_eq!(capacity(&image), 2_048);
        image[0x7C] = 31;
        assert_eq!(capacity(&image), 4_096);
        assert_eq!(capacity(&[0xFF; 300]), 512, "blank");
        assert_eq!(capacity(&[]), 128);
    }
}
