//! The local clock of a controller, a quartz that is a little off and counts from power-on; the
//! receive times it takes, and the system time made of it.
//!
//! Reference: S1 chapter 9 (distributed clocks), S2 2.15.

use linesman_proto::port::Port;
use linesman_proto::register as r;
use linesman_proto::time::Instant;

use super::core::{Core, Passing};
use crate::hardware::PortKind;

/// How a controller's quartz behaves.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct LocalClock {
    /// What it shows at power-on, in ns.
    pub start: u64,
    /// How much too fast it runs, in parts per thousand million; negative is too slow. Quartzes of
    /// SubDevices are within 25 ppm, that is 25,000.
    pub ppb: i64,
}

impl LocalClock {
    /// A clock that is `ppm` parts per million too fast.
    #[must_use]
    pub fn with_ppm(start: u64, ppm: f64) -> Self {
        Self { start, ppb: (ppm * 1_000.0).round() as i64 }
    }
}

/// A clock that runs since an instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunningClock {
    clock: LocalClock,
    since: Instant,
}

impl RunningClock {
    pub(super) fn new(clock: LocalClock, since: Instant) -> Self {
        Self { clock, since }
    }

    /// What it shows, in ns. Before its start it stands.
    pub(super) fn local(&self, at: Instant) -> u64 {
        let passed = at.since(self.since).as_nanos();
        // In 128 bits: 585 years of ns times any ppb fit.
        let gained = i128::from(passed) * i128::from(self.clock.ppb) / 1_000_000_000;
        self.clock.start.wrapping_add(passed).wrapping_add(gained as u64)
    }

    /// Changes its speed at an instant without a jump.
    pub(super) fn change_speed(&mut self, at: Instant, ppb: i64) {
        *self = Self::new(LocalClock { start: self.local(at), ppb }, at);
    }
}

impl Core {
    /// The frame that just passed wrote to 0x0900: its receive times are kept, those of ports that
    /// it has not reached yet when it does.
    pub(super) fn latch_receive_times(&mut self) {
        let Passing { number, began, .. } = self.passing;
        self.latched = Some(number);
        let local = self.clock.local(began);
        self.memory.set_u64(&r::RECEIVE_TIME_PROCESSING_UNIT, local);
        for port in Port::ALL {
            let (frame, when) = self.entered[port];
            if frame == number && self.hardware.ports[port] != PortKind::Absent {
                self.latch_receive_time(port, when);
            }
        }
    }

    pub(super) fn latch_receive_time(&mut self, port: Port, when: Instant) {
        let local = self.clock.local(when) as u32;
        let address = usize::from(r::RECEIVE_TIME.of_port(port).0);
        self.memory.put(address, &local.to_le_bytes());
    }

    /// The local copy of the system time.
    pub(super) fn system_time(&self, when: Instant) -> u64 {
        self.clock.local(when).wrapping_add(self.memory.u64(&r::SYSTEM_TIME_OFFSET))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_quartz_gains() {
        let clock = RunningClock::new(LocalClock::with_ppm(100, 20.0), Instant::from_nanos(1_000));
        assert_eq!(clock.local(Instant::from_nanos(1_000)), 100);
        assert_eq!(clock.local(Instant::from_nanos(1_000_001_000)), 100 + 1_000_000_000 + 20_000);
        let slow = RunningClock::new(LocalClock { start: 0, ppb: -500 }, Instant::ZERO);
        assert_eq!(slow.local(Instant::from_nanos(10_000_000_000)), 10_000_000_000 - 5_000);
    }

    #[test]
    fn a_change_of_speed_is_no_jump() {
        let mut clock = RunningClock::new(LocalClock::with_ppm(0, 10.0), Instant::ZERO);
        let at = Instant::from_nanos(1_000_000_000);
        let before = clock.local(at);
        clock.change_speed(at, -10_000);
        assert_eq!(clock.local(at), before);
        let second = Instant::from_nanos(2_000_000_000);
        assert_eq!(clock.local(second), before + 1_000_000_000 - 10_000);
    }
}
