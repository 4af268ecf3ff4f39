//! An axis that moves: what is demanded of it, and how it follows.
//!
//! Lengths are in increments, times in seconds. The demand is made by a generator within the limits
//! of a profile; the axis follows it with a velocity and an acceleration that it can have, unless
//! something blocks it. Whatever time passes between two looks is gone through in small steps, until
//! everything stands still or moves evenly: the rest is one step then.

use linesman_proto::time::{Instant, Span};

/// The longest step in s.
const STEP: f64 = 100e-6;
/// How fast a following error is worked off, per second.
const STIFFNESS: f64 = 200.0;

/// What is demanded.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Goal {
    /// Nothing: the axis is without power and comes to rest by itself.
    Coast,
    /// To rest, with this deceleration in inc/s².
    Stop {
        /// In inc/s².
        deceleration: f64,
    },
    /// An even way to `target`, there at `until`. As the next target may be a little late it goes on
    /// like that for a while; then it is to be at the target.
    Line {
        /// In increments.
        target: f64,
        /// When it is to be there.
        until: Instant,
        /// How long it goes on.
        grace: Span,
    },
    /// A velocity, reached with this acceleration.
    Velocity {
        /// In inc/s.
        target: f64,
        /// In inc/s².
        acceleration: f64,
        /// In inc/s².
        deceleration: f64,
    },
    /// A position, with a profile of its own.
    Position {
        /// In increments.
        target: f64,
        /// In inc/s.
        velocity: f64,
        /// In inc/s².
        acceleration: f64,
        /// In inc/s².
        deceleration: f64,
    },
}

/// What an axis can do at most.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Limits {
    /// In inc/s.
    pub(crate) velocity: f64,
    /// In inc/s².
    pub(crate) acceleration: f64,
}

/// How quickly an axis without power comes to rest, in inc/s².
const FRICTION: f64 = 20_000_000.0;

/// An axis.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Motion {
    /// Where it is.
    pub(crate) position: f64,
    /// How fast it moves.
    pub(crate) velocity: f64,
    /// Where it should be.
    pub(crate) demand: f64,
    demanded_velocity: f64,
    /// Something holds it.
    pub(crate) blocked: bool,
    goal: Goal,
    limits: Limits,
    since: Instant,
}

impl Motion {
    /// At rest somewhere, without power.
    pub(crate) const fn at_rest(position: f64) -> Self {
        Self {
            position,
            velocity: 0.0,
            demand: 0.0,
            demanded_velocity: 0.0,
            blocked: false,
            goal: Goal::Coast,
            limits: Limits { velocity: 0.0, acceleration: 0.0 },
            since: Instant::ZERO,
        }
    }

    /// From now on this is demanded, of an axis with these limits. Bring it up to date before.
    pub(crate) fn demand(&mut self, goal: Goal, limits: Limits) {
        if self.goal == Goal::Coast {
            // Power comes: the demand begins where the axis is.
            (self.demand, self.demanded_velocity) = (self.position, self.velocity);
        }
        (self.goal, self.limits) = (goal, limits);
    }

    /// How far it lags behind.
    pub(crate) fn following_error(&self) -> f64 {
        if self.goal == Goal::Coast { 0.0 } else { self.demand - self.position }
    }

    /// Whether it stands, and is to stand.
    pub(crate) fn stands(&self) -> bool {
        self.velocity == 0.0 && self.demanded_velocity == 0.0
    }

    /// Brings it up to `now`.
    pub(crate) fn advance(&mut self, now: Instant) {
        let from = self.since;
        self.since = self.since.max(now);
        let mut left = now.since(from).as_secs_f64();
        let mut at = from;
        while left > 0.0 {
            if self.is_even(at) {
                self.demand += self.demanded_velocity * left;
                self.position += self.velocity * left;
                return;
            }
            let step = left.min(STEP);
            let lag = self.demand - self.position;
            self.generate(at, step);
            self.follow(lag, step);
            left -= step;
            at += Span::ns((step * 1e9) as u64);
        }
    }

