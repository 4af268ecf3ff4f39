//! Values of the process data that are nothing but electrical signals.

use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::time::Instant;

use crate::device::application::Channel;
use crate::device::dictionary::{Dictionary, EntryRef};
use crate::device::signal::{SignalId, Signals};

/// An object and the signals that carry its value, lowest 32 bits first.
#[derive(Clone, Debug)]
struct ObjectSignals {
    entry: EntryRef,
    bits: usize,
    signals: Vec<SignalId>,
}

/// Objects with their signals, as far as the dictionary has them.
#[derive(Clone, Default, Debug)]
struct ChannelObjects(Vec<ObjectSignals>);

impl ChannelObjects {
    fn push(
        &mut self,
        dictionary: &Dictionary,
        address: ObjectAddress,
        bits: usize,
        signals: &[SignalId],
    ) {
        if let Some(entry) = dictionary.find(address) {
            self.0.push(ObjectSignals { entry, bits, signals: signals.to_vec() });
        }
    }
}

/// Outputs: each object drives its signals.
#[derive(Clone, Default, Debug)]
pub(super) struct Driven(ChannelObjects);

impl Driven {
    pub(super) fn push(
        &mut self,
        dictionary: &Dictionary,
        address: ObjectAddress,
        bits: usize,
        signals: &[SignalId],
    ) {
        self.0.push(dictionary, address, bits, signals);
    }

    fn set_all(&self, signals: &mut Signals, value: impl Fn(&ObjectSignals) -> u64) {
        for carried in &self.0.0 {
            let value = value(carried);
            for (signal, shift) in carried.signals.iter().zip([0, 32]) {
                signals.set(*signal, (value >> shift) as u32 as i32);
            }
        }
    }
}

impl Channel for Driven {
    fn drive(&mut self, _now: Instant, dictionary: &Dictionary, signals: &mut Signals) {
        self.set_all(signals, |carried| dictionary.number(carried.entry));
    }

    fn make_safe(&mut self, _now: Instant, _dictionary: &Dictionary, signals: &mut Signals) {
        self.set_all(signals, |_| 0);
    }

    fn lose_supply(&mut self, signals: &mut Signals) {
        self.set_all(signals, |_| 0);
    }
}

/// Inputs: each object takes what its signals carry. One that nothing drives keeps its value.
#[derive(Clone, Default, Debug)]
pub(super) struct Taken(ChannelObjects);

impl Taken {
    pub(super) fn push(
        &mut self,
        dictionary: &Dictionary,
        address: ObjectAddress,
        bits: usize,
        signals: &[SignalId],
    ) {
        self.0.push(dictionary, address, bits, signals);
    }
}

impl Channel for Taken {
    fn has_inputs(&self) -> bool {
        !self.0.0.is_empty()
    }

    fn sample(&mut self, _now: Instant, dictionary: &mut Dictionary, signals: &Signals) {
        for carried in &self.0.0 {
            let driven = carried.signals.iter().any(|signal| signals.driven(*signal).is_some());
            if driven {
                let parts = carried.signals.iter().zip([0, 32]);
                let value = parts.fold(0, |value, (signal, shift)| {
                    value | u64::from(signals.value(*signal) as u32) << shift
                });
                let kept =
                    if carried.bits >= 64 { value } else { value & ((1 << carried.bits) - 1) };
                dictionary.set_number(carried.entry, kept);
            }
        }
    }
}
