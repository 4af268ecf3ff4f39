//! `linesman fault`: break and heal a virtual segment while it runs on real interfaces, drive its
//! inputs, and tell what really happened.

use std::path::PathBuf;

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;
use linesman_runtime::control::message::{
    FaultState, Faults, Request, SignalDirection, SignalState, SignalTable,
};
use linesman_runtime::control::{ask, listen};
use linesman_runtime::serve::report::Status as SimStatus;
use linesman_runtime::truth_writer::{EventKind, TruthEvent};
use linesman_sim::segment_file::FaultEntry;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::sim::summary;
use crate::amount::{LONGEST, MILLISECOND, duration};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table};
use crate::text::quantity::time;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// The socket that `linesman sim … --control SOCKET` opened
    socket: PathBuf,
    #[command(subcommand)]
    action: Action,
    /// JSON: schema linesman.faults/1, linesman.sim/1, linesman.signals/1 or linesman.truth/1
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// Put a fault on the line
    Inject {
        /// A fault name, such as link-open
        kind: FaultName,
        /// A link K1.C-B3.A, or one direction of it K1.C>B3.A; more than one for a shared cause
        #[arg(long, value_name = "PLACE")]
        at: Vec<String>,
        /// A device, by name; more than one for a shared cause
        #[arg(long, value_name = "NAME")]
        device: Vec<String>,
        /// How long it lasts (500, 2s); until it is healed unless said
        #[arg(long, visible_alias = "for", value_name = "MS", value_parser = duration(MILLISECOND, Span::ns(1), LONGEST))]
        for_ms: Option<Span>,
        /// Parameters of its kind, such as hits_per_s=40, and its schedule: every_ms=500 for_ms=20
        #[arg(value_name = "KEY=VALUE", value_parser = parameter)]
        parameters: Vec<(String, toml::Value)>,
    },
    /// End a fault, or all of them
    Heal {
        /// Its number, as `list` tells; all unless said
        no: Option<u32>,
    },
    /// Pull the cable of a device, or those of a hot connect group, with all that hangs behind
    Unplug {
        /// A device by name, or a group of the segment file
        #[arg(value_name = "DEVICE|GROUP")]
        name: String,
    },
    /// Plug it in again
    Plug {
        /// A device by name, or a group of the segment file
        #[arg(value_name = "DEVICE|GROUP")]
        name: String,
        /// A free port, such as K1.C; where it was unless said
        #[arg(long, value_name = "NAME.PORT")]
        on: Option<String>,
    },
    /// Tell which faults there are and were
    List,
    /// Tell what went over the interfaces, and whether this host kept up
    Status,
    /// Tell what really happened: each fault and each of its effects
    Events {
        /// Go on with what happens from now on, until the segment ends or Ctrl-C
        #[arg(long)]
        follow: bool,
    },
    /// Tell the inputs and outputs of all devices
    Signals,
    /// Hold an input at a value, whatever it is wired to
    Set {
        /// Device and channel from 1, such as I1.3
        input: String,
        /// true, false or a number; for an analogue input digits of the nominal range, which ends
        /// at 32767
        #[arg(value_parser = level, allow_negative_numbers = true)]
        value: i32,
    },
    /// Give an input back to what it is wired to, or all of them
    Release {
        /// Device and channel; all unless said
        input: Option<String>,
    },
}

/// `true`, `off`, `0x7FFF`, `-12`.
fn level(text: &str) -> Result<i32, String> {
    let number = match text.to_ascii_lowercase().as_str() {
        "true" | "on" | "high" => Some(1),
        "false" | "off" | "low" => Some(0),
        lower => match lower.strip_prefix("0x") {
            Some(digits) => i32::from_str_radix(digits, 16).ok(),
            None => lower.parse().ok(),
        },
    };
    number.ok_or_else(|| format!("`{text}`: expected true, false or a whole number"))
}

/// `hits_per_s=40`, `to=SAFEOP`, `code=0x001D`, `at_ms=[0,500]`.
fn parameter(text: &str) -> Result<(String, toml::Value), String> {
    let (key, value) =
        text.split_once('=').ok_or_else(|| format!("`{text}`: expected KEY=VALUE"))?;
    let as_toml = toml::from_str::<toml::Table>(&format!("value = {value}"));
    let value = match as_toml.ok().and_then(|mut table| table.remove("value")) {
        Some(value) => value,
        None => toml::Value::String(value.to_owned()),
    };
    Ok((key.to_owned(), value))
}

