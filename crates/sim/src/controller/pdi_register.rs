//! Registers from the side of the SubDevice's own processor: what it may write, and what its writes
//! do.
//!
//! Reference: the column "PDI" of S2 chapter 2, which the register table repeats.

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{self as r, Access, AlStatus};

use super::access::touches;
use super::memory::{RAM, Rights, at};
use super::pdi::Pdi;
use super::sync_manager;

/// What the processor may do with the register byte at an address, whatever controller it is.
fn right(address: usize) -> Access {
    let found = r::ALL.iter().find(|register| touches(&(address..address + 1), register));
    let Some(register) = found else { return Access::None };
    let in_gap = register.repeat.is_some_and(|repeat| {
        (address - at(register)) % usize::from(repeat.stride) >= usize::from(register.len)
    });
    if touches(&(address..address + 1), &r::SYNC_MANAGER) {
        // The last byte of each is the processor's side (S2 2.14.7).
        const PDI_CONTROL: usize = 7;
        let offset = (address - at(register)) % usize::from(register.len);
        return if offset == PDI_CONTROL { Access::ReadWrite } else { Access::Read };
    }
    if in_gap { Access::None } else { register.pdi }
}

impl Pdi<'_> {
    /// Writes register bytes as a processor can. False when one of them cannot be written by this
    /// side, at all or at this moment; those before it are written then.
    pub fn write_register(&mut self, address: RegisterAddress, data: &[u8]) -> bool {
        let start = usize::from(address.0);
        data.iter().enumerate().all(|(offset, value)| self.write_byte(start + offset, *value))
    }

    fn write_byte(&mut self, address: usize, value: u8) -> bool {
        let there = address < RAM && self.core.rights.byte(address) & Rights::READ != 0;
        if !there || !right(address).writes() {
            return false;
        }
        let is = |register: &r::Register| touches(&(address..address + 1), register);
        let core = &mut *self.core;
        if is(&r::ESC_RESET_PDI) {
            core.reset_step(&r::ESC_RESET_PDI, value, true, self.now);
        } else if is(&r::AL_STATUS) {
            if core.emulates_device() {
                return false;
            }
            let mut bytes = core.memory.u16(&r::AL_STATUS).to_le_bytes();
            bytes[address - at(&r::AL_STATUS)] = value;
            core.set_al_status(AlStatus(u16::from_le_bytes(bytes)));
        } else if is(&r::SII_ACCESS_PDI) {
            // Only what the MainDevice has offered can be taken.
            if value & 1 != 0 && core.memory.u8(&r::SII_ACCESS_ECAT) & 1 == 0 {
                return false;
            }
            core.memory.set_u8(&r::SII_ACCESS_PDI, value & 1);
        } else if is(&r::PHY_ACCESS_PDI) {
            if value & 1 != 0 && core.memory.u8(&r::PHY_ACCESS_ECAT) & 1 != 0 {
                return false;
            }
            let forced = core.memory.u8(&r::PHY_ACCESS_PDI) & 1 << 1;
            core.memory.set_u8(&r::PHY_ACCESS_PDI, forced | value & 1);
        } else if is(&r::SYNC_MANAGER) {
            let index = (address - at(&r::SYNC_MANAGER)) / usize::from(r::SYNC_MANAGER.len);
            core.memory.put(address, &[value]);
            core.sync_managers.configure(index, &mut core.memory);
            core.refresh_sync_manager_events(index, self.now);
            return index < sync_manager::MAX;
        } else if is(&r::SII_CONTROL_STATUS) || is(&r::SII_ADDRESS) || is(&r::SII_DATA) {
            return self.write_sii_byte(address, value);
        } else if [r::PHY_CONTROL_STATUS, r::PHY_ADDRESS, r::PHY_REGISTER_ADDRESS, r::PHY_DATA]
            .iter()
            .any(is)
        {
            return self.write_phy_byte(address, value);
        } else {
            core.memory.put(address, &[value]);
            if is(&r::RUN_LED_OVERRIDE) || is(&r::ERR_LED_OVERRIDE) {
                core.refresh_leds();
            }
        }
        true
    }

    /// The SII is this side's while it has taken it; each byte counts as an access of its own, and
    /// the high byte of control starts the command.
    fn write_sii_byte(&mut self, address: usize, value: u8) -> bool {
        let core = &mut *self.core;
        let taken = core.memory.u8(&r::SII_ACCESS_PDI) & 1 != 0;
        if !taken || core.sii.done_at().is_some() {
            return false;
        }
        match address.checked_sub(at(&r::SII_CONTROL_STATUS)) {
            Some(0) => core.sii.control(Some(value), None, self.now, &mut core.memory),
            Some(1) => {
                core.sii.control(None, Some(value), self.now, &mut core.memory);
                core.sii.end_frame();
            }
            _ => core.memory.put(address, &[value]),
        }
        core.rescheduled = true;
        true
    }

    fn write_phy_byte(&mut self, address: usize, value: u8) -> bool {
        let core = &mut *self.core;
        let taken = core.memory.u8(&r::PHY_ACCESS_PDI) & 1 != 0;
        if !taken || core.phys.done_at().is_some() {
            return false;
        }
        match address.checked_sub(super::phy::CONTROL) {
            Some(0) => core.phy_written(Some(value), None, self.now),
            Some(1) => core.phy_written(None, Some(value), self.now),
            _ => core.memory.put(address, &[value]),
        }
        core.rescheduled = true;
        true
    }

    /// An access of the processor went wrong: 0x030D counts it, and 0x030E keeps the reason where
    /// the controller has it.
    pub fn count_pdi_error_because(&mut self, reason: u16) {
        self.count_pdi_error();
        if self.core.rights.byte(at(&r::PDI_ERROR_CODE)) & Rights::READ != 0 {
            self.core.memory.set_u16(&r::PDI_ERROR_CODE, reason);
        }
    }
}
