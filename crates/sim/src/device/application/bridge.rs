//! One side of a bridge between two networks: what its MainDevice puts out the other side takes in.
//!
//! Objects 0x7000 (out) and 0x6000 (in), 32 bits an entry; which of them are exchanged the MainDevice
//! says by the mapping of the PDO of user data, which is empty after power-on. The values are signals,
//! one for each entry; behind them is the time of the other side. What is not driven from over there
//! keeps its value, and when nothing is, nothing is connected.

use linesman_proto::time::Instant;

use super::two_times::TwoTimes;
use super::{Channel, ChannelValue};
use crate::device::dictionary::Dictionary;
use crate::device::signal::{SignalId, Signals};

/// Values for the other side.
pub const OUTPUTS: u16 = 0x7000;
/// Values from there.
pub const INPUTS: u16 = 0x6000;

/// A side of a bridge.
#[derive(Clone, Debug)]
pub struct Bridge {
    times: TwoTimes,
    outputs: Vec<(ChannelValue, SignalId)>,
    inputs: Vec<(ChannelValue, SignalId)>,
}

impl Bridge {
    /// With these signals for user data, and one for the time of the other side.
    #[must_use]
    pub fn new(
        dictionary: &Dictionary,
        outputs: &[SignalId],
        inputs: &[SignalId],
        ahead: SignalId,
    ) -> Self {
        let of = |index, signals: &[SignalId]| {
            let values = (1u8..=255).map(|subindex| ChannelValue::of(dictionary, index, subindex));
            values.zip(signals.iter().copied()).collect()
        };
        Self {
            times: TwoTimes::new(dictionary, ahead),
            outputs: of(OUTPUTS, outputs),
            inputs: of(INPUTS, inputs),
        }
    }
}

impl Channel for Bridge {
    fn drive(&mut self, _now: Instant, dictionary: &Dictionary, signals: &mut Signals) {
        for (value, signal) in &self.outputs {
            signals.set(*signal, value.get(dictionary) as u32 as i32);
        }
    }

    fn make_safe(&mut self, _now: Instant, _dictionary: &Dictionary, signals: &mut Signals) {
        for (_, signal) in &self.outputs {
            signals.set(*signal, 0);
        }
    }

    fn lose_supply(&mut self, signals: &mut Signals) {
        for (_, signal) in &self.outputs {
            signals.release(*signal);
        }
    }

    fn has_inputs(&self) -> bool {
        true
    }

    fn tell_time(&mut self, system_time_ns: u64) {
        self.times.tell_time(system_time_ns);
    }

    fn sample(&mut self, now: Instant, dictionary: &mut Dictionary, signals: &Signals) {
        let mut connected = false;
        for (value, signal) in &self.inputs {
            if let Some(driven) = signals.driven(*signal) {
                value.set(dictionary, u64::from(driven as u32));
                connected = true;
            }
        }
        self.times.set_connected(connected);
        self.times.sample(now, dictionary, signals);
    }
}
