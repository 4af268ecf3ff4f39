//! Values of registers, as what was read of a SubDevice.

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{DlStatus, ErrorCounter, ErrorCounters};

use super::state_word;
use crate::observation_file::{Count, ReadDevice, Word};

const DL_STATUS: u16 = 0x0110;
const AL_STATUS: u16 = 0x0130;
const AL_STATUS_CODE: u16 = 0x0134;

/// Takes over what bytes from a register on say: DL status, AL status and its code, error counters. Other registers
/// are left aside.
pub(super) fn fill(read: &mut ReadDevice, start: u16, bytes: &[u8]) {
    let word = |register: u16| {
        let at = usize::from(register.checked_sub(start)?);
        Some(u16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]))
    };
    if let Some(status) = word(DL_STATUS).map(DlStatus) {
        for port in Port::ALL {
            let state = status.port_state(port);
            let into = read.port_mut(port);
            (into.link, into.open) = (Some(state.link), Some(!state.closed));
            into.communication = Some(state.communication);
        }
    }
    if let Some(status) = word(AL_STATUS) {
        read.state = state_word::of_status(status.into()).or(read.state.take());
    }
    if let Some(code) = word(AL_STATUS_CODE) {
        read.al_code = Some(Word(code));
    }
    let counters = ErrorCounters::from_bytes(bytes, RegisterAddress(start));
    for (counter, value) in counters.iter() {
        let value = Some(Count(value.into()));
        match counter {
            ErrorCounter::InvalidFrame(port) => read.port_mut(port).frame = value,
            ErrorCounter::PhysicalLayer(port) => read.port_mut(port).physical = value,
            ErrorCounter::Forwarded(port) => read.port_mut(port).forwarded = value,
            ErrorCounter::LostLink(port) => read.port_mut(port).lost_link = value,
            ErrorCounter::ProcessingUnit => read.processing_unit = value,
            ErrorCounter::Pdi => {}
        }
    }
}

/// The ports that are open, where DL status is among the bytes.
pub(super) fn open_ports(start: u16, bytes: &[u8]) -> Option<PortMap<bool>> {
    let at = usize::from(DL_STATUS.checked_sub(start)?);
    let status = DlStatus(u16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]));
    Some(PortMap::from_fn(|port| !status.port_state(port).closed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn block_of_registers_is_taken_apart() {
        let mut read = ReadDevice::default();
        let mut bytes = [0; 0x26];
        bytes[..2].copy_from_slice(&0x5A30_u16.to_le_bytes());
        (bytes[0x20], bytes[0x24]) = (0x14, 0x1B);
        fill(&mut read, DL_STATUS, &bytes);
        assert_eq!(read.state.as_deref(), Some("ERR SAFEOP"));
        assert_eq!(read.al_code, Some(Word(0x001B)));
        assert_eq!(read.port_mut(Port::B).link, Some(true));
        let open = open_ports(DL_STATUS, &bytes).unwrap();
        assert_eq!([open[Port::A], open[Port::B], open[Port::C]], [true, true, false]);
        assert_eq!(open_ports(0x0300, &bytes), None);
        fill(&mut read, 0x0302, &[3, 4]);
        let b = read.port_mut(Port::B);
        assert_eq!((b.frame, b.physical), (Some(Count(3)), Some(Count(4))));
        fill(&mut read, 0xFFFF, &[1]);
    }
}
