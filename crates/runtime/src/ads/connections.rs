//! Connections: one message behind the other, each answered before the next is taken.

use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use linesman_proto::ads::{
    AMS_TCP_HEADER_LEN, AdsAnswer, AdsCode, AdsRequest, AmsError, AmsHeader, AmsNetId,
};

use super::counts::{AdsCounts, AdsReport};
use super::own_net_id;
use super::pass::by_net_id;
use super::services::{AdsNetwork, AdsServices};
use crate::control_socket::RequestSender;
use crate::network_access::NetworkAccess;
use crate::online::OnlineState;
use crate::online::report::OnlineReport;
use crate::request_rates::RequestRates;
use crate::service::ServiceProtocol;
use crate::service::message::{Answer, Request};
use crate::tcp_server::{ConnectionRefusal, ServedConnection, TcpService};

/// Time that a connection may be silent: clients keep theirs open as long as they run.
const IDLE: Duration = Duration::from_secs(30 * 60);
/// Time that a message may take from its first byte to its last.
const MESSAGE: Duration = Duration::from_secs(5);
/// Age up to which a report is given again: the thread that runs the line is asked no more often.
const FRESH: Duration = Duration::from_millis(50);
/// Requests that are out at once, when many SubDevices are asked for the same.
const AT_ONCE: usize = 8;

/// State that all threads of the server share.
pub(super) struct AdsShared {
    access: NetworkAccess,
    pub(super) listen: SocketAddr,
    pub(super) net_id: AmsNetId,
    /// True if the NetId of any address of this computer is taken that a client has called.
    any_own: bool,
    counts: AdsCounts,
    /// The run has ended.
    pub(super) closed: AtomicBool,
    rates: Mutex<RequestRates>,
    started: Instant,
    sender: RequestSender<ServiceProtocol>,
    online: OnlineState,
    /// The last report, and when it was made.
    fresh: Mutex<Option<(Instant, Arc<OnlineReport>)>>,
    /// Abort code of the last access to an object that failed, by station address.
    aborts: Mutex<BTreeMap<u16, u32>>,
}

impl AdsShared {
    pub(super) fn new(
        access: NetworkAccess,
        listen: SocketAddr,
        net_id: AmsNetId,
        any_own: bool,
        sender: RequestSender<ServiceProtocol>,
        online: OnlineState,
    ) -> Self {
        Self {
            access,
            listen,
            net_id,
            any_own,
            counts: AdsCounts::default(),
            closed: AtomicBool::default(),
            rates: Mutex::new(RequestRates::new()),
            started: Instant::now(),
            sender,
            online,
            fresh: Mutex::default(),
            aborts: Mutex::default(),
        }
    }

    pub(super) fn report(&self) -> AdsReport {
        let counts = self.counts.now();
        AdsReport {
            listen: self.listen.to_string(),
            net_id: self.net_id.to_string(),
            read_only: self.access.read_only,
            clients: counts.clients,
            requests: counts.requests,
            answers: counts.answers,
            refused: counts.refused,
        }
    }

    fn aborts(&self) -> MutexGuard<'_, BTreeMap<u16, u32>> {
        self.aborts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// True if a SubDevice has this NetId; one that may not ask now is not told.
    fn is_sub_device(&self, net_id: AmsNetId, admitted: bool) -> bool {
        let report = admitted.then(|| AdsNetwork::report(self)).flatten();
        report.is_some_and(|report| by_net_id(&report, net_id).is_some())
    }

