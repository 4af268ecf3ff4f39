//! A controller whose history began before the run: registers are as they were found, and the SII
//! takes the time that it was seen to take.

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{self as r, DlControl};
use linesman_proto::time::Span;

use super::access::touches;
use super::esc::Controller;
use super::memory::{RAM, Rights, at};
use super::sync_manager;

impl Controller {
    /// Whether an access of the EtherCAT side to registers can succeed: one byte of them is there,
    /// and this side has the right.
    #[must_use]
    pub fn has_register(&self, address: RegisterAddress, len: usize, writes: bool) -> bool {
        let start = usize::from(address.0).min(RAM);
        let end = (start + len).min(RAM);
        let right = if writes { Rights::WRITE } else { Rights::READ };
        start < end && self.core.rights.any(start, end, right)
    }

    /// Gives registers the values that they had when the run began, without any effect of a write;
    /// mappings, buffers and loops follow. Bytes the controller does not have are left out. For
    /// process-data RAM, what it holds.
    pub fn preset(&mut self, address: RegisterAddress, data: &[u8]) {
        let start = usize::from(address.0);
        let core = &mut self.core;
        for (at, byte) in (start..RAM).zip(data) {
            if core.rights.byte(at) & Rights::READ != 0 {
                core.memory.put(at, &[*byte]);
            }
        }
        let len = core.memory.len();
        if RAM <= start && start + data.len() <= len {
            core.memory.copy_in(start, data);
            return;
        }
        let range = start..(start + data.len()).min(RAM);
        if touches(&range, &r::FMMU) {
            core.configure_fmmus();
        }
        if touches(&range, &r::SYNC_MANAGER) {
            let count = usize::from(core.hardware.sync_managers).min(sync_manager::MAX);
            for index in 0..count {
                core.sync_managers.configure(index, &mut core.memory);
            }
        }
        if range.contains(&(at(&r::DL_CONTROL) + 1)) {
            core.ports.loops.rewrite(DlControl(core.memory.u32(&r::DL_CONTROL)));
            core.refresh_dl_status();
        }
        core.refresh_irq();
        core.refresh_leds();
        core.rescheduled = true;
        self.reschedule();
    }

    /// How long the EEPROM acknowledges nothing behind a write.
    pub fn set_sii_programming_time(&mut self, time: Span) {
        self.core.sii.set_programming_time(time);
    }

    /// The next commands to the SII take these times, one after the other; those behind take what
    /// they take by the data sheet.
    pub fn expect_sii_times(&mut self, times: impl IntoIterator<Item = Span>) {
        self.core.sii.expect(times);
    }
}
