//! `linesman state`: states of SubDevices, looked at, asked for, errors acknowledged.

use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_proto::address::DeviceId;
use linesman_proto::register::AlStatus;
use linesman_proto::state::{AlState, AlStatusCode};
use serde::Serialize;

use super::service::{DeviceReport, Session, Trouble, end};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table};
use crate::version;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the line is: eth0, eth0+eth1 (a ring) or sim:plant.toml
    #[arg(value_name = "WHERE")]
    line: String,
    /// The SubDevice: its number (3), station address (0x1003), alias (alias:7), or name; all
    /// unless said
    #[arg(value_name = "DEVICE")]
    device: Option<String>,
    /// Take it to this state, step by step: INIT, PREOP, SAFEOP, OP or BOOT. Without process data
    /// only SubDevices without outputs enter OP
    #[arg(long, value_name = "STATE", ignore_case = true, value_parser = state)]
    to: Option<AlState>,
    /// Acknowledge an error that it reports
    #[arg(long)]
    acknowledge: bool,
    /// JSON, schema linesman.states/1; linesman.refusal/1 when it is refused
    #[arg(long)]
    pub(crate) json: bool,
}

/// `PREOP`, `pre-op`, `SafeOp`, `bootstrap`.
fn state(text: &str) -> Result<AlState, String> {
    let letters: String = text.chars().filter(char::is_ascii_alphabetic).collect();
    match letters.to_ascii_uppercase().as_str() {
        "INIT" => Ok(AlState::Init),
        "PREOP" => Ok(AlState::PreOp),
        "SAFEOP" => Ok(AlState::SafeOp),
        "OP" => Ok(AlState::Op),
        "BOOT" | "BOOTSTRAP" => Ok(AlState::Boot),
        _ => Err(format!("`{text}`: expected INIT, PREOP, SAFEOP, OP or BOOT")),
    }
}

/// States of SubDevices.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.states/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// By number.
    devices: Vec<StateReport>,
}

/// The state of a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct StateReport {
    /// Whose.
    device: DeviceReport,
    /// `INIT`, `BOOT`, `PREOP`, `SAFEOP`, `OP`.
    al_state: String,
    /// Whether it reports an error.
    al_error: bool,
    /// The AL status code; 0 for none.
    al_code: u16,
    /// What the code means; `null` without an error.
    al_code_text: Option<String>,
    /// Where it was before it was taken elsewhere; `null` when nothing was asked for.
    before: Option<String>,
}

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let mut session = Session::open(&arguments.line)?;
    let chosen: Vec<DeviceId> = match &arguments.device {
        Some(word) => vec![session.device(word)?],
        None => session.devices().iter().map(|known| known.id).collect(),
    };
    let outcome = act(&mut session, &chosen, arguments, output);
    for emergency in session.emergencies() {
        output.warn(&format!("emergency of {emergency}"));
    }
    end(outcome, arguments.json, output)
}

fn act(
    session: &mut Session,
    chosen: &[DeviceId],
    arguments: &Arguments,
    output: &mut Output,
) -> Result<(), Trouble> {
    let mut devices = Vec::with_capacity(chosen.len());
    let mut refused = None;
    for id in chosen {
        let before = session.state(*id)?;
        let service = match (arguments.to, arguments.acknowledge) {
            (Some(to), _) => Service::Enter(to),
            (None, true) => Service::Acknowledge,
            (None, false) => Service::State,
        };
        let changes = service != Service::State;
        let answer = match session.ask(*id, service) {
            Ok(answer) => answer,
            // The others are asked all the same: the first refusal is told at the end.
            Err(Trouble::Refused(refusal)) if chosen.len() > 1 => {
                output.warn(&refusal.failure.reason);
                refused.get_or_insert(refusal);
                session.ask(*id, Service::State)?
            }
            Err(trouble) => return Err(trouble),
        };
        if let ServiceAnswer::State { status, code } = answer {
            let before = changes.then_some(before);
            devices.push(report(session.report(*id), status, code, before));
        }
    }
    if session.is_passing() && arguments.to.is_some() {
        output.warn("this virtual segment ends with the command, and its states too");
    }
    if let Some(refusal) = refused {
        if !arguments.json {
            output.text(&text(&devices, output));
        }
        return Err(Trouble::Refused(refusal));
    }
    if arguments.json {
        let (schema, tool) = ("linesman.states/1".to_owned(), version::tool());
        output.json(&Report { schema, tool, devices });
    } else {
        output.text(&text(&devices, output));
    }
    Ok(())
}

fn report(
    device: DeviceReport,
    status: AlStatus,
    code: AlStatusCode,
    before: Option<AlStatus>,
) -> StateReport {
    let error = status.error();
    StateReport {
        device,
        al_state: status.state().to_string(),
        al_error: error,
        al_code: if error { code.0 } else { 0 },
        al_code_text: error.then(|| code.explain().name.to_owned()),
        before: before.map(|before| before.to_string()),
    }
}

fn text(devices: &[StateReport], output: &Output) -> String {
    let mut table = Table::new(&["no", "station", "name", "type", "state"], output.paint());
    for StateReport { device, al_state, al_error, al_code, al_code_text, before } in devices {
        let mut state = match al_code_text {
            Some(text) => output.paint().bad(&format!("{al_state}, error 0x{al_code:04X} {text}")),
            None if *al_error => output.paint().bad(&format!("{al_state}, error")),
            None => al_state.clone(),
        };
        if let Some(before) = before.as_ref().filter(|before| *before != al_state) {
            state = format!("{before} → {state}");
        }
        table.row([
            device.no.to_string(),
            format!("0x{:04X}", device.station),
            device.name.clone().unwrap_or_default(),
            device.r#type.clone(),
            state,
        ]);
    }
    table.render()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_written_in_many_ways() {
        for (text, expected) in [
            ("INIT", AlState::Init),
            ("pre-op", AlState::PreOp),
            ("SafeOp", AlState::SafeOp),
            ("op", AlState::Op),
            ("Bootstrap", AlState::Boot),
        ] {
            assert_eq!(state(text), Ok(expected), "{text}");
        }
        assert!(state("RUN").unwrap_err().contains("PREOP"));
    }
}