    /// The answer to a message: its frame; `None` to one that is not to be answered.
    fn answer(&self, connection: &ServedConnection<'_>, message: &[u8]) -> Option<Vec<u8>> {
        let refused = |header: &AmsHeader, code| {
            self.counts.answer(code);
            Some(header.answer(code).frame(&[]))
        };
        let (header, data) = match AmsHeader::parse(message) {
            Ok(parsed) => parsed,
            Err(AmsError::DataLength { header, .. }) if header.is_request() => {
                return refused(&header, AdsCode::BAD_LENGTH);
            }
            Err(_) => {
                self.counts.refuse(MALFORMED);
                return None;
            }
        };
        if !header.is_request() {
            self.counts.refuse(MALFORMED);
            return None;
        }
        let is_ours = header.target.net_id == self.net_id
            || self.any_own
                && connection
                    .own_address()
                    .is_ok_and(|own| own_net_id(own) == header.target.net_id);
        let admitted = {
            let mut rates = self.rates.lock().unwrap_or_else(PoisonError::into_inner);
            rates.admit(connection.host(), self.started.elapsed())
        };
        let services = AdsServices {
            network: self,
            net_id: header.target.net_id,
            read_only: self.access.read_only,
        };
        let answer = match AdsRequest::parse(header.command, data) {
            Err(AdsCode::UNKNOWN_COMMAND) => return refused(&header, AdsCode::UNKNOWN_COMMAND),
            Err(_) if !is_ours && !self.is_sub_device(header.target.net_id, admitted) => {
                return refused(&header, AdsCode::MACHINE_NOT_FOUND);
            }
            Err(code) => AdsAnswer::Refused(code),
            Ok(_) if !admitted => AdsAnswer::Refused(AdsCode::BUSY),
            Ok(request) => {
                let answer = if is_ours {
                    services.answer(header.target.port, &request)
                } else {
                    services.pass(&header, &request)
                };
                match answer {
                    Ok(answer) => answer,
                    Err(code) => return refused(&header, code),
                }
            }
        };
        self.counts.answer(answer.result());
        Some(header.answer(AdsCode::OK).frame(&answer.to_bytes(header.command)))
    }
}

impl AdsNetwork for AdsShared {
    fn report(&self) -> Option<Arc<OnlineReport>> {
        let mut fresh = self.fresh.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((at, report)) = &*fresh
            && at.elapsed() < FRESH
        {
            return Some(Arc::clone(report));
        }
        let sent = self.sender.send(Request::Online)?;
        let answer = self.sender.receive(&sent)?;
        let report = Arc::new(*answer.online?);
        *fresh = Some((Instant::now(), Arc::clone(&report)));
        Some(report)
    }

    fn ask(&self, requests: Vec<Request>) -> Vec<Result<Answer, AdsCode>> {
        let mut answers = Vec::new();
        for some in requests.chunks(AT_ONCE) {
            let sent: Vec<_> = some.iter().map(|one| self.sender.send(one.clone())).collect();
            answers.extend(sent.into_iter().map(|sent| match sent {
                Some(sent) => self.sender.receive(&sent).ok_or(AdsCode::TIMEOUT),
                None => Err(AdsCode::BUSY),
            }));
        }
        // What was read before it was changed is old.
        *self.fresh.lock().unwrap_or_else(PoisonError::into_inner) = None;
        answers
    }

    fn topology(&self) -> Option<Vec<u8>> {
        self.online.topology()
    }

    fn last_abort(&self, station: u16) -> u32 {
        self.aborts().get(&station).copied().unwrap_or(0)
    }

    fn set_last_abort(&self, station: u16, code: u32) {
        self.aborts().insert(station, code);
    }
}

const MALFORMED: &str = "malformed";

/// The connections of a server.
pub(super) struct AdsConnections(pub(super) Arc<AdsShared>);

impl TcpService for AdsConnections {
    const THREAD: &'static str = "ads accept";
    const CONNECTION: &'static str = "a connection to the ADS server";

    fn access(&self) -> &NetworkAccess {
        &self.0.access
    }

    fn closed(&self) -> &AtomicBool {
        &self.0.closed
    }

    fn refuse(&self, why: ConnectionRefusal) {
        self.0.counts.refuse(match why {
            ConnectionRefusal::TooMany => "too-many-connections",
            ConnectionRefusal::NotAllowed => "not-allowed",
        });
    }

    /// Takes one message after another, until there is no more, or none that can be told from the next.
    fn serve(&self, mut connection: ServedConnection<'_>) -> io::Result<()> {
        let Self(shared) = self;
        shared.counts.client();
        loop {
            let mut header = [0; AMS_TCP_HEADER_LEN];
            let [first, others @ ..] = &mut header;
            if !connection.fill(std::slice::from_mut(first), IDLE)? {
                return Ok(());
            }
            shared.counts.request();
            let began = Instant::now();
            let mut message = Vec::new();
            let is_whole = connection.fill(others, MESSAGE)?
                && match AmsHeader::announced(header) {
                    Ok(len) => {
                        message.resize(len, 0);
                        connection.fill(&mut message, MESSAGE.saturating_sub(began.elapsed()))?
                    }
                    Err(_) => false,
                };
            if !is_whole {
                shared.counts.refuse(MALFORMED);
                return Ok(());
            }
            if let Some(answer) = shared.answer(&connection, &message) {
                connection.send(&answer)?;
            }
        }
    }
}
