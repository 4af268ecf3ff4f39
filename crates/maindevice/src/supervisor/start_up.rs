//! The start-up commands of one SubDevice, executed at their transitions.

use linesman_config::plan::DevicePlan;
use linesman_config::start_up::{StartUpAction, StartUpCommand, Transition};

use super::Context;
use crate::exchange::{ExchangeError, Target};
use crate::mailbox::{MailboxFailure, MailboxRequest};
use crate::procedure::state::StepError;

/// A start-up command that was not taken.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum StartUpError {
    /// Its object was not written.
    #[error(transparent)]
    Object(#[from] MailboxFailure),
    /// Its registers were not written.
    #[error(transparent)]
    Register(#[from] ExchangeError),
}

impl StartUpError {
    /// Whether the SubDevice itself has said no.
    #[must_use]
    pub fn is_refusal(&self) -> bool {
        match self {
            Self::Object(failure) => failure.why.is_refusal(),
            Self::Register(_) => false,
        }
    }
}

/// Where on the way of a transition commands are executed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Moment {
    /// Before the new state is asked for.
    Before,
    /// When it is there.
    After,
}

/// Executes the commands of a transition that are due at a moment, one after another.
///
/// # Errors
/// [`StepError::StartUp`] with the first command that was not taken; those behind it are not executed.
pub(super) async fn execute(
    context: &Context,
    device: &DevicePlan,
    transition: Transition,
    moment: Moment,
) -> Result<(), StepError> {
    for command in device.start_up.iter().filter(|command| command.transition == transition) {
        let outcome = match &command.action {
            StartUpAction::CoeDownload { .. }
            | StartUpAction::SetAddresses { .. }
            | StartUpAction::WriteIdn { .. }
            | StartUpAction::Ads { .. }
            | StartUpAction::WriteFile { .. }
            | StartUpAction::SendVendorMessage { .. }
                if due(transition) != moment =>
            {
                continue;
            }
            StartUpAction::CoeDownload { object, complete_access, data } => {
                let request = MailboxRequest::Download {
                    object: *object,
                    complete: *complete_access,
                    data: data.clone(),
                };
                asked(context, device, request).await
            }
            StartUpAction::SetAddresses { port, parameters } => {
                let (port, parameters) = (*port, parameters.clone());
                asked(context, device, MailboxRequest::SetAddresses { port, parameters }).await
            }
            StartUpAction::WriteIdn { drive, idn, elements, data } => {
                let (drive, idn, elements) = (*drive, *idn, *elements);
                let data = data.clone();
                let request = MailboxRequest::WriteIdn { drive, idn, elements, data };
                asked(context, device, request).await
            }
            StartUpAction::Ads { target, source, command, data } => {
                let request = MailboxRequest::Ads {
                    net_id: Some(target.net_id),
                    port: target.port,
                    source: Some(*source),
                    command: *command,
                    data: data.clone(),
                };
                asked(context, device, request).await
            }
            StartUpAction::WriteFile { name, password, data } => {
                let (name, password, data) = (name.clone(), *password, data.clone());
                asked(context, device, MailboxRequest::WriteFile { name, password, data }).await
            }
            StartUpAction::SendVendorMessage { data, answer_within } => {
                let (data, answer_within) = (data.clone(), *answer_within);
                let request = MailboxRequest::SendVendorMessage { data, answer_within };
                asked(context, device, request).await
            }
            StartUpAction::RegisterWrite { .. } if moment == Moment::After => continue,
            StartUpAction::RegisterWrite { address, data } => {
                let target = Target::Station(device.station);
                context.wire.write_one(target, *address, data).await.map(|_| ()).map_err(Into::into)
            }
        };
        outcome.map_err(|error| failed(command, error))?;
    }
    Ok(())
}

async fn asked(
    context: &Context,
    device: &DevicePlan,
    request: MailboxRequest,
) -> Result<(), StartUpError> {
    let outcome = context.mailboxes.ask(device.id, request).await;
    outcome.map(|_| ()).map_err(StartUpError::from)
}

/// When mailbox commands of a transition are executed.
fn due(transition: Transition) -> Moment {
    if transition.opens_mailbox() { Moment::After } else { Moment::Before }
}

fn failed(command: &StartUpCommand, error: StartUpError) -> StepError {
    StepError::StartUp { command: Box::new(command.clone()), error: Box::new(error) }
}
