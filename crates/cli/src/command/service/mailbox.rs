//! A mailbox opened for the time of a command: a SubDevice in INIT has none.

use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_proto::address::DeviceId;
use linesman_proto::register::AlStatus;
use linesman_proto::state::{AlState, StateValue};

use super::{ServiceError, ServiceLine};
use crate::failure::Failure;
use crate::output::Output;

/// A SubDevice that was taken to another state for a command.
#[derive(Debug)]
pub(crate) struct OpenedMailbox {
    id: DeviceId,
    /// Where it was; `None` when it stayed there.
    back_to: Option<AlState>,
}

impl ServiceLine {
    /// The state of a SubDevice.
    pub(crate) fn state(&mut self, id: DeviceId) -> Result<AlStatus, ServiceError> {
        match self.ask(id, Service::State)? {
            ServiceAnswer::State { status, .. } => Ok(status),
            ServiceAnswer::Done | ServiceAnswer::Data(_) | ServiceAnswer::Written { .. } => {
                Ok(AlStatus(0))
            }
        }
    }

    /// Makes sure that a SubDevice has a mailbox: one in INIT is taken to PREOP, and said so.
    pub(crate) fn open_mailbox(
        &mut self,
        id: DeviceId,
        output: &Output,
    ) -> Result<OpenedMailbox, ServiceError> {
        let label = self.label(id);
        if self.known(id).is_none_or(|known| !known.mailbox) {
            let reason = format!("{label} has no mailbox: it has no objects and no files");
            let advice = "choose a SubDevice that has one; `linesman scan -v` lists them";
            return Err(Failure::new(reason, advice).into());
        }
        let status = self.state(id)?;
        match status.state() {
            StateValue::Known(AlState::PreOp | AlState::SafeOp | AlState::Op) => {
                Ok(OpenedMailbox { id, back_to: None })
            }
            StateValue::Known(AlState::Init) if !status.error() => {
                output.warn(&format!(
                    "{label} is in INIT, where it has no mailbox: it is taken to PREOP for this, then \
                     back to INIT"
                ));
                self.ask(id, Service::Enter(AlState::PreOp))?;
                Ok(OpenedMailbox { id, back_to: Some(AlState::Init) })
            }
            StateValue::Known(AlState::Init | AlState::Boot) | StateValue::Unknown(_) => {
                let reason = format!("{label} is in {status}, where it takes no such messages");
                let advice = format!(
                    "take it to PREOP first: `linesman state {} {} --to PREOP`",
                    self.place,
                    id.no()
                );
                Err(Failure::new(reason, advice).into())
            }
        }
    }

    /// Takes a SubDevice to BOOT, and said so.
    pub(crate) fn open_boot(
        &mut self,
        id: DeviceId,
        output: &Output,
    ) -> Result<OpenedMailbox, ServiceError> {
        let label = self.label(id);
        let status = self.state(id)?;
        if status.state() == StateValue::Known(AlState::Boot) {
            return Ok(OpenedMailbox { id, back_to: None });
        }
        let was = status.state().state().unwrap_or(AlState::Init);
        // OP needs outputs, which nobody sends here unless the line is driven.
        let driven = self.inventory().is_none();
        let back_to = if was == AlState::Op && !driven { AlState::SafeOp } else { was };
        let way = if back_to == AlState::Init { "back" } else { "through INIT" };
        output.warn(&format!(
            "{label} is taken from {status} to BOOT for this, then {way} to {back_to}"
        ));
        self.ask(id, Service::Enter(AlState::Boot))?;
        Ok(OpenedMailbox { id, back_to: Some(back_to) })
    }

    /// Does something with a SubDevice whose mailbox was opened for it, and takes it back to where it was.
    pub(crate) fn with_opened<T>(
        &mut self,
        opened: Result<OpenedMailbox, ServiceError>,
        output: &mut Output,
        act: impl FnOnce(&mut Self, &mut Output) -> Result<T, ServiceError>,
    ) -> Result<T, ServiceError> {
        let opened = opened?;
        let outcome = act(self, output);
        self.close(opened, outcome, output)
    }

    /// Takes a SubDevice back to where it was, whatever has become of the command.
    fn close<T>(
        &mut self,
        opened: OpenedMailbox,
        outcome: Result<T, ServiceError>,
        output: &Output,
    ) -> Result<T, ServiceError> {
        for emergency in self.emergencies() {
            output.warn(&format!("emergency of {emergency}"));
        }
        let Some(back_to) = opened.back_to else { return outcome };
        let closed = self.ask(opened.id, Service::Enter(back_to));
        match (outcome, closed) {
            (Ok(done), Ok(_)) => Ok(done),
            (Ok(_), Err(trouble)) => Err(trouble),
            (Err(trouble), Ok(_)) => Err(trouble),
            (Err(trouble), Err(stays)) => {
                let (why, label) = (stays.reason(), self.label(opened.id));
                output.warn(&format!("{label} did not go back to {back_to}: {why}"));
                Err(trouble)
            }
        }
    }
}
