//! `linesman soe`: identification numbers (IDN) of a drive, through its mailbox.

mod execute;
mod idn;
pub(crate) mod report;
mod value;

use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::soe::{
    self, ALL_COMMANDS, ALL_NUMBERS, ATTRIBUTE, CommandState, DATA_STATE, Idn, VALUE, VariableData,
    elements_in_words, numbers_of_list,
};
use linesman_proto::time::Span;

use super::sdo::value::{bytes, hex};
use super::service::{ServiceError, ServiceLine, ServiceTarget, end};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;
use idn::DriveClient;
use report::{IdnReport, Report};

/// Drive, action and form of the answer.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) place: ServiceTarget,
    #[command(subcommand)]
    action: Action,
    /// Drive of the SubDevice
    #[arg(long, global = true, value_name = "N", default_value = "0",
        value_parser = clap::value_parser!(u8).range(0..8))]
    drive: u8,
    /// JSON, schema linesman.soe/1; linesman.refusal/1 when it is refused
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// All IDNs of the drive (S-0-0017) with their names
    List {
        /// Values, units, limits and where they can be written, too: six requests for each IDN
        #[arg(long)]
        all: bool,
    },
    /// Read an IDN: its value with name, unit, limits and attribute
    Read {
        /// The IDN: S-0-0036, P-0-0150
        #[arg(value_parser = number)]
        idn: Idn,
        /// This element alone
        #[arg(long, value_enum)]
        element: Option<IdnElement>,
        /// The bytes in the order of the line, without asking for the attribute
        #[arg(long)]
        raw: bool,
    },
    /// Write the value of an IDN; the attribute says what it is
    Write {
        /// The IDN: S-0-0091, P-0-0150
        #[arg(value_parser = number)]
        idn: Idn,
        /// The value: 300, -1, 50.5 with decimal places, 0xC000, S-0-0051, a text, "1, 2, 3" for a list
        #[arg(allow_hyphen_values = true)]
        value: String,
        /// The value is bytes in the order of the line: 01 02 FF, or 0102FF
        #[arg(long)]
        raw: bool,
    },
    /// Execute a procedure command: set it, wait for its end, take it back
    Execute {
        /// The IDN of the command: S-0-0099
        #[arg(value_parser = number)]
        idn: Idn,
        /// Time in which it is to come to its end, in seconds
        #[arg(long, value_name = "SECONDS", default_value = "10",
            value_parser = clap::value_parser!(u32).range(1..=3600))]
        within: u32,
    },
}

/// An element of an IDN.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
enum IdnElement {
    /// The value
    Value,
    /// The name
    Name,
    /// Length, format and write protection
    Attribute,
    /// The unit
    Unit,
    /// The least value
    Min,
    /// The greatest value
    Max,
    /// State of a procedure command
    DataState,
    /// The default, of drives that have it
    Default,
}

impl IdnElement {
    const fn bit(self) -> u8 {
        match self {
            Self::Value => VALUE,
            Self::Name => soe::NAME,
            Self::Attribute => ATTRIBUTE,
            Self::Unit => soe::UNIT,
            Self::Min => soe::MINIMUM,
            Self::Max => soe::MAXIMUM,
            Self::DataState => DATA_STATE,
            Self::Default => soe::DEFAULT,
        }
    }
}

fn number(text: &str) -> Result<Idn, String> {
    Idn::from_text(text)
        .ok_or_else(|| format!("`{text}`: expected an IDN such as S-0-0036 or P-0-0150"))
}

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    // What stands in the way here is told before anything is sent.
    if let Action::Write { value, raw: true, .. } = &arguments.action {
        raw_bytes(value)?;
    }
    let mut session = ServiceLine::open(&arguments.place.line)?;
    let id = session.device(&arguments.place.device)?;
    let opened = session.open_mailbox(id, output);
    let outcome =
        session.with_opened(opened, output, |session, output| act(session, id, arguments, output));
    match outcome {
        Ok(status) => Ok(status),
        Err(trouble) => end(Err(trouble), arguments.json, output),
    }
}

fn raw_bytes(text: &str) -> Result<Vec<u8>, Failure> {
    bytes(text).filter(|data| !data.is_empty()).ok_or_else(|| {
        let reason = format!("`{text}` is no row of bytes: expected one at least");
        Failure::new(reason, "write pairs of hexadecimal digits in the order of the line: 01 02 FF")
    })
}