    /// Whether nothing changes any more by itself.
    fn is_even(&self, at: Instant) -> bool {
        let follows = if self.goal == Goal::Coast || self.blocked {
            self.velocity == 0.0
        } else {
            self.velocity == self.demanded_velocity && self.position == self.demand
        };
        let settled = match self.goal {
            Goal::Coast => true,
            Goal::Stop { .. } => self.demanded_velocity == 0.0,
            Goal::Line { until, grace, .. } => at >= until + grace && self.demanded_velocity == 0.0,
            Goal::Velocity { target, .. } => self.demanded_velocity == target,
            Goal::Position { target, .. } => self.demand == target && self.demanded_velocity == 0.0,
        };
        follows && settled
    }

    /// Moves the demand on.
    fn generate(&mut self, at: Instant, step: f64) {
        let before = self.demanded_velocity;
        let toward = |target: f64, up: f64, down: f64| {
            let faster = target.abs() > before.abs() && target * before >= 0.0;
            let change = (if faster { up } else { down }) * step;
            target.clamp(before - change, before + change)
        };
        match self.goal {
            Goal::Coast => (self.demand, self.demanded_velocity) = (self.position, self.velocity),
            Goal::Stop { deceleration } => {
                self.demanded_velocity = toward(0.0, deceleration, deceleration);
                self.demand += (before + self.demanded_velocity) / 2.0 * step;
            }
            Goal::Velocity { target, acceleration, deceleration } => {
                self.demanded_velocity = toward(target, acceleration, deceleration);
                self.demand += (before + self.demanded_velocity) / 2.0 * step;
            }
            Goal::Line { target, until, grace } => {
                let remaining = until.since(at).as_secs_f64();
                if remaining > 0.0 {
                    self.demanded_velocity = (target - self.demand) / remaining;
                    self.demand += self.demanded_velocity * step;
                } else if at < until + grace {
                    self.demand += self.demanded_velocity * step;
                } else {
                    (self.demand, self.demanded_velocity) = (target, 0.0);
                }
            }
            Goal::Position { target, velocity, acceleration, deceleration } => {
                let way = target - self.demand;
                // As fast as it can still be braked in time.
                let brakeable = (2.0 * deceleration * way.abs()).sqrt();
                let wanted = way.signum() * velocity.min(brakeable);
                let next = toward(wanted, acceleration, deceleration);
                let moved = (before + next) / 2.0 * step;
                if moved.abs() >= way.abs() && next.abs() <= deceleration * step * 2.0 {
                    (self.demand, self.demanded_velocity) = (target, 0.0);
                } else {
                    self.demanded_velocity = next;
                    self.demand += moved;
                }
            }
        }
    }

