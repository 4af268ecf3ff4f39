//! Cards of the line as the host sees them, the lock of outputs after a link error, and its reset (PLC-07).

use linesman_proto::address::Path;
use linesman_proto::state::NetworkState;
use linesman_proto::time::{Instant, Span};

use super::MainDevice;
use crate::event::Event;
use crate::executor::lock;

/// Time after the last frame that a card did not take until it counts as taking them again.
const FORGIVEN_AFTER: Span = Span::s(1);

/// Cards of the line, as the host sees them.
#[derive(Clone, Copy, Debug)]
pub(super) struct CardStates {
    /// Which of them have a link.
    links: [bool; 2],
    /// Time at which a card that took no frame counts as taking them again; [`Instant::MAX`]: all take them.
    forgiven_at: Instant,
    /// Outputs are locked.
    pub(super) locked: bool,
}

impl Default for CardStates {
    fn default() -> Self {
        Self { links: [true; 2], forgiven_at: Instant::MAX, locked: false }
    }
}

impl CardStates {
    /// True when a card that took no frame has taken them for a while.
    #[inline]
    pub(super) fn is_forgiven(&self, now: Instant) -> bool {
        self.forgiven_at <= now
    }
}

impl MainDevice {
    /// Takes that a card has a link, or has none. Where the plan says so
    /// ([`lock_after_link_error`](linesman_config::plan::Plan)), the outputs of a line that runs are withheld once no card has a
    /// link, until [`MainDevice::reset`].
    pub fn handle_carrier(&mut self, card: Path, carrier: bool) {
        self.cards.links[card.index()] = carrier;
        let is_down = !self.cards.links[0] && (!self.options.ring || !self.cards.links[1]);
        let Some(running) = &mut self.running else { return };
        running.network_status.set_carrier(card, carrier);
        let has_run = running.network_status.present() > 0;
        if is_down && has_run && running.plan.lock_after_link_error && !self.cards.locked {
            self.cards.locked = true;
            running.cyclic.set_locked(true);
            lock(&running.device_table).set_locked(true);
            self.executor.emit(Event::OutputsLocked);
        }
    }

    /// Takes that a card did not take a frame.
    pub fn handle_send_failure(&mut self, now: Instant) {
        self.cards.forgiven_at = now + FORGIVEN_AFTER;
        self.set_state_bit(NetworkState::OUT_OF_SEND_RESOURCES, true);
    }

    #[cold]
    pub(super) fn forgive_send_failures(&mut self) {
        self.cards.forgiven_at = Instant::MAX;
        self.set_state_bit(NetworkState::OUT_OF_SEND_RESOURCES, false);
    }

    /// Takes that an interface of the line, or its driver, is gone: nothing is sent any more.
    pub fn handle_interface_gone(&mut self) {
        self.set_state_bit(NetworkState::DRIVER, true);
    }

    /// True while outputs are withheld after a link error.
    #[must_use]
    pub const fn is_locked(&self) -> bool {
        self.cards.locked
    }

    /// Resets the network: outputs that were locked after a link error are sent again, and SubDevices go on to their targets.
    /// Until they are there, the state word has [`NetworkState::RESET`]. False when no plan runs.
    pub fn reset(&mut self) -> bool {
        let Some(running) = &mut self.running else { return false };
        if std::mem::take(&mut self.cards.locked) {
            running.cyclic.set_locked(false);
            lock(&running.device_table).set_locked(false);
        }
        self.executor.emit(Event::ResetBegun);
        true
    }

    fn set_state_bit(&mut self, bit: u16, set: bool) {
        if let Some(running) = &mut self.running {
            running.network_status.set(bit, set);
        }
    }
}
