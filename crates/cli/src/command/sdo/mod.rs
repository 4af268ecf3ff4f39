//! `linesman sdo`: objects of a SubDevice, read, written, listed, explained.

mod browse;
pub(crate) mod dictionary;
pub(crate) mod report;
mod start_up;
pub(crate) mod value;

use std::path::PathBuf;

use linesman_config::start_up::Transition;
use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::Service;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::information::{ListKind, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectAddress, ObjectIndex};

use super::service::{ServiceError, ServiceLine, ServiceTarget, end};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;
use dictionary::Dictionary;
use report::{ObjectReport, ReadReport};

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) place: ServiceTarget,
    #[command(subcommand)]
    action: Action,
    /// JSON: schema linesman.sdo/1 or linesman.objects/1; linesman.refusal/1 when it is refused
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// Read an entry; without a subindex all entries of the object
    Read {
        /// Index and subindex, hexadecimal: 0x1018:01
        #[arg(value_name = "INDEX[:SUB]", value_parser = address)]
        object: Wanted,
        /// The data type of the value, such as UINT, REAL, STRING or hex; asked for unless said
        #[arg(long = "type", value_name = "TYPE", value_parser = value::data_type)]
        data_type: Option<DataType>,
        /// All entries in one transfer
        #[arg(long)]
        complete: bool,
    },
    /// Write an entry
    Write {
        /// Index and subindex, hexadecimal: 0x8010:01
        #[arg(value_name = "INDEX[:SUB]", value_parser = address)]
        object: Wanted,
        /// The value: 300, 0x12C, -1, true, 2.5, save, or 01 02 FF with --type hex
        #[arg(allow_hyphen_values = true)]
        value: String,
        /// The data type of the value, such as UINT, REAL, STRING or hex; asked for unless said
        #[arg(long = "type", value_name = "TYPE", value_parser = value::data_type)]
        data_type: Option<DataType>,
        /// All entries in one transfer; the value is bytes in hex
        #[arg(long)]
        complete: bool,
        /// Make it a start-up command of this project, too
        #[arg(long, value_name = "PROJECT.toml")]
        start_up: Option<PathBuf>,
        /// Whose start-up command it is in the project; of who has this station address unless said
        #[arg(long = "as", value_name = "NAME", requires = "start_up")]
        name: Option<String>,
        /// When the start-up command is due
        #[arg(long, value_name = "TRANSITION", default_value = "PS", value_parser = transition, requires = "start_up")]
        at: String,
    },
    /// List the objects that the SubDevice has
    List {
        /// Which of its lists
        #[arg(long, value_enum, default_value_t)]
        list: List,
        /// Each entry too, with its rights
        #[arg(long)]
        entries: bool,
        /// Each entry with its value
        #[arg(long)]
        values: bool,
    },
    /// Tell what an object and its entries are
    Info {
        /// Index and subindex, hexadecimal: 0x8010 or 0x8010:01
        #[arg(value_name = "INDEX[:SUB]", value_parser = address)]
        object: Wanted,
    },
}

/// The lists that a SubDevice keeps.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, clap::ValueEnum)]
enum List {
    /// All objects
    #[default]
    All,
    /// What can be mapped into outputs
    Rx,
    /// What can be mapped into inputs
    Tx,
    /// What to keep for a replacement
    Backup,
    /// What is set at start-up
    Settings,
}

impl List {
    const fn kind(self) -> ListKind {
        match self {
            Self::All => ListKind::All,
            Self::Rx => ListKind::RxPdoMappable,
            Self::Tx => ListKind::TxPdoMappable,
            Self::Backup => ListKind::Backup,
            Self::Settings => ListKind::Settings,
        }
    }
}

/// An object, and an entry if one was named.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Wanted {
    index: ObjectIndex,
    subindex: Option<u8>,
}

impl Wanted {
    fn entry(self) -> ObjectAddress {
        ObjectAddress { index: self.index, subindex: self.subindex.unwrap_or(0) }
    }
}

/// `0x1018:01`, `1018:1`, `0x1018`.
fn address(text: &str) -> Result<Wanted, String> {
    let (index, subindex) = match text.split_once(':') {
        Some((index, subindex)) => (index, Some(subindex)),
        None => (text, None),
    };
    let digits = |text: &str| text.trim_start_matches("0x").to_owned();
    let wrong =
        || format!("`{text}`: expected index and subindex in hexadecimal, such as 0x1018:01");
    let index = u16::from_str_radix(&digits(index), 16).map_err(|_| wrong())?;
    let subindex = subindex.map(|sub| u8::from_str_radix(&digits(sub), 16));
    Ok(Wanted { index: ObjectIndex(index), subindex: subindex.transpose().map_err(|_| wrong())? })
}

fn transition(letters: &str) -> Result<String, String> {
    let letters = letters.to_ascii_uppercase();
    match Transition::from_letters(&letters) {
        Some(_) => Ok(letters),
        None => Err("expected two of the letters I, P, S, O, B, such as PS".to_owned()),
    }
}

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let mut session = ServiceLine::open(&arguments.place.line)?;
    let id = session.device(&arguments.place.device)?;
    let opened = session.open_mailbox(id, output);
    let outcome =
        session.with_opened(opened, output, |session, output| act(session, id, arguments, output));
    end(outcome, arguments.json, output)
}

