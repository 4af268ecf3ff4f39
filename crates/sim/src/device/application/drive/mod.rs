//! A drive of CiA 402 with an axis that moves.
//!
//! Read first: CiA 402 part 2 (ETG.6010). [`state`] is its automaton, `motion` the axis. Modes: profile
//! position, profile velocity, homing (to where the axis is), cyclic synchronous position and
//! velocity. An axis that lags too far behind for too long, or that is still driven when its outputs
//! end, is a fault: 0x603F has the code, an emergency tells of it.

mod mode;
mod object;
mod state;

use linesman_proto::mailbox::coe::{Emergency, ErrorRegister};
use linesman_proto::time::{Instant, Span};

use self::mode::Mode;
use self::object::Objects;
use self::state::{Request, State};
use super::Channel;
use super::motion::{Goal, Motion};
use crate::device::dictionary::Dictionary;
use crate::device::signal::{SignalId, Signals};

/// The axis lags behind: class "monitoring, positioning".
const FOLLOWING_ERROR: u16 = 0x8611;
/// Outputs ended while the axis was driven: class "communication".
const OUTPUTS_LOST: u16 = 0x7500;
/// What stands in 0x1001 with a fault: generic error, and one of the profile.
const WITH_FAULT: ErrorRegister = ErrorRegister(0x21);

/// Bits of the controlword beyond the automaton.
mod control {
    /// Of the mode: new set-point, or start of homing.
    pub(super) const START: u16 = 0x0010;
    /// Take the set-point at once.
    pub(super) const AT_ONCE: u16 = 0x0020;
    /// The set-point counts from where the axis is to be.
    pub(super) const RELATIVE: u16 = 0x0040;
    /// A rising edge ends a fault.
    pub(super) const RESET: u16 = 0x0080;
    /// Stop, whatever the mode does.
    pub(super) const HALT: u16 = 0x0100;
}

/// Bits of the statusword beyond the automaton.
mod status {
    /// There is voltage.
    pub(super) const VOLTAGE: u16 = 0x0010;
    /// It listens to the controlword.
    pub(super) const REMOTE: u16 = 0x0200;
    pub(super) const TARGET_REACHED: u16 = 0x0400;
    /// A limit switch holds the axis.
    pub(super) const INTERNAL_LIMIT: u16 = 0x0800;
    /// Of the mode: follows its target, took the set-point, found its home.
    pub(super) const MODE: u16 = 0x1000;
    /// Of the mode: following error, error of homing.
    pub(super) const MODE_ERROR: u16 = 0x2000;
}

/// Options of a quick stop (0x605A) after which the drive stays in "quick stop active".
const STAYS: std::ops::RangeInclusive<i16> = 5..=8;

/// The drive. Its output signal is the position in increments; its inputs are the home switch, the
/// negative and the positive limit switch, and whether something holds the axis.
#[derive(Clone, Debug)]
pub struct Cia402 {
    position_signal: SignalId,
    inputs: [SignalId; 4],
    objects: Objects,
    state: State,
    motion: Motion,
    /// What is to be added to the axis' own position.
    offset: f64,
    controlword: u16,
    mode: Mode,
    /// The set-point of profile position was taken.
    acknowledged: bool,
    /// The axis is where homing left it, or homing cannot be done.
    homed: bool,
    homing_failed: bool,
    /// Since when it lags too far behind.
    lagging_since: Option<Instant>,
    error_code: u16,
    emergency: Option<Emergency>,
}

impl Cia402 {
    /// The drive with the objects of its profile.
    #[must_use]
    pub fn new(dictionary: &Dictionary, position: SignalId, inputs: [SignalId; 4]) -> Self {
        Self {
            position_signal: position,
            inputs,
            objects: Objects::of(dictionary),
            state: State::default(),
            motion: Motion::at_rest(0.0),
            offset: 0.0,
            controlword: 0,
            mode: Mode::None,
            acknowledged: false,
            homed: false,
            homing_failed: false,
            lagging_since: None,
            error_code: 0,
            emergency: None,
        }
    }

