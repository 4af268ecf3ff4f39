//! `linesman id`: the numbers that tell equal SubDevices apart, read in each of three ways, compared with a project, and
//! set where a SubDevice allows that.
//!
//! Source: S0 L1161-1223; ETG.1020, explicit device identification.

mod against;

use std::collections::BTreeMap;
use std::path::PathBuf;

use linesman_config::project::IdentificationWay;
use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_proto::address::DeviceId;
use linesman_proto::register::{self, AlControl, AlStatus};
use linesman_proto::sii::Identification;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use serde::Serialize;

use self::against::{ComparedNumbers, compare};
use super::service::{DeviceReport, ServiceLine};
use super::sii;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files::{self, Planned};
use crate::output::{Output, Table};
use crate::version;

/// So often it is looked whether a SubDevice has loaded its number, and so long between.
const LOOKS: usize = 20;
const LOOK: Span = Span::ms(5);

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Where the line is: eth0, eth0+eth1 (a ring), sim:plant.toml, or the socket of `run --control`
    #[arg(value_name = "WHERE")]
    pub(crate) line: String,
    /// One SubDevice: its number, station address, type or name; all unless said
    #[arg(value_name = "DEVICE")]
    device: Option<String>,
    /// Give it this number: its station alias, 1 to 65535
    #[arg(long, value_name = "N", requires = "device", conflicts_with = "against",
        value_parser = clap::value_parser!(u16).range(1..))]
    set: Option<u16>,
    /// Where the copy of its EEPROM goes that is made before
    #[arg(long, value_name = "FILE", requires = "set")]
    backup: Option<PathBuf>,
    /// Compare with this project
    #[arg(long, value_name = "machine.toml")]
    against: Option<PathBuf>,
    /// JSON, schema linesman.numbers/1; with --set linesman.sii/1, and linesman.refusal/1 when it is refused
    #[arg(long)]
    pub(crate) json: bool,
}

/// The numbers of SubDevices.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.numbers/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// By number.
    devices: Vec<NumbersReport>,
    /// Whether another process drives the line: selectors that have to be asked for are not read then.
    driven: bool,
    /// What differs from the project, each with what to do; `null` without --against.
    differences: Option<Vec<NumberDifference>>,
    /// Numbers of the project that were not compared, each with the reason; empty without --against.
    not_compared: Vec<String>,
}

/// The numbers that a SubDevice tells.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct NumbersReport {
    /// Whose.
    device: DeviceReport,
    /// How its selector is read: `at 0x1000`, `by AL control`; `null`: it has none.
    read: Option<String>,
    /// What the selector tells; `null`: nothing.
    selector: Option<u16>,
    /// Its station alias; `null`: none.
    alias: Option<u16>,
    /// Its serial number; `null`: none.
    serial: Option<u32>,
}

/// A number that is not as planned.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct NumberDifference {
    /// Whose number, what it must be and what it is.
    reason: String,
    /// What to do.
    next_step: String,
}

/// The numbers that a SubDevice tells.
struct ToldNumbers {
    id: DeviceId,
    label: String,
    /// How its selector is read; nothing where its description names none.
    how: Identification,
    selector: Option<u16>,
    alias: u16,
    serial: u32,
    /// Vendor and product code, where they are known.
    product: Option<(u32, u32)>,
}

impl ToldNumbers {
    /// How its selector is read, in words; `None` where it has none.
    fn read(&self) -> Option<String> {
        match self.how {
            Identification::None => None,
            Identification::AlStatus => Some("by AL control".to_owned()),
            Identification::Memory(at) => Some(format!("at 0x{:04X}", at.0)),
        }
    }

    /// The same in words.
    fn tells(&self, way: IdentificationWay) -> String {
        match self.by(way) {
            0 => format!("{} tells none", self.label),
            number => format!("{} tells {number}", self.label),
        }
    }

    /// The number that it tells in one way; 0 is none.
    fn by(&self, way: IdentificationWay) -> u32 {
        match way {
            IdentificationWay::Selector => self.selector.map_or(0, u32::from),
            IdentificationWay::Alias => self.alias.into(),
            IdentificationWay::Serial => self.serial,
        }
    }
}

