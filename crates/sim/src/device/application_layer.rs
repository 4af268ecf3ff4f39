//! Application layer of a SubDevice: states, errors and acknowledgement through AL control.
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
    /// How many requests it refuses before it takes one; `None` for all.
    pub times: Option<u32>,
}

/// The application layer of a SubDevice: what stands in AL status and why.
#[derive(Clone, Copy, Default, Debug)]
pub struct ApplicationLayer {
    boots: bool,
    refusal: Option<Refusal>,
    /// What it answers who asks for its identification; `None` when it does not know how.
    identification: Option<u16>,
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

    /// Whether it was told to refuse a step.
    #[must_use]
    pub fn refuses(&self) -> bool {
        self.refusal.is_some()
    }

    /// From now on it tells this number to who asks for its identification through AL control.
    pub fn identify(&mut self, identification: u16) {
        self.identification = Some(identification);
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
    pub fn take_request(&mut self, pdi: &mut Pdi<'_>) -> Option<AlState> {
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
        if let Some(refusal) = &mut self.refusal
            && refusal.transition_to == requested
            && requested > current
            && refusal.times != Some(0)
        {
            refusal.times = refusal.times.map(|times| times - 1);
            let code = refusal.code;
            Self::fail(pdi, current, code);
            return None;
        }
        Some(requested)
    }

    /// It is in `state`, without error. While AL control asks for the identification (bit 5), that
    /// stands in place of the status code, and bit 5 of AL status says so.
    pub fn enter(&self, pdi: &mut Pdi<'_>, state: AlState) {
        let asked = pdi.al_control().requests_identification();
        let identification = self.identification.filter(|_| asked);
        pdi.set_al_code(identification.map_or(AlStatusCode::NO_ERROR, AlStatusCode));
        let loaded = identification.is_some();
        pdi.set_al_status(AlStatus::new(state).with_identification_loaded(loaded));
    }

    /// It stays in `state`, or falls back to it, because of an error.
    pub fn fail(pdi: &mut Pdi<'_>, state: AlState, code: AlStatusCode) {
        pdi.set_al_code(code);
        pdi.set_al_status(AlStatus::new(state).with_error(true));
    }

    /// Answers all requests of a device that checks nothing.
    pub fn serve_unchecked(&mut self, pdi: &mut Pdi<'_>) {
        if let Some(state) = self.take_request(pdi) {
            self.enter(pdi, state);
        }
    }

    /// Whether it is in OP.
    #[must_use]
    pub fn is_operational(pdi: &Pdi<'_>) -> bool {
        pdi.al_status().state() == StateValue::Known(AlState::Op)
    }
}
