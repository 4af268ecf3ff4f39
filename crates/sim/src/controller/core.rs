//! The controller without the device behind it: its parts, and how they start.
//!
//! Reference: S2 chapter 2 (identity), the reset values in each register's chapter.

use std::sync::Arc;

use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::register::{
    self as r, AlControl, AlStatus, DlControl, EscInformation, Features, FmmuConfig,
    PortDescriptor, PortType, WatchdogDivider, WatchdogTime,
};
use linesman_proto::time::Instant;

use super::clock::{FrameEntries, LocalClock, RunningClock, SyncUnit, TimeLoop};
use super::fmmu::Fmmus;
use super::implemented::ClockUnits;
use super::kind::ControllerKind;
use super::memory::{Memory, Rights, at};
use super::phy::Phys;
use super::port::ControllerPorts;
use super::rx_code::RxReasons;
use super::shadow::Shadow;
use super::sii::Sii;
use super::sync_manager::{self, SyncManagers};
use super::watchdog::Watchdogs;
use crate::hardware::PortKind;

/// All that a MainDevice sees.
#[derive(Debug)]
pub(super) struct Core {
    pub(super) id: DeviceId,
    pub(super) hardware: ControllerKind,
    pub(super) memory: Memory,
    pub(super) rights: Arc<Rights>,
    pub(super) ports: ControllerPorts,
    pub(super) fmmus: Fmmus,
    pub(super) sync_managers: SyncManagers,
    pub(super) sii: Sii,
    pub(super) phys: Phys,
    pub(super) rx_reasons: RxReasons,
    pub(super) shadow: Shadow,
    /// A copy of data that commands which read and write need, kept for its memory.
    pub(super) scratch: Vec<u8>,
    pub(super) clock: RunningClock,
    quartz: LocalClock,
    pub(super) time_loop: TimeLoop,
    pub(super) sync: SyncUnit,
    pub(super) startup: Startup,
    /// A frame has set something going: what is due next must be found anew.
    pub(super) rescheduled: bool,
    /// ECAT events that the mask lets through, for the datagrams that pass.
    pub(super) irq: u16,
    pub(super) watchdogs: Watchdogs,
    /// The processor behind the controller has stopped serving it.
    pub(super) processor_stuck: bool,
    /// Where a coding switch is read, and what it says.
    pub(super) coding_switch: Option<(RegisterAddress, u16)>,
    /// AL status does not copy AL control although device emulation is on: a fault.
    pub(super) emulation_suspended: bool,
    pub(super) reset: EscReset,
    /// When the device behind is to be called.
    pub(super) firmware_at: Option<Instant>,
    pub(super) entries: FrameEntries,
    pub(super) passing: FrameProgress,
}

/// How far a controller has come since its power came.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Startup {
    /// When the power came: ticks of watchdogs count from here.
    pub(super) powered_at: Instant,
    /// The configuration area is loaded: process-data RAM can be reached.
    pub(super) loaded: bool,
    /// The device behind has been started. Never before the configuration area is loaded.
    pub(super) started: bool,
}

/// A reset that a MainDevice or the processor orders by the sequence `R`, `E`, `S`.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct EscReset {
    /// When it is carried out, once the sequence is complete.
    pub(super) at: Option<Instant>,
    /// The frame that wrote the latest byte of the sequence: each comes by one of its own.
    frame: u64,
}

/// What the frame that passes the processing unit has done so far, beside its writes.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct FrameProgress {
    /// When its first bit came.
    pub(super) began: Instant,
    /// Its number in the segment.
    pub(super) number: u64,
    pub(super) read_dl_status: bool,
    pub(super) read_al_status: bool,
    /// Times of the latch unit that were read, one bit each.
    pub(super) read_latches: u8,
    pub(super) enables_registers: bool,
    pub(super) enables_all: bool,
    /// Something was written, be it at once or at the frame's end.
    pub(super) wrote: bool,
    /// SyncManagers that were touched, one bit each.
    pub(super) touched: u16,
}

