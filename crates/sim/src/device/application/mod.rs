//! Application of a device: channels between its process data and electrical signals.

pub mod analog;
pub mod bridge;
pub mod digital;
pub mod drive;
pub(crate) mod motion;
pub mod oversampling;
pub mod sercos;
pub mod stepper;
pub mod time_stamp;
pub mod two_times;

use std::fmt::Debug;

use linesman_proto::mailbox::coe::{Emergency, ObjectAddress};
use linesman_proto::time::Instant;

use super::dictionary::{Dictionary, EntryRef};
use super::signal::Signals;

/// A channel, or an axis.
pub trait Channel: Debug + Send {
    /// Fresh outputs are in their objects, and the device is in OP.
    fn drive(&mut self, _now: Instant, _dictionary: &Dictionary, _signals: &mut Signals) {}

    /// Outputs go to their safe values: not in OP, or the watchdog expired.
    fn make_safe(&mut self, _now: Instant, _dictionary: &Dictionary, _signals: &mut Signals) {}

    /// The supply is gone.
    fn lose_supply(&mut self, _signals: &mut Signals) {}

    /// Whether [`Channel::sample`] is wanted.
    fn has_inputs(&self) -> bool {
        false
    }

    /// What the device's copy of the system time shows, in ns: told before each sample.
    fn tell_time(&mut self, _system_time_ns: u64) {}

    /// An error to tell the MainDevice of, once. Asked after outputs were driven and inputs sampled.
    fn emergency(&mut self) -> Option<Emergency> {
        None
    }

    /// Inputs go into their objects.
    fn sample(&mut self, _now: Instant, _dictionary: &mut Dictionary, _signals: &Signals) {}
}

/// An object of a channel, which a type may lack.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct ChannelValue(Option<EntryRef>);

impl ChannelValue {
    fn of(dictionary: &Dictionary, index: u16, subindex: u8) -> Self {
        Self(dictionary.find(ObjectAddress::new(index, subindex)))
    }

    fn get(self, dictionary: &Dictionary) -> u64 {
        self.0.map_or(0, |at| dictionary.number(at))
    }

    fn is_set(self, dictionary: &Dictionary) -> bool {
        self.get(dictionary) != 0
    }

    /// The value of an object of 16 bits with a sign.
    fn get_i16(self, dictionary: &Dictionary) -> i32 {
        i32::from(self.get(dictionary) as u16 as i16)
    }

    fn set(self, dictionary: &mut Dictionary, value: u64) {
        if let Some(at) = self.0 {
            dictionary.set_number(at, value);
        }
    }

    fn set_bit(self, dictionary: &mut Dictionary, on: bool) {
        self.set(dictionary, u64::from(on));
    }
}
