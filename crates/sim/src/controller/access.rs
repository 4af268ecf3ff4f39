//! Access of a datagram to memory: the bytes behind an address, and the rights to read and write
//! them.
//!
//! Read first: S1 1.3 on working counters, 3.4 (shadow buffer), 8 (SyncManager), 17.3 (write
//! protection). An access succeeds as soon as one of its bytes does. Up to 0x0EFF there are
//! registers only; from 0x0F00 up SyncManagers may guard; writes below 0x0F80 wait in the shadow
//! for the end of the frame, those from there up are done at once.

use std::ops::Range;

use linesman_proto::register::{self as r, RAM_START};

use super::core::Core;
use super::memory::{RAM, Rights, at};
use super::sync_manager::Grant;

/// Where SyncManagers can guard something: digital outputs, user RAM, process-data RAM.
const GUARDED: usize = at(&r::DIGITAL_OUTPUT);
/// Where writes need no shadow.
const UNSHADOWED: usize = RAM_START.0 as usize;
/// The chapter of distributed clocks, whose registers are worked out when they are read.
const CLOCK: Range<usize> = 0x0900..0x0A00;

impl Core {
    /// Puts memory from `address` on into `out`, or ORs it in. True when at least one byte could be
    /// read; bytes that could not are left as they were.
    pub(super) fn read(&mut self, address: u16, out: &mut [u8], ors: bool) -> bool {
        let start = usize::from(address);
        let end = (start + out.len()).min(self.memory.len());
        let mut any = false;
        if start < GUARDED {
            let stop = end.min(GUARDED);
            any |= self.read_registers(start, &mut out[..stop - start], ors);
        }
        if GUARDED < end {
            let from = start.max(GUARDED);
            if from < end {
                any |= self.read_guarded(from, &mut out[from - start..end - start], ors);
            }
        }
        any
    }

    /// Registers that are not there read as 0 beside those that are.
    fn read_registers(&mut self, start: usize, out: &mut [u8], ors: bool) -> bool {
        let end = start + out.len();
        if !self.rights.any(start, end, Rights::READ) {
            return false;
        }
        let range = start..end;
        self.passing.read_dl_status |= touches(&range, &r::DL_STATUS);
        self.passing.read_al_status |= touches(&range, &r::AL_STATUS);
        if end > CLOCK.start && start < CLOCK.end {
            self.refresh_clock(&range);
        }
        copy(&self.memory.bytes()[range], out, ors);
        true
    }

    fn read_guarded(&mut self, start: usize, out: &mut [u8], ors: bool) -> bool {
        let end = start + out.len();
        let (mut from, mut any) = (start, false);
        while from < end {
            let (until, grant, guard) = self.sync_managers.ask(from, end, false);
            self.passing.touched |= guard;
            let place = match grant {
                Grant::Plain => Some(from),
                Grant::At(place) => Some(place),
                Grant::Denied => None,
            };
            if let Some(place) = place {
                let out = &mut out[from - start..until - start];
                any |= self.read_place(place, out, ors);
            }
            from = until;
        }
        any
    }

    /// Bytes that nobody guards any more: I/O registers by their rights, RAM once the SII is loaded.
    fn read_place(&self, place: usize, out: &mut [u8], ors: bool) -> bool {
        let end = place + out.len();
        let io = place..end.min(RAM).max(place);
        let mut any = false;
        if !io.is_empty() && self.rights.any(io.start, io.end, Rights::READ) {
            copy(&self.memory.bytes()[io.clone()], &mut out[..io.len()], ors);
            any = true;
        }
        if end > RAM && self.startup.loaded {
            let from = place.max(RAM);
            copy(self.memory.ram(from, end), &mut out[from - place..], ors);
            any = true;
        }
        any
    }

    /// Takes `data` for memory from `address` on. True when at least one byte could be written.
    /// `latches` says that the command is one that latches receive times at 0x0900.
    pub(super) fn write(&mut self, address: u16, data: &[u8], latches: bool) -> bool {
        let start = usize::from(address);
        let end = (start + data.len()).min(self.memory.len());
        let mut any = false;
        if start < GUARDED {
            let stop = end.min(GUARDED);
            any |= self.write_registers(start, &data[..stop - start], latches);
        }
        if GUARDED < end {
            let from = start.max(GUARDED);
            if from < end {
                any |= self.write_guarded(from, &data[from - start..end - start]);
            }
        }
        self.passing.wrote |= any;
        any
    }

