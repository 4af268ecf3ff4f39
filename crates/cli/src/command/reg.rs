//! `linesman reg`: registers of a SubDevice's controller, and the memory behind them.

mod consent;
mod dump;

use linesman_maindevice::service::Service;
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::register::{address_by_name, describe, pieces};
use serde::Serialize;

use super::sdo::value::{bytes, hex, whole};
use super::service::{DeviceReport, ServiceError, ServiceLine, ServiceTarget, end};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table};
use crate::version;

/// The most that one datagram carries.
const MOST: u16 = 1_486;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) place: ServiceTarget,
    #[command(subcommand)]
    action: Action,
    /// JSON, schema linesman.registers/1
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// Read a register, and say what it means
    Read {
        /// Its address (0x0130) or name (al-status)
        #[arg(value_parser = register)]
        address: RegisterAddress,
        /// How many bytes; those of the register unless said
        #[arg(long, value_name = "BYTES", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
        len: Option<u16>,
    },
    /// Read many, word by word: address, hexadecimal, decimal, text, name
    Dump {
        /// From where; a name will do, too
        #[arg(long, default_value = "0x0000", value_parser = register)]
        from: RegisterAddress,
        /// How many bytes
        #[arg(long, value_name = "BYTES", default_value_t = 0x0500, value_parser = clap::value_parser!(u16).range(2..=0x1000))]
        len: u16,
    },
    /// Write a register: at once. What takes a SubDevice off the line, out of its state or away from its
    /// process data is written only with --force
    Write {
        /// Its address (0x0010) or name (configured-station-alias)
        #[arg(value_parser = register)]
        address: RegisterAddress,
        /// A number, for the length of the register: 5, 0x0005; or bytes in hex: "01 02"
        value: String,
        /// How many bytes; those of the register unless said
        #[arg(long, value_name = "BYTES", value_parser = clap::value_parser!(u16).range(1..=8))]
        len: Option<u16>,
        /// Whatever it does to the line
        #[arg(long)]
        force: bool,
    },
}

/// `0x0130`, `130`, `al-status`; of a family also `rx-error-counter-port-b` and `fmmu-2`.
fn register(text: &str) -> Result<RegisterAddress, String> {
    if let Some(address) = address_by_name(text) {
        return Ok(address);
    }
    u16::from_str_radix(text.trim_start_matches("0x"), 16).map(RegisterAddress).map_err(|_| {
        format!("`{text}`: expected an address in hexadecimal (0x0130), or a name (al-status)")
    })
}

/// Registers of a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.registers/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Whose.
    device: DeviceReport,
    /// `read`, `dump` or `write`.
    action: String,
    /// Where the bytes begin.
    address: u16,
    /// The bytes in the order of the line, in hex.
    bytes: String,
    /// What they say, register by register.
    registers: Vec<PieceReport>,
    /// Of a dump: the same word by word.
    words: Vec<dump::Word>,
}

/// Bytes of one register.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct PieceReport {
    /// Where they begin.
    address: u16,
    /// The register; `null` where there is none.
    name: Option<String>,
    /// The bytes in the order of the line, in hex.
    bytes: String,
    /// What they say; `null` where there is no register.
    meaning: Option<String>,
}

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    // A value that cannot be written is refused before anything is sent.
    let data = match &arguments.action {
        Action::Write { address, value, len, force } => {
            let data = value_bytes(*address, value, *len)?;
            if let Some(objection) = consent::objection(*address, &data).filter(|_| !force) {
                return Err(objection);
            }
            Some(data)
        }
        Action::Read { .. } | Action::Dump { .. } => None,
    };
    let mut session = ServiceLine::open(&arguments.place.line)?;
    let id = session.device(&arguments.place.device)?;
    let outcome = act(&mut session, id, arguments, data, output);
    end(outcome, arguments.json, output)
}

