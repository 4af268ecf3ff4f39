//! Mailbox gateway of a running MainDevice: mailbox messages of other programs, by UDP and TCP, to SubDevices and to
//! the MainDevice itself.
//!
//! Reference: ETG.8200; ETG.1510 for the objects of the MainDevice. Threads of their own talk to clients
//! (`udp`, `tcp`); `server` says what is taken of them, within the limits of `admission` and `screen`. The
//! thread that runs the line only hands messages to the MainDevice, and hands back what came of them: [`MailboxGateway`].
//! Messages to address 0 are answered from the `objects` of the MainDevice.
//!
//! A client's counter is its own, and comes back in the answer; towards the SubDevice the MainDevice counts. What
//! cannot be served is not answered, as the specification has it.

mod admission;
mod commands;
mod counts;
mod object_thread;
mod objects;
mod screen;
mod server;
mod tcp;
mod udp;

use std::fmt;
use std::io;
use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;

use linesman_link::socket::WakeHandle;
use linesman_maindevice::MainDevice;
use linesman_maindevice::mailbox::{MailboxRequest, Why};
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;
use linesman_sim::device::dictionary::Dictionary;

use self::admission::WAITING;
pub use self::counts::{GatewayRefusal, GatewayReport};
use self::server::{GatewayRequest, GatewayServer, GatewayWaiting};
use crate::network_access::NetworkAccess;
use crate::online::report::OnlineReport;
use crate::online::{OnlineState, Rates, Snapshot};

/// Messages that are handed to the MainDevice between two frames.
const PER_TURN: usize = 4;
/// Messages of all clients that wait for the mailbox of one SubDevice.
const PER_SUBDEVICE: usize = 16;
/// How often a port is looked for that is free for UDP and TCP.
const ATTEMPTS: usize = 16;

/// Counts of a gateway, for those who look on.
#[derive(Clone)]
pub(crate) struct GatewayWatch(Arc<GatewayServer>);

impl GatewayWatch {
    pub(crate) fn report(&self) -> GatewayReport {
        self.0.report()
    }
}

impl fmt::Debug for GatewayWatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GatewayWatch").field("listen", &self.0.listen).finish_non_exhaustive()
    }
}

/// The objects of the MainDevice itself, as they are at address 0 before a client has written into them.
pub(crate) fn own_objects(report: &OnlineReport) -> Dictionary {
    objects::dictionary(report, &commands::ObjectCommands::default())
}

/// The gateway, as the thread that runs the line knows it. It is closed when this is dropped.
pub struct MailboxGateway {
    server: Arc<GatewayServer>,
    requests: Receiver<GatewayRequest>,
    /// Messages on their way to SubDevices, and who waits for what answers them.
    pending: Vec<(ServiceTicket, DeviceId, GatewayWaiting)>,
    rates: Rates,
}

impl MailboxGateway {
    /// Begins to listen. `wake_handle` wakes the thread that calls [`MailboxGateway::turn`]; `online` knows what has
    /// happened.
    ///
    /// # Errors
    /// When the address is not one of this computer, somebody listens there already, or the system refuses.
    pub fn open(
        options: NetworkAccess,
        wake_handle: WakeHandle,
        online: OnlineState,
    ) -> io::Result<Self> {
        let (socket, listener) = bind(options.listen)?;
        let listen = socket.local_addr()?;
        let (server, requests) = GatewayServer::new(options, listen, wake_handle);
        let server = Arc::new(server);
        online.set_gateway(GatewayWatch(Arc::clone(&server)));
        let objects = object_thread::start(Arc::clone(&server), online)?;
        udp::start(socket, Arc::clone(&server), objects.clone())?;
        tcp::start(listener, Arc::clone(&server), objects)?;
        let pending = Vec::with_capacity(WAITING);
        Ok(Self { server, requests, pending, rates: Rates::default() })
    }

    /// Where it listens.
    #[must_use]
    pub fn listen(&self) -> SocketAddr {
        self.server.listen
    }

