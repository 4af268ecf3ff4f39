//! The clock of a controller: a quartz that is a little off, the local time that is made of it, and
//! what is done with that time.
//!
//! `quartz` counts, `local` corrects what it counts, `time_loop` decides how, `receive_time` takes
//! the times at which frames come in, `sync_unit` makes SYNC signals and `latch_unit` takes the
//! times of inputs. All arithmetic is in whole numbers and every time is a function of the instant,
//! so that nothing adds up with the number of calls.
//!
//! Reference: S1 chapter 9 (distributed clocks), S2 2.15.

mod latch_unit;
mod local;
mod quartz;
mod receive_time;
mod sync_unit;
mod time_loop;

use std::ops::Range;

use linesman_proto::register as r;
use linesman_proto::time::Instant;

use super::access::touches;
use super::core::Core;
use super::memory::at;

pub use latch_unit::{Edge, LatchInput};
pub(super) use local::RunningClock;
pub use quartz::LocalClock;
pub(super) use receive_time::FrameEntries;
pub use sync_unit::SyncSignal;
pub(super) use sync_unit::SyncUnit;
pub(super) use time_loop::TimeLoop;

impl Core {
    /// Works out what of the chapter a read is going to see.
    pub(super) fn refresh_clock(&mut self, range: &Range<usize>) {
        if touches(range, &r::SYSTEM_TIME) {
            self.put_system_time();
        }
        if range.end > at(&r::CYCLIC_UNIT_CONTROL) {
            self.show_sync();
            self.passing.read_latches |= Self::latch_reads(range);
        }
    }

    /// Whether the EtherCAT side may set the byte at `address` in the SYNC or latch unit.
    pub(super) fn clock_is_for_ecat(&self, address: usize) -> bool {
        let latch = |register, input| touches(&(address..address + 1), register).then_some(input);
        let latch = latch(&r::LATCH0_CONTROL, LatchInput::Latch0)
            .or_else(|| latch(&r::LATCH1_CONTROL, LatchInput::Latch1));
        latch.map_or_else(|| self.sync_is_for_ecat(), |input| self.latch_is_for_ecat(input))
    }

    /// Something of the chapter is about to be written, perhaps: what depended on the old values is
    /// settled. Gives the activation as it was.
    pub(super) fn before_clock_write(&mut self, range: &Range<usize>) -> u8 {
        let chapter = at(&r::RECEIVE_TIME)..at(&r::BUFFER_CHANGE_TIME_ECAT);
        if range.start < chapter.end && chapter.start < range.end {
            self.settle_sync(self.passing.began);
        }
        self.memory.u8(&r::SYNC_ACTIVATION)
    }

    /// Something of the chapter was written, in a frame that ended at `end`.
    pub(super) fn clock_written(
        &mut self,
        range: &Range<usize>,
        data: &[u8],
        activation_before: u8,
        latches: bool,
        end: Instant,
    ) {
        if latches && range.contains(&at(&r::RECEIVE_TIME)) {
            self.latch_receive_times();
        }
        let time = at(&r::SYSTEM_TIME).checked_sub(range.start);
        if let Some(received) = time.and_then(|time| data.get(time..)?.first_chunk()) {
            self.compare_system_time(u32::from_le_bytes(*received), end);
        }
        if touches(range, &r::SYSTEM_TIME_OFFSET) {
            self.sync_jumps(end);
            self.plan_sync(end);
        }
        if touches(range, &r::SPEED_COUNTER_START) {
            self.restart_time_loop(end);
        }
        let sync = at(&r::CYCLIC_UNIT_CONTROL)..at(&r::LATCH0_CONTROL);
        if range.start < sync.end && sync.start < range.end {
            self.sync_written(range, activation_before, end);
        }
    }

    /// The local clock begins anew, without anything else.
    pub(super) fn restart_clock(&mut self, at: Instant) {
        self.settle_sync(at);
        self.clock = self.clock.restarted(at);
        self.time_loop = TimeLoop::default();
        self.sync_jumps(at);
    }
}
