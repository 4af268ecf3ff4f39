//! `linesman aoe`: a SubDevice asked by ADS, through its mailbox.

use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::Service;
use linesman_proto::address::DeviceId;
use linesman_proto::ads::{AdsAnswer, AdsCode, AdsCommand, AdsRequest, AmsNetId, index};
use serde::Serialize;

use super::sdo::value::{bytes, number, whole};
use super::service::{DeviceReport, ServiceError, ServiceLine, ServiceTarget, end};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;
use crate::version;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) place: ServiceTarget,
    #[command(subcommand)]
    action: Action,
    /// The SubDevice's NetId; unless said, that of the plan of a running MainDevice, else 127.0.0.1 and
    /// the two bytes of its station address
    #[arg(long, global = true, value_name = "NETID")]
    net_id: Option<AmsNetId>,
    /// The AMS port: 65535 is the SubDevice itself; IO-Link masters number their ports from 0x1000
    /// or 0x1001
    #[arg(long, global = true, value_name = "PORT", value_parser = port, default_value = "65535")]
    port: u16,
    /// JSON, schema linesman.ads/1; linesman.refusal/1 when it is refused
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// Name and version
    Info,
    /// State, as ADS numbers it, and the SubDevice's own
    State,
    /// Read bytes; objects are in index group 0xF302, at offset index * 65536 + subindex
    Read {
        /// Index group: 0xF302
        #[arg(value_parser = number)]
        group: u32,
        /// Index offset: 0x10180001
        #[arg(value_parser = number)]
        offset: u32,
        /// The most bytes that are to come
        #[arg(value_parser = number, default_value = "1024")]
        len: u32,
    },
    /// Write bytes
    Write {
        /// Index group: 0xF302
        #[arg(value_parser = number)]
        group: u32,
        /// Index offset: 0x80100001
        #[arg(value_parser = number)]
        offset: u32,
        /// The bytes in the order of the line: 01 02 FF, or 0102FF
        data: String,
    },
    /// Write bytes, and read others in one go
    ReadWrite {
        /// Index group: 0xF302
        #[arg(value_parser = number)]
        group: u32,
        /// Index offset: 0x80100001
        #[arg(value_parser = number)]
        offset: u32,
        /// The bytes that are written, in the order of the line: 01 02 FF, or 0102FF
        data: String,
        /// The most bytes that are to come
        #[arg(value_parser = number, default_value = "1024")]
        len: u32,
    },
    /// Give it the NetId that it is to have; it forgets it in INIT
    SetNetId {
        /// Six numbers with points between them: 192.168.1.5.3.1
        new: AmsNetId,
    },
}

fn port(text: &str) -> Result<u16, String> {
    let number = whole(text).and_then(|number| u16::try_from(number).ok());
    number.ok_or_else(|| format!("`{text}`: expected a number up to 0xFFFF"))
}

/// An answer by ADS.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.ads/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Who answers.
    device: DeviceReport,
    /// What was asked: `read device info`, `read state`, `read`, `write`, `read and write`.
    command: String,
    /// The AMS port that was asked.
    port: u16,
    /// The bytes that were read, hexadecimal; `null` where none are.
    data: Option<String>,
    /// What it says of itself; `null` unless that was asked.
    info: Option<AdsDeviceInfo>,
    /// State of ADS (5: RUN) and of the SubDevice; `null` unless that was asked.
    state: Option<[u16; 2]>,
}

/// Name and version.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct AdsDeviceInfo {
    /// The name.
    name: String,
    /// The version: `1.0.3`.
    version: String,
}

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    // What stands in the way here is told before anything is sent.
    let (command, data) = asked(&arguments.action)?;
    let mut session = ServiceLine::open(&arguments.place.line)?;
    let id = session.device(&arguments.place.device)?;
    let opened = session.open_mailbox(id, output);
    let outcome = session.with_opened(opened, output, |session, output| {
        ask(session, id, arguments, command, data, output)
    });
    end(outcome, arguments.json, output)
}

/// The command, and the data that ask it.
fn asked(action: &Action) -> Result<(AdsCommand, Vec<u8>), Failure> {
    let written = |text: &str| {
        bytes(text).filter(|data| !data.is_empty()).ok_or_else(|| {
            let reason = format!("`{text}` is no row of bytes: expected one at least");
            Failure::new(
                reason,
                "write pairs of hexadecimal digits in the order of the line: 01 02 FF",
            )
        })
    };
    let (group, offset) = (index::OWN_NET_ID, index::OWN_NET_ID_OFFSET);
    let (command, data) = match action {
        Action::Info => (AdsCommand::ReadDeviceInfo, AdsRequest::DeviceInfo.to_bytes().1),
        Action::State => (AdsCommand::ReadState, AdsRequest::State.to_bytes().1),
        Action::Read { group, offset, len } => {
            let read = AdsRequest::Read { group: *group, offset: *offset, len: *len };
            (AdsCommand::Read, read.to_bytes().1)
        }
        Action::Write { group, offset, data } => {
            let data = written(data)?;
            let write = AdsRequest::Write { group: *group, offset: *offset, data: &data };
            (AdsCommand::Write, write.to_bytes().1)
        }
        Action::ReadWrite { group, offset, data, len } => {
            let (data, len) = (written(data)?, *len);
            let both = AdsRequest::ReadWrite { group: *group, offset: *offset, len, data: &data };
            (AdsCommand::ReadWrite, both.to_bytes().1)
        }
        Action::SetNetId { new } => {
            (AdsCommand::Write, AdsRequest::Write { group, offset, data: &new.0 }.to_bytes().1)
        }
    };
    Ok((command, data))
}

fn ask(
    session: &mut ServiceLine,
    id: DeviceId,
    arguments: &Arguments,
    command: AdsCommand,
    data: Vec<u8>,
    output: &mut Output,
) -> Result<(), ServiceError> {
    let (net_id, port, source) = (arguments.net_id, arguments.port, None);
    let request = MailboxRequest::Ads { net_id, port, source, command, data };
    let given = session.bytes(id, Service::Mailbox(request))?;
    let reads = matches!(command, AdsCommand::Read | AdsCommand::ReadWrite);
    let whole = [&AdsCode::OK.0.to_le_bytes(), &given[..]].concat();
    let answer = match reads {
        true => AdsAnswer::Read(given),
        false => AdsAnswer::parse(command, &whole).unwrap_or(AdsAnswer::Done),
    };
    let hex = |data: &[u8]| data.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>();
    let mut report = Report {
        schema: "linesman.ads/1".to_owned(),
        tool: version::tool(),
        device: session.report(id),
        command: command.to_string(),
        port,
        data: None,
        info: None,
        state: None,
    };
    let told = match answer {
        AdsAnswer::DeviceInfo { major, minor, build, name } => {
            let version = format!("{major}.{minor}.{build}");
            let told = format!("{name}, version {version}");
            report.info = Some(AdsDeviceInfo { name, version });
            told
        }
        AdsAnswer::State { ads, device } => {
            report.state = Some([ads, device]);
            format!("state of ADS {ads}, of the SubDevice {device}")
        }
        AdsAnswer::Read(data) => {
            report.data = Some(hex(&data).concat().to_lowercase());
            match data.len() {
                0 => "no bytes".to_owned(),
                _ => hex(&data).join(" "),
            }
        }
        AdsAnswer::Done | AdsAnswer::Refused(_) => "written".to_owned(),
    };
    if arguments.json {
        output.json(&report);
        return Ok(());
    }
    output.line(&format!("{}: {told}", session.label(id)));
    Ok(())
}
