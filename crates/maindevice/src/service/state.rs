//! States of single SubDevices: on a line that nobody drives step by step, else by asking whoever does.

use linesman_config::plan::DevicePlan;
use linesman_proto::state::transition::{next_step, steps};
use linesman_proto::state::{AlState, StateValue};
use linesman_proto::time::Span;

use super::ServiceAnswer;
use super::failure::ServiceFailure;
use super::perform::ServiceContext;
use crate::exchange::Target;
use crate::executor::lock;
use crate::procedure::{StepError, set_up, state};

/// Looks at the state.
pub(super) async fn read_state(
    context: &ServiceContext,
    device: &DevicePlan,
) -> Result<ServiceAnswer, ServiceFailure> {
    let target = Target::Station(device.station);
    match state::read(&context.wire, target).await {
        Ok((status, code)) => Ok(ServiceAnswer::State { status, code }),
        Err(error) => Err(ServiceFailure::Register { id: device.id, error }),
    }
}

/// Acknowledges an error.
pub(super) async fn acknowledge(
    context: &ServiceContext,
    device: &DevicePlan,
) -> Result<ServiceAnswer, ServiceFailure> {
    let (wire, target, id) = (&context.wire, Target::Station(device.station), device.id);
    let looked = state::read(wire, target).await;
    let (status, _) = looked.map_err(|error| ServiceFailure::Register { id, error })?;
    if status.error() {
        let to = status.state().state().unwrap_or(AlState::Init);
        state::acknowledge(wire, target, status, device.device_emulation)
            .await
            .map_err(|error| ServiceFailure::State { id, to, error })?;
    }
    read_state(context, device).await
}

/// Notes in which state a SubDevice of a line is that nobody drives: that opens or closes its mailbox.
pub(super) async fn learn(context: &ServiceContext, device: &DevicePlan) {
    if context.driven {
        return;
    }
    let looked = state::read(&context.wire, Target::Station(device.station)).await;
    let found = looked.ok().and_then(|(status, _)| status.state().state());
    lock(&context.device_table).set_moving(device.id, found);
}

/// Takes a SubDevice to a state.
pub(super) async fn enter(
    context: &ServiceContext,
    device: &DevicePlan,
    to: AlState,
) -> Result<ServiceAnswer, ServiceFailure> {
    let id = device.id;
    if to == AlState::Boot && device.mailbox.is_none_or(|mailbox| mailbox.bootstrap.is_none()) {
        return Err(ServiceFailure::NoBootstrap { id });
    }
    if context.driven {
        return redirect(context, device, to).await;
    }
    if to == AlState::Op && !device.outputs.is_empty() {
        return Err(ServiceFailure::NeedsCycle { id });
    }
    acknowledge(context, device).await?;
    let failed = |error| ServiceFailure::State { id, to, error };
    let looked = state::read(&context.wire, Target::Station(device.station)).await;
    let (status, _) = looked.map_err(|error| failed(StepError::from(error)))?;
    let mut current = status.state().state();
    loop {
        lock(&context.device_table).set_moving(id, current);
        let next = match current {
            None => AlState::Init,
            Some(current) => match next_step(current, to) {
                Some(next) => next,
                None => return read_state(context, device).await,
            },
        };
        let made = step(context, device, current, next).await;
        if made.is_err() {
            learn(context, device).await;
        }
        made.map_err(failed)?;
        current = Some(next);
    }
}

/// One step of a SubDevice that nobody drives.
async fn step(
    context: &ServiceContext,
    device: &DevicePlan,
    current: Option<AlState>,
    next: AlState,
) -> Result<(), StepError> {
    let wire = &context.wire;
    match (current, next) {
        (Some(AlState::Init), AlState::PreOp) => {
            let areas = device.mailbox.map(|mailbox| mailbox.areas);
            set_up::before_mailbox(wire, device, areas).await?;
        }
        (Some(AlState::Init), AlState::Boot) => {
            let areas = device.mailbox.and_then(|mailbox| mailbox.bootstrap);
            set_up::before_mailbox(wire, device, areas).await?;
        }
        (Some(AlState::PreOp), AlState::SafeOp) => set_up::before_safe_op(wire, device).await?,
        _ => {}
    }
    let limit = context.options.state_timeouts.of(current.unwrap_or(AlState::Op), next);
    let step = state::Step { to: next, limit, emulated: device.device_emulation };
    state::request(wire, Target::Station(device.station), step).await
}

/// Between two looks at a SubDevice that others take to a state.
const LOOK: Span = Span::ms(2);
/// An error that stood before the request is not its outcome, unless it stays so long.
const OLD_ERROR: Span = Span::ms(500);

/// Asks whoever drives the line for another state of a SubDevice, and waits for it.
async fn redirect(
    context: &ServiceContext,
    device: &DevicePlan,
    to: AlState,
) -> Result<ServiceAnswer, ServiceFailure> {
    let (wire, target, id) = (&context.wire, Target::Station(device.station), device.id);
    let failed = |error| ServiceFailure::State { id, to, error };
    let before = state::read(wire, target).await.map_err(|error| failed(error.into()))?;
    if !lock(&context.device_table).ask_for(id, to) {
        return Err(ServiceFailure::Unknown { id });
    }
    let began = wire.now();
    let from = before.0.state().state().unwrap_or(AlState::Init);
    let limits = steps(from, to).chain([to]).zip(std::iter::once(from).chain(steps(from, to)));
    let patience = limits
        .fold(OLD_ERROR, |sum, (next, from)| sum + context.options.state_timeouts.of(from, next));
    loop {
        wire.sleep(LOOK).await;
        let looked = state::read(wire, target).await.map_err(|error| failed(error.into()))?;
        let (status, code) = looked;
        let is_there = status.state() == StateValue::Known(to) && !status.error();
        if is_there && lock(&context.device_table).has_reached(id) {
            return Ok(ServiceAnswer::State { status, code });
        }
        let waited = wire.now().since(began);
        if status.error() && (looked != before || waited >= OLD_ERROR) {
            return Err(failed(StepError::Refused { to, status, code }));
        }
        if waited >= patience {
            return Err(failed(StepError::TimedOut { to, status }));
        }
    }
}
