//! Options of the mailbox gateway of a run.

use std::net::SocketAddr;

use linesman_link::socket::WakeHandle;
use linesman_proto::mailbox::gateway::PORT;
use linesman_runtime::gateway::{AllowedHosts, GatewayOptions, GatewayReport, MailboxGateway};
use linesman_runtime::online::OnlineState;

use crate::failure::Failure;
use crate::text::quantity::count;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(super) struct GatewayArguments {
    /// Pass mailbox messages of other programs to the SubDevices while the line runs: the mailbox gateway of
    /// ETG.8200, by UDP and TCP; station address 0 is this MainDevice (127.0.0.1, 0.0.0.0:34980)
    #[arg(long, value_name = "ADDRESS[:PORT]", value_parser = address)]
    gateway: Option<SocketAddr>,
    /// Serve programs on these computers as well (192.168.1.0/24, 10.0.0.7); may be given several times
    #[arg(long, value_name = "ADDRESS[/BITS]", requires = "gateway")]
    gateway_allow: Vec<AllowedHosts>,
    /// Let only uploads of objects and questions about dictionaries through
    #[arg(long, requires = "gateway")]
    gateway_read_only: bool,
}

fn address(text: &str) -> Result<SocketAddr, String> {
    let with_port = text.parse::<SocketAddr>().ok();
    let address = with_port.or_else(|| Some(SocketAddr::new(text.parse().ok()?, PORT)));
    address.ok_or_else(|| {
        "expected an address of this computer, with a port or without: 127.0.0.1, 192.168.1.5:34980".to_owned()
    })
}

impl GatewayArguments {
    /// Opens the gateway, if one is wanted.
    pub(super) fn open(
        &self,
        wake_handle: WakeHandle,
        online: OnlineState,
    ) -> Result<Option<MailboxGateway>, Failure> {
        let Some(listen) = self.gateway else { return Ok(None) };
        let allowed = self.gateway_allow.clone();
        let options = GatewayOptions { listen, allowed, read_only: self.gateway_read_only };
        if options.serves_nobody_else() {
            return Err(Failure::new(
                format!(
                    "--gateway {listen}: it listens for other computers, and none is allowed to ask"
                ),
                "name those that are (`--gateway-allow 192.168.1.0/24`), or listen on 127.0.0.1",
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
}

/// Where it listens, for people.
pub(super) fn opened(gateway: &MailboxGateway) -> String {
    let report = gateway.report();
    let read_only = if report.read_only { ", read-only" } else { "" };
    format!("Mailbox gateway on {}, UDP and TCP{read_only}.", report.listen)
}

/// What went through it, for people.
pub(super) fn summary(report: &GatewayReport) -> String {
    let (requests, answers) = (count(report.requests, "request"), count(report.answers, "answer"));
    let mut text = format!("Mailbox gateway: {requests}, {answers}");
    let refused: u64 = report.refused.values().sum();
    if refused > 0 {
        let reasons = report.refused.iter().map(|(reason, count)| format!("{reason} {count}"));
        let reasons: Vec<String> = reasons.collect();
        text.push_str(&format!(", {refused} refused or not answered ({})", reasons.join(", ")));
    }
    text.push_str(".\n");
    text
}
