//! Procedure command of a drive: set, watched by its data state until it ends, taken back.
//!
//! Reference: IEC 61800-7-204, procedure commands: 3 sets a command and enables it, 0 takes it back.

use linesman_proto::mailbox::soe::{CommandProgress, CommandState, DATA_STATE, Idn};
use linesman_proto::time::Span;

use super::idn::DriveClient;
use super::report::IdnReport;
use crate::command::service::ServiceError;
use crate::failure::Failure;
use crate::output::Output;

/// Time between two looks at the data state.
const INTERVAL: Span = Span::ms(50);

/// End of a procedure command.
pub(super) struct CommandEnd {
    pub(super) progress: CommandProgress,
    /// The data state, for people.
    state: String,
}

/// Executes a command and gives how far it came.
pub(super) fn execute(
    client: &mut DriveClient<'_>,
    idn: Idn,
    within: Span,
    output: &Output,
) -> Result<(IdnReport, CommandEnd), ServiceError> {
    let mut report = client.named(idn)?;
    let attribute = client.attribute(idn)?;
    report.attribute = attribute.map(Into::into);
    if attribute.is_some_and(|attribute| !attribute.is_command()) {
        let reason = format!("{}: {} is no procedure command", client.label(), report.title());
        let next_step = format!(
            "read it ({}), or choose one of S-0-0025",
            client.command(&format!("read {idn}"))
        );
        return Err(Failure::new(reason, next_step).into());
    }
    client.write(idn, CommandState::SET_AND_ENABLE.to_le_bytes().to_vec())?;
    let outcome = watch(client, idn, within, &mut report);
    // Whatever has become of it: a command that stays set can be executed by nobody else.
    match (client.write(idn, CommandState::CANCEL.to_le_bytes().to_vec()), outcome) {
        (Ok(()), outcome) => outcome.map(|progress| ended(report, progress)),
        (Err(stays), Ok(progress)) => {
            output.warn(&format!("{idn} was not taken back: {}", stays.reason()));
            Ok(ended(report, progress))
        }
        (Err(_), Err(trouble)) => Err(trouble),
    }
}

fn ended(report: IdnReport, progress: CommandProgress) -> (IdnReport, CommandEnd) {
    let state = report.text.clone();
    (report, CommandEnd { progress, state })
}

/// Reads the data state until the command has come to an end, or the time is over.
fn watch(
    client: &mut DriveClient<'_>,
    idn: Idn,
    within: Span,
    report: &mut IdnReport,
) -> Result<CommandProgress, ServiceError> {
    let mut waited = Span::ZERO;
    report.element = "data state".to_owned();
    loop {
        let data = client.element(idn, DATA_STATE)?;
        report.holds(&data, None);
        let Some(state) = CommandState::parse(&data) else {
            let reason = format!(
                "{}: the data state of {idn} has {} bytes instead of 2",
                client.label(),
                data.len()
            );
            return Err(Failure::new(reason, "ask the maker of the drive").into());
        };
        (report.value, report.text) = (state.0.into(), format!("0x{:04X}", state.0));
        let progress = state.progress();
        match progress {
            CommandProgress::Done | CommandProgress::Failed | CommandProgress::Interrupted => {
                return Ok(progress);
            }
            CommandProgress::Running | CommandProgress::Set | CommandProgress::NotSet => {}
        }
        if waited >= within || !client.session.wait(INTERVAL)? {
            return Ok(progress);
        }
        waited += INTERVAL;
    }
}

impl CommandEnd {
    /// Why it was not done, with what to do; `None` when it was.
    pub(super) fn failure(&self, told: &str, idn: Idn, within: Span) -> Option<Failure> {
        let next_step = match self.progress {
            CommandProgress::Done => return None,
            CommandProgress::Failed | CommandProgress::Interrupted => {
                "look at the diagnosis of the drive (S-0-0095, S-0-0390) and at what its manual \
                 requires for this command"
                    .to_owned()
            }
            CommandProgress::Running | CommandProgress::Set | CommandProgress::NotSet => {
                let seconds = within.as_nanos() / 1_000_000_000;
                format!(
                    "it was taken back after {seconds} s; give it more time: execute {idn} --within {}",
                    (2 * seconds).min(3_600)
                )
            }
        };
        Some(Failure::new(format!("{told} (data state {})", self.state), next_step))
    }
}