    /// What has gone through it.
    #[must_use]
    pub fn report(&self) -> GatewayReport {
        self.server.report()
    }

    /// Hands messages that came in to the MainDevice.
    pub(crate) fn turn(&mut self, now: Instant, main: &mut MainDevice) {
        self.rates.turn(now, || main.statistics());
        for _ in 0..PER_TURN {
            match self.requests.try_recv() {
                Ok(GatewayRequest::Snapshot(reply)) => {
                    let snapshot = main.plan().map(|_| Snapshot::of(main, now, &self.rates));
                    // Whoever asked may have lost patience.
                    let _ = reply.try_send(snapshot.map(Box::new));
                }
                Ok(GatewayRequest::Message { station, kind, data, refusal, unanswered }) => {
                    let client = unanswered.client;
                    let request = MailboxRequest::Pass { client, kind, data };
                    match (self.addressee(main, station), refusal) {
                        // Who is not there says nothing.
                        (Ok(_), Some(refusal)) => unanswered.give(Ok(refusal)),
                        (Ok(id), None) => {
                            let ticket = main.serve(now, id, Service::Mailbox(request));
                            self.pending.push((ticket, id, unanswered));
                        }
                        (Err(why), _) => unanswered.give(Err(why)),
                    }
                }
                Err(_) => return,
            }
        }
    }

    /// The SubDevice with this station address, if it can be asked.
    fn addressee(&self, main: &MainDevice, station: u16) -> Result<DeviceId, GatewayRefusal> {
        let plan = main.plan().ok_or(GatewayRefusal::NotUp)?;
        let device = plan.devices.iter().find(|device| device.station.0 == station);
        let id = device.ok_or(GatewayRefusal::UnknownStation)?.id;
        let waiting = self.pending.iter().filter(|(_, other, _)| *other == id).count();
        if waiting < PER_SUBDEVICE { Ok(id) } else { Err(GatewayRefusal::TooManyRequests) }
    }

    /// A service is done.
    pub(crate) fn served(
        &mut self,
        ticket: ServiceTicket,
        result: &Result<ServiceAnswer, ServiceFailure>,
    ) {
        if let Some(at) = self.pending.iter().position(|(pending, ..)| *pending == ticket) {
            let (_, _, unanswered) = self.pending.swap_remove(at);
            unanswered.give(match result {
                Ok(ServiceAnswer::Data(messages)) => Ok(messages.clone()),
                Ok(_) => Err(GatewayRefusal::NoAnswer),
                Err(failure) => Err(refusal(failure)),
            });
        }
    }
}

impl Drop for MailboxGateway {
    fn drop(&mut self) {
        self.server.closed.store(true, Ordering::Release);
    }
}

/// One port for datagrams and connections.
fn bind(listen: SocketAddr) -> io::Result<(UdpSocket, TcpListener)> {
    let mut attempts = if listen.port() == 0 { ATTEMPTS } else { 1 };
    loop {
        attempts -= 1;
        let listener = TcpListener::bind(listen)?;
        match UdpSocket::bind(listener.local_addr()?) {
            Ok(socket) => return Ok((socket, listener)),
            Err(_) if attempts > 0 => {}
            Err(error) => return Err(error),
        }
    }
}

/// Why a message was not answered.
#[allow(clippy::wildcard_enum_match_arm, reason = "all others: the SubDevice gave no answer")]
fn refusal(failure: &ServiceFailure) -> GatewayRefusal {
    match failure {
        ServiceFailure::Mailbox(failure) => match failure.why {
            Why::NoMailbox | Why::NotOpen | Why::NotSpoken { .. } => GatewayRefusal::NoMailbox,
            Why::TooSmall(_) => GatewayRefusal::TooLong,
            Why::Crowded { .. } => GatewayRefusal::TooManyRequests,
            _ => GatewayRefusal::NoAnswer,
        },
        ServiceFailure::Unknown { .. } => GatewayRefusal::NotUp,
        _ => GatewayRefusal::NoAnswer,
    }
}
