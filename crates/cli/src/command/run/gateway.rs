//! Options of the mailbox gateway of a run.

use std::collections::BTreeMap;
use std::net::SocketAddr;

use linesman_config::project::ProjectGateway;
use linesman_link::socket::WakeHandle;
use linesman_proto::mailbox::gateway::PORT;
use linesman_runtime::gateway::{GatewayReport, MailboxGateway};
use linesman_runtime::network_access::{AllowedHosts, NetworkAccess};
use linesman_runtime::online::OnlineState;

use super::Source;
use crate::failure::Failure;
use crate::text::quantity::count;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(super) struct GatewayArguments {
    /// Pass mailbox messages of other programs to the SubDevices while the line runs: the mailbox gateway of
    /// ETG.8200, by UDP and TCP; station address 0 is this MainDevice (127.0.0.1, 0.0.0.0:34980)
    #[arg(long, value_name = "ADDRESS[:PORT]", value_parser = gateway_address)]
    gateway: Option<SocketAddr>,
    /// Serve programs on these computers as well (192.168.1.0/24, 10.0.0.7); may be given several times
    #[arg(long, value_name = "ADDRESS[/BITS]", requires = "gateway")]
    gateway_allow: Vec<AllowedHosts>,
    /// Let only uploads of objects and questions about dictionaries through
    #[arg(long, requires = "gateway")]
    gateway_read_only: bool,
}

/// An address of this computer, with this port where it names none.
pub(super) fn address(text: &str, port: u16) -> Result<SocketAddr, String> {
    let with_port = text.parse::<SocketAddr>().ok();
    let address = with_port.or_else(|| Some(SocketAddr::new(text.parse().ok()?, port)));
    address.ok_or_else(|| {
        format!("expected an address of this computer, with a port or without: 127.0.0.1, 192.168.1.5:{port}")
    })
}

fn gateway_address(text: &str) -> Result<SocketAddr, String> {
    address(text, PORT)
}

impl GatewayArguments {
    /// The gateway that is wanted, if one is: as these options say, or else as the project does.
    pub(super) fn wanted(&self, source: &Source) -> Result<Option<NetworkAccess>, Failure> {
        if let Some(listen) = self.gateway {
            let allowed = self.gateway_allow.clone();
            return Ok(Some(NetworkAccess { listen, allowed, read_only: self.gateway_read_only }));
        }
        let project = match source {
            Source::Project(project) | Source::Planned(_, Some(project)) => project,
            Source::AsFound | Source::Planned(_, None) => return Ok(None),
        };
        let Some(ProjectGateway { listen, allow, read_only }) = &project.gateway else {
            return Ok(None);
        };
        let wrong = |key: &str, text: &str, why: String| {
            let reason = format!("`{key} = \"{text}\"` in [gateway] of the project: {why}");
            Failure::new(reason, "correct it, or take the table out and use `--gateway`")
        };
        let allowed = allow
            .iter()
            .map(|text| text.parse::<AllowedHosts>().map_err(|why| wrong("allow", text, why)));
        Ok(Some(NetworkAccess {
            listen: gateway_address(listen).map_err(|why| wrong("listen", listen, why))?,
            allowed: allowed.collect::<Result<_, _>>()?,
            read_only: *read_only,
        }))
    }
}

/// Opens the gateway, if one is wanted.
pub(super) fn open(
    options: Option<NetworkAccess>,
    wake_handle: WakeHandle,
    online: OnlineState,
) -> Result<Option<MailboxGateway>, Failure> {
    let Some(options) = options else { return Ok(None) };
    let listen = options.listen;
    if options.serves_nobody_else() {
        return Err(Failure::new(
            format!(
                "--gateway {listen}: it listens for other computers, and none is allowed to ask"
            ),
            "name those that are (`--gateway-allow 192.168.1.0/24`, `allow` in [gateway] of a project), or listen on \
             127.0.0.1",
        ));
    }
    let gateway = MailboxGateway::open(options, wake_handle, online).map_err(|error| {
        Failure::new(
            format!("--gateway {listen}: opening UDP and TCP port {}: {error}", listen.port()),
            "name an address of this computer (`ip address`) and a port that nobody uses (`ss -lntu`)",
        )
    })?;
    Ok(Some(gateway))
}

/// Where it listens, for people.
pub(super) fn opened(gateway: &MailboxGateway) -> String {
    let report = gateway.report();
    let read_only = if report.read_only { ", read-only" } else { "" };
    format!("Mailbox gateway on {}, UDP and TCP{read_only}.", report.listen)
}

/// What went through it, for people.
pub(in crate::command) fn summary(report: &GatewayReport) -> String {
    let (requests, answers) = (count(report.requests, "request"), count(report.answers, "answer"));
    let clients = count(report.clients, "client");
    let text = format!("Mailbox gateway: {requests} of {clients}, {answers}");
    with_refusals(text, &report.refused)
}

/// A sentence with what was refused, and why.
pub(super) fn with_refusals(mut text: String, refused: &BTreeMap<String, u64>) -> String {
    let sum: u64 = refused.values().sum();
    if sum > 0 {
        let reasons = refused.iter().map(|(reason, count)| format!("{reason} {count}"));
        let reasons: Vec<String> = reasons.collect();
        text.push_str(&format!(", {sum} refused or not answered ({})", reasons.join(", ")));
    }
    text.push_str(".\n");
    text
}