fn act(
    session: &mut ServiceLine,
    id: DeviceId,
    arguments: &Arguments,
    output: &mut Output,
) -> Result<(), ServiceError> {
    let json = arguments.json;
    match &arguments.action {
        Action::Read { object, data_type, complete } => {
            let read = read(session, id, *object, *data_type, *complete)?;
            if json { output.json(&read) } else { output.text(&read.text(output)) }
        }
        Action::Write { object, value, data_type, complete, start_up, name, at } => {
            let (wrote, data) = write(session, id, *object, value, *data_type, *complete)?;
            if session.is_passing() {
                output.warn("this virtual segment ends with the command, and what was written too");
            }
            if json {
                output.json(&wrote)
            } else {
                output.line(&wrote.wrote_text(&session.label(id)))
            }
            if let Some(path) = start_up {
                let command = start_up::Command {
                    transition: at,
                    object: object.entry(),
                    complete: *complete,
                    data: &data,
                    comment: wrote.name().unwrap_or_default(),
                };
                let station = session.report(id).station;
                let whose = start_up::add(path, name.as_deref(), station, &command)?;
                if !json {
                    let path = path.display();
                    output.line(&format!("{path}: a start-up command of {whose}, at {at}."));
                }
            }
        }
        Action::List { list, entries, values } => {
            let depth = match (entries, values) {
                (_, true) => browse::Depth::Values,
                (true, false) => browse::Depth::Entries,
                (false, false) => browse::Depth::Objects,
            };
            let listed = browse::list(session, id, list.kind(), depth)?;
            if json { output.json(&listed) } else { output.text(&listed.text(output)) }
        }
        Action::Info { object } => {
            let listed = browse::info(session, id, object.index, object.subindex)?;
            if json { output.json(&listed) } else { output.text(&listed.text(output)) }
        }
    }
    Ok(())
}

/// Fetches one entry, or all with complete access.
pub(crate) fn upload(
    session: &mut ServiceLine,
    id: DeviceId,
    object: ObjectAddress,
    complete: bool,
) -> Result<Vec<u8>, ServiceError> {
    session.bytes(id, Service::Mailbox(MailboxRequest::Upload { object, complete }))
}

/// Brings one entry, or all with complete access.
pub(crate) fn download(
    session: &mut ServiceLine,
    id: DeviceId,
    object: ObjectAddress,
    complete: bool,
    data: Vec<u8>,
) -> Result<(), ServiceError> {
    session.ask(id, Service::Mailbox(MailboxRequest::Download { object, complete, data })).map(drop)
}

fn read(
    session: &mut ServiceLine,
    id: DeviceId,
    wanted: Wanted,
    data_type: Option<DataType>,
    complete: bool,
) -> Result<ReadReport, ServiceError> {
    let device = session.report(id);
    let mut dictionary = Dictionary::new(session, id);
    let object = wanted.entry();
    if complete {
        let data = upload(dictionary.session, id, object, true)?;
        let object = ObjectReport::of(object, None, data_type, &data);
        return Ok(ReadReport::new(device, true, vec![object]));
    }
    let about = dictionary.object(wanted.index)?;
    // A list of entries is meant as a whole, unless one of them is named.
    let last = match (&about, wanted.subindex) {
        (Some(about), None) if about.object_code != ObjectCode::Variable => {
            let count = upload(dictionary.session, id, object, false)?;
            count.first().copied().unwrap_or(0).min(about.max_subindex)
        }
        _ => object.subindex,
    };
    let mut objects = Vec::new();
    for subindex in object.subindex..=last {
        let object = ObjectAddress { subindex, ..object };
        let entry = dictionary.entry(object)?;
        let data = match upload(dictionary.session, id, object, false) {
            Ok(data) => data,
            // Lists have gaps, and entries that can only be written.
            Err(ServiceError::Refused(refusal))
                if wanted.subindex.is_none() && last > 0 && refusal.abort_code().is_some() =>
            {
                objects.push(ObjectReport::refused(object, entry, &refusal));
                continue;
            }
            Err(trouble) => return Err(trouble),
        };
        objects.push(ObjectReport::of(object, entry, data_type, &data));
    }
    Ok(ReadReport::new(device, false, objects))
}

fn write(
    session: &mut ServiceLine,
    id: DeviceId,
    wanted: Wanted,
    text: &str,
    data_type: Option<DataType>,
    complete: bool,
) -> Result<(ReadReport, Vec<u8>), ServiceError> {
    let (device, object) = (session.report(id), wanted.entry());
    let mut dictionary = Dictionary::new(session, id);
    let wrong = |reason: String| Failure::new(reason, "say its data type with --type");
    let entry = if complete { None } else { dictionary.entry(object)? };
    let told = entry.as_ref().map(|entry| entry.data_type).filter(|told| told.name().is_some());
    let data_type = if complete { Some(DataType::OCTET_STRING) } else { data_type.or(told) };
    let data = match data_type {
        Some(data_type) => value::parse(text, data_type).map_err(wrong)?,
        None => {
            let there = upload(dictionary.session, id, object, false)?;
            value::parse_sized(text, there.len()).map_err(wrong)?
        }
    };
    download(session, id, object, complete, data.clone())?;
    let wrote = ObjectReport::of(object, entry, data_type, &data);
    Ok((ReadReport::wrote(device, complete, wrote), data))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_written_in_hexadecimal() {
        let wanted = |index, subindex| Wanted { index: ObjectIndex(index), subindex };
        assert_eq!(address("0x1018:01"), Ok(wanted(0x1018, Some(1))));
        assert_eq!(address("1c12:1A"), Ok(wanted(0x1C12, Some(0x1A))));
        assert_eq!(address("0x1C12:0x1A"), Ok(wanted(0x1C12, Some(0x1A))));
        assert_eq!(address("0x6000"), Ok(wanted(0x6000, None)));
        for wrong in ["", ":1", "0x10000", "0x1018:100", "0x1018:", "index"] {
            assert!(address(wrong).unwrap_err().contains("0x1018:01"), "{wrong}");
        }
    }
}