    /// Keeps the bytes that can be written, for the end of the frame.
    fn write_registers(&mut self, start: usize, data: &[u8], latches: bool) -> bool {
        let (mut from, mut any) = (0, false);
        while from < data.len() {
            if !self.may_write(start + from) {
                from += 1;
                continue;
            }
            let run = data[from..].iter().enumerate();
            let len = run.take_while(|(offset, _)| self.may_write(start + from + offset)).count();
            let range = start + from..start + from + len;
            self.passing.enables_registers |= touches(&range, &r::REGISTER_WRITE_ENABLE);
            self.passing.enables_all |= touches(&range, &r::ESC_WRITE_ENABLE);
            self.shadow.push(range.start, &data[from..from + len], latches);
            from += len;
            any = true;
        }
        any
    }

    /// Whether the register byte at `address` can be written at this moment.
    fn may_write(&self, address: usize) -> bool {
        let rights = self.rights.byte(address);
        if rights & Rights::WRITE == 0 || self.is_protected(address) {
            return false;
        }
        rights & Rights::CONDITIONAL == 0 || self.condition_holds(address)
    }

    fn condition_holds(&self, address: usize) -> bool {
        let range = address..address + 1;
        if touches(&range, &r::AL_CONTROL) {
            self.takes_al_control()
        } else if touches(&range, &r::SYNC_MANAGER) {
            let index = (address - at(&r::SYNC_MANAGER)) / usize::from(r::SYNC_MANAGER.len);
            !super::sync_manager::config(index, &self.memory).activate.enable()
        } else if CLOCK.contains(&address) {
            self.clock_is_for_ecat(address)
        } else if address < super::phy::CONTROL {
            self.sii.is_free(&self.memory)
        } else {
            self.phys.is_free(&self.memory)
        }
    }

    /// Whether write protection holds for a byte, in the frame that is passing.
    fn is_protected(&self, address: usize) -> bool {
        let registers = self.memory.u8(&r::REGISTER_WRITE_PROTECTION) & 1 != 0;
        let all = self.memory.u8(&r::ESC_WRITE_PROTECTION) & 1 != 0;
        if !registers && !all {
            return false;
        }
        // The two keys lie outside of what they open.
        if address == at(&r::REGISTER_WRITE_ENABLE) || address == at(&r::ESC_WRITE_ENABLE) {
            return false;
        }
        (all && !self.passing.enables_all)
            || (registers && !self.passing.enables_registers && address < UNSHADOWED)
    }

    fn write_guarded(&mut self, start: usize, data: &[u8]) -> bool {
        let end = start + data.len();
        let (mut from, mut any) = (start, false);
        while from < end {
            // A protected byte never gets as far as a SyncManager.
            if self.is_protected(from) {
                from += 1;
                continue;
            }
            let limit = if from < UNSHADOWED { end.min(UNSHADOWED) } else { end };
            let (until, grant, guard) = self.sync_managers.ask(from, limit, true);
            self.passing.touched |= guard;
            let place = match grant {
                Grant::Plain => Some(from),
                Grant::At(place) => Some(place),
                Grant::Denied => None,
            };
            if let Some(place) = place {
                any |= self.write_place(place, &data[from - start..until - start]);
            }
            from = until;
        }
        any
    }

    fn write_place(&mut self, place: usize, data: &[u8]) -> bool {
        let end = place + data.len();
        let mut any = false;
        if place < UNSHADOWED {
            let len = end.min(UNSHADOWED) - place;
            any |= self.write_registers(place, &data[..len], false);
        }
        if place < RAM && end > UNSHADOWED {
            let io = place.max(UNSHADOWED)..end.min(RAM);
            self.memory.put(io.start, &data[io.start - place..io.end - place]);
            any = true;
        }
        if end > RAM && self.startup.loaded {
            let from = place.max(RAM);
            self.memory.copy_in(from, &data[from - place..]);
            any = true;
        }
        any
    }
}

/// Whether a range of addresses has a byte in common with a register or a family of registers.
pub(super) fn touches(range: &Range<usize>, register: &r::Register) -> bool {
    range.start < usize::from(register.end().0) && at(register) < range.end
}

#[inline]
fn copy(from: &[u8], out: &mut [u8], ors: bool) {
    if ors {
        for (out, byte) in out.iter_mut().zip(from) {
            *out |= byte;
        }
    } else {
        out.copy_from_slice(from);
    }
}
