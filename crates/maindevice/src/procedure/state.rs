//! One step between states: request, wait, refusal, acknowledgement.
//!
//! Reference: ETG.1000.6, EtherCAT state machine. A request is a kind of mailbox: the controller
//! takes the next one only when the SubDevice has fetched the last, so a repeated request may count
//! nothing although the first one is being worked on. The AL status alone tells.

use linesman_config::start_up::StartUpCommand;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::register::{self, AlControl, AlStatus};
use linesman_proto::state::{AlState, AlStatusCode, StateValue};
use linesman_proto::time::Span;

use super::read_only_scan::{AL_LEN, al_of};
use crate::exchange::{ExchangeError, Target};
use crate::executor::Wire;
use crate::supervisor::StartUpError;

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
    /// Its clock does not follow the reference clock.
    #[error("clock {difference} off the reference after {patience}, expected {limit} at most")]
    ClockOff {
        /// How far it is off (0x092C).
        difference: Span,
        /// How far it may be.
        limit: Span,
        /// How long it was waited for.
        patience: Span,
    },
    /// A slot holds another module than planned.
    #[error(
        "slot {slot} holds module 0x{found:08X}, expected 0x{expected:08X} (object 0xF050:{slot:02X}; 0 is an \
         empty slot)"
    )]
    Module {
        /// The slot, from 1.
        slot: u8,
        /// The planned module.
        expected: u32,
        /// The one that is there.
        found: u32,
    },
    /// It cannot work as fast as its SyncSignals come.
    #[error("its cycle of {cycle} is shorter than it can bear, {shortest} ({object})")]
    CycleTooShort {
        /// The planned cycle of SYNC0.
        cycle: Span,
        /// The shortest that it says it can bear.
        shortest: Span,
        /// Where it says so.
        object: ObjectAddress,
    },
    /// It does not say which modules it has.
    #[error("asking for its modules: {0}")]
    Unread(Box<StartUpError>),
    /// It does not take a command that belongs to the step.
    #[error("start-up command {command}: {error}")]
    StartUp {
        /// Which command.
        command: Box<StartUpCommand>,
        /// What failed.
        error: Box<StartUpError>,
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
/// A request that was not taken is written again after so long.
const WRITE_AGAIN_AFTER: Span = Span::ms(50);
/// The status is looked at again after this part of the time that has passed, so that at most that
/// much is waited in vain; at first with every frame.
const POLL_PART: u64 = 8;
/// Shorter waits than a frame takes are none.
const SHORTEST_POLL: Span = Span::us(20);

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
    let mut acknowledge = to == AlState::Init && !emulated;
    let began = wire.now();
    let until = began + limit;
    let mut write_at = began;
    loop {
        let now = wire.now();
        // A register takes its value when the frame has ended: the status needs a frame of its own.
        if now >= write_at {
            let control = AlControl::request(to).with_error_acknowledge(acknowledge).to_bytes();
            let sent = wire.write(target, register::AL_CONTROL.address, &control).await?;
            if sent.answered() {
                write_at = now + WRITE_AGAIN_AFTER;
            }
        }
        let (status, code) = read(wire, target).await?;
        if acknowledge && is_mirrored(to, status, code) {
            acknowledge = false;
            write_at = now;
            continue;
        }
        // Otherwise no error bit was written that could be mirrored: the SubDevice shows it.
        if status.error() {
            return Err(StepError::Refused { to, status, code });
        }
        if status.state() == StateValue::Known(to) {
            return Ok(());
        }
        let now = wire.now();
        if now >= until {
            return Err(StepError::TimedOut { to, status });
        }
        let pause = Span::ns(now.since(began).as_nanos() / POLL_PART).min(SLOWEST_POLL);
        if pause >= SHORTEST_POLL {
            wire.sleep(pause).await;
        }
    }
}

/// Whether what we acknowledged comes back as it was written, with no reason: nobody said so, but AL
/// status of this controller mirrors AL control (device emulation, register 0x0141 bit 0).
fn is_mirrored(to: AlState, status: AlStatus, code: AlStatusCode) -> bool {
    status.error() && status.state() == StateValue::Known(to) && code == AlStatusCode::NO_ERROR
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
    mut emulated: bool,
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
        emulated |= is_mirrored(to, status, code);
        wire.sleep(SLOWEST_POLL).await;
    }
}
