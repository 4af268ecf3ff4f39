//! Steps between states: which a SubDevice takes, which it refuses, how long each may last, and the
//! way from one state to another.
//!
//! Read first: ETG.1000.6, EtherCAT state machine; facts as in the public SubDevice stack code
//! (SSC 5.11). [`answer`] is the table: every pair of states is named, nothing falls through.

use crate::register::{AlControl, AlStatus};
use crate::state::al_state::{AlState, StateValue};
use crate::state::status_code::AlStatusCode;
use crate::time::Span;
use AlState::{Boot, Init, Op, PreOp, SafeOp};

/// What a SubDevice does with a requested state.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Answer {
    /// It goes there, once its own checks pass. The same state again is allowed and repeats the
    /// checks.
    Enter(AlState),
    /// It stays where it is, sets the error bit and shows this code.
    Refuse(Refusal),
}

/// Why a step is refused by the table itself, before any check of settings.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Refusal {
    /// There is no such step: 0x0011.
    InvalidRequestedState,
    /// The value names no state: 0x0012.
    UnknownRequestedState,
    /// The SubDevice has no BOOT: 0x0013.
    BootNotSupported,
}

impl Refusal {
    /// The AL status code that goes with it.
    #[must_use]
    pub const fn code(self) -> AlStatusCode {
        match self {
            Self::InvalidRequestedState => AlStatusCode::INVALID_REQUESTED_STATE_CHANGE,
            Self::UnknownRequestedState => AlStatusCode::UNKNOWN_REQUESTED_STATE,
            Self::BootNotSupported => AlStatusCode::BOOTSTRAP_NOT_SUPPORTED,
        }
    }
}

/// The state table: what a SubDevice in `current` does when `requested` is asked of it. `boots`
/// tells whether it knows BOOT at all.
#[must_use]
pub const fn answer(current: AlState, requested: StateValue, boots: bool) -> Answer {
    use Answer::{Enter, Refuse};
    let StateValue::Known(requested) = requested else {
        return Refuse(Refusal::UnknownRequestedState);
    };
    match (current, requested) {
        (Init | Boot | PreOp | SafeOp | Op, Init) => Enter(Init),
        (Init | Boot, Boot) if boots => Enter(Boot),
        (Init | Boot, Boot) => Refuse(Refusal::BootNotSupported),
        (PreOp | SafeOp | Op, Boot) => Refuse(Refusal::InvalidRequestedState),
        (Init | PreOp | SafeOp | Op, PreOp) => Enter(PreOp),
        (PreOp | SafeOp | Op, SafeOp) => Enter(SafeOp),
        (SafeOp | Op, Op) => Enter(Op),
        (Boot, PreOp | SafeOp | Op) | (Init, SafeOp | Op) | (PreOp, Op) => {
            Refuse(Refusal::InvalidRequestedState)
        }
    }
}

/// What a SubDevice does with a write to AL control, its error bit included.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Response {
    /// Nothing: an error stands that was not acknowledged.
    Ignore,
    /// It answers the request.
    Act {
        /// Whether a standing error is cleared first, and the status code with it.
        clears_error: bool,
        /// What it does then.
        answer: Answer,
    },
}

/// The whole decision about a write to AL control, for a SubDevice in `current` whose AL status is
/// `status`.
///
/// While the error bit stands, a request counts only with the acknowledge bit; a request for INIT
/// is always heard. Controllers with device emulation (0x0141 bit 0) copy AL control to AL status
/// instead and do not come here.
#[must_use]
pub const fn respond(
    current: AlState,
    status: AlStatus,
    control: AlControl,
    boots: bool,
) -> Response {
    let wants_init = matches!(control.requested(), StateValue::Known(Init));
    if status.error() && !control.acknowledges_error() && !wants_init {
        return Response::Ignore;
    }
    Response::Act {
        clears_error: status.error(),
        answer: answer(current, control.requested(), boots),
    }
}