impl Core {
    pub(super) fn new(
        id: DeviceId,
        hardware: ControllerKind,
        quartz: LocalClock,
        sii: Vec<u8>,
    ) -> Self {
        Self {
            id,
            memory: Memory::new(&hardware),
            rights: hardware.rights(ClockUnits::default()),
            ports: ControllerPorts::new(&hardware),
            fmmus: Fmmus::new(),
            sync_managers: SyncManagers::new(Features(hardware.features).sequential_mode()),
            sii: Sii::new(sii, &hardware),
            phys: Phys::new(&hardware),
            rx_reasons: RxReasons::new(super::implemented::keeps_reasons(&hardware)),
            shadow: Shadow::default(),
            scratch: Vec::new(),
            clock: RunningClock::new(quartz, Instant::ZERO),
            quartz,
            time_loop: TimeLoop::default(),
            sync: SyncUnit::default(),
            startup: Startup::default(),
            rescheduled: false,
            irq: 0,
            watchdogs: Watchdogs::default(),
            processor_stuck: false,
            coding_switch: None,
            emulation_suspended: false,
            reset: EscReset::default(),
            firmware_at: None,
            entries: FrameEntries::default(),
            passing: FrameProgress::default(),
            hardware,
        }
    }

    /// Everything as after power-on but for the links, which belong to the wires.
    pub(super) fn start(&mut self, now: Instant) {
        self.memory.clear();
        self.ports.restart();
        // It begins at 0 (SOEM#48).
        self.clock = RunningClock::new(LocalClock { start: 0, ..self.quartz }, now);
        self.startup = Startup { powered_at: now, ..Startup::default() };
        self.rights = self.hardware.rights(ClockUnits::default());
        self.time_loop = TimeLoop::default();
        self.sync = self.sync.restarted();
        self.irq = 0;
        self.watchdogs.restart();
        self.processor_stuck = false;
        self.reset.at = None;
        self.firmware_at = None;
        self.entries.forget_latches();
        self.shadow.clear();
        self.identify();
        self.put_reset_values();
        self.put_coding_switch();
        for index in 0..usize::from(self.hardware.sync_managers).min(sync_manager::MAX) {
            self.sync_managers.configure(index, &mut self.memory);
        }
        self.configure_fmmus();
        self.sii.power_on(now, &mut self.memory);
        self.start_phys();
        self.refresh_leds();
        let status = self.dl_status();
        self.memory.set_u16(&r::DL_STATUS, status.0);
    }

    /// The supply has been there for long: the clock shows what the segment file says, or chance.
    pub(super) fn clock_runs_before(&mut self, at: Instant) {
        self.clock = RunningClock::new(self.quartz, at);
    }

    fn identify(&mut self) {
        let hardware = &*self.hardware;
        let ports = Port::ALL.into_iter().fold(PortDescriptor::default(), |ports, port| {
            let kind = match hardware.ports[port] {
                PortKind::Absent => PortType::NotImplemented,
                PortKind::Ebus => PortType::Ebus,
                PortKind::Mii => PortType::Mii,
            };
            ports.with_port(port, kind)
        });
        let information = EscInformation {
            controller: r::ControllerType(hardware.controller_type),
            revision: hardware.revision,
            build: hardware.build,
            fmmus: hardware.fmmus,
            sync_managers: hardware.sync_managers,
            ram_kb: hardware.ram_kib,
            ports,
            features: Features(hardware.features),
        };
        self.memory.put(at(&r::ESC_TYPE), &information.to_bytes());
    }