    /// Where the axis is, as the MainDevice counts.
    fn position(&self) -> i32 {
        (self.motion.position + self.offset).round() as i64 as i32
    }

    /// Brings everything up to `now`: axis, following error, the end of a stop.
    fn move_on(&mut self, now: Instant, dictionary: &Dictionary, signals: &Signals) {
        self.motion.blocked = signals.is_high(self.inputs[3]);
        self.motion.advance(now);
        if self.state.is_driven() && self.motion.stands() {
            match self.state {
                State::FaultReactionActive => self.enter(State::Fault, dictionary),
                State::QuickStopActive if !STAYS.contains(&self.objects.quick_stop(dictionary)) => {
                    self.enter(State::SwitchOnDisabled, dictionary);
                }
                State::QuickStopActive
                | State::OperationEnabled
                | State::SwitchOnDisabled
                | State::ReadyToSwitchOn
                | State::SwitchedOn
                | State::Fault => {}
            }
        }
        self.watch(now, dictionary);
    }

    /// Whether the axis lags behind for too long.
    fn watch(&mut self, now: Instant, dictionary: &Dictionary) {
        let lags = self.state == State::OperationEnabled
            && self.mode.is_watched()
            && self.motion.following_error().abs() > self.objects.window.unsigned(dictionary);
        if !lags {
            self.lagging_since = None;
            return;
        }
        let since = *self.lagging_since.get_or_insert(now);
        let time_out = Span::ms(self.objects.window_time.unsigned(dictionary) as u64);
        if now.since(since) >= time_out {
            self.fault(FOLLOWING_ERROR, dictionary);
        }
    }

    fn fault(&mut self, code: u16, dictionary: &Dictionary) {
        self.error_code = code;
        let [low, high] = self.mode.code().to_le_bytes();
        let data = [low, high, 0, 0, 0];
        self.emergency = Some(Emergency { code, register: WITH_FAULT, data });
        self.enter(State::FaultReactionActive, dictionary);
    }

    fn enter(&mut self, state: State, dictionary: &Dictionary) {
        if state == self.state {
            return;
        }
        self.state = state;
        let limits = self.objects.limits(dictionary);
        match state {
            State::QuickStopActive | State::FaultReactionActive => {
                let deceleration = self.objects.quick_stop_deceleration.rate(dictionary);
                self.motion.demand(Goal::Stop { deceleration }, limits);
            }
            State::OperationEnabled => {
                (self.acknowledged, self.homed, self.homing_failed) = (false, false, false);
                let deceleration = self.objects.deceleration.rate(dictionary);
                self.motion.demand(Goal::Coast, limits);
                self.motion.demand(Goal::Stop { deceleration }, limits);
            }
            State::SwitchOnDisabled | State::ReadyToSwitchOn | State::SwitchedOn | State::Fault => {
                self.motion.demand(Goal::Coast, limits)
            }
        }
    }

    /// Hears a controlword.
    fn obey(&mut self, controlword: u16, dictionary: &Dictionary) {
        let rising = controlword & !self.controlword;
        self.controlword = controlword;
        if self.state == State::Fault && rising & control::RESET != 0 {
            self.error_code = 0;
            let register = ErrorRegister::default();
            self.emergency = Some(Emergency { code: 0, register, data: [0; 5] });
            self.enter(State::SwitchOnDisabled, dictionary);
            return;
        }
        self.enter(self.state.after(Request::of(controlword)), dictionary);
    }