/// Lists, compares or sets.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let project = match &arguments.against {
        Some(path) => {
            let project = Planned::open(path)?.project;
            project.tree().map_err(|error| files::in_file(path, &error))?;
            Some(project)
        }
        None => None,
    };
    let mut session = ServiceLine::open(&arguments.line)?;
    if let (Some(value), Some(word)) = (arguments.set, &arguments.device) {
        return set(&mut session, word, value, arguments, output);
    }
    let one = arguments.device.as_deref().map(|word| session.device(word)).transpose()?;
    let ids: Vec<DeviceId> = session.devices().iter().map(|device| device.id).collect();
    let mut told = Vec::with_capacity(ids.len());
    for id in ids.into_iter().filter(|id| one.is_none_or(|one| one == *id)) {
        told.push(read(&mut session, id)?);
    }
    let is_driven = session.inventory().is_none();
    let compared = project.as_ref().map(|project| compare(project, &told, one, is_driven));
    if arguments.json {
        output.json(&report(&session, &told, compared.as_ref()));
    } else {
        output.text(&table(&told, is_driven, output));
        if session.inventory().is_none() {
            output.line(
                "Another process drives this line: selectors that have to be asked for are not read.",
            );
        }
    }
    let Some(compared) = compared else {
        if !arguments.json {
            propose(&told, output);
        }
        return Ok(Status::Good);
    };
    for failure in &compared.wrong {
        output.complain(failure);
    }
    if !arguments.json {
        for line in compared.not_compared() {
            output.line(line);
        }
        output.line(&compared.result());
    }
    Ok(compared.status())
}

fn report(
    session: &ServiceLine,
    told: &[ToldNumbers],
    compared: Option<&ComparedNumbers>,
) -> Report {
    let devices = told.iter().map(|one| NumbersReport {
        device: session.report(one.id),
        read: one.read(),
        selector: one.selector,
        alias: Some(one.alias).filter(|alias| *alias != 0),
        serial: Some(one.serial).filter(|serial| *serial != 0),
    });
    let difference = |failure: &Failure| NumberDifference {
        reason: failure.reason.clone(),
        next_step: failure.next_step.clone(),
    };
    Report {
        schema: "linesman.numbers/1".to_owned(),
        tool: version::tool(),
        devices: devices.collect(),
        driven: session.inventory().is_none(),
        differences: compared.map(|all| all.wrong.iter().map(difference).collect()),
        not_compared: compared.map(|all| all.not_compared().cloned().collect()).unwrap_or_default(),
    }
}

/// Reads the number of a SubDevice in each way.
fn read(session: &mut ServiceLine, id: DeviceId) -> Result<ToldNumbers, Failure> {
    let known = session.known(id);
    let identity = known.and_then(|known| known.identity);
    let serial = identity.map_or(0, |identity| identity.serial_number);
    let product = identity.map(|identity| (identity.vendor_id, identity.product_code));
    let how = session.inventory().and_then(|inventory| inventory.devices.get(id.index()));
    let how = how.map_or(Identification::None, |found| found.profile.identification);
    let word = |bytes: Option<Vec<u8>>| -> Option<u16> {
        Some(u16::from_le_bytes(*bytes?.first_chunk()?))
    };
    let selector = match how {
        Identification::None => None,
        Identification::Memory(at) => word(session.try_read(id, at, 2)?),
        Identification::AlStatus => ask(session, id)?,
    };
    let alias = word(session.try_read(id, register::STATION_ALIAS.address, 2)?).unwrap_or(0);
    Ok(ToldNumbers { id, label: session.label(id), how, selector, alias, serial, product })
}

