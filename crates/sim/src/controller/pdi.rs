//! The controller as the device behind it sees it: the process data interface.
//!
//! Read first: S2 2.5 (AL control and status), 2.8 (AL events), S1 chapter 8 (SyncManager).

use std::ops::Range;

use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::register::{self as r, AlControl, AlEvents, AlStatus, SyncManagerConfig};
use linesman_proto::state::AlStatusCode;
use linesman_proto::time::Instant;

use super::clock::{Edge, LatchInput, SyncSignal};
use super::core::Core;
use super::memory::RAM;
use super::sync_manager;
use crate::device::Signals;

/// What a [`Firmware`](crate::device::Firmware) may do with its controller, at one instant.
#[derive(Debug)]
pub struct Pdi<'a> {
    pub(super) core: &'a mut Core,
    pub(super) signals: &'a mut Signals,
    pub(super) now: Instant,
}

impl Pdi<'_> {
    /// Whose controller it is.
    #[must_use]
    pub fn id(&self) -> DeviceId {
        self.core.id
    }

    /// The instant of this call.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.now
    }

    // ---- application layer ----

    /// AL control as the MainDevice wrote it last. Looking does not take the request.
    #[must_use]
    pub fn al_control(&self) -> AlControl {
        AlControl(self.core.memory.u16(&r::AL_CONTROL))
    }

    /// A new request in AL control, if there is one; takes it, so that the MainDevice can write the
    /// next.
    pub fn take_al_control_event(&mut self) -> Option<AlControl> {
        let new = self.core.al_events().contains(AlEvents::AL_CONTROL);
        self.core.clear_al_events(AlEvents::AL_CONTROL);
        new.then(|| self.al_control())
    }

    /// AL status as it stands.
    #[must_use]
    pub fn al_status(&self) -> AlStatus {
        AlStatus(self.core.memory.u16(&r::AL_STATUS))
    }

    /// Sets AL status. Not with device emulation: there the controller does it.
    pub fn set_al_status(&mut self, status: AlStatus) {
        if !self.core.emulates_device() {
            self.core.set_al_status(status);
        }
    }

    /// Sets the AL status code, 0x0134. Set it before the status that points at it.
    pub fn set_al_code(&mut self, code: AlStatusCode) {
        self.core.memory.set_u16(&r::AL_STATUS_CODE, code.0);
    }

    /// Whether AL status follows AL control without a processor (0x0141, bit 0).
    #[must_use]
    pub fn emulates_device(&self) -> bool {
        self.core.emulates_device()
    }

    // ---- events ----

    /// AL event request, 0x0220: what happened and was not served yet.
    #[must_use]
    pub fn events(&self) -> AlEvents {
        self.core.al_events()
    }

    /// AL event mask, 0x0204. It is for the interrupt line, which firmware here does without: it is
    /// called for every event.
    pub fn set_event_mask(&mut self, mask: AlEvents) {
        self.core.memory.set_u32(&r::AL_EVENT_MASK, mask.0);
    }

    /// Whether a SyncManager was switched on or off, or a repeat requested, since the last call.
    pub fn take_activation_event(&mut self) -> bool {
        let new = self.core.al_events().contains(AlEvents::SYNC_MANAGER_ACTIVATION);
        self.core.clear_al_events(AlEvents::SYNC_MANAGER_ACTIVATION);
        new
    }

    // ---- SyncManagers ----

    /// The registers of a SyncManager; `None` for one the controller does not have.
    #[must_use]
    pub fn sync_manager(&self, index: u8) -> Option<SyncManagerConfig> {
        self.index(index).map(|index| sync_manager::config(index, &self.core.memory))
    }

    /// Reads what the MainDevice wrote last, as far as `buffer` reaches, and returns the
    /// SyncManager's length. A mailbox is empty then. `None` when there is nothing: an empty
    /// mailbox, process data that never came, a SyncManager that is off or of the other direction.
    pub fn read_sync_manager(&mut self, index: u8, buffer: &mut [u8]) -> Option<usize> {
        let index = self.index(index)?;
        let len = self.core.sync_managers.read_by_pdi(index, buffer, &mut self.core.memory)?;
        self.core.refresh_sync_manager_events(index, self.now);
        Some(len)
    }

    /// Gives the MainDevice something to read; what `data` lacks to the SyncManager's length is
    /// filled with 0, but in a mailbox, where it stays what it was. False when it cannot be taken: a full mailbox, too much data, a SyncManager
    /// that is off or of the other direction.
    pub fn write_sync_manager(&mut self, index: u8, data: &[u8]) -> bool {
        let Some(index) = self.index(index) else { return false };
        let taken = self.core.sync_managers.write_by_pdi(index, data, &mut self.core.memory);
        if taken {
            self.core.refresh_sync_manager_events(index, self.now);
        }
        taken
    }

    /// Begins to write what [`Pdi::write_sync_manager`] will complete. `shown` says whether this type
    /// of controller shows the buffer as open meanwhile (SyncManager status, bit 7): not all do.
    pub fn open_sync_manager(&mut self, index: u8, shown: bool) {
        let Some(index) = self.index(index) else { return };
        self.core.sync_managers.open_by_pdi(index, shown, &mut self.core.memory);
        self.core.refresh_sync_manager_events(index, self.now);
    }

    /// Whether a mailbox holds a message, in either direction.
    #[must_use]
    pub fn mailbox_full(&self, index: u8) -> bool {
        self.index(index).is_some_and(|index| self.core.sync_managers.is_full(index))
    }

    /// Locks the memory of a SyncManager, so that accesses add nothing to the working counter, or
    /// unlocks it: then it is as if it had just been switched on.
    pub fn deactivate_sync_manager(&mut self, index: u8, deactivated: bool) {
        self.change_pdi_control(index, |control| control.with_deactivated(deactivated));
    }

    /// Whether the MainDevice wants the last mailbox message again: its repeat request differs from
    /// the acknowledgement.
    #[must_use]
    pub fn repeat_requested(&self, index: u8) -> bool {
        self.sync_manager(index).is_some_and(|config| {
            config.activate.repeat_request() != config.pdi_control.repeat_acknowledge()
        })
    }

    /// Says that the message is in the mailbox again.
    pub fn acknowledge_repeat(&mut self, index: u8) {
        let Some(config) = self.sync_manager(index) else { return };
        let request = config.activate.repeat_request();
        self.change_pdi_control(index, |control| control.with_repeat_acknowledge(request));
    }

    fn change_pdi_control(
        &mut self,
        index: u8,
        change: impl Fn(r::SmPdiControl) -> r::SmPdiControl,
    ) {
        const PDI_CONTROL: usize = 7;
        let Some(index) = self.index(index) else { return };
        let control = sync_manager::config(index, &self.core.memory).pdi_control;
        let at = sync_manager::address(index) + PDI_CONTROL;
        self.core.memory.put(at, &[change(control).0]);
        self.core.sync_managers.configure(index, &mut self.core.memory);
        self.core.refresh_sync_manager_events(index, self.now);
    }

    fn index(&self, index: u8) -> Option<usize> {
        let count = usize::from(self.core.hardware.sync_managers).min(sync_manager::MAX);
        Some(usize::from(index)).filter(|index| *index < count)
    }

    // ---- memory ----

    /// Process-data RAM by its addresses, from 0x1000 up, past all SyncManagers. Parts that do not
    /// exist are cut off.
    #[must_use]
    pub fn ram(&self, range: Range<u16>) -> &[u8] {
        self.core.memory.ram(usize::from(range.start).max(RAM), usize::from(range.end))
    }

    /// Puts bytes into process-data RAM from `start` on, as far as it reaches; what would lie below
    /// it goes nowhere.
    pub fn put_ram(&mut self, start: RegisterAddress, data: &[u8]) {
        let start = usize::from(start.0);
        let skipped = RAM.saturating_sub(start).min(data.len());
        self.core.memory.copy_in(start + skipped, &data[skipped..]);
    }

    /// A byte of a register, without any effect of reading it.
    #[must_use]
    pub fn register(&self, address: RegisterAddress) -> u8 {
        self.core.memory.byte(usize::from(address.0))
    }

    /// A register of two bytes.
    #[must_use]
    pub fn register_u16(&self, address: RegisterAddress) -> u16 {
        let high = self.register(RegisterAddress(address.0.saturating_add(1)));
        u16::from_le_bytes([self.register(address), high])
    }

    /// The digital outputs at 0x0F00 to 0x0F03.
    #[must_use]
    pub fn digital_outputs(&self) -> u32 {
        self.core.memory.u32(&r::DIGITAL_OUTPUT)
    }

    /// Sets the station alias, 0x0012.
    pub fn set_station_alias(&mut self, alias: u16) {
        self.core.memory.set_u16(&r::STATION_ALIAS, alias);
    }

    /// Whether the configuration area of the SII was loaded; without it process-data RAM cannot be
    /// reached by the MainDevice.
    #[must_use]
    pub fn sii_load_ok(&self) -> bool {
        self.core.startup.loaded
    }

    /// Whether the MainDevice has handed the SII to this side (0x0500, bit 0).
    #[must_use]
    pub fn sii_offered(&self) -> bool {
        self.core.memory.u8(&r::SII_ACCESS_ECAT) & 1 != 0
    }

    // ---- watchdogs, errors ----

    /// Whether the process data watchdog has expired, or was never started (0x0440). Takes the
    /// event of its expiry.
    pub fn watchdog_expired(&mut self) -> bool {
        self.core.clear_al_events(AlEvents::PROCESS_DATA_WATCHDOG);
        self.core.memory.u16(&r::WATCHDOG_STATUS_PROCESS_DATA) & 1 == 0
    }

    /// The processor stops serving its controller, so that the PDI watchdog runs out, or serves it
    /// again. Otherwise it counts as served all the time, without a call.
    pub fn set_processor_stuck(&mut self, stuck: bool) {
        self.core.set_processor_stuck(stuck, self.now);
    }

    /// An access of the processor went wrong: 0x030D.
    pub fn count_pdi_error(&mut self) {
        self.core.increment(r::PDI_ERROR_COUNTER.address);
    }

    // ---- SYNC and latch unit ----

    /// What the MainDevice switched on in 0x0981: bit 0 the unit, bits 1 and 2 SYNC0 and SYNC1.
    #[must_use]
    pub fn sync_activation(&self) -> u8 {
        self.core.memory.u8(&r::SYNC_ACTIVATION)
    }

    /// The cycle of a signal: 0x09A0 or 0x09A4, in ns.
    #[must_use]
    pub fn sync_cycle(&self, signal: SyncSignal) -> u32 {
        self.core.memory.u32(match signal {
            SyncSignal::Sync0 => &r::SYNC0_CYCLE_TIME,
            SyncSignal::Sync1 => &r::SYNC1_CYCLE_TIME,
        })
    }

    /// Reads the status of a signal, which ends its pulse in acknowledge mode.
    pub fn acknowledge_sync(&mut self, signal: SyncSignal) {
        self.core.acknowledge_sync(signal);
    }

    /// An input of the latch unit has this level since `when`.
    pub fn set_latch_input(&mut self, input: LatchInput, high: bool, when: Instant) {
        self.core.set_latch_input(input, high, when);
    }

    /// Reads the system time of an edge, which takes its event if this side owns the input.
    pub fn latch_time(&mut self, input: LatchInput, edge: Edge) -> u64 {
        self.core.read_latch_time(input, edge)
    }

    // ---- time and signals ----

    /// The local clock, in ns since power-on.
    #[must_use]
    pub fn local_time(&self) -> u64 {
        self.core.clock.local(self.now)
    }

    /// The local copy of the system time, in ns.
    #[must_use]
    pub fn system_time(&self) -> u64 {
        self.core.system_time(self.now)
    }

    /// The electrical signals of the segment.
    #[must_use]
    pub fn signals(&self) -> &Signals {
        self.signals
    }

    /// The same, to drive.
    pub fn signals_mut(&mut self) -> &mut Signals {
        self.signals.at(self.now)
    }
}