    /// Does what the mode does with its targets.
    fn pursue(&mut self, now: Instant, rising: u16, dictionary: &Dictionary, signals: &Signals) {
        let halt = self.controlword & control::HALT != 0;
        let wanted = Mode::of(self.objects.mode.get(dictionary) as u8 as i8);
        if wanted != self.mode {
            self.mode = wanted;
            (self.acknowledged, self.homed, self.homing_failed) = (false, false, false);
        }
        if self.state != State::OperationEnabled {
            return;
        }
        let objects = &self.objects;
        let limits = objects.limits(dictionary);
        let deceleration = objects.deceleration.rate(dictionary);
        let acceleration = objects.acceleration.rate(dictionary);
        let stop = Goal::Stop { deceleration };
        let goal = match self.mode {
            Mode::None | Mode::Homing => Some(stop),
            Mode::CyclicPosition if halt => Some(stop),
            Mode::CyclicPosition => {
                let target = objects.target_position.signed(dictionary) - self.offset;
                let grace = objects.interpolation_time(dictionary);
                Some(Goal::Line { target, until: now + grace, grace })
            }
            Mode::CyclicVelocity | Mode::ProfileVelocity => {
                let target = objects.target_velocity.signed(dictionary);
                let target = if halt || self.held(target, signals) { 0.0 } else { target };
                let cyclic = self.mode == Mode::CyclicVelocity;
                let (up, down) = if cyclic {
                    (limits.acceleration, limits.acceleration)
                } else {
                    (acceleration, deceleration)
                };
                let target = target.clamp(-limits.velocity, limits.velocity);
                Some(Goal::Velocity { target, acceleration: up, deceleration: down })
            }
            Mode::ProfilePosition if halt => Some(stop),
            Mode::ProfilePosition => self.set_point(rising, dictionary, acceleration, deceleration),
        };
        if self.mode == Mode::Homing && rising & control::START != 0 {
            self.home(dictionary);
        }
        if let Some(goal) = goal {
            self.motion.demand(goal, limits);
        }
    }

    /// Profile position: a rising edge of bit 4 brings a new set-point.
    fn set_point(
        &mut self,
        rising: u16,
        dictionary: &Dictionary,
        acceleration: f64,
        deceleration: f64,
    ) -> Option<Goal> {
        let start = self.controlword & control::START != 0;
        let free = self.motion.stands() || self.controlword & control::AT_ONCE != 0;
        if !start {
            self.acknowledged = false;
            return None;
        }
        let fresh = rising & control::START != 0 || !self.acknowledged;
        if !(fresh && free) {
            return None;
        }
        self.acknowledged = true;
        let relative = self.controlword & control::RELATIVE != 0;
        let given = self.objects.target_position.signed(dictionary);
        let target = if relative { self.motion.demand + given } else { given - self.offset };
        let velocity = self.objects.profile_velocity.unsigned(dictionary);
        let velocity = velocity.min(self.objects.limits(dictionary).velocity);
        Some(Goal::Position { target, velocity, acceleration, deceleration })
    }

    /// Methods 35 and 37: the axis is at home where it is.
    fn home(&mut self, dictionary: &Dictionary) {
        if matches!(self.objects.homing_method.get(dictionary) as u8, 35 | 37) {
            self.offset = self.objects.home_offset.signed(dictionary) - self.motion.position;
            self.homed = true;
        } else {
            self.homing_failed = true;
        }
    }

    /// Whether a limit switch holds the axis in this direction.
    fn held(&self, velocity: f64, signals: &Signals) -> bool {
        (velocity < 0.0 && signals.is_high(self.inputs[1]))
            || (velocity > 0.0 && signals.is_high(self.inputs[2]))
    }

