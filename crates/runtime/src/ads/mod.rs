//! ADS server of a running MainDevice: what is seen online, and services for SubDevices, by the remote protocol of the
//! vendor's controllers.
//!
//! Reference: `proto::ads`. Threads of their own talk to clients (`connections`); `services` says what an index group
//! means, in requests and answers of the control socket ([`crate::service::message`]), which the thread that runs the line
//! takes here as it does there: [`AdsServer`]. The AMS port 65535 is the MainDevice, other ports are station addresses.

mod connections;
mod counts;
mod datagram;
mod pass;
mod services;
#[cfg(test)]
mod tests;

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;

use linesman_link::socket::WakeHandle;
use linesman_maindevice::MainDevice;
use linesman_maindevice::service::{ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_proto::ads::AmsNetId;
use linesman_proto::time::Instant;

use self::connections::{AdsConnections, AdsShared};
pub use self::counts::AdsReport;
use crate::control_socket::{Asked, request_queue};
use crate::network_access::NetworkAccess;
use crate::online::OnlineState;
use crate::run::report::RunReport;
use crate::service::{PendingServices, ServiceProtocol};
use crate::tcp_server;

/// Requests that are handed to the MainDevice between two frames.
const PER_TURN: usize = 4;

/// Counts of an ADS server, and its NetId, for those who look on.
#[derive(Clone)]
pub(crate) struct AdsWatch(Arc<AdsShared>);

impl AdsWatch {
    pub(crate) fn report(&self) -> AdsReport {
        self.0.report()
    }

    /// NetId of the MainDevice.
    pub(crate) fn net_id(&self) -> AmsNetId {
        self.0.net_id
    }
}

impl std::fmt::Debug for AdsWatch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AdsWatch").field("net_id", &self.0.net_id).finish_non_exhaustive()
    }
}

/// The server, as the thread that runs the line knows it. It is closed when this is dropped.
pub struct AdsServer {
    shared: Arc<AdsShared>,
    requests: Receiver<Asked<ServiceProtocol>>,
    services: PendingServices,
}

impl AdsServer {
    /// Begins to listen. Without a `net_id` the MainDevice has that of the address: `192.168.1.5.2.1`.
    /// `wake_handle` wakes the thread that calls `turn`; `online` knows what has happened.
    ///
    /// # Errors
    /// When the address is not one of this computer, somebody listens there already, or the system refuses.
    pub fn open(
        access: NetworkAccess,
        net_id: Option<AmsNetId>,
        wake_handle: WakeHandle,
        online: OnlineState,
    ) -> io::Result<Self> {
        let listener = TcpListener::bind(access.listen)?;
        let listen = listener.local_addr()?;
        let protocol = ServiceProtocol { online: online.clone() };
        let (sender, requests) = request_queue(wake_handle, protocol);
        let any_own = net_id.is_none() && listen.ip().is_unspecified();
        let net_id = net_id.unwrap_or_else(|| own_net_id(listen.ip()));
        let shared = AdsShared::new(access, listen, net_id, any_own, sender, online.clone());
        let shared = Arc::new(shared);
        online.set_ads(AdsWatch(Arc::clone(&shared)));
        tcp_server::start(listener, AdsConnections(Arc::clone(&shared)))?;
        Ok(Self { shared, requests, services: PendingServices::default() })
    }

    /// Address at which it listens.
    #[must_use]
    pub fn listen(&self) -> SocketAddr {
        self.shared.listen
    }

    /// Messages that have gone through it.
    #[must_use]
    pub fn report(&self) -> AdsReport {
        self.shared.report()
    }

    /// Takes what is asked for. `report` tells how the run goes.
    pub(crate) fn turn(
        &mut self,
        now: Instant,
        main: &mut MainDevice,
        report: impl Fn(&MainDevice) -> RunReport,
    ) {
        self.services.turn(now, main);
        for asked in self.requests.try_iter().take(PER_TURN) {
            self.services.take(asked, now, main, &report);
        }
    }

    /// A service is done.
    pub(crate) fn served(
        &mut self,
        ticket: ServiceTicket,
        result: &Result<ServiceAnswer, ServiceFailure>,
    ) {
        self.services.served(ticket, result);
    }
}

impl Drop for AdsServer {
    fn drop(&mut self) {
        self.shared.closed.store(true, Ordering::Release);
    }
}

/// NetId of the MainDevice of the computer that has this address. An address of IPv6 has no room in one.
pub(crate) fn own_net_id(address: IpAddr) -> AmsNetId {
    match address.to_canonical() {
        IpAddr::V4(address) if !address.is_unspecified() => {
            AmsNetId::of_main_device(address.octets())
        }
        IpAddr::V4(_) | IpAddr::V6(_) => AmsNetId::of_main_device(Ipv4Addr::LOCALHOST.octets()),
    }
}
