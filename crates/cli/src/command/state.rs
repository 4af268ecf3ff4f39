//! `linesman state`: states of SubDevices, looked at, asked for, errors acknowledged.

use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_proto::address::DeviceId;
use linesman_proto::register::AlStatus;
use linesman_proto::state::transition::steps;
use linesman_proto::state::{AlState, AlStatusCode};
use serde::Serialize;

use super::service::{DeviceReport, KnownDevice, ServiceError, ServiceLine, end};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table};
use crate::version;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the line is: eth0, eth0+eth1 (a ring) or sim:plant.toml
    #[arg(value_name = "WHERE")]
    pub(crate) line: String,
    /// The SubDevice: its number (3), station address (0x1003), alias (alias:7), position (position:2),
    /// type, or name, also as answers write it ("Term 4 (EL3104)"); all unless said
    #[arg(value_name = "DEVICE")]
    device: Option<String>,
    /// Take it to this state, step by step: INIT, PREOP, SAFEOP, OP or BOOT. All are looked at before one
    /// is changed. Without process data only SubDevices without outputs enter OP
    #[arg(long, value_name = "STATE", ignore_case = true, value_parser = state)]
    to: Option<AlState>,
    /// With --to: tell what would be done, and whether it can be, and change nothing
    #[arg(long, requires = "to")]
    dry_run: bool,
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
    /// `INIT`, `BOOT`, `PREOP`, `SAFEOP`, `OP`; `null`: it does not answer.
    al_state: Option<String>,
    /// Whether it reports an error.
    al_error: bool,
    /// The AL status code; 0 for none.
    al_code: u16,
    /// What the code means; `null` without an error.
    al_code_text: Option<String>,
    /// Where it was before it was taken elsewhere; `null` when nothing was asked for.
    before: Option<String>,
    /// With --dry-run the states it would be taken to, in order; else empty.
    steps: Vec<String>,
}

/// What a SubDevice was seen in; `None`: it does not answer.
type Seen = Option<(AlStatus, AlStatusCode)>;

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let mut session = ServiceLine::open(&arguments.line)?;
    let chosen: Vec<DeviceId> = match &arguments.device {
        Some(word) => vec![session.device(word)?],
        None => session.devices().iter().map(|known| known.id).collect(),
    };
    let outcome = act(&mut session, &chosen, arguments, output);
    for emergency in session.emergencies() {
        output.warn(&format!("emergency of {emergency}"));
    }
    match outcome {
        Ok(true) => Ok(Status::Good),
        Ok(false) => Ok(Status::Findings),
        Err(trouble) => end(Err(trouble), arguments.json, output),
    }
}

/// Looks at all, then does what was asked; says whether all answer.
fn act(
    session: &mut ServiceLine,
    chosen: &[DeviceId],
    arguments: &Arguments,
    output: &mut Output,
) -> Result<bool, ServiceError> {
    let seen = look_at(session, chosen)?;
    let service = match (arguments.to, arguments.acknowledge) {
        (Some(to), _) => {
            check(session, chosen, &seen, to)?;
            Some(Service::Enter(to))
        }
        (None, true) => Some(Service::Acknowledge),
        (None, false) => None,
    };
    let mut devices = Vec::with_capacity(chosen.len());
    let mut trouble = None;
    for (id, before) in chosen.iter().zip(&seen) {
        let device = session.report(*id);
        let Some((status, _)) = before else {
            devices.push(report(device, *before));
            continue;
        };
        let Some(service) = service.as_ref().filter(|_| !arguments.dry_run) else {
            let steps = arguments.to.map_or_else(Vec::new, |to| would_be(*status, to));
            devices.push(StateReport { steps, ..report(device, *before) });
            continue;
        };
        let after = match session.attempt(*id, service.clone())? {
            Ok(ServiceAnswer::State { status, code }) => Some((status, code)),
            Ok(ServiceAnswer::Done | ServiceAnswer::Data(_) | ServiceAnswer::Written { .. }) => {
                *before
            }
            // The others are asked all the same: the first trouble is told at the end.
            Err(one) if chosen.len() > 1 => {
                output.warn(one.reason());
                trouble.get_or_insert(one);
                look(session, *id)?.ok()
            }
            Err(one) => return Err(one),
        };
        let before = Some(status.to_string());
        devices.push(StateReport { before, ..report(device, after) });
    }
    if session.is_passing() && arguments.to.is_some() && !arguments.dry_run {
        output.warn("this virtual segment ends with the command, and its states too");
    }
    if let Some(trouble) = trouble {
        if !arguments.json {
            output.text(&text(&devices, arguments, output));
        }
        return Err(trouble);
    }
    let all_answer = devices.iter().all(|device| device.al_state.is_some());
    if arguments.json {
        let (schema, tool) = ("linesman.states/1".to_owned(), version::tool());
        output.json(&Report { schema, tool, devices });
    } else {
        output.text(&text(&devices, arguments, output));
    }
    Ok(all_answer)
}

