//! States of single SubDevices, on a line that nobody drives.

use linesman_config::plan::DevicePlan;
use linesman_proto::sii::MailboxPair;
use linesman_proto::sii::word::BOOTSTRAP_MAILBOX;
use linesman_proto::state::transition::next_step;
use linesman_proto::state::{AlState, StateValue};

use super::ServiceAnswer;
use super::failure::ServiceFailure;
use super::perform::Servant;
use crate::exchange::Target;
use crate::executor::lock;
use crate::procedure::{StepError, set_up, sii, state};

/// Looks at the state.
pub(super) async fn look(
    servant: &Servant,
    device: &DevicePlan,
) -> Result<ServiceAnswer, ServiceFailure> {
    let target = Target::Station(device.station);
    match state::read(&servant.wire, target).await {
        Ok((status, code)) => Ok(ServiceAnswer::State { status, code }),
        Err(error) => Err(ServiceFailure::Register { id: device.id, error }),
    }
}

/// Acknowledges an error.
pub(super) async fn acknowledge(
    servant: &Servant,
    device: &DevicePlan,
) -> Result<ServiceAnswer, ServiceFailure> {
    let (wire, target, id) = (&servant.wire, Target::Station(device.station), device.id);
    let looked = state::read(wire, target).await;
    let (status, _) = looked.map_err(|error| ServiceFailure::Register { id, error })?;
    if status.error() {
        let to = status.state().state().unwrap_or(AlState::Init);
        state::acknowledge(wire, target, status, device.device_emulation)
            .await
            .map_err(|error| ServiceFailure::State { id, to, error })?;
    }
    look(servant, device).await
}

/// Takes a SubDevice to a state.
pub(super) async fn enter(
    servant: &Servant,
    device: &DevicePlan,
    to: AlState,
) -> Result<ServiceAnswer, ServiceFailure> {
    let id = device.id;
    if servant.attended.is_none() {
        return Err(ServiceFailure::Driven { id });
    }
    if to == AlState::Op && !device.outputs.is_empty() {
        return Err(ServiceFailure::NeedsCycle { id });
    }
    acknowledge(servant, device).await?;
    let failed = |error| ServiceFailure::State { id, to, error };
    let (wire, target) = (&servant.wire, Target::Station(device.station));
    let looked = state::read(wire, target).await;
    let (status, _) = looked.map_err(|error| failed(StepError::from(error)))?;
    let mut current = match status.state() {
        StateValue::Known(current) => Some(current),
        StateValue::Unknown(_) => None,
    };
    loop {
        moving(servant, device, current);
        let next = match current {
            None => AlState::Init,
            Some(current) => match next_step(current, to) {
                Some(next) => next,
                None => return look(servant, device).await,
            },
        };
        match (current, next) {
            (Some(AlState::Init), AlState::PreOp) => {
                servant.mailboxes.set_areas(id, None);
                set_up::before_pre_op(wire, device).await.map_err(|error| failed(error.into()))?;
            }
            (Some(AlState::Init), AlState::Boot) => before_boot(servant, device).await?,
            (Some(AlState::PreOp), AlState::SafeOp) => {
                set_up::before_safe_op(wire, device).await.map_err(|error| failed(error.into()))?;
            }
            _ => {}
        }
        let from = current.unwrap_or(AlState::Op);
        let limit = servant.options.state_timeouts.of(from, next);
        let step = state::Step { to: next, limit, emulated: device.device_emulation };
        let stepped = state::request(wire, target, step).await;
        if stepped.is_err()
            && let Some(attended) = &servant.attended
        {
            attended.look(wire, device).await;
        }
        stepped.map_err(failed)?;
        current = Some(next);
    }
}

fn moving(servant: &Servant, device: &DevicePlan, state: Option<AlState>) {
    if let Some(attended) = &servant.attended {
        lock(&attended.line).set_moving(device.id, state);
    }
}

/// Before INIT to BOOT: the mailbox where the SII says it lies in BOOT (words 0x14 to 0x17).
async fn before_boot(servant: &Servant, device: &DevicePlan) -> Result<(), ServiceFailure> {
    let (wire, target, id) = (&servant.wire, Target::Station(device.station), device.id);
    let words = sii::read_words(wire, target, BOOTSTRAP_MAILBOX, 4)
        .await
        .map_err(|error| ServiceFailure::Sii { id, error })?;
    let word = |at: usize| {
        let bytes = words.get(2 * at..2 * at + 2).and_then(|slice| slice.first_chunk());
        u16::from_le_bytes(bytes.copied().unwrap_or_default())
    };
    let areas = MailboxPair::from_words([word(0), word(1), word(2), word(3)]);
    let (Some(mailbox), true) = (device.mailbox, areas.receive.size > 0 && areas.send.size > 0)
    else {
        return Err(ServiceFailure::NoBootstrap { id });
    };
    let mut boots = device.clone();
    boots.mailbox = Some(linesman_config::profile::Mailbox { areas, ..mailbox });
    servant.mailboxes.set_areas(id, Some(areas));
    set_up::before_pre_op(wire, &boots).await.map_err(|error| ServiceFailure::State {
        id,
        to: AlState::Boot,
        error: error.into(),
    })
}
