//! Inspection of a controller from outside its wires: what the segment, faults and tests read and
//! set.

use linesman_proto::address::{DeviceId, RegisterAddress, StationAddress};
use linesman_proto::mailbox::coe::{Emergency, ObjectAddress};
use linesman_proto::register::{self as r, AlStatus, DlStatus, ErrorCounter, ErrorCounters};
use linesman_proto::state::AlStatusCode;
use linesman_proto::time::{Instant, Span};

use super::clock::SyncSignal;
use super::esc::Controller;
use super::memory::at;
use super::pdi::Pdi;
use super::watchdog::WatchdogExpiry;
use crate::device::{Firmware, Refusal, Signals, SoftwareFault};
use crate::hardware::Hardware;

impl Controller {
    /// Which controller it is.
    #[must_use]
    pub fn id(&self) -> DeviceId {
        self.core.id
    }

    /// What it is made of.
    #[must_use]
    pub fn hardware(&self) -> &Hardware {
        &self.core.hardware
    }

    /// The device behind it.
    #[must_use]
    pub fn firmware(&self) -> &dyn Firmware {
        &*self.firmware
    }

    /// The device behind it: for faults that make it misbehave.
    pub fn firmware_mut(&mut self) -> &mut dyn Firmware {
        self.sampling.renew();
        &mut *self.firmware
    }

    /// The device's processor stops serving the controller at `at`, or serves it again: events stay
    /// unanswered meanwhile and the PDI watchdog runs out.
    pub fn set_processor_stuck(&mut self, at: Instant, stuck: bool) {
        self.core.set_processor_stuck(stuck, at);
        self.reschedule();
    }

    /// The device refuses a step from `at` on, or `None`: no longer. Where the controller emulates
    /// the device, it leaves AL control to [`Firmware`] meanwhile, without 0x0141 saying so.
    pub fn refuse(&mut self, at: Instant, refusal: Option<Refusal>) {
        self.firmware.refuse(refusal);
        self.core.emulation_suspended = refusal.is_some();
        self.core.call_firmware(at);
        self.reschedule();
    }

    /// The work of the device in each cycle takes so long from now on; `None` for as long as it needs.
    pub fn slow_down(&mut self, takes: Option<Span>) {
        self.firmware.slow_down(takes);
    }

    /// The device sends an emergency at `at`, or as soon as its mailbox works.
    pub fn report(&mut self, at: Instant, emergency: Emergency) {
        self.firmware.report(emergency);
        self.core.call_firmware(at);
        self.reschedule();
    }

    /// A frame comes from outside the segment to an Ethernet port of the device, at `at`.
    pub fn handle_ethernet_frame(&mut self, at: Instant, port: u8, frame: Vec<u8>) {
        let Some(side) = self.firmware.ethernet_mut() else { return };
        side.handle_outside(port, frame);
        if self.powered {
            self.core.call_firmware(at);
            self.reschedule();
        }
    }

    /// The next frame that leaves the segment by an Ethernet port of the device, and by which port.
    pub fn poll_ethernet_frame(&mut self) -> Option<(u8, Vec<u8>)> {
        self.firmware.ethernet_mut()?.poll_outside()
    }

    /// Whether a watchdog ran out since they were taken last.
    #[must_use]
    pub fn has_watchdog_expiries(&self) -> bool {
        !self.core.watchdogs.expiries.is_empty()
    }

    /// Watchdogs that ran out since the last call, the first ones of many.
    pub fn take_watchdog_expiries(&mut self) -> Vec<WatchdogExpiry> {
        std::mem::take(&mut self.core.watchdogs.expiries)
    }

    /// A coding switch is wired to the controller: its value stands at `address` from every start on.
    pub fn set_coding_switch(&mut self, address: RegisterAddress, value: u16) {
        self.core.coding_switch = Some((address, value));
        self.core.put_coding_switch();
    }

    /// Somebody sets the time of the process data watchdog, 0x0420, at `at`. Gives the former one.
    pub fn set_watchdog_time(&mut self, at: Instant, time: r::WatchdogTime) -> r::WatchdogTime {
        let former = r::WatchdogTime(self.core.memory.u16(&r::WATCHDOG_TIME_PROCESS_DATA));
        if self.powered {
            self.core.memory.set_u16(&r::WATCHDOG_TIME_PROCESS_DATA, time.0);
            self.core.retime_watchdogs(at);
            self.reschedule();
        }
        former
    }

    /// The software of the device misbehaves from `at` on, or no longer.
    pub fn software_fault(&mut self, at: Instant, software_fault: SoftwareFault, begins: bool) {
        self.firmware.software_fault(software_fault, begins);
        self.core.call_firmware(at);
        self.reschedule();
    }

    /// A number in the dictionary of its processor; `None` where there is none.
    #[must_use]
    pub fn object_number(&self, address: ObjectAddress) -> Option<u64> {
        self.firmware.number(address)
    }

