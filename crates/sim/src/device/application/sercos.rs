//! One axis of a drive that speaks SoE: master control word and velocity command in the MDT, drive
//! status word and position feedback in the AT.
//!
//! Read first: IEC 61800-7-204, S-0-0134 and S-0-0135. Bits of the master control word: 15 drive on,
//! 14 enable, 13 restart. The drive tells in bits 15 and 14 of its status word how far it is: 1 ready
//! for power, 2 power is on, 3 in operation.

use linesman_proto::time::Instant;

use super::motion::{Goal, Limits, Motion};
use super::{Channel, ChannelValue};
use crate::device::dictionary::Dictionary;
use crate::device::signal::{SignalId, Signals};

/// Master control word: drive on, enable, restart.
const ON: u16 = 0x8000;
const ENABLE: u16 = 0x4000;
const RESTART: u16 = 0x2000;
/// Increments of a turn, and of velocity: position counts 2²⁰ a turn, velocity 2¹⁸ a turn and second.
const POSITION_PER_VELOCITY: f64 = 4.0;
/// What the axis can do: 100 turns per second, reached in 50 ms.
const LIMITS: Limits = Limits { velocity: 104_857_600.0, acceleration: 2_097_152_000.0 };

/// The axis. Its output signal is the position; its input, whether something holds it.
#[derive(Clone, Debug)]
pub struct Sercos {
    position_signal: SignalId,
    blocked: SignalId,
    control: ChannelValue,
    command: ChannelValue,
    status: ChannelValue,
    feedback: ChannelValue,
    velocity: ChannelValue,
    velocity_limit: ChannelValue,
    control_word: u16,
    motion: Motion,
}

impl Sercos {
    /// The axis with the IDNs of its telegrams.
    #[must_use]
    pub fn new(dictionary: &Dictionary, position: SignalId, blocked: SignalId) -> Self {
        let value = |idn| ChannelValue::of(dictionary, idn, 0);
        Self {
            position_signal: position,
            blocked,
            control: value(134),
            command: value(36),
            status: value(135),
            feedback: value(51),
            velocity: value(40),
            velocity_limit: value(91),
            control_word: 0,
            motion: Motion::at_rest(0.0),
        }
    }

    fn is_enabled(&self) -> bool {
        self.control_word & (ON | ENABLE) == ON | ENABLE
    }

    fn move_on(&mut self, now: Instant, signals: &Signals) {
        self.motion.blocked = signals.is_high(self.blocked);
        self.motion.advance(now);
    }

    fn show(&self, signals: &mut Signals) {
        signals.set(self.position_signal, self.position());
    }

    fn position(&self) -> i32 {
        self.motion.position.round() as i64 as i32
    }
}

impl Channel for Sercos {
    fn drive(&mut self, now: Instant, dictionary: &Dictionary, signals: &mut Signals) {
        self.move_on(now, signals);
        self.control_word = self.control.get(dictionary) as u16;
        let goal = if self.is_enabled() {
            let wanted = f64::from(self.command.get(dictionary) as u32 as i32);
            let runs = self.control_word & RESTART != 0;
            let wanted = if runs { wanted * POSITION_PER_VELOCITY } else { 0.0 };
            let limit = self.velocity_limit.get(dictionary) as f64 * POSITION_PER_VELOCITY;
            let limit = limit.min(LIMITS.velocity);
            Goal::Velocity {
                target: wanted.clamp(-limit, limit),
                acceleration: LIMITS.acceleration,
                deceleration: LIMITS.acceleration,
            }
        } else {
            Goal::Coast
        };
        self.motion.demand(goal, LIMITS);
        self.show(signals);
    }

    fn make_safe(&mut self, now: Instant, _dictionary: &Dictionary, signals: &mut Signals) {
        self.move_on(now, signals);
        self.control_word = 0;
        self.motion.demand(Goal::Coast, LIMITS);
        self.show(signals);
    }

    fn lose_supply(&mut self, signals: &mut Signals) {
        self.control_word = 0;
        self.motion = Motion::at_rest(self.motion.position);
        self.show(signals);
    }

    fn has_inputs(&self) -> bool {
        true
    }

    fn sample(&mut self, now: Instant, dictionary: &mut Dictionary, signals: &Signals) {
        self.move_on(now, signals);
        let ready: u16 = if self.is_enabled() {
            3
        } else if self.control_word & ON != 0 {
            2
        } else {
            1
        };
        self.status.set(dictionary, u64::from(ready << 14));
        self.feedback.set(dictionary, self.position() as u64);
        let velocity = (self.motion.velocity / POSITION_PER_VELOCITY).round() as i64;
        self.velocity.set(dictionary, velocity.cast_unsigned());
    }
}
