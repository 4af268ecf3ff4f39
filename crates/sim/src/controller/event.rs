//! Events: what the controller reports to the MainDevice (0x0210) and to the device behind it
//! (0x0220), and AL control and status, which raise most of them.
//!
//! Reference: S2 2.5, 2.8. Each event goes away when its source is served, not by reading the
//! request register.

use linesman_proto::register::{self as r, AlEvents, AlStatus, EcatEvents};
use linesman_proto::state::AlState;
use linesman_proto::time::Instant;

use super::core::Core;

/// Bit 0 of 0x0141.
const DEVICE_EMULATION: u8 = 1;

impl Core {
    pub(super) fn al_events(&self) -> AlEvents {
        AlEvents(self.memory.u32(&r::AL_EVENT_REQUEST))
    }

    /// Sets events for the device behind, and calls it for those that are new.
    pub(super) fn raise_al_events(&mut self, events: AlEvents, when: Instant) {
        let before = self.al_events();
        if !before.contains(events) {
            self.memory.set_u32(&r::AL_EVENT_REQUEST, before.with(events).0);
            self.call_firmware(when);
        }
    }

    pub(super) fn clear_al_events(&mut self, events: AlEvents) {
        let left = self.al_events().without(events);
        self.memory.set_u32(&r::AL_EVENT_REQUEST, left.0);
    }

    pub(super) fn raise_ecat_events(&mut self, events: EcatEvents) {
        let request = EcatEvents(self.memory.u16(&r::ECAT_EVENT_REQUEST)).with(events);
        self.put_ecat_events(request);
    }

    pub(super) fn clear_ecat_events(&mut self, events: EcatEvents) {
        let request = EcatEvents(self.memory.u16(&r::ECAT_EVENT_REQUEST)).without(events);
        self.put_ecat_events(request);
    }

    fn put_ecat_events(&mut self, request: EcatEvents) {
        self.memory.set_u16(&r::ECAT_EVENT_REQUEST, request.0);
        self.refresh_irq();
    }

    /// What datagrams carry away in their event field follows request and mask.
    pub(super) fn refresh_irq(&mut self) {
        let mask = EcatEvents(self.memory.u16(&r::ECAT_EVENT_MASK));
        self.irq = EcatEvents(self.memory.u16(&r::ECAT_EVENT_REQUEST)).masked(mask).0;
    }

    /// The events of SyncManager `index` follow its state. `when` it is new, the device is called.
    pub(super) fn refresh_sync_manager_events(&mut self, index: usize, when: Instant) {
        let al = AlEvents::sync_manager(index as u16);
        if self.sync_managers.raises_al_event(index) {
            self.raise_al_events(al, when);
        } else {
            self.clear_al_events(al);
        }
        let ecat = EcatEvents::sync_manager(index as u16);
        if self.sync_managers.raises_ecat_event(index) {
            self.raise_ecat_events(ecat);
        } else {
            self.clear_ecat_events(ecat);
        }
    }

    /// Whether there is no processor that answers requests: AL status copies AL control. A fault can
    /// suspend that (and 0x0141 does not show it).
    pub(super) fn emulates_device(&self) -> bool {
        !self.emulation_suspended
            && self.memory.u8(&r::ESC_CONFIGURATION_A0) & DEVICE_EMULATION != 0
    }

    /// Whether the MainDevice may write AL control: not before the last request was taken.
    pub(super) fn takes_al_control(&self) -> bool {
        self.emulates_device() || !self.al_events().contains(AlEvents::AL_CONTROL)
    }

    /// The MainDevice wrote AL control.
    pub(super) fn al_control_written(&mut self, when: Instant) {
        if self.emulates_device() {
            let control = self.memory.u16(&r::AL_CONTROL);
            self.set_al_status(AlStatus(control));
            self.call_firmware(when);
        } else {
            self.raise_al_events(AlEvents::AL_CONTROL, when);
        }
    }

    /// Shows another AL status, and tells of the change.
    pub(super) fn set_al_status(&mut self, status: AlStatus) {
        if self.memory.u16(&r::AL_STATUS) != status.0 {
            self.memory.set_u16(&r::AL_STATUS, status.0);
            self.refresh_leds();
            if status.state().state().is_some_and(AlState::has_inputs) {
                self.sii.forget_first_owner(&mut self.memory);
            }
            self.raise_ecat_events(EcatEvents::AL_STATUS);
        }
    }
}