fn act(
    session: &mut ServiceLine,
    id: DeviceId,
    arguments: &Arguments,
    output: &mut Output,
) -> Result<Status, ServiceError> {
    let drive = arguments.drive;
    let device = session.report(id);
    let mut client = DriveClient { session, id, drive };
    let (report, text, status) = match &arguments.action {
        Action::List { all } => {
            let (idns, commands) = list(&mut client, *all)?;
            let report = Report::new(device, "list", drive, idns);
            let text = report.table(*all, &commands, output);
            (report, text, Status::Good)
        }
        Action::Read { idn, element: None, raw: false } => {
            let read = client.whole(*idn)?;
            let text = format!("{}: {}", client.label(), read.lines());
            (Report::new(device, "read", drive, vec![read]), text, Status::Good)
        }
        Action::Read { idn, element, raw } => {
            let element = element.unwrap_or(IdnElement::Value);
            let read = one_element(&mut client, *idn, element, *raw)?;
            let text = format!("{}: {idn} {}: {}", client.label(), read.element, read.text);
            (Report::new(device, "read", drive, vec![read]), text, Status::Good)
        }
        Action::Write { idn, value, raw } => {
            let wrote = write(&mut client, *idn, value, *raw)?;
            let text = format!("{}: written {idn} = {}", client.label(), wrote.text);
            (Report::new(device, "write", drive, vec![wrote]), text, Status::Good)
        }
        Action::Execute { idn, within } => {
            let within = Span::s(u64::from(*within));
            let (command, end) = execute::execute(&mut client, *idn, within, output)?;
            let label = client.label();
            let text = format!("{label}: {}: {}", command.title(), end.progress.text());
            let report = Report::new(device, "execute", drive, vec![command]).with(end.progress);
            if let Some(failure) = end.failure(&text, *idn, within) {
                if arguments.json {
                    output.json(&report);
                }
                output.complain(&failure);
                return Ok(Status::Findings);
            }
            (report, text, Status::Good)
        }
    };
    match arguments.json {
        true => output.json(&report),
        false => output.line(text.trim_end()),
    }
    Ok(status)
}

/// The IDNs of the drive, and which of them are procedure commands.
fn list(
    client: &mut DriveClient<'_>,
    all: bool,
) -> Result<(Vec<IdnReport>, Vec<Idn>), ServiceError> {
    let list = client.element(ALL_NUMBERS, VALUE)?;
    let numbers = numbers_of_list(&list).ok_or_else(|| {
        let reason = format!(
            "{}: the list of all IDNs ({ALL_NUMBERS}) ends before the length that it says: {} bytes",
            client.label(),
            list.len()
        );
        Failure::new(reason, "read single IDNs, and ask the maker of the drive")
    })?;
    let commands = client.optional(ALL_COMMANDS, VALUE)?;
    let commands = commands.ok().and_then(|list| numbers_of_list(&list)).unwrap_or_default();
    let mut idns = Vec::with_capacity(numbers.len());
    for idn in numbers {
        idns.push(if all { client.as_far_as_told(idn)? } else { client.named(idn)? });
    }
    Ok((idns, commands))
}

/// One element by itself.
fn one_element(
    client: &mut DriveClient<'_>,
    idn: Idn,
    element: IdnElement,
    raw: bool,
) -> Result<IdnReport, ServiceError> {
    let data = client.element(idn, element.bit())?;
    let mut report = IdnReport::new(idn);
    report.element = elements_in_words(element.bit());
    report.holds(&data, None);
    if raw {
        return Ok(report);
    }
    match element {
        IdnElement::Value | IdnElement::Min | IdnElement::Max | IdnElement::Default => {
            let attribute = client.attribute(idn)?;
            report.holds(&data, attribute);
            report.attribute = attribute.map(Into::into);
        }
        IdnElement::Name | IdnElement::Unit => match VariableData::parse(&data) {
            Some(text) => (report.text, report.value) = value::text(text.bytes),
            None => {
                report.text = format!("{} (it ends before the length that it says)", hex(&data))
            }
        },
        IdnElement::Attribute => {
            let attribute = soe::SoeAttribute::parse(&data);
            report.attribute = attribute.map(Into::into);
            if let Some(attribute) = &report.attribute {
                report.text = attribute.text();
            }
        }
        IdnElement::DataState => {
            let is_command = client.attribute(idn)?.is_some_and(soe::SoeAttribute::is_command);
            if let Some(state) = CommandState::parse(&data) {
                report.value = state.0.into();
                let told =
                    if is_command { state.progress().text() } else { "no procedure command" };
                report.text = format!("0x{:04X}: {told}", state.0);
            }
        }
    }
    Ok(report)
}

fn write(
    client: &mut DriveClient<'_>,
    idn: Idn,
    text: &str,
    raw: bool,
) -> Result<IdnReport, ServiceError> {
    let mut report = IdnReport::new(idn);
    if raw {
        let data = raw_bytes(text)?;
        client.write(idn, data.clone())?;
        report.holds(&data, None);
        return Ok(report);
    }
    let data = client.element(idn, ATTRIBUTE)?;
    let label = client.label();
    let attribute = soe::SoeAttribute::parse(&data).ok_or_else(|| {
        let reason =
            format!("{label}: the attribute of {idn} has {} bytes instead of 4", data.len());
        Failure::new(reason, "give the bytes of the value with --raw")
    })?;
    if attribute.is_command() {
        let reason = format!("{label}: {idn} is a procedure command");
        let next_step = format!("execute it: {}", client.command(&format!("execute {idn}")));
        return Err(Failure::new(reason, next_step).into());
    }
    let data = value::parse(text, attribute).map_err(|reason| {
        let reason = format!("{label}: {idn}: {reason}");
        let length = attribute.length();
        let next_step =
            format!("write a value of its attribute: {length}, {}", attribute.format().name());
        Failure::new(reason, next_step)
    })?;
    client.write(idn, data.clone())?;
    report.holds(&data, Some(attribute));
    report.attribute = Some(attribute.into());
    Ok(report)
}
