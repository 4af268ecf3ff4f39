//! `linesman foe`: files of a SubDevice, its firmware too.

use std::path::{Path, PathBuf};

use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::Service;
use linesman_proto::address::DeviceId;
use linesman_runtime::service::LONGEST_FILE;
use serde::Serialize;

use super::sdo::value::number;
use super::service::{DeviceReport, ServiceError, ServiceLine, ServiceTarget, end};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::quantity::count;
use crate::version;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) place: ServiceTarget,
    #[command(subcommand)]
    action: Action,
    /// JSON, schema linesman.file/1; linesman.refusal/1 when it is refused
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// Fetch a file from the SubDevice
    Read(Transfer),
    /// Bring a file to the SubDevice, such as firmware: it takes what it is given
    Write(Transfer),
}

#[derive(clap::Args, Debug)]
struct Transfer {
    /// What the SubDevice calls the file; some want no extension
    name: String,
    /// The file here
    file: PathBuf,
    /// The password of the SubDevice's manual: 0x12345678
    #[arg(long, value_parser = number, default_value = "0")]
    password: u32,
    /// Take it to BOOT for this, as firmware needs, and back to its state
    #[arg(long)]
    boot: bool,
}

/// A file that was moved.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.file/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Whose.
    device: DeviceReport,
    /// `read` or `write`.
    action: String,
    /// What the SubDevice calls the file.
    name: String,
    /// The file here.
    file: String,
    /// Its length in bytes.
    size: usize,
    /// Whether it was moved in BOOT.
    boot: bool,
}

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    // What stands in the way here is told before anything is sent.
    let data = match &arguments.action {
        Action::Read(transfer) => {
            files::refuse_to_overwrite(&transfer.file)?;
            None
        }
        Action::Write(transfer) => {
            Some(files::bytes(&transfer.file, "the file to be sent", LONGEST_FILE)?)
        }
    };
    let mut session = ServiceLine::open(&arguments.place.line)?;
    let id = session.device(&arguments.place.device)?;
    let (Action::Read(transfer) | Action::Write(transfer)) = &arguments.action;
    let opened = match transfer.boot {
        true => session.open_boot(id, output),
        false => session.open_mailbox(id, output),
    };
    let outcome = session.with_opened(opened, output, |session, output| {
        act(session, id, transfer, data, arguments.json, output)
    });
    end(outcome, arguments.json, output)
}

fn act(
    session: &mut ServiceLine,
    id: DeviceId,
    transfer: &Transfer,
    data: Option<Vec<u8>>,
    json: bool,
    output: &mut Output,
) -> Result<(), ServiceError> {
    let (name, password) = (transfer.name.clone(), transfer.password);
    let (action, size) = match data {
        Some(data) => {
            let size = data.len();
            let request = MailboxRequest::WriteFile { name, password, data };
            session.ask(id, Service::Mailbox(request))?;
            ("write", size)
        }
        None => {
            let request = MailboxRequest::ReadFile { name, password };
            let bytes = session.bytes(id, Service::Mailbox(request))?;
            save(&transfer.file, &bytes)?;
            ("read", bytes.len())
        }
    };
    let report = Report {
        schema: "linesman.file/1".to_owned(),
        tool: version::tool(),
        device: session.report(id),
        action: action.to_owned(),
        name: transfer.name.clone(),
        file: transfer.file.display().to_string(),
        size,
        boot: transfer.boot,
    };
    if json {
        output.json(&report);
        return Ok(());
    }
    let (label, size) = (session.label(id), count(size as u64, "byte"));
    let file = transfer.file.display();
    output.line(&match action {
        "write" => format!("{label}: {file} written as `{}`, {size}", transfer.name),
        _ => format!("{label}: `{}` saved as {file}, {size}", transfer.name),
    });
    Ok(())
}

fn save(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    files::write_new_bytes(path, "the file of the SubDevice", bytes)
}