    /// Registers that do not start at 0. Receive times hold whatever was left in them, as real ones
    /// hold letters: those of ports that no frame passes must not be used.
    fn put_reset_values(&mut self) {
        const LEFTOVER: &[u8; 4] = b"left";
        if Features(self.hardware.features).distributed_clocks() {
            for port in Port::ALL {
                self.memory.put(usize::from(r::RECEIVE_TIME.of_port(port).0), LEFTOVER);
            }
        }
        let memory = &mut self.memory;
        memory.set_u32(&r::DL_CONTROL, DlControl::RESET.0);
        memory.set_u16(&r::AL_CONTROL, AlControl::default().0);
        memory.set_u16(&r::AL_STATUS, AlStatus::default().0);
        memory.set_u16(&r::WATCHDOG_DIVIDER, WatchdogDivider::RESET.0);
        memory.set_u16(&r::WATCHDOG_TIME_PDI, WatchdogTime::RESET.0);
        memory.set_u16(&r::WATCHDOG_TIME_PROCESS_DATA, WatchdogTime::RESET.0);
        for register in [
            &r::AL_EVENT_MASK,
            &r::SPEED_COUNTER_START,
            &r::DIFFERENCE_FILTER_DEPTH,
            &r::SPEED_FILTER_DEPTH,
        ] {
            let value = register.reset.unwrap_or(0).to_le_bytes();
            memory.put(at(register), &value[..usize::from(register.len)]);
        }
    }

    /// What stands in memory because a switch is wired there.
    pub(super) fn put_coding_switch(&mut self) {
        if let Some((at, value)) = self.coding_switch
            && usize::from(at.0) + 2 <= self.memory.len()
        {
            self.memory.copy_in(usize::from(at.0), &value.to_le_bytes());
        }
    }

    pub(super) fn power_off(&mut self) {
        self.sii.power_off();
        self.ports.power_off(&self.hardware);
        self.startup.loaded = false;
        self.watchdogs.stop();
        self.reset.at = None;
        self.firmware_at = None;
        self.irq = 0;
        self.sync = self.sync.restarted();
    }

    /// The configuration area was loaded: what depends on it follows.
    pub(super) fn loaded(&mut self) {
        const DEACTIVATED: u8 = 0;
        self.startup.loaded = true;
        let a0 = self.memory.u8(&r::ESC_CONFIGURATION_A0);
        let a5 = self.memory.u16(&r::ESC_CONFIGURATION_A5);
        let units = ClockUnits::configured(&self.hardware, a0, a5);
        self.rights = self.hardware.rights(units);
        // Without an interface nobody triggers its watchdog, as the EK1100 shows.
        self.watchdogs.pdi_ok = self.memory.u8(&r::PDI_CONTROL) != DEACTIVATED;
    }

    /// Calls the device behind at `when`, or earlier if it was to be called earlier anyway.
    pub(super) fn call_firmware(&mut self, when: Instant) {
        self.firmware_at = Some(self.firmware_at.map_or(when, |at| at.min(when)));
    }

    pub(super) fn configure_fmmus(&mut self) {
        let memory = &self.memory;
        let configs = (0..u16::from(self.hardware.fmmus)).filter_map(|index| {
            let address = r::FMMU.at(index)?;
            Some(FmmuConfig::from_bytes(memory.array(usize::from(address.0))))
        });
        self.fmmus.configure(configs, Features(self.hardware.features));
        if self.fmmus.crossed() {
            self.scratch.reserve(2_048);
        }
    }

    /// A byte of the reset sequence was written: `R`, `E`, `S` in three frames.
    pub(super) fn reset_written(&mut self, value: u8, end: Instant) {
        let another_frame = self.reset.frame != self.passing.number;
        self.reset.frame = self.passing.number;
        self.reset_step(&r::ESC_RESET_ECAT, value, another_frame, end);
    }

    /// A byte of the reset sequence came to one of its two registers. `fresh` says that it came by
    /// an access of its own.
    pub(super) fn reset_step(
        &mut self,
        register: &r::Register,
        value: u8,
        fresh: bool,
        when: Instant,
    ) {
        const SEQUENCE: [u8; 3] = *b"RES";
        let progress = usize::from(self.memory.u8(register));
        let step = match SEQUENCE.get(progress) {
            Some(expected) if *expected == value && (fresh || progress == 0) => progress + 1,
            _ => usize::from(value == SEQUENCE[0]),
        };
        self.memory.set_u8(register, step as u8);
        if step == SEQUENCE.len() {
            self.reset.at = Some(when);
        }
    }
}