fn act(
    session: &mut ServiceLine,
    id: DeviceId,
    arguments: &Arguments,
    data: Option<Vec<u8>>,
    output: &mut Output,
) -> Result<(), ServiceError> {
    let (action, address, data) = match (&arguments.action, data) {
        (Action::Read { address, len }, _) => {
            let len = len.unwrap_or_else(|| rest_of_register(*address));
            let address = *address;
            ("read", address, session.bytes(id, Service::ReadRegister { address, len })?)
        }
        (Action::Dump { from, len }, _) => {
            let mut data = Vec::new();
            while data.len() < usize::from(*len) {
                let address = RegisterAddress(from.0.saturating_add(data.len() as u16));
                let len = (*len - data.len() as u16).min(MOST / 2 * 2);
                let part = session.bytes(id, Service::ReadRegister { address, len })?;
                if part.is_empty() {
                    break;
                }
                data.extend(part);
            }
            if !arguments.json {
                output.line(&format!("{}:", session.label(id)));
                output.text(&dump::text(&dump::words(*from, &data), output));
                return Ok(());
            }
            ("dump", *from, data)
        }
        (Action::Write { address, .. }, data) => {
            let (address, data) = (*address, data.unwrap_or_default());
            session.ask(id, Service::WriteRegister { address, data: data.clone() })?;
            if session.is_passing() {
                output.warn("this virtual segment ends with the command, and what was written too");
            }
            ("write", address, data)
        }
    };
    let registers = pieces(address, &data)
        .map(|piece| PieceReport {
            address: piece.address.0,
            name: piece.description.map(|found| found.title()),
            bytes: hex(piece.data),
            meaning: piece.summary(),
        })
        .collect();
    let report = Report {
        schema: "linesman.registers/1".to_owned(),
        tool: version::tool(),
        device: session.report(id),
        action: action.to_owned(),
        address: address.0,
        bytes: hex(&data),
        registers,
        words: if action == "dump" { dump::words(address, &data) } else { Vec::new() },
    };
    if arguments.json {
        output.json(&report);
    } else {
        output.text(&text(&report, &session.label(id), output));
    }
    Ok(())
}

/// Bytes from an address to the end of its register; 2 where there is none.
fn rest_of_register(address: RegisterAddress) -> u16 {
    describe(address).map_or(2, |found| found.register.len - found.offset).min(MOST)
}

fn value_bytes(address: RegisterAddress, text: &str, len: Option<u16>) -> Result<Vec<u8>, Failure> {
    let wrong = |reason: String| {
        Failure::new(
            reason,
            "give a number, or bytes in hex with spaces between; --len sets the length",
        )
    };
    if text.contains(' ') {
        let data = bytes(text).ok_or_else(|| wrong(format!("`{text}`: no bytes in hex")))?;
        return match usize::from(MOST) >= data.len() && !data.is_empty() {
            true => Ok(data),
            false => Err(wrong(format!("`{text}`: 1 to {MOST} bytes"))),
        };
    }
    let len = usize::from(len.unwrap_or_else(|| rest_of_register(address)));
    let number = whole(text).ok_or_else(|| wrong(format!("`{text}`: no number")))?;
    if len > 8 || number < 0 || number >> (8 * len.min(8)) != 0 {
        return Err(wrong(format!("`{text}`: does not fit into the {len} bytes at {address}")));
    }
    Ok(number.to_le_bytes()[..len].to_vec())
}

fn text(report: &Report, label: &str, output: &Output) -> String {
    let mut table = Table::new(&["address", "register", "bytes", "meaning"], output.paint());
    for piece in &report.registers {
        table.row([
            format!("0x{:04X}", piece.address),
            piece.name.clone().unwrap_or_default(),
            piece.bytes.clone(),
            piece.meaning.clone().unwrap_or_default(),
        ]);
    }
    let done = if report.action == "write" { "written" } else { "read" };
    format!("{label}, {done}:\n{}", table.render())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_have_addresses_and_names() {
        assert_eq!(register("0x0130"), Ok(RegisterAddress(0x0130)));
        assert_eq!(register("130"), Ok(RegisterAddress(0x0130)));
        assert_eq!(register("al-status"), Ok(RegisterAddress(0x0130)));
        assert!(register("al-state").unwrap_err().contains("0x0130"));
    }

    #[test]
    fn a_number_gets_the_length_of_its_register() {
        let at = RegisterAddress(0x0010);
        assert_eq!(value_bytes(at, "0x1001", None).unwrap(), [0x01, 0x10]);
        assert_eq!(value_bytes(at, "01 02 03", None).unwrap(), [1, 2, 3]);
        assert_eq!(value_bytes(at, "1", Some(1)).unwrap(), [1]);
        for wrong in ["65536", "-1", "x", "0x", "01 2"] {
            assert!(value_bytes(at, wrong, None).is_err(), "{wrong}");
        }
    }
}
