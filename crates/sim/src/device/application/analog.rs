//! Analogue channels: value and status, limits, scaling.
//!
//! The numbers of a signal are digits of the nominal range: 0x7FFF is its end. Where nothing drives
//! an input it sees a slow wave, so that process data move as they do in a plant.

use linesman_proto::time::Instant;

use super::{Channel, ChannelValue};
use crate::device::dictionary::Dictionary;
use crate::device::signal::{SignalId, Signals};

/// The range of a channel in digits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Range {
    /// The least value.
    pub minimum: i32,
    /// The greatest value.
    pub maximum: i32,
    /// Lowest bits that the converter does not resolve.
    pub unresolved_bits: u8,
}

impl Range {
    /// Both signs, 16 bits: ±10 V and the like.
    pub const BIPOLAR: Self = Self { minimum: -0x8000, maximum: 0x7FFF, unresolved_bits: 0 };
    /// One sign, 16 bits: 0 to 10 V, 4 to 20 mA.
    pub const UNIPOLAR: Self = Self { minimum: 0, maximum: 0x7FFF, unresolved_bits: 0 };
    /// Both signs, 12 bits.
    pub const BIPOLAR_12: Self = Self { unresolved_bits: 4, ..Self::BIPOLAR };
    /// One sign, 12 bits.
    pub const UNIPOLAR_12: Self = Self { unresolved_bits: 4, ..Self::UNIPOLAR };
}

/// Subindices of status and value within an input's object.
mod status {
    pub(super) const UNDERRANGE: u8 = 0x01;
    pub(super) const OVERRANGE: u8 = 0x02;
    pub(super) const LIMIT_1: u8 = 0x03;
    pub(super) const LIMIT_2: u8 = 0x05;
    pub(super) const ERROR: u8 = 0x07;
    pub(super) const TOGGLE: u8 = 0x10;
    pub(super) const VALUE: u8 = 0x11;
}

/// Subindices of a channel's settings.
mod setting {
    pub(super) const USER_SCALE: u8 = 0x01;
    pub(super) const ENABLE_LIMIT_1: u8 = 0x07;
    pub(super) const ENABLE_LIMIT_2: u8 = 0x08;
    pub(super) const OFFSET: u8 = 0x11;
    pub(super) const GAIN: u8 = 0x12;
    pub(super) const LIMIT_1: u8 = 0x13;
    pub(super) const LIMIT_2: u8 = 0x14;
    pub(super) const DEFAULT_OUTPUT: u8 = 0x13;
}

/// Scaling by the user: gain in 1/65536, then offset.
#[derive(Clone, Copy, Debug)]
struct Scale {
    on: ChannelValue,
    offset: ChannelValue,
    gain: ChannelValue,
}

impl Scale {
    fn of(dictionary: &Dictionary, settings: u16) -> Self {
        let value = |subindex| ChannelValue::of(dictionary, settings, subindex);
        Self {
            on: value(setting::USER_SCALE),
            offset: value(setting::OFFSET),
            gain: value(setting::GAIN),
        }
    }

    fn apply(self, raw: i32, dictionary: &Dictionary) -> i32 {
        if !self.on.is_set(dictionary) {
            return raw;
        }
        let gain = i64::from(self.gain.get(dictionary) as u32 as i32);
        let scaled = ((i64::from(raw) * gain) >> 16) + i64::from(self.offset.get_i16(dictionary));
        scaled.clamp(-0x8000, 0x7FFF) as i32
    }
}

/// An analogue input with its status word.
#[derive(Clone, Debug)]
pub struct AnalogInput {
    signal: SignalId,
    range: Range,
    /// What makes the waves of several channels differ.
    phase: u64,
    underrange: ChannelValue,
    overrange: ChannelValue,
    limits: [Limit; 2],
    error: ChannelValue,
    toggle: ChannelValue,
    value: ChannelValue,
    scale: Scale,
}

#[derive(Clone, Copy, Debug)]
struct Limit {
    status: ChannelValue,
    on: ChannelValue,
    at: ChannelValue,
}

impl Limit {
    fn apply(self, value: i32, dictionary: &mut Dictionary) {
        // 0: not watched; 1: below, 2: above, 3: equal.
        let state = if self.on.is_set(dictionary) {
            match value.cmp(&self.at.get_i16(dictionary)) {
                std::cmp::Ordering::Less => 1,
                std::cmp::Ordering::Greater => 2,
                std::cmp::Ordering::Equal => 3,
            }
        } else {
            0
        };
        self.status.set(dictionary, state);
    }
}

