//! `linesman fault`: break and heal a virtual segment while it runs on real interfaces.

use std::path::PathBuf;

use linesman_config::fault::FaultName;
use linesman_runtime::control::{Answer, FaultState, Request, ask};
use linesman_sim::segment_file::FaultEntry;

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
    /// JSON, schema linesman.faults/1
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
        /// How long it lasts; until it is healed unless said
        #[arg(long, value_name = "MS")]
        for_ms: Option<f64>,
        /// Parameters of its kind, such as hits_per_s=40, and its schedule: every_ms=500 for_ms=20
        #[arg(value_name = "KEY=VALUE", value_parser = parameter)]
        parameters: Vec<(String, toml::Value)>,
    },
    /// End a fault, or all of them
    Heal {
        /// Its number, as `list` tells; all unless said
        no: Option<u32>,
    },
    /// Tell which faults there are and were
    List,
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
    let request = request(&arguments.action)?;
    let path = arguments.socket.display();
    let answer = ask(&arguments.socket, &request).map_err(|error| {
        let advice = "start the segment with `linesman sim SEGMENT.toml --on NIC --control SOCKET`, \
                      and name the same socket";
        Failure::new(format!("{path}: asking the segment: {error}"), advice)
    })?;
    if let Some(error) = &answer.error {
        return Err(Failure::new(format!("{path}: {error}"), "see `linesman fault --help`"));
    }
    if arguments.json {
        output.json(&answer);
    } else {
        let text = table(&answer, output);
        output.text(&text);
    }
    Ok(Status::Good)
}

fn request(action: &Action) -> Result<Request, Failure> {
    Ok(match action {
        Action::Inject { kind, at, device, for_ms, parameters } => {
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
            let fault = entry.try_into::<FaultEntry>().map_err(|error| {
                let advice = "see docs/guide/faults.md for what each fault takes";
                Failure::new(format!("{kind}: {}", error.message()), advice)
            })?;
            Request::Inject { fault, for_ms: *for_ms }
        }
        Action::Heal { no } => Request::Heal { no: *no },
        Action::List => Request::List,
    })
}

fn table(answer: &Answer, output: &Output) -> String {
    if answer.faults.is_empty() {
        return "No faults so far.\n".to_owned();
    }
    let headings = ["no", "fault", "at", "began", "ended", "spoiled", "lost"];
    let mut table = Table::new(&headings, output.paint());
    let at = |instant: Option<u64>| instant.map_or_else(|| "-".to_owned(), time);
    for FaultState { no, name, places, began_ns, ended_ns, frames_spoiled, frames_lost } in
        &answer.faults
    {
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
        let action = Action::Inject {
            kind: FaultName::EmcNoise,
            at: vec!["K1.C-K2.A".to_owned()],
            device: Vec::new(),
            for_ms: None,
            parameters: parameters.iter().map(|text| parameter(text).unwrap()).collect(),
        };
        let Ok(Request::Inject { fault, .. }) = request(&action) else { panic!("no request") };
        assert_eq!(fault.schedule.at_ms.unwrap().as_slice(), [0.0, 500.0]);
        assert_eq!(fault.schedule.for_ms, Some(20.0));
        let keys: Vec<&String> = fault.parameters.keys().collect();
        assert_eq!(keys, ["hits_per_s"]);
    }
}
