//! The times of two networks, or of a network and a clock outside: what a MainDevice needs to keep
//! one with the other.
//!
//! Objects 0x10F4 (what is found) and 0x10F5 (who sets the pace), status word as facts has it. The
//! time of the other side is modelled by one signal: how many ns it is ahead of this network's; while
//! nothing drives it, nothing is connected.

use linesman_proto::time::Instant;

use super::{Channel, ChannelValue};
use crate::device::dictionary::Dictionary;
use crate::device::signal::{SignalId, Signals};

/// Sync modes of 0x10F4:01.
const SECONDARY_LEADS: u64 = 1;
const PRIMARY_LEADS: u64 = 2;

/// The two times.
#[derive(Clone, Debug)]
pub struct TwoTimes {
    ahead: SignalId,
    /// The other side is there, whatever its time is.
    connected: bool,
    system_time: u64,
    secondary_leads: ChannelValue,
    mode: ChannelValue,
    control_toggle: ChannelValue,
    stamp_toggle: ChannelValue,
    alone: ChannelValue,
    internal: ChannelValue,
    external: ChannelValue,
    control: ChannelValue,
    /// Toggle bits of the PDOs: status word of each of them.
    toggles: [ChannelValue; 4],
}

impl TwoTimes {
    /// With the objects of external synchronisation.
    #[must_use]
    pub fn new(dictionary: &Dictionary, ahead: SignalId) -> Self {
        let value = |subindex| ChannelValue::of(dictionary, 0x10F4, subindex);
        Self {
            ahead,
            connected: false,
            system_time: 0,
            secondary_leads: ChannelValue::of(dictionary, 0x10F5, 0x01),
            mode: value(0x01),
            control_toggle: value(0x0E),
            stamp_toggle: value(0x0F),
            alone: value(0x10),
            internal: value(0x11),
            external: value(0x12),
            control: value(0x13),
            toggles: [0x1800, 0x1801, 0x1802, 0x1803]
                .map(|parameter| ChannelValue::of(dictionary, parameter, 0x09)),
        }
    }

    /// The other side is there, or not. While nobody says how far its time is ahead, both are in one
    /// network and have one time.
    pub fn set_connected(&mut self, connected: bool) {
        self.connected = connected;
    }

    fn toggle(value: ChannelValue, dictionary: &mut Dictionary) {
        let on = !value.is_set(dictionary);
        value.set_bit(dictionary, on);
    }
}

impl Channel for TwoTimes {
    fn has_inputs(&self) -> bool {
        true
    }

    fn tell_time(&mut self, system_time_ns: u64) {
        self.system_time = system_time_ns;
    }

    fn sample(&mut self, _now: Instant, dictionary: &mut Dictionary, signals: &Signals) {
        for toggle in self.toggles {
            Self::toggle(toggle, dictionary);
        }
        let ahead = signals.driven(self.ahead).or(self.connected.then_some(0));
        self.alone.set_bit(dictionary, ahead.is_none());
        let Some(ahead) = ahead else {
            self.mode.set(dictionary, 0);
            return;
        };
        let secondary = self.secondary_leads.is_set(dictionary);
        self.mode.set(dictionary, if secondary { SECONDARY_LEADS } else { PRIMARY_LEADS });
        let other = self.system_time.wrapping_add_signed(i64::from(ahead));
        self.internal.set(dictionary, self.system_time);
        self.external.set(dictionary, other);
        Self::toggle(self.stamp_toggle, dictionary);
        // By how much this network has to hurry.
        self.control.set(dictionary, ahead as u64);
        Self::toggle(self.control_toggle, dictionary);
    }
}