/// Asks the segment and tells what it says.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    match &arguments.action {
        Action::Inject { kind, at, device, for_ms, parameters } => {
            let fault = Box::new(entry(*kind, at, device, parameters)?);
            let for_ms = for_ms.map(|lasts| lasts.as_nanos() as f64 / 1e6);
            faults(arguments, &Request::Inject { fault, for_ms }, output)
        }
        Action::Heal { no } => faults(arguments, &Request::Heal { no: *no }, output),
        Action::Unplug { name } => {
            faults(arguments, &Request::Unplug { name: name.clone() }, output)
        }
        Action::Plug { name, on } => {
            let request = Request::Plug { name: name.clone(), on: on.clone() };
            faults(arguments, &request, output)
        }
        Action::List => faults(arguments, &Request::List, output),
        Action::Status => {
            let status: SimStatus = asked(arguments, &Request::Status)?;
            tell(arguments, &status, status.error.as_deref(), output, |_| summary(&status))
        }
        Action::Events { follow } => events(arguments, *follow, output),
        Action::Signals => signals(arguments, &Request::Signals, output),
        Action::Set { input, value } => {
            let request = Request::Set { input: input.clone(), value: *value };
            signals(arguments, &request, output)
        }
        Action::Release { input } => {
            signals(arguments, &Request::Release { input: input.clone() }, output)
        }
    }
}

fn entry(
    kind: FaultName,
    at: &[String],
    device: &[String],
    parameters: &[(String, toml::Value)],
) -> Result<FaultEntry, Failure> {
    let mut entry = toml::Table::new();
    entry.insert("kind".to_owned(), kind.name().into());
    let mut places = |one: &str, many: &str, names: &[String]| match names {
        [] => None,
        [name] => entry.insert(one.to_owned(), name.as_str().into()),
        more => entry.insert(many.to_owned(), more.to_vec().into()),
    };
    places("at", "at", at);
    places("device", "devices", device);
    entry.extend(parameters.iter().cloned());
    entry.try_into::<FaultEntry>().map_err(|error| {
        let advice = "see docs/guide/faults.md for what each fault takes";
        Failure::new(format!("{kind}: {}", error.message()), advice)
    })
}

fn asked<T: DeserializeOwned>(arguments: &Arguments, request: &Request) -> Result<T, Failure> {
    ask(&arguments.socket, request).map_err(|error| unreachable(arguments, &error))
}

fn unreachable(arguments: &Arguments, error: &std::io::Error) -> Failure {
    let path = arguments.socket.display();
    let advice =
        format!("start the segment with `linesman sim SEGMENT.toml --on NIC --control {path}`");
    Failure::new(format!("{path}: asking the segment: {error}"), advice)
}

/// Tells an answer as JSON or as `text`, or why it was refused.
fn tell<T: Serialize>(
    arguments: &Arguments,
    answer: &T,
    error: Option<&str>,
    output: &mut Output,
    text: impl FnOnce(&Output) -> String,
) -> Result<Status, Failure> {
    if let Some(error) = error {
        let path = arguments.socket.display();
        return Err(Failure::new(format!("{path}: {error}"), "see `linesman fault --help`"));
    }
    if arguments.json {
        output.json(answer);
    } else {
        let text = text(output);
        output.text(&text);
    }
    Ok(Status::Good)
}

fn faults(
    arguments: &Arguments,
    request: &Request,
    output: &mut Output,
) -> Result<Status, Failure> {
    let answer: Faults = asked(arguments, request)?;
    let text = |output: &Output| fault_table(&answer.faults, output);
    tell(arguments, &answer, answer.error.as_deref(), output, text)
}

fn fault_table(faults: &[FaultState], output: &Output) -> String {
    if faults.is_empty() {
        return "No faults so far.\n".to_owned();
    }
    let headings = ["no", "fault", "at", "began", "ended", "spoiled", "lost"];
    let mut table = Table::new(&headings, output.paint());
    let at = |instant: Option<u64>| instant.map_or_else(|| "-".to_owned(), time);
    for FaultState { no, name, places, began_ns, ended_ns, frames_spoiled, frames_lost } in faults {
        table.row([
            no.to_string(),
            name.to_string(),
            places.join(", "),
            at(*began_ns),
            at(*ended_ns),
            frames_spoiled.to_string(),
            frames_lost.to_string(),
        ]);
    }
    table.render()
}

