//! Options of the ADS server of a run.

use std::net::SocketAddr;

use linesman_link::socket::WakeHandle;
use linesman_proto::ads::{AmsNetId, PORT};
use linesman_runtime::ads::{AdsReport, AdsServer};
use linesman_runtime::network_access::{AllowedHosts, NetworkAccess};
use linesman_runtime::online::OnlineState;

use super::gateway::{address, with_refusals};
use crate::failure::Failure;
use crate::text::quantity::count;

/// Arguments of the ADS server.
#[derive(clap::Args, Debug)]
pub(super) struct AdsArguments {
    /// Answer other programs by ADS while the line runs: states, counts, identities, objects of SubDevices, as the
    /// vendor's EtherCAT MainDevice does (127.0.0.1, 0.0.0.0:48898)
    #[arg(long, value_name = "ADDRESS[:PORT]", value_parser = ads_address)]
    ads: Option<SocketAddr>,
    /// NetId of the MainDevice; without it that of the address: 192.168.1.5.2.1
    #[arg(long, value_name = "NETID", requires = "ads")]
    ads_net_id: Option<AmsNetId>,
    /// Serve programs on these computers as well (192.168.1.0/24, 10.0.0.7); may be given several times
    #[arg(long, value_name = "ADDRESS[/BITS]", requires = "ads")]
    ads_allow: Vec<AllowedHosts>,
    /// Refuse what changes something: states, objects, registers, counts
    #[arg(long, requires = "ads")]
    ads_read_only: bool,
}

fn ads_address(text: &str) -> Result<SocketAddr, String> {
    address(text, PORT)
}

/// The server that is wanted.
pub(super) struct AdsOptions {
    access: NetworkAccess,
    net_id: Option<AmsNetId>,
}

impl AdsArguments {
    /// The server that is wanted, if one is.
    pub(super) fn wanted(&self) -> Option<AdsOptions> {
        let (listen, allowed) = (self.ads?, self.ads_allow.clone());
        let access = NetworkAccess { listen, allowed, read_only: self.ads_read_only };
        Some(AdsOptions { access, net_id: self.ads_net_id })
    }
}

/// Opens the server, if one is wanted.
pub(super) fn open(
    options: Option<AdsOptions>,
    wake_handle: WakeHandle,
    online: OnlineState,
) -> Result<Option<AdsServer>, Failure> {
    let Some(AdsOptions { access, net_id }) = options else { return Ok(None) };
    let listen = access.listen;
    if access.serves_nobody_else() {
        return Err(Failure::new(
            format!("--ads {listen}: it listens for other computers, and none is allowed to ask"),
            "name those that are (`--ads-allow 192.168.1.0/24`), or listen on 127.0.0.1",
        ));
    }
    let server = AdsServer::open(access, net_id, wake_handle, online).map_err(|error| {
        Failure::new(
            format!("--ads {listen}: opening TCP port {}: {error}", listen.port()),
            "name an address of this computer (`ip address`) and a port that nobody uses (`ss -lnt`)",
        )
    })?;
    Ok(Some(server))
}

/// Address at which it listens, for people.
pub(super) fn opened(server: &AdsServer) -> String {
    let report = server.report();
    let read_only = if report.read_only { ", read-only" } else { "" };
    format!(
        "ADS on {}: the MainDevice is {}, port 65535, SubDevices are ports by their station addresses{read_only}.",
        report.listen, report.net_id
    )
}

/// Messages that went through it, for people.
pub(in crate::command) fn summary(report: &AdsReport) -> String {
    let (requests, answers) = (count(report.requests, "request"), count(report.answers, "answer"));
    let clients = count(report.clients, "client");
    let text = format!("ADS: {requests} of {clients}, {answers}");
    with_refusals(text, &report.refused)
}
