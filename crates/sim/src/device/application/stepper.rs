//! One axis with a stepper motor: enable, velocity, position.
//!
//! Process data of a stepper terminal: encoder (status, counter, latch; control, counter to set) and
//! motor (status; control, velocity). Velocity 0x7FFF is the top of the speed range that settings
//! object 0x8012:05 chooses, from 1,000 to 16,000 full steps per second.

use linesman_proto::time::Instant;

use super::{Channel, ChannelValue};
use crate::device::dictionary::Dictionary;
use crate::device::signal::{SignalId, Signals};

/// Microsteps per second at the top of the lowest speed range: 1,000 full steps of 64 microsteps.
const TOP_SPEED: i64 = 64_000;
/// The highest of the speed ranges; each is twice the one before.
const HIGHEST_RANGE: u64 = 4;
/// Velocity at the top of the speed range.
const FULL_VELOCITY: i64 = 0x7FFF;
const NANOS: i64 = 1_000_000_000;

/// The axis. Its output signal is the position in microsteps; its two inputs are digital.
#[derive(Clone, Debug)]
pub struct Stepper {
    position_signal: SignalId,
    inputs: [SignalId; 2],
    encoder: Encoder,
    motor: Motor,
    /// Position in microsteps, and what is beyond the last whole one, in 1/(10⁹ · 0x7FFF).
    position: i64,
    remainder: i64,
    /// Counter value less position.
    counter_offset: i64,
    /// Velocity that is being driven times the microsteps per second at the top of the range, and
    /// since when the position was not brought up to date.
    velocity: i64,
    since: Instant,
    setting_done: bool,
}

#[derive(Clone, Copy, Debug)]
struct Encoder {
    set_counter: ChannelValue,
    set_value: ChannelValue,
    set_done: ChannelValue,
    toggle: ChannelValue,
    counter: ChannelValue,
}

#[derive(Clone, Copy, Debug)]
struct Motor {
    enable: ChannelValue,
    velocity: ChannelValue,
    speed_range: ChannelValue,
    ready_to_enable: ChannelValue,
    ready: ChannelValue,
    moving_positive: ChannelValue,
    moving_negative: ChannelValue,
    inputs: [ChannelValue; 2],
    toggle: ChannelValue,
}

impl Stepper {
    /// The axis with encoder objects 0x6000/0x7000 and motor objects 0x6010/0x7010.
    #[must_use]
    pub fn new(dictionary: &Dictionary, position: SignalId, inputs: [SignalId; 2]) -> Self {
        let value = |index, subindex| ChannelValue::of(dictionary, index, subindex);
        Self {
            position_signal: position,
            inputs,
            encoder: Encoder {
                set_counter: value(0x7000, 0x03),
                set_value: value(0x7000, 0x11),
                set_done: value(0x6000, 0x03),
                toggle: value(0x6000, 0x10),
                counter: value(0x6000, 0x11),
            },
            motor: Motor {
                enable: value(0x7010, 0x01),
                velocity: value(0x7010, 0x21),
                speed_range: value(0x8012, 0x05),
                ready_to_enable: value(0x6010, 0x01),
                ready: value(0x6010, 0x02),
                moving_positive: value(0x6010, 0x05),
                moving_negative: value(0x6010, 0x06),
                inputs: [value(0x6010, 0x0C), value(0x6010, 0x0D)],
                toggle: value(0x6010, 0x10),
            },
            position: 0,
            remainder: 0,
            counter_offset: 0,
            velocity: 0,
            since: Instant::ZERO,
            setting_done: false,
        }
    }

    /// Brings the position up to `now`.
    fn move_on(&mut self, now: Instant) {
        let elapsed = i64::try_from(now.since(self.since).as_nanos()).unwrap_or(i64::MAX);
        self.since = now;
        if self.velocity == 0 {
            return;
        }
        let whole = i128::from(elapsed) * i128::from(self.velocity) + i128::from(self.remainder);
        let step = i128::from(NANOS * FULL_VELOCITY);
        self.position = self.position.wrapping_add(whole.div_euclid(step) as i64);
        self.remainder = whole.rem_euclid(step) as i64;
    }

    fn show(&self, signals: &mut Signals) {
        signals.set(self.position_signal, self.position as i32);
    }
}

impl Channel for Stepper {
    fn drive(&mut self, now: Instant, dictionary: &Dictionary, signals: &mut Signals) {
        self.move_on(now);
        let enabled = self.motor.enable.is_set(dictionary);
        let wanted = i64::from(self.motor.velocity.get_i16(dictionary));
        let top_speed = TOP_SPEED << self.motor.speed_range.get(dictionary).min(HIGHEST_RANGE);
        self.velocity = if enabled { wanted * top_speed } else { 0 };
        let set = self.encoder.set_counter.is_set(dictionary);
        if set && !self.setting_done {
            let value = self.encoder.set_value.get(dictionary) as i64;
            self.counter_offset = value - self.position;
        }
        self.setting_done = set;
        self.show(signals);
    }

    fn make_safe(&mut self, now: Instant, _dictionary: &Dictionary, signals: &mut Signals) {
        self.move_on(now);
        self.velocity = 0;
        self.show(signals);
    }

    fn lose_supply(&mut self, signals: &mut Signals) {
        self.velocity = 0;
        self.counter_offset = -self.position;
        self.show(signals);
    }

    fn has_inputs(&self) -> bool {
        true
    }

    fn sample(&mut self, now: Instant, dictionary: &mut Dictionary, signals: &Signals) {
        self.move_on(now);
        let (encoder, motor) = (self.encoder, self.motor);
        encoder.counter.set(dictionary, self.position.wrapping_add(self.counter_offset) as u64);
        encoder.set_done.set_bit(dictionary, self.setting_done);
        let enabled = motor.enable.is_set(dictionary);
        motor.ready_to_enable.set_bit(dictionary, true);
        motor.ready.set_bit(dictionary, enabled);
        motor.moving_positive.set_bit(dictionary, self.velocity > 0);
        motor.moving_negative.set_bit(dictionary, self.velocity < 0);
        for (value, signal) in motor.inputs.into_iter().zip(self.inputs) {
            value.set_bit(dictionary, signals.is_high(signal));
        }
        for toggle in [encoder.toggle, motor.toggle] {
            let toggled = !toggle.is_set(dictionary);
            toggle.set_bit(dictionary, toggled);
        }
    }
}