/// Asks for the number by bit 5 of AL control; it stands in 0x0134 while bit 5 of AL status is set (ETG.1020). The state stays
/// as it is.
fn ask(session: &mut ServiceLine, id: DeviceId) -> Result<Option<u16>, Failure> {
    let al = |bytes: Option<Vec<u8>>| -> Option<(AlStatus, u16)> {
        let [low, high, _, _, code_low, code_high] = *bytes?.first_chunk()?;
        Some((AlStatus(u16::from_le_bytes([low, high])), u16::from_le_bytes([code_low, code_high])))
    };
    let at = register::AL_STATUS.address;
    let Some((status, _)) = al(session.try_read(id, at, 6)?) else { return Ok(None) };
    let Some(state) = status.state().state().filter(|_| !status.error()) else { return Ok(None) };
    let write = |session: &mut ServiceLine, request: AlControl| {
        let data = request.to_bytes().to_vec();
        let write = Service::WriteRegister { address: register::AL_CONTROL.address, data };
        session.attempt(id, write).map(|done| matches!(done, Ok(ServiceAnswer::Done)))
    };
    if state == AlState::Boot
        || !write(session, AlControl::request(state).with_identification_request(true))?
    {
        return Ok(None);
    }
    let mut number = None;
    for _ in 0..LOOKS {
        let now = al(session.try_read(id, at, 6)?);
        number = now.filter(|(status, _)| status.identification_loaded() && !status.error());
        if number.is_some() || !session.wait(LOOK)? {
            break;
        }
    }
    write(session, AlControl::request(state))?;
    Ok(number.map(|(_, code)| code))
}

fn table(told: &[ToldNumbers], is_driven: bool, output: &Output) -> String {
    let mut table =
        Table::new(&["no", "SubDevice", "selector", "read", "alias", "serial"], output.paint());
    for one in told {
        let without = if is_driven { "not read" } else { "has none" };
        let how = one.read().unwrap_or_else(|| without.to_owned());
        let number = |value: u32| if value == 0 { "-".to_owned() } else { value.to_string() };
        table.row([
            one.id.no().to_string(),
            one.label.clone(),
            number(one.by(IdentificationWay::Selector)),
            how,
            number(one.alias.into()),
            number(one.serial),
        ]);
    }
    table.render()
}

/// The keys for a project that make these numbers compared, of those that have one; and numbers that several tell.
fn propose(told: &[ToldNumbers], output: &mut Output) {
    let ways = [(IdentificationWay::Selector, "selector"), (IdentificationWay::Alias, "alias")];
    let mut lines = Vec::new();
    for (way, word) in ways {
        let mut tellers: BTreeMap<u32, Vec<&ToldNumbers>> = BTreeMap::new();
        for one in told.iter().filter(|one| one.by(way) != 0) {
            tellers.entry(one.by(way)).or_default().push(one);
        }
        for (number, several) in &tellers {
            if let [one] = several.as_slice() {
                let has_better =
                    way == IdentificationWay::Alias && one.by(IdentificationWay::Selector) != 0;
                if !has_better {
                    lines.push(format!(
                        "{}: identification = {{ by = \"{word}\", value = {number} }}",
                        one.label
                    ));
                }
            } else {
                let names: Vec<&str> = several.iter().map(|one| one.label.as_str()).collect();
                lines.push(format!(
                    "{word} {number} is told by {}: give each a number of its own",
                    names.join(" and ")
                ));
            }
        }
    }
    if !lines.is_empty() {
        output.line("\nFor a project, at each [[device]] or [[group]]:");
        lines.iter().for_each(|line| output.line(&format!("  {line}")));
    }
}

/// Writes the station alias of a SubDevice that has no selector.
fn set(
    session: &mut ServiceLine,
    word: &str,
    value: u16,
    arguments: &Arguments,
    output: &mut Output,
) -> Result<Status, Failure> {
    let id = session.device(word)?;
    let told = read(session, id)?;
    if told.how != Identification::None {
        return Err(Failure::new(
            format!("{}: {} has a selector, which no frame can set", arguments.line, told.label),
            format!(
                "set it at its switches or display; to use its alias all the same: `linesman sii {} {word} alias {value}`",
                arguments.line
            ),
        ));
    }
    let done = sii::set_alias(session, id, value, arguments.backup.as_deref(), output);
    let outcome = done.map(|report| match arguments.json {
        true => output.json(&report),
        false => output.text(&report.text(&session.label(id), output)),
    });
    super::service::end(outcome, arguments.json, output)
}
