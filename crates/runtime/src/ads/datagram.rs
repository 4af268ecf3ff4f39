//! Single datagrams of clients: a register of one SubDevice, read or written by the service for registers.
//!
//! Reference: Beckhoff/ADS, `adstool`, and ports of `FB_EcPhysicalReadCmd` and `FB_EcPhysicalWriteCmd`: a header of ten
//! bytes (command, index, ADP, ADO, length, interrupts), the data, the working counter. The same comes back.

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::{Addressing, Command};

/// Bytes of the header.
const HEADER: usize = 10;
/// Bytes of the working counter.
const COUNTER: usize = 2;
/// Most bytes of data: those of a datagram in an Ethernet frame.
const MAX_DATA: usize = 1_486;

/// SubDevice that is addressed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum RegisterTarget {
    /// The SubDevice at this place: 0, 65535, 65534.
    Place(u16),
    /// The SubDevice with this station address.
    Station(u16),
}

/// A datagram that one SubDevice answers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct RegisterDatagram {
    bytes: Vec<u8>,
    pub(super) target: RegisterTarget,
    pub(super) register: RegisterAddress,
    /// True if it writes.
    pub(super) writes: bool,
}

impl RegisterDatagram {
    /// The datagram; `None` if it is cut off, too long, or no command of one register of one SubDevice.
    pub(super) fn parse(bytes: &[u8]) -> Option<Self> {
        let [command, _, a0, a1, o0, o1, l0, l1, _, _] = *bytes.first_chunk::<HEADER>()?;
        let word = |low, high| u16::from_le_bytes([low, high]);
        let len = usize::from(word(l0, l1));
        if len == 0 || len > MAX_DATA || bytes.len() != HEADER + len + COUNTER {
            return None;
        }
        let (address, register) = (word(a0, a1), RegisterAddress(word(o0, o1)));
        let command = Command::from_code(command)?;
        let target = match command.addressing() {
            Addressing::Position => RegisterTarget::Place(address),
            Addressing::Station => RegisterTarget::Station(address),
            Addressing::None | Addressing::Broadcast | Addressing::Logical => return None,
        };
        let writes = matches!(command, Command::Apwr | Command::Fpwr);
        if !writes && !matches!(command, Command::Aprd | Command::Fprd) {
            return None;
        }
        Some(Self { bytes: bytes.to_vec(), target, register, writes })
    }

    /// Its data.
    pub(super) fn data(&self) -> &[u8] {
        self.bytes.get(HEADER..self.bytes.len() - COUNTER).unwrap_or_default()
    }

    /// The datagram as it comes back: an address by place counted on by each of `passed` SubDevices, what was read, and
    /// the working counter.
    pub(super) fn returned(mut self, passed: u16, read: Option<&[u8]>, answered: bool) -> Vec<u8> {
        if let RegisterTarget::Place(address) = self.target {
            let counted = address.wrapping_add(passed).to_le_bytes();
            self.bytes.get_mut(2..4).into_iter().for_each(|to| to.copy_from_slice(&counted));
        }
        let end = self.bytes.len() - COUNTER;
        if let (Some(read), Some(data)) = (read, self.bytes.get_mut(HEADER..end)) {
            data.iter_mut().zip(read).for_each(|(to, from)| *to = *from);
        }
        if let Some(counter) = self.bytes.get_mut(end..) {
            counter.copy_from_slice(&u16::from(answered).to_le_bytes());
        }
        self.bytes
    }
}
