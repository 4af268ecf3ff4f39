//! How a SubDevice answers AL control: states, errors, acknowledgement.
//!
//! Read first: ETG.1000.6, EtherCAT state machine; [`respond`] is its table.
//! What a device checks before it enters a state is its own affair: here is what all have in common.

use linesman_proto::register::AlStatus;
use linesman_proto::state::transition::{Answer, Response, respond};
use linesman_proto::state::{AlState, AlStatusCode, StateValue};

use crate::controller::Pdi;

/// A step that a SubDevice does not take, whatever its settings are: a fault.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Refusal {
    /// The state it does not enter.
    pub transition_to: AlState,
    /// The AL status code it shows instead.
    pub code: AlStatusCode,
}

/// The application layer of a SubDevice: what stands in AL status and why.
#[derive(Clone, Copy, Default, Debug)]
pub struct ApplicationLayer {
    boots: bool,
    refusal: Option<Refusal>,
}

impl ApplicationLayer {
    /// One that knows BOOT, or not.
    #[must_use]
    pub fn new(boots: bool) -> Self {
        Self { boots, ..Self::default() }
    }

    /// From now on it refuses a step, or does so no longer.
    pub fn refuse(&mut self, refusal: Option<Refusal>) {
        self.refusal = refusal;
    }

    /// Whether it refuses a step.
    #[must_use]
    pub fn refuses(&self) -> bool {
        self.refusal.is_some()
    }

    /// The state it is in. A register that holds no state counts as INIT: only a controller with
    /// device emulation can have got there.
    #[must_use]
    pub fn state(pdi: &Pdi<'_>) -> AlState {
        pdi.al_status().state().state().unwrap_or(AlState::Init)
    }

    /// Takes a new request, if there is one, and answers what needs no check. Returns the state to
    /// enter when the checks of the device pass; [`ApplicationLayer::enter`] or
    /// [`ApplicationLayer::fail`] ends the step.
    pub fn take_request(&self, pdi: &mut Pdi<'_>) -> Option<AlState> {
        let control = pdi.take_al_control_event()?;
        let (status, current) = (pdi.al_status(), Self::state(pdi));
        let Response::Act { clears_error, answer } = respond(current, status, control, self.boots)
        else {
            return None;
        };
        if clears_error {
            pdi.set_al_code(AlStatusCode::NO_ERROR);
            pdi.set_al_status(status.with_error(false));
        }
        let requested = match answer {
            Answer::Enter(requested) => requested,
            Answer::Refuse(refusal) => {
                Self::fail(pdi, current, refusal.code());
                return None;
            }
        };
        if let Some(refusal) = self.refusal
            && refusal.transition_to == requested
            && requested != current
        {
            Self::fail(pdi, current, refusal.code);
            return None;
        }
        Some(requested)
    }

    /// It is in `state`, without error. No device here has an identification to show, so bit 5 of AL
    /// control stays unanswered.
    pub fn enter(pdi: &mut Pdi<'_>, state: AlState) {
        pdi.set_al_code(AlStatusCode::NO_ERROR);
        pdi.set_al_status(AlStatus::new(state));
    }

    /// It stays in `state`, or falls back to it, because of an error.
    pub fn fail(pdi: &mut Pdi<'_>, state: AlState, code: AlStatusCode) {
        pdi.set_al_code(code);
        pdi.set_al_status(AlStatus::new(state).with_error(true));
    }

    /// Answers all requests of a device that checks nothing.
    pub fn serve_unchecked(&self, pdi: &mut Pdi<'_>) {
        if let Some(state) = self.take_request(pdi) {
            Self::enter(pdi, state);
        }
    }

    /// Whether it is in OP.
    #[must_use]
    pub fn is_operational(pdi: &Pdi<'_>) -> bool {
        pdi.al_status().state() == StateValue::Known(AlState::Op)
    }
}