/// The next state to request on the way from `current` to `target`; `None` when it is reached.
///
/// Upwards every state on the way is visited: INIT, PREOP, SAFEOP, OP. Downwards one step is
/// enough. To BOOT and from it the way leads through INIT.
#[must_use]
pub const fn next_step(current: AlState, target: AlState) -> Option<AlState> {
    match (current, target) {
        (Init, Init) | (Boot, Boot) | (PreOp, PreOp) | (SafeOp, SafeOp) | (Op, Op) => None,
        (Boot | PreOp | SafeOp | Op, Init)
        | (PreOp | SafeOp | Op, Boot)
        | (Boot, PreOp | SafeOp | Op) => Some(Init),
        (Init, Boot) => Some(Boot),
        (Init, PreOp | SafeOp | Op) | (SafeOp | Op, PreOp) => Some(PreOp),
        (PreOp, SafeOp | Op) | (Op, SafeOp) => Some(SafeOp),
        (SafeOp, Op) => Some(Op),
    }
}

/// All states to request, in order, to come from `current` to `target`; empty when it is reached.
pub fn steps(current: AlState, target: AlState) -> impl Iterator<Item = AlState> {
    std::iter::successors(next_step(current, target), move |reached| next_step(*reached, target))
}

/// How long a SubDevice may take for a step before the MainDevice gives up.
///
/// The defaults are those that MainDevices use where the device description names none.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct StateTimeouts {
    /// INIT to PREOP and INIT to BOOT. Default 3 s.
    pub preop: Span,
    /// PREOP to SAFEOP and SAFEOP to OP. Default 10 s.
    pub safeop_op: Span,
    /// Back to INIT or PREOP. Default 5 s.
    pub back_to_init: Span,
    /// OP to SAFEOP. Default 200 ms.
    pub back_to_safeop: Span,
}

impl StateTimeouts {
    /// The defaults.
    pub const DEFAULT: Self = Self {
        preop: Span::ms(3_000),
        safeop_op: Span::ms(10_000),
        back_to_init: Span::ms(5_000),
        back_to_safeop: Span::ms(200),
    };

    /// The limit for the step from `from` to `to`. A request for the same state, or for a step that
    /// does not exist, may take as long as entering `to` from below.
    #[must_use]
    pub const fn of(&self, from: AlState, to: AlState) -> Span {
        match (from, to) {
            (Init | Boot | PreOp | SafeOp | Op, Init) | (SafeOp | Op, PreOp) => self.back_to_init,
            (Init | Boot | PreOp | SafeOp | Op, Boot) | (Init | Boot | PreOp, PreOp) => self.preop,
            (Op, SafeOp) => self.back_to_safeop,
            (Init | Boot | PreOp | SafeOp, SafeOp) | (Init | Boot | PreOp | SafeOp | Op, Op) => {
                self.safeop_op
            }
        }
    }
}

impl Default for StateTimeouts {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GO: Option<u16> = None;
    const INVALID: Option<u16> = Some(0x0011);
    const UNKNOWN: Option<u16> = Some(0x0012);
    const NO_BOOT: Option<u16> = Some(0x0013);

    /// The refusal code of an answer, `None` for a step that is taken (and that it is taken to the
    /// state asked for).
    fn code(current: AlState, requested: AlState, boots: bool) -> Option<u16> {
        match answer(current, StateValue::Known(requested), boots) {
            Answer::Enter(state) => {
                assert_eq!(state, requested);
                None
            }
            Answer::Refuse(refusal) => Some(refusal.code().value()),
        }
    }

    // proves: SW-01 partial
    #[test]
    fn every_cell_of_the_state_table() {
        // current, then what INIT, BOOT, PREOP, SAFEOP and OP bring
        let table = [
            (Init, [GO, GO, GO, INVALID, INVALID]),
            (Boot, [GO, GO, INVALID, INVALID, INVALID]),
            (PreOp, [GO, INVALID, GO, GO, INVALID]),
            (SafeOp, [GO, INVALID, GO, GO, GO]),
            (Op, [GO, INVALID, GO, GO, GO]),
        ];
        for (current, row) in table {
            for (requested, expected) in AlState::ALL.into_iter().zip(row) {
                let found = code(current, requested, true);
                assert_eq!(found, expected, "{current} to {requested}");
            }
        }
    }