    /// Something inside the device sets a number in the dictionary of its processor.
    pub(crate) fn set_object_number(&mut self, address: ObjectAddress, value: u64) {
        self.firmware.set_number(address, value);
    }

    /// The processor of the device has crashed and runs again from `at` on, without a reset of the
    /// controller.
    pub fn reboot_processor(&mut self, at: Instant, signals: &mut Signals) {
        if !self.powered || !self.core.startup.started {
            return;
        }
        self.core.set_processor_stuck(false, at);
        self.firmware.reboot(at, &mut Pdi { core: &mut self.core, signals, now: at });
        self.core.call_firmware(at);
        self.reschedule();
    }

    /// The content of its EEPROM.
    #[must_use]
    pub fn sii(&self) -> &[u8] {
        self.core.sii.image()
    }

    /// A byte of a register, without any effect of reading it; 0 where there is none.
    #[must_use]
    pub fn register(&self, address: RegisterAddress) -> u8 {
        self.core.memory.byte(usize::from(address.0))
    }

    /// All bytes below the process-data RAM, without any effect of reading them.
    #[must_use]
    pub fn registers(&self) -> &[u8] {
        self.core.memory.bytes()
    }

    /// The process-data RAM.
    #[must_use]
    pub fn ram(&self) -> &[u8] {
        self.core.memory.ram(super::memory::RAM, self.core.memory.len())
    }

    /// DL status, 0x0110.
    #[must_use]
    pub fn dl_status(&self) -> DlStatus {
        DlStatus(self.core.memory.u16(&r::DL_STATUS))
    }

    /// AL status, 0x0130.
    #[must_use]
    pub fn al_status(&self) -> AlStatus {
        AlStatus(self.core.memory.u16(&r::AL_STATUS))
    }

    /// AL status code, 0x0134.
    #[must_use]
    pub fn al_code(&self) -> AlStatusCode {
        AlStatusCode(self.core.memory.u16(&r::AL_STATUS_CODE))
    }

    /// Configured station address, 0x0010.
    #[must_use]
    pub fn station_address(&self) -> StationAddress {
        StationAddress(self.core.memory.u16(&r::STATION_ADDRESS))
    }

    /// Sets the station address, as a datagram of somebody else does; gives the former one. Nothing
    /// happens to a controller without supply.
    pub fn set_station_address(&mut self, address: StationAddress) -> StationAddress {
        let former = self.station_address();
        if self.powered {
            self.core.memory.set_u16(&r::STATION_ADDRESS, address.0);
        }
        former
    }

    /// All error counters. Those of ports and kinds it does not have read 0.
    #[must_use]
    pub fn error_counters(&self) -> ErrorCounters {
        let start = at(&r::RX_ERROR_COUNTER);
        let bytes = &self.core.memory.bytes()[start..start + ErrorCounters::LEN];
        ErrorCounters::from_bytes(bytes, ErrorCounters::START)
    }

    /// Gives a counter a value, as history does: old errors, noise at power-on. A counter that the
    /// hardware does not have stays 0.
    pub fn set_counter(&mut self, counter: ErrorCounter, value: u8) {
        self.core.set_counter(counter.address(), value);
    }

    /// What the local clock shows, in ns.
    #[must_use]
    pub fn local_time(&self, at: Instant) -> u64 {
        self.core.clock.local(at)
    }

    /// The local copy of the system time, in ns.
    #[must_use]
    pub fn system_time(&self, at: Instant) -> u64 {
        self.core.system_time(at)
    }

    /// Changes the speed of the local clock, without a jump: `ppb` parts per thousand million too
    /// fast, and `ramp_ppb_per_s` more each second for as long as `ramp`.
    pub fn set_drift(&mut self, at: Instant, ppb: i64, ramp_ppb_per_s: i64, ramp: Span) {
        self.core.clock.change_speed(at, ppb, ramp_ppb_per_s, ramp);
        self.replan_sync(at);
    }

    /// The local clock has the speed of its own quartz again.
    pub fn restore_drift(&mut self, at: Instant) {
        self.core.clock.restore_speed(at);
        self.replan_sync(at);
    }

    /// The local clock starts anew at `at`, as after a dip of its supply that nothing else noticed.
    pub fn restart_clock(&mut self, at: Instant) {
        self.core.restart_clock(at);
        self.replan_sync(at);
    }

    /// The line from the SYNC unit to the processor breaks, or is whole again.
    pub fn cut_sync(&mut self, cut: bool) {
        self.core.sync.cut = cut;
        if !cut {
            // A pulse that nobody ended is found on the line, and ended.
            for signal in SyncSignal::ALL {
                self.core.acknowledge_sync(signal);
            }
        }
    }

    /// The line from the SYNC unit to the processor carries each edge twice, or as it is.
    pub fn bounce_sync(&mut self, bounces: bool) {
        self.core.sync.bounces = bounces;
    }

    fn replan_sync(&mut self, at: Instant) {
        self.core.plan_sync(at);
        self.reschedule();
    }
}
