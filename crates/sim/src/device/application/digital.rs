//! Digital channels of devices with a processor.

use linesman_proto::time::Instant;

use super::{Channel, ChannelValue};
use crate::device::dictionary::Dictionary;
use crate::device::signal::{SignalId, Signals};

/// A digital output.
#[derive(Clone, Debug)]
pub struct DigitalOutput {
    value: ChannelValue,
    signal: SignalId,
}

impl DigitalOutput {
    /// The output whose value is this entry.
    #[must_use]
    pub fn new(dictionary: &Dictionary, index: u16, subindex: u8, signal: SignalId) -> Self {
        Self { value: ChannelValue::of(dictionary, index, subindex), signal }
    }
}

impl Channel for DigitalOutput {
    fn drive(&mut self, _now: Instant, dictionary: &Dictionary, signals: &mut Signals) {
        signals.set(self.signal, i32::from(self.value.is_set(dictionary)));
    }

    fn make_safe(&mut self, _now: Instant, _dictionary: &Dictionary, signals: &mut Signals) {
        signals.set(self.signal, 0);
    }

    fn lose_supply(&mut self, signals: &mut Signals) {
        signals.set(self.signal, 0);
    }
}
