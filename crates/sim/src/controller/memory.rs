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

/// Registers and RAM.
#[derive(Clone)]
pub(super) struct Memory {
    bytes: Vec<u8>,
}

impl Memory {
    pub(super) fn new(hardware: &Hardware) -> Self {
        Self { bytes: vec![0; RAM + usize::from(hardware.ram_kib) * 1024] }
    }

    /// All registers and RAM back to 0.
    pub(super) fn clear(&mut self) {
        self.bytes.fill(0);
    }

    /// The first address behind the RAM.
    pub(super) fn len(&self) -> usize {
        self.bytes.len()
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    pub(super) fn u8(&self, register: &Register) -> u8 {
        self.bytes[at(register)]
    }

    pub(super) fn set_u8(&mut self, register: &Register, value: u8) {
        self.bytes[at(register)] = value;
    }

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
    pub(super) fn array<const N: usize>(&self, address: usize) -> [u8; N] {
        let mut array = [0; N];
        array.copy_from_slice(&self.bytes[address..address + N]);
        array
    }

    pub(super) fn put(&mut self, address: usize, bytes: &[u8]) {
        self.bytes[address..address + bytes.len()].copy_from_slice(bytes);
    }
}

impl fmt::Debug for Memory {
    /// Its size; the content is read register by register.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Memory({} bytes)", self.bytes.len())
    }
}

/// Where a register is.
pub(super) const fn at(register: &Register) -> usize {
    register.address.0 as usize
}

/// What the EtherCAT side may do with each byte below the process-data RAM.
#[derive(Clone)]
pub(super) struct Rights(Box<[u8]>);

impl Rights {
    /// The register is there and can be read.
    pub(super) const READ: u8 = 1;
    /// It can be written.
    pub(super) const WRITE: u8 = 1 << 1;
    /// Whether it can be written depends on the moment.
    pub(super) const CONDITIONAL: u8 = 1 << 2;
    /// What is written is not what it holds then: a write is a command.
    pub(super) const LIVE: u8 = 1 << 3;

    pub(super) fn of(hardware: &Hardware, units: ClockUnits) -> Self {
        let mut rights = vec![0; RAM].into_boxed_slice();
        implemented::fill(hardware, units, &mut rights);
        Self(rights)
    }

    pub(super) fn byte(&self, address: usize) -> u8 {
        self.0[address]
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
