//! One step between states: request, wait, refusal, acknowledgement.
//!
//! Reference: ETG.1000.6, EtherCAT state machine. A request is a kind of mailbox: the controller
//! takes the next one only when the SubDevice has fetched the last, so a repeated request may count
//! nothing although the first one is being worked on. The AL status alone tells.

use linesman_proto::register::{self, AlControl, AlStatus};
use linesman_proto::state::{AlState, AlStatusCode, StateValue};
use linesman_proto::time::Span;

use super::look::{AL_LEN, al_of};
use crate::exchange::{ExchangeError, Target};
use crate::executor::Wire;

/// A step was not made.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum StepError {
    /// The SubDevice does not answer.
    #[error(transparent)]
    Gone(#[from] ExchangeError),
    /// It refuses.
    #[error("refuses to enter {to}, is in {status}: {code}")]
    Refused {
        /// Where it should have gone.
        to: AlState,
        /// Where it is.
        status: AlStatus,
        /// Why.
        code: AlStatusCode,
    },
    /// It takes too long.
    #[error("is still in {status} although it was asked to enter {to}; its time is up")]
    TimedOut {
        /// Where it should have gone.
        to: AlState,
        /// Where it is.
        status: AlStatus,
    },
}

/// A step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Step {
    /// Where to.
    pub to: AlState,
    /// How long it may take.
    pub limit: Span,
    /// AL status mirrors AL control: the acknowledge bit must not be sent.
    pub emulated: bool,
}

const FIRST_POLL: Span = Span::us(500);
const SLOWEST_POLL: Span = Span::ms(10);
/// A request that was not taken is written again after so many looks at the status.
const WRITE_AGAIN_AFTER: u32 = 20;

/// How long an acknowledgement may take.
const ACKNOWLEDGE_LIMIT: Span = Span::ms(500);

/// State and status code.
///
/// # Errors
/// [`ExchangeError`] when the SubDevice does not answer.
pub async fn read(wire: &Wire, target: Target) -> Result<(AlStatus, AlStatusCode), ExchangeError> {
    let reply = wire.read_one(target, register::AL_STATUS.address, AL_LEN).await?;
    Ok(al_of(&reply))
}

/// Asks for a state and waits until it is there.
///
/// # Errors
/// [`StepError`].
pub async fn request(wire: &Wire, target: Target, step: Step) -> Result<(), StepError> {
    let Step { to, limit, emulated } = step;
    // INIT is heard even when an error stands; the bit does no harm there and clears it.
    let acknowledge = to == AlState::Init && !emulated;
    let control = AlControl::request(to).with_error_acknowledge(acknowledge).to_bytes();
    let until = wire.now() + limit;
    let mut pause = FIRST_POLL;
    let mut looks = 0;
    loop {
        if looks % WRITE_AGAIN_AFTER == 0 {
            let sent = wire.write(target, register::AL_CONTROL.address, &control).await?;
            looks += u32::from(sent.answered());
        } else {
            looks += 1;
        }
        let (status, code) = read(wire, target).await?;
        // We never write the error bit to a controller with device emulation, so it does not mirror
        // it: there, too, it is the SubDevice that shows it.
        if status.error() {
            return Err(StepError::Refused { to, status, code });
        }
        if status.state() == StateValue::Known(to) {
            return Ok(());
        }
        if wire.now() >= until {
            return Err(StepError::TimedOut { to, status });
        }
        wire.sleep(pause).await;
        pause = (pause * 2).min(SLOWEST_POLL);
    }
}

/// Acknowledges an error; the SubDevice stays in its state. Where AL status mirrors AL control the
/// bit is taken back afterwards.
///
/// # Errors
/// [`StepError`] when the error bit does not go.
pub async fn acknowledge(
    wire: &Wire,
    target: Target,
    status: AlStatus,
    emulated: bool,
) -> Result<(), StepError> {
    // A value that names no state cannot be asked for: INIT clears all.
    let to = status.state().state().unwrap_or(AlState::Init);
    let control = AlControl::request(to);
    let acknowledge = control.with_error_acknowledge(true).to_bytes();
    let until = wire.now() + ACKNOWLEDGE_LIMIT;
    loop {
        wire.write(target, register::AL_CONTROL.address, &acknowledge).await?;
        wire.sleep(FIRST_POLL).await;
        if emulated {
            wire.write(target, register::AL_CONTROL.address, &control.to_bytes()).await?;
        }
        let (status, code) = read(wire, target).await?;
        if !status.error() {
            return Ok(());
        }
        if wire.now() >= until {
            return Err(StepError::Refused { to, status, code });
        }
        wire.sleep(SLOWEST_POLL).await;
    }
}