impl AnalogInput {
    /// The input `channel`, whose objects are 0x6000 and 0x8000 with 0x10 for each channel.
    #[must_use]
    pub fn new(dictionary: &Dictionary, channel: u8, range: Range, signal: SignalId) -> Self {
        let (object, settings) = objects(0x6000, channel);
        let value = |subindex| ChannelValue::of(dictionary, object, subindex);
        let limit = |status, on, at| Limit {
            status: value(status),
            on: ChannelValue::of(dictionary, settings, on),
            at: ChannelValue::of(dictionary, settings, at),
        };
        Self {
            signal,
            range,
            phase: u64::from(channel),
            underrange: value(status::UNDERRANGE),
            overrange: value(status::OVERRANGE),
            limits: [
                limit(status::LIMIT_1, setting::ENABLE_LIMIT_1, setting::LIMIT_1),
                limit(status::LIMIT_2, setting::ENABLE_LIMIT_2, setting::LIMIT_2),
            ],
            error: value(status::ERROR),
            toggle: value(status::TOGGLE),
            value: value(status::VALUE),
            scale: Scale::of(dictionary, settings),
        }
    }
}

impl Channel for AnalogInput {
    fn has_inputs(&self) -> bool {
        true
    }

    fn sample(&mut self, now: Instant, dictionary: &mut Dictionary, signals: &Signals) {
        let Range { minimum, maximum, unresolved_bits } = self.range;
        let seen = signals.driven(self.signal).unwrap_or_else(|| wave(now, self.phase, self.range));
        let (under, over) = (seen < minimum, seen > maximum);
        let raw = seen.clamp(minimum, maximum) >> unresolved_bits << unresolved_bits;
        let value = self.scale.apply(raw, dictionary);
        self.underrange.set_bit(dictionary, under);
        self.overrange.set_bit(dictionary, over);
        self.error.set_bit(dictionary, under || over);
        for limit in self.limits {
            limit.apply(value, dictionary);
        }
        let toggled = !self.toggle.is_set(dictionary);
        self.toggle.set_bit(dictionary, toggled);
        self.value.set(dictionary, value as u64);
    }
}

/// What an input sees that nothing drives: a triangle over the middle half of its range.
fn wave(now: Instant, phase: u64, range: Range) -> i32 {
    const PERIOD_US: u64 = 4_000_000;
    let at = (now.as_nanos() / 1_000 + phase * PERIOD_US / 7) % PERIOD_US;
    let rising = at.min(PERIOD_US - at);
    let span = i64::from(range.maximum) - i64::from(range.minimum);
    let quarter = span / 4;
    let share = quarter * 2 * rising as i64 / (PERIOD_US / 2) as i64;
    (i64::from(range.minimum) + quarter + share) as i32
}

/// An analogue output.
#[derive(Clone, Debug)]
pub struct AnalogOutput {
    signal: SignalId,
    range: Range,
    value: ChannelValue,
    default: ChannelValue,
    scale: Scale,
}

impl AnalogOutput {
    /// The output `channel`, whose objects are 0x7000 and 0x8000 with 0x10 for each channel.
    #[must_use]
    pub fn new(
        dictionary: &Dictionary,
        channel: u8,
        subindex: u8,
        range: Range,
        signal: SignalId,
    ) -> Self {
        let (object, settings) = objects(0x7000, channel);
        Self {
            signal,
            range,
            value: ChannelValue::of(dictionary, object, subindex),
            default: ChannelValue::of(dictionary, settings, setting::DEFAULT_OUTPUT),
            scale: Scale::of(dictionary, settings),
        }
    }

    fn put(&self, value: i32, dictionary: &Dictionary, signals: &mut Signals) {
        let Range { minimum, maximum, unresolved_bits } = self.range;
        let scaled = self.scale.apply(value, dictionary).clamp(minimum, maximum);
        signals.set(self.signal, scaled >> unresolved_bits << unresolved_bits);
    }
}

impl Channel for AnalogOutput {
    fn drive(&mut self, _now: Instant, dictionary: &Dictionary, signals: &mut Signals) {
        self.put(self.value.get_i16(dictionary), dictionary, signals);
    }

    fn make_safe(&mut self, _now: Instant, dictionary: &Dictionary, signals: &mut Signals) {
        self.put(self.default.get_i16(dictionary), dictionary, signals);
    }

    fn lose_supply(&mut self, signals: &mut Signals) {
        signals.set(self.signal, 0);
    }
}

/// Object and settings of a channel.
fn objects(first: u16, channel: u8) -> (u16, u16) {
    let offset = 0x10 * u16::from(channel);
    (first + offset, 0x8000 + offset)
}
