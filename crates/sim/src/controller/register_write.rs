//! Effects of written registers, once the frame that wrote them was good.
//!
//! Reference: S1 3.4; the registers in S2. Most registers simply hold what was written; this file
//! names those that do something.

use std::ops::Range;

use linesman_proto::register::{self as r, AlEvents, DlControl, SyncManagerConfig};
use linesman_proto::time::Instant;

use super::access::touches;
use super::core::Core;
use super::memory::{Rights, at};
use super::shadow::Write;
use super::sync_manager;

impl Core {
    /// Does what the shadow holds, in the order in which it was written. `end` is the end of the
    /// frame.
    pub(super) fn commit(&mut self, end: Instant) {
        let mut shadow = std::mem::take(&mut self.shadow);
        for (write, data) in shadow.iter() {
            self.commit_write(write, data, end);
        }
        shadow.clear();
        self.shadow = shadow;
        self.sii.end_frame();
        self.phys.end_frame();
    }

    fn commit_write(&mut self, write: Write, data: &[u8], end: Instant) {
        let range = write.address..write.address + write.len;
        let loops_before = DlControl(self.memory.u32(&r::DL_CONTROL));
        let managers = self.written_sync_managers(&range);
        let clock_before = self.before_clock_write(&range);
        self.store(&range, data);
        // By pages, since nearly every write concerns one register.
        for page in range.start >> 8..=(range.end - 1) >> 8 {
            match page {
                0x00 => self.reset_area_written(&range, data, end),
                0x01 => self.control_written(&range, loops_before, end),
                0x02 => self.refresh_irq(),
                0x03 => self.clear_error_counters(&range),
                0x04 => self.watchdogs_written(&range, end),
                0x05 => self.sii_written(&range, data, end),
                0x06 => self.configure_fmmus(),
                0x08 => self.sync_managers_written(managers.clone(), end),
                0x09 => self.clock_written(&range, data, clock_before, write.latches, end),
                0x0F => self.call_firmware(end),
                _ => {}
            }
        }
    }

    /// Most bytes just hold what was written.
    fn store(&mut self, range: &Range<usize>, data: &[u8]) {
        for (address, byte) in range.clone().zip(data) {
            if self.rights.byte(address) & Rights::LIVE == 0 {
                self.memory.bytes_mut()[address] = *byte;
            }
        }
    }

    fn reset_area_written(&mut self, range: &Range<usize>, data: &[u8], end: Instant) {
        if let Some(value) = byte_for(range, data, at(&r::ESC_RESET_ECAT)) {
            self.reset_written(value, end);
        }
    }

    fn control_written(&mut self, range: &Range<usize>, before: DlControl, end: Instant) {
        if touches(range, &r::RUN_LED_OVERRIDE) || touches(range, &r::ERR_LED_OVERRIDE) {
            self.refresh_leds();
        }
        if range.contains(&(at(&r::DL_CONTROL) + 1)) {
            self.loops_written(before, end);
        }
        if touches(range, &r::AL_CONTROL) {
            self.al_control_written(end);
        }
    }

    fn clear_error_counters(&mut self, range: &Range<usize>) {
        let groups: [&[&r::Register]; 4] = [
            &[
                &r::RX_ERROR_COUNTER,
                &r::FORWARDED_RX_ERROR_COUNTER,
                &r::EXTENDED_RX_ERROR_COUNTER,
                &r::RX_ERROR_CODE,
            ],
            &[&r::PROCESSING_UNIT_ERROR_COUNTER],
            &[&r::PDI_ERROR_COUNTER, &r::PDI_ERROR_CODE],
            &[&r::LOST_LINK_COUNTER],
        ];
        for group in groups {
            if group.iter().any(|register| touches(range, register)) {
                for register in group {
                    self.zero(register);
                }
            }
        }
    }

    fn watchdogs_written(&mut self, range: &Range<usize>, end: Instant) {
        let counters = [&r::WATCHDOG_COUNTER_PROCESS_DATA, &r::WATCHDOG_COUNTER_PDI];
        if counters.iter().any(|counter| touches(range, counter)) {
            for counter in counters {
                self.zero(counter);
            }
        }
        let times = [&r::WATCHDOG_DIVIDER, &r::WATCHDOG_TIME_PDI, &r::WATCHDOG_TIME_PROCESS_DATA];
        if times.iter().any(|time| touches(range, time)) {
            self.retime_watchdogs(end);
        }
    }

    fn zero(&mut self, register: &r::Register) {
        self.memory.bytes_mut()[at(register)..usize::from(register.end().0)].fill(0);
    }

    fn sii_written(&mut self, range: &Range<usize>, data: &[u8], end: Instant) {
        if let Some(value) = byte_for(range, data, at(&r::SII_ACCESS_ECAT)) {
            self.sii.assign(value, &mut self.memory);
        }
        let control = at(&r::SII_CONTROL_STATUS);
        if touches(range, &r::SII_CONTROL_STATUS) {
            let low = byte_for(range, data, control);
            let high = byte_for(range, data, control + 1);
            self.sii.control(low, high, end, &mut self.memory);
            self.ask_sii_emulation(end);
        }
        self.phy_area_written(range, data, end);
    }

    fn phy_area_written(&mut self, range: &Range<usize>, data: &[u8], end: Instant) {
        if let Some(value) = byte_for(range, data, at(&r::PHY_ACCESS_ECAT)) {
            self.phy_reserved(value);
        }
        if let Some(value) = byte_for(range, data, at(&r::PHY_ACCESS_PDI)) {
            self.phy_released(value);
        }
        if touches(range, &r::PHY_PORT_STATUS) {
            self.phy_status_written();
        }
        if touches(range, &r::PHY_CONTROL_STATUS) {
            let control = super::phy::CONTROL;
            let (low, high) = (byte_for(range, data, control), byte_for(range, data, control + 1));
            self.phy_written(low, high, end);
        }
    }

    /// Which SyncManagers a write concerns, and what their activate bytes were before.
    fn written_sync_managers(&self, range: &Range<usize>) -> Managers {
        let first = sync_manager::address(0);
        let last = sync_manager::address(sync_manager::MAX);
        if range.end <= first || last <= range.start {
            return Managers { indices: 0..0, activate: [0; sync_manager::MAX] };
        }
        let index = |address: usize| (address - first) / SyncManagerConfig::LEN;
        let indices = index(range.start.max(first))..index(range.end.min(last) - 1) + 1;
        let activate = std::array::from_fn(|index| {
            if indices.contains(&index) {
                sync_manager::config(index, &self.memory).activate.0
            } else {
                0
            }
        });
        Managers { indices, activate }
    }

    fn sync_managers_written(&mut self, managers: Managers, end: Instant) {
        let count = usize::from(self.hardware.sync_managers).min(sync_manager::MAX);
        for index in managers.indices.start..managers.indices.end.min(count) {
            self.sync_managers.configure(index, &mut self.memory);
            self.refresh_sync_manager_events(index, end);
            let activate = sync_manager::config(index, &self.memory).activate.0;
            if activate != managers.activate[index] {
                self.raise_al_events(AlEvents::SYNC_MANAGER_ACTIVATION, end);
            }
        }
    }
}

/// SyncManagers whose registers are being written.
#[derive(Clone, Debug)]
struct Managers {
    indices: Range<usize>,
    activate: [u8; sync_manager::MAX],
}

/// What was written to one address.
fn byte_for(range: &Range<usize>, data: &[u8], address: usize) -> Option<u8> {
    data.get(address.checked_sub(range.start)?).copied()
}
