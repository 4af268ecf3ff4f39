//! The 64 KiB address space of a controller, as far as it is filled: registers and RAM as bytes,
//! and what the EtherCAT side may do with each register byte.
//!
//! Reference: S2 chapter 1. Registers hold their values here, whoever changes them; only the system
//! time is put in at the moment it is read.

use std::fmt;

use linesman_proto::register::{PROCESS_RAM_START, Register};

use super::implemented::{self, ClockUnits};
use crate::hardware::Hardware;

/// Where process-data RAM begins.
pub(super) const RAM: usize = PROCESS_RAM_START.0 as usize;

/// Registers and RAM. The process-data RAM takes memory of the host only once something other than
/// 0 was written to it: most of a long line never uses it.
#[derive(Clone)]
pub(super) struct Memory {
    registers: Box<[u8; RAM]>,
    /// Empty, for all zero, or of the whole length.
    ram: Vec<u8>,
    ram_len: usize,
}

/// What RAM reads as that was never written.
static BLANK: [u8; 0x1_0000 - RAM] = [0; 0x1_0000 - RAM];

impl Memory {
    pub(super) fn new(hardware: &Hardware) -> Self {
        let ram_len = (usize::from(hardware.ram_kib) * 1024).min(BLANK.len());
        Self { registers: Box::new([0; RAM]), ram: Vec::new(), ram_len }
    }

    /// All registers and RAM back to 0.
    pub(super) fn clear(&mut self) {
        self.registers.fill(0);
        self.ram.fill(0);
    }

    /// The first address behind the RAM.
    pub(super) fn len(&self) -> usize {
        RAM + self.ram_len
    }

    /// All below the process-data RAM.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.registers[..]
    }

    /// The same, to change.
    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.registers[..]
    }

    /// A byte anywhere; 0 behind the end.
    pub(super) fn byte(&self, address: usize) -> u8 {
        match address.checked_sub(RAM) {
            None => self.registers[address],
            Some(offset) => self.ram.get(offset).copied().unwrap_or(0),
        }
    }

    /// Process-data RAM between two addresses from [`RAM`] up, as far as it reaches.
    pub(super) fn ram(&self, start: usize, end: usize) -> &[u8] {
        let from = start.saturating_sub(RAM).min(self.ram_len);
        let to = end.saturating_sub(RAM).clamp(from, self.ram_len);
        if self.ram.is_empty() { &BLANK[..to - from] } else { &self.ram[from..to] }
    }

    /// Takes what lies from `start` on, registers or RAM; behind the end there is nothing.
    pub(super) fn copy_out(&self, start: usize, out: &mut [u8]) {
        let registers = out.len().min(RAM.saturating_sub(start));
        let (low, high) = out.split_at_mut(registers);
        low.copy_from_slice(&self.registers[start.min(RAM)..][..registers]);
        let from = start.max(RAM);
        let ram = self.ram(from, from + high.len());
        high[..ram.len()].copy_from_slice(ram);
    }

    /// Puts bytes from `start` on, registers or RAM; behind the end they go nowhere.
    pub(super) fn copy_in(&mut self, start: usize, data: &[u8]) {
        let (low, high) = data.split_at(data.len().min(RAM.saturating_sub(start)));
        if !low.is_empty() {
            self.registers[start..start + low.len()].copy_from_slice(low);
        }
        let from = start.max(RAM) - RAM;
        let len = high.len().min(self.ram_len.saturating_sub(from));
        if len == 0 || (self.ram.is_empty() && high[..len].iter().all(|byte| *byte == 0)) {
            return;
        }
        if self.ram.is_empty() {
            self.ram.resize(self.ram_len, 0);
        }
        self.ram[from..from + len].copy_from_slice(&high[..len]);
    }

    /// Registers or RAM between two addresses back to 0.
    pub(super) fn clear_range(&mut self, start: usize, end: usize) {
        if start < RAM {
            self.registers[start..end.min(RAM)].fill(0);
        }
        if !self.ram.is_empty() && end > RAM {
            let to = (end - RAM).min(self.ram_len);
            self.ram[start.saturating_sub(RAM).min(to)..to].fill(0);
        }
    }

    pub(super) fn u8(&self, register: &Register) -> u8 {
        self.registers[at(register)]
    }

    pub(super) fn set_u8(&mut self, register: &Register, value: u8) {
        self.registers[at(register)] = value;
    }

    #[inline]
    pub(super) fn u16(&self, register: &Register) -> u16 {
        u16::from_le_bytes(self.array(at(register)))
    }

    pub(super) fn set_u16(&mut self, register: &Register, value: u16) {
        self.put(at(register), &value.to_le_bytes());
    }

    pub(super) fn u32(&self, register: &Register) -> u32 {
        u32::from_le_bytes(self.array(at(register)))
    }

    pub(super) fn set_u32(&mut self, register: &Register, value: u32) {
        self.put(at(register), &value.to_le_bytes());
    }

    pub(super) fn u64(&self, register: &Register) -> u64 {
        u64::from_le_bytes(self.array(at(register)))
    }

    pub(super) fn set_u64(&mut self, register: &Register, value: u64) {
        self.put(at(register), &value.to_le_bytes());
    }

    /// `N` bytes from `address`, which must be a register's: those are always there.
    #[inline]
    pub(super) fn array<const N: usize>(&self, address: usize) -> [u8; N] {
        self.registers[address..].first_chunk().copied().unwrap_or([0; N])
    }

    /// Puts bytes into registers.
    pub(super) fn put(&mut self, address: usize, bytes: &[u8]) {
        self.registers[address..address + bytes.len()].copy_from_slice(bytes);
    }
}

impl fmt::Debug for Memory {
    /// Its size; the content is read register by register.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Memory({} bytes)", self.len())
    }
}

/// Where a register is.
pub(super) const fn at(register: &Register) -> usize {
    register.address.0 as usize
}

/// What the EtherCAT side may do with each byte below the process-data RAM.
///
/// Controllers of one kind share them.
pub(super) struct Rights([u8; RAM]);

impl Rights {
    /// The register is there and can be read.
    pub(super) const READ: u8 = 1;
    /// It can be written.
    pub(super) const WRITE: u8 = 1 << 1;
    /// Whether it can be written depends on the moment.
    pub(super) const CONDITIONAL: u8 = 1 << 2;
    /// What is written is not what it holds then: a write is a command.
    pub(super) const LIVE: u8 = 1 << 3;
    /// [`Rights::READ`] for each byte of a word.
    pub(super) const ANY_READ: u64 = u64::from_ne_bytes([Self::READ; 8]);

    pub(super) fn of(hardware: &Hardware, units: ClockUnits) -> Self {
        let mut rights = [0; RAM];
        implemented::fill(hardware, units, &mut rights[..]);
        Self(rights)
    }

    pub(super) fn byte(&self, address: usize) -> u8 {
        self.0[address]
    }

    /// Those of eight bytes, the first lowest.
    #[inline]
    pub(super) fn word(&self, address: usize) -> u64 {
        self.0[address..].first_chunk().copied().map_or(0, u64::from_le_bytes)
    }

    /// Whether any byte of the range has one of these rights.
    pub(super) fn any(&self, start: usize, end: usize, right: u8) -> bool {
        self.0[start..end].iter().any(|rights| rights & right != 0)
    }
}

impl fmt::Debug for Rights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let readable = self.0.iter().filter(|rights| *rights & Self::READ != 0).count();
        write!(f, "Rights({readable} bytes can be read)")
    }
}