/// What each is in. That nobody answers at all is no answer.
fn look_at(session: &mut ServiceLine, chosen: &[DeviceId]) -> Result<Vec<Seen>, ServiceError> {
    let (mut all, mut silent) = (Vec::with_capacity(chosen.len()), None);
    for id in chosen {
        all.push(match look(session, *id)? {
            Ok(seen) => Some(seen),
            Err(trouble) => {
                silent.get_or_insert(trouble);
                None
            }
        });
    }
    match silent {
        Some(trouble) if all.iter().all(Option::is_none) => Err(trouble),
        Some(_) | None => Ok(all),
    }
}

fn look(
    session: &mut ServiceLine,
    id: DeviceId,
) -> Result<Result<(AlStatus, AlStatusCode), ServiceError>, Failure> {
    let answer = session.attempt(id, Service::State)?;
    Ok(answer.map(|answer| match answer {
        ServiceAnswer::State { status, code } => (status, code),
        ServiceAnswer::Done | ServiceAnswer::Data(_) | ServiceAnswer::Written { .. } => {
            (AlStatus(0), AlStatusCode(0))
        }
    }))
}

/// Refuses, before anything is written, what cannot be done with all of them.
fn check(
    session: &ServiceLine,
    chosen: &[DeviceId],
    seen: &[Seen],
    to: AlState,
) -> Result<(), Failure> {
    let place = session.place();
    let named = |ids: Vec<DeviceId>| -> Option<String> {
        let names: Vec<String> = ids.into_iter().map(|id| session.label(id)).collect();
        (!names.is_empty()).then(|| names.join(", "))
    };
    let all = || chosen.iter().zip(seen);
    let silent = all().filter(|(_, seen)| seen.is_none()).map(|(id, _)| *id).collect();
    if let Some(names) = named(silent) {
        let reason = format!("{place}: {names}: no answer; nothing was changed");
        let look = session.look_closer();
        let advice = format!("find out why with `{look}`, or name the others one by one");
        return Err(Failure::new(reason, advice));
    }
    let with = |fault: &dyn Fn(&KnownDevice) -> bool| {
        let ids = chosen.iter().copied();
        named(ids.filter(|id| session.known(*id).is_some_and(fault)).collect())
    };
    if to == AlState::Op
        && let Some(names) = with(&|known| known.needs_cycle)
    {
        let reason = format!(
            "{place}: OP: {names}: with outputs it needs somebody who sends them in every cycle, and \
             nobody drives this line; nothing was changed"
        );
        let advice = format!(
            "`linesman run --on {place}` drives all to OP; SAFEOP can be asked for here, and OP for \
             those without outputs"
        );
        return Err(Failure::new(reason, advice));
    }
    if to == AlState::Boot
        && let Some(names) = with(&|known| !known.boot)
    {
        let reason = format!("{place}: BOOT: {names}: no mailbox for it; nothing was changed");
        return Err(Failure::new(reason, "name one that can be updated"));
    }
    Ok(())
}

/// The states that lead there.
fn would_be(status: AlStatus, to: AlState) -> Vec<String> {
    let first = status.state().state();
    // One in a state that does not exist is taken to INIT first.
    let lost = first.is_none().then_some(AlState::Init);
    let from = first.unwrap_or(AlState::Init);
    lost.into_iter().chain(steps(from, to)).map(|state| state.to_string()).collect()
}

fn report(device: DeviceReport, seen: Seen) -> StateReport {
    let error = seen.is_some_and(|(status, _)| status.error());
    let code = seen.map(|(_, code)| code).filter(|_| error);
    StateReport {
        device,
        al_state: seen.map(|(status, _)| status.state().to_string()),
        al_error: error,
        al_code: code.map_or(0, |code| code.0),
        al_code_text: code.map(|code| code.explain().name.to_owned()),
        before: None,
        steps: Vec::new(),
    }
}

fn text(devices: &[StateReport], arguments: &Arguments, output: &Output) -> String {
    let paint = output.paint();
    let mut table = Table::new(&["no", "station", "name", "type", "state"], paint);
    for one in devices {
        let StateReport { device, al_state, al_error, al_code, al_code_text, before, steps } = one;
        let mut state = match (al_state, al_code_text) {
            (None, _) => paint.bad("no answer"),
            (Some(state), Some(text)) => {
                paint.bad(&format!("{state}, error 0x{al_code:04X} {text}"))
            }
            (Some(state), None) if *al_error => paint.bad(&format!("{state}, error")),
            (Some(state), None) => state.clone(),
        };
        if let Some(before) = before.as_ref().filter(|before| Some(*before) != al_state.as_ref()) {
            state = format!("{before} → {state}");
        }
        if arguments.dry_run {
            let steps = steps.iter().map(|step| format!(" → {step}"));
            let words = [state].into_iter().chain(steps).collect::<String>();
            state = if one.steps.is_empty() { format!("{words}: as it is") } else { words };
        }
        table.row([
            device.no.to_string(),
            format!("0x{:04X}", device.station),
            device.name.clone().unwrap_or_default(),
            device.r#type.clone(),
            state,
        ]);
    }
    let mut text = table.render();
    if arguments.dry_run {
        text.push_str("Nothing was changed.\n");
    }
    text
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