    fn statusword(&self, dictionary: &Dictionary, signals: &Signals) -> u16 {
        let mut word = self.state.statusword() | status::VOLTAGE | status::REMOTE;
        let enabled = self.state == State::OperationEnabled;
        let near = self.motion.following_error().abs() <= self.objects.near(dictionary);
        let target = self.objects.target_velocity.signed(dictionary);
        let reached = match self.mode {
            Mode::ProfilePosition => self.motion.stands() && near,
            Mode::ProfileVelocity => (self.motion.velocity - target).abs() < 1.0,
            Mode::Homing => self.motion.stands(),
            Mode::None | Mode::CyclicPosition | Mode::CyclicVelocity => false,
        };
        let of_mode = match self.mode {
            Mode::ProfilePosition => self.acknowledged,
            Mode::Homing => self.homed,
            Mode::CyclicPosition | Mode::CyclicVelocity => true,
            Mode::ProfileVelocity => self.motion.stands(),
            Mode::None => false,
        };
        let error = match self.mode {
            Mode::Homing => self.homing_failed,
            Mode::ProfilePosition | Mode::CyclicPosition => self.lagging_since.is_some(),
            Mode::None | Mode::ProfileVelocity | Mode::CyclicVelocity => false,
        };
        let held = signals.is_high(self.inputs[1]) || signals.is_high(self.inputs[2]);
        for (bit, on) in [
            (status::TARGET_REACHED, enabled && reached),
            (status::INTERNAL_LIMIT, held),
            (status::MODE, enabled && of_mode),
            (status::MODE_ERROR, (enabled && error) || self.error_code == FOLLOWING_ERROR),
        ] {
            word |= if on { bit } else { 0 };
        }
        word
    }
}

impl Channel for Cia402 {
    fn drive(&mut self, now: Instant, dictionary: &Dictionary, signals: &mut Signals) {
        self.move_on(now, dictionary, signals);
        let controlword = self.objects.controlword.get(dictionary) as u16;
        let rising = controlword & !self.controlword;
        self.obey(controlword, dictionary);
        self.pursue(now, rising, dictionary, signals);
        signals.set(self.position_signal, self.position());
    }

    fn make_safe(&mut self, now: Instant, dictionary: &Dictionary, signals: &mut Signals) {
        self.move_on(now, dictionary, signals);
        match self.state {
            State::OperationEnabled | State::QuickStopActive => {
                self.fault(OUTPUTS_LOST, dictionary);
            }
            State::ReadyToSwitchOn | State::SwitchedOn => {
                self.enter(State::SwitchOnDisabled, dictionary);
            }
            State::SwitchOnDisabled | State::FaultReactionActive | State::Fault => {}
        }
        self.controlword = 0;
        signals.set(self.position_signal, self.position());
    }

    fn lose_supply(&mut self, signals: &mut Signals) {
        // The position is kept: the encoder is an absolute one.
        self.motion = Motion::at_rest(self.motion.position);
        self.state = State::default();
        (self.controlword, self.mode, self.error_code) = (0, Mode::None, 0);
        (self.lagging_since, self.emergency) = (None, None);
        signals.set(self.position_signal, self.position());
    }

    fn has_inputs(&self) -> bool {
        true
    }

    fn sample(&mut self, now: Instant, dictionary: &mut Dictionary, signals: &Signals) {
        self.move_on(now, dictionary, signals);
        let switches = [self.inputs[1], self.inputs[2], self.inputs[0]];
        let switches = switches.into_iter().enumerate();
        let switches = switches
            .fold(0, |word, (bit, signal)| word | u64::from(signals.is_high(signal)) << bit);
        let word = self.statusword(dictionary, signals);
        let demand = (self.motion.demand + self.offset).round() as i64;
        let objects = self.objects;
        for (value, number) in [
            (objects.statusword, u64::from(word)),
            (objects.mode_display, self.mode.code() as u64),
            (objects.position, self.position() as u64),
            (objects.demand, demand as u64),
            (objects.velocity, self.motion.velocity.round() as i64 as u64),
            (objects.following_error, self.motion.following_error().round() as i64 as u64),
            (objects.error_code, u64::from(self.error_code)),
            (objects.digital_inputs, switches),
        ] {
            value.set(dictionary, number);
        }
    }

    fn emergency(&mut self) -> Option<Emergency> {
        self.emergency.take()
    }
}