    #[test]
    fn without_boot_only_the_steps_into_boot_differ() {
        for current in AlState::ALL {
            for requested in AlState::ALL {
                let found = code(current, requested, false);
                let expected = match (current, requested) {
                    (Init | Boot, Boot) => NO_BOOT,
                    _ => code(current, requested, true),
                };
                assert_eq!(found, expected, "{current} to {requested}");
            }
        }
    }

    #[test]
    fn a_value_that_is_no_state_is_refused_everywhere() {
        for current in AlState::ALL {
            for bits in [0, 5, 6, 7, 9, 10, 11, 12, 13, 14, 15] {
                let found = match answer(current, StateValue::from_bits(bits), true) {
                    Answer::Enter(_) => None,
                    Answer::Refuse(refusal) => Some(refusal.code().value()),
                };
                assert_eq!(found, UNKNOWN, "{current} to value {bits}");
            }
        }
    }

    #[test]
    fn an_error_must_be_acknowledged_except_for_init() {
        let standing = AlStatus::new(SafeOp).with_error(true);
        let clean = AlStatus::new(SafeOp);
        let plain = AlControl::request(Op);
        let acknowledging = AlControl::request(Op).with_error_acknowledge(true);
        let init = AlControl::request(Init);
        let act =
            |clears_error, state| Response::Act { clears_error, answer: Answer::Enter(state) };
        let table = [
            (clean, plain, act(false, Op)),
            (clean, acknowledging, act(false, Op)),
            (standing, plain, Response::Ignore),
            (standing, acknowledging, act(true, Op)),
            (standing, init, act(true, Init)),
        ];
        for (status, control, expected) in table {
            assert_eq!(respond(SafeOp, status, control, false), expected, "{status} {control}");
        }
    }

    #[test]
    fn the_way_up_visits_each_state_and_boot_is_reached_through_init() {
        let way = |from, to| steps(from, to).collect::<Vec<_>>();
        assert_eq!(way(Init, Op), [PreOp, SafeOp, Op]);
        assert_eq!(way(PreOp, Op), [SafeOp, Op]);
        assert_eq!(way(Boot, Op), [Init, PreOp, SafeOp, Op]);
        assert_eq!(way(Op, Boot), [Init, Boot]);
        assert_eq!(way(Op, PreOp), [PreOp]);
        assert_eq!(way(Op, Op), []);
    }

    #[test]
    fn every_way_ends_at_its_target_by_steps_that_a_subdevice_takes() {
        for from in AlState::ALL {
            for to in AlState::ALL {
                let mut current = from;
                let mut count = 0;
                for step in steps(from, to) {
                    assert_eq!(
                        code(current, step, true),
                        GO,
                        "{from} to {to}: {current} to {step}"
                    );
                    current = step;
                    count += 1;
                    assert!(count <= 4, "{from} to {to} does not end");
                }
                assert_eq!(current, to);
            }
        }
    }

    #[test]
    fn time_limits_follow_the_direction() {
        let limits = StateTimeouts::DEFAULT;
        let table = [
            (Init, PreOp, 3_000),
            (Init, Boot, 3_000),
            (PreOp, SafeOp, 10_000),
            (SafeOp, Op, 10_000),
            (Op, SafeOp, 200),
            (Op, PreOp, 5_000),
            (SafeOp, PreOp, 5_000),
            (Op, Init, 5_000),
            (Boot, Init, 5_000),
            (PreOp, PreOp, 3_000),
        ];
        for (from, to, ms) in table {
            assert_eq!(limits.of(from, to), Span::ms(ms), "{from} to {to}");
        }
    }
}