    /// Lets the axis follow its demand, behind which it was by `lag` when the step began.
    fn follow(&mut self, lag: f64, step: f64) {
        if self.blocked {
            self.velocity = 0.0;
            return;
        }
        if self.goal == Goal::Coast {
            let change = FRICTION * step;
            let next = 0f64.clamp(self.velocity - change, self.velocity + change);
            self.position += (self.velocity + next) / 2.0 * step;
            self.velocity = next;
            (self.demand, self.demanded_velocity) = (self.position, next);
            return;
        }
        let Limits { velocity, acceleration } = self.limits;
        let catch_up = (STIFFNESS * lag).clamp(
            -(2.0 * acceleration * lag.abs()).sqrt(),
            (2.0 * acceleration * lag.abs()).sqrt(),
        );
        let wanted = (self.demanded_velocity + catch_up).clamp(-velocity, velocity);
        let change = acceleration * step;
        let next = wanted.clamp(self.velocity - change, self.velocity + change);
        self.position += next * step;
        self.velocity = next;
        // The last part of an increment is no way to go.
        let lag = self.demand - self.position;
        if lag.abs() < 0.5 && (self.demanded_velocity - next).abs() <= change {
            (self.position, self.velocity) = (self.demand, self.demanded_velocity);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { velocity: 1e7, acceleration: 1e9 };

    fn at(ms: u64) -> Instant {
        Instant::ZERO + Span::ms(ms)
    }

    #[test]
    fn a_position_is_reached_with_a_profile_and_kept() {
        let mut axis = Motion::at_rest(0.0);
        let goal = Goal::Position {
            target: 100_000.0,
            velocity: 100_000.0,
            acceleration: 1_000_000.0,
            deceleration: 1_000_000.0,
        };
        axis.demand(goal, LIMITS);
        axis.advance(at(50));
        // 0.5 a t².
        assert!((axis.position - 1_250.0).abs() < 60.0, "{}", axis.position);
        assert!((axis.velocity - 50_000.0).abs() < 1_000.0, "{}", axis.velocity);
        axis.advance(at(600));
        assert!((axis.velocity - 100_000.0).abs() < 1.0, "{}", axis.velocity);
        // 1 s of travel and 0.1 s for both ramps.
        axis.advance(at(1_130));
        assert_eq!((axis.position, axis.velocity), (100_000.0, 0.0));
        assert!(axis.stands());
        axis.advance(at(10_000_000));
        assert_eq!(axis.position, 100_000.0);
    }

    #[test]
    fn even_motion_over_a_day_takes_one_step() {
        let mut axis = Motion::at_rest(0.0);
        let goal = Goal::Velocity { target: -1_000.0, acceleration: 1e6, deceleration: 1e6 };
        axis.demand(goal, LIMITS);
        axis.advance(at(10));
        let start = axis.position;
        axis.advance(at(86_400_000));
        assert!((axis.position - start + 86_399_990.0).abs() < 1.0, "{}", axis.position);
    }

    #[test]
    fn many_looks_and_one_come_to_the_same() {
        let goal = Goal::Position {
            target: -5_000.0,
            velocity: 20_000.0,
            acceleration: 100_000.0,
            deceleration: 50_000.0,
        };
        let mut often = Motion::at_rest(0.0);
        often.demand(goal, LIMITS);
        let mut once = often;
        for ms in 0..=2_000 {
            often.advance(at(ms));
        }
        once.advance(at(2_000));
        assert_eq!((often.position, once.position), (-5_000.0, -5_000.0));
    }

    #[test]
    fn a_blocked_axis_lags_behind_and_catches_up_when_let_go() {
        let mut axis = Motion::at_rest(0.0);
        axis.demand(Goal::Velocity { target: 1e5, acceleration: 1e6, deceleration: 1e6 }, LIMITS);
        axis.blocked = true;
        axis.advance(at(200));
        assert_eq!((axis.position, axis.velocity), (0.0, 0.0));
        assert!(axis.following_error() > 14_000.0);
        axis.blocked = false;
        axis.advance(at(300));
        assert!(axis.following_error().abs() < 100.0, "{}", axis.following_error());
        axis.demand(Goal::Coast, LIMITS);
        axis.advance(at(400));
        assert!(axis.stands());
        assert_eq!(axis.following_error(), 0.0);
    }

    #[test]
    fn targets_of_each_cycle_make_an_even_way() {
        let mut axis = Motion::at_rest(0.0);
        for ms in 0..500u64 {
            axis.advance(at(ms));
            let target = (ms as f64 + 1.0) * 100.0;
            let goal = Goal::Line { target, until: at(ms + 1), grace: Span::ms(1) };
            axis.demand(goal, LIMITS);
        }
        axis.advance(at(500));
        assert!((axis.position - 50_000.0).abs() < 1.0, "{}", axis.position);
        axis.advance(at(600));
        assert_eq!((axis.position, axis.stands()), (50_000.0, true));
    }
}