fn signals(
    arguments: &Arguments,
    request: &Request,
    output: &mut Output,
) -> Result<Status, Failure> {
    let answer: SignalTable = asked(arguments, request)?;
    let text = |output: &Output| signal_table(&answer.signals, output);
    tell(arguments, &answer, answer.error.as_deref(), output, text)
}

fn signal_table(signals: &[SignalState], output: &Output) -> String {
    if signals.is_empty() {
        return "No device of this segment has inputs or outputs.\n".to_owned();
    }
    let mut table = Table::new(&["signal", "direction", "value", "from"], output.paint());
    for SignalState { name, direction, value, wired_to, held } in signals {
        let direction = match direction {
            SignalDirection::Input => "input",
            SignalDirection::Output => "output",
        };
        let from = match (held, wired_to) {
            (true, _) => "held".to_owned(),
            (false, Some(output)) => output.clone(),
            (false, None) => String::new(),
        };
        let value = value.map_or_else(|| "open".to_owned(), |value| value.to_string());
        table.row([name.clone(), direction.to_owned(), value, from]);
    }
    table.render()
}

/// What happened, a line each, as it comes.
fn events(arguments: &Arguments, follow: bool, output: &mut Output) -> Result<Status, Failure> {
    let path = &arguments.socket;
    let lines = listen(path, follow).map_err(|error| unreachable(arguments, &error))?;
    for line in lines {
        let line = line.map_err(|error| unreachable(arguments, &error))?;
        if arguments.json {
            output.line(&line);
        } else {
            let event: TruthEvent = serde_json::from_str(&line)
                .map_err(|error| unreachable(arguments, &error.into()))?;
            output.line(&event_line(&event));
        }
        if output.is_closed() {
            break;
        }
    }
    Ok(Status::Good)
}

fn event_line(event: &TruthEvent) -> String {
    let TruthEvent { time_ns, event, fault, name, places, effect, .. } = event;
    let who = match (fault, name) {
        (Some(no), Some(name)) => format!("fault {no} {name}"),
        (Some(no), None) => format!("fault {no}"),
        (None, _) => "no fault".to_owned(),
    };
    let what = match (event, effect) {
        (EventKind::Begin, _) => "begins".to_owned(),
        (EventKind::End, _) => "ends".to_owned(),
        (EventKind::Effect, Some(effect)) => effect.text.clone(),
        (EventKind::Effect, None) => "has an effect".to_owned(),
    };
    format!("{:>12}  {who}: {what} at {}", time(*time_ns), places.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_numbers_where_they_can_be() {
        let rows = [
            ("hits=10", toml::Value::Integer(10)),
            ("hits_per_s=2.5", toml::Value::Float(2.5)),
            ("code=0x001D", toml::Value::Integer(0x1D)),
            ("to=SAFEOP", toml::Value::String("SAFEOP".to_owned())),
            ("quiet=true", toml::Value::Boolean(true)),
        ];
        for (text, expected) in rows {
            let (key, _) = text.split_once('=').unwrap();
            assert_eq!(parameter(text), Ok((key.to_owned(), expected)), "{text}");
        }
        assert!(parameter("hits").is_err());
    }

    #[test]
    fn a_schedule_is_taken_with_the_parameters() {
        let parameters = ["hits_per_s=40", "at_ms=[0, 500]", "for_ms=20"];
        let parameters: Vec<_> = parameters.iter().map(|text| parameter(text).unwrap()).collect();
        let places = ["K1.C-K2.A".to_owned()];
        let fault = entry(FaultName::EmcNoise, &places, &[], &parameters).unwrap();
        assert_eq!(fault.schedule.at_ms.unwrap().as_slice(), [0.0, 500.0]);
        assert_eq!(fault.schedule.for_ms, Some(20.0));
        let keys: Vec<&String> = fault.parameters.keys().collect();
        assert_eq!(keys, ["hits_per_s"]);
    }

    #[test]
    fn levels_are_words_or_numbers() {
        let rows = [("true", 1), ("OFF", 0), ("-12", -12), ("0x7FFF", 0x7FFF), ("1", 1)];
        for (text, expected) in rows {
            assert_eq!(level(text), Ok(expected), "{text}");
        }
        for wrong in ["", "yes?", "1.5", "0x", "99999999999"] {
            assert!(level(wrong).is_err(), "{wrong}");
        }
    }
}
