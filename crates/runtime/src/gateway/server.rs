//! What threads of the gateway share: limits, counts, and the way to the thread that runs the line.

use std::net::{IpAddr, SocketAddr};
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use linesman_link::socket::WakeHandle;
use linesman_proto::mailbox::{Header, MailboxType, Message, gateway};

use super::admission::{GatewayClient, GatewayClients, WAITING, WaitingPlace};
use super::counts::{GatewayCounts, GatewayRefusal, GatewayReport};
use super::screen::screen;
use crate::network_access::NetworkAccess;
use crate::online::Snapshot;
use crate::request_rates::RequestRates;

/// What the thread that runs the line is asked.
pub(super) enum GatewayRequest {
    /// Pass a message on.
    Message {
        station: u16,
        kind: MailboxType,
        data: Vec<u8>,
        /// What is answered instead, if the SubDevice is there.
        refusal: Option<Vec<u8>>,
        unanswered: GatewayWaiting,
    },
    /// How the line is now; nothing before a plan is run.
    Snapshot(SyncSender<Option<Box<Snapshot>>>),
}

/// A message to the MainDevice itself.
pub(super) struct ObjectRequest {
    pub(super) data: Vec<u8>,
    pub(super) unanswered: GatewayWaiting,
}

/// A request that waits for its answer.
pub(super) struct GatewayWaiting {
    /// Whose it is.
    pub(super) client: u64,
    /// Its mailbox header.
    header: Header,
    /// Where it came from, for datagrams.
    sender: Option<SocketAddr>,
    answers: SyncSender<GatewayAnswer>,
    place: WaitingPlace,
}

impl GatewayWaiting {
    /// The mailbox messages that answer it, one behind the other, or why there are none.
    pub(super) fn give(self, outcome: Result<Vec<u8>, GatewayRefusal>) {
        let Self { header, sender, answers, place, .. } = self;
        // There is room for all that wait; who asked may have gone.
        let _ = answers.try_send(GatewayAnswer { header, sender, outcome, _place: place });
    }
}

/// What came of a request.
pub(super) struct GatewayAnswer {
    header: Header,
    pub(super) sender: Option<SocketAddr>,
    outcome: Result<Vec<u8>, GatewayRefusal>,
    _place: WaitingPlace,
}

/// Where an answer goes.
#[derive(Clone)]
pub(super) struct ReturnPath {
    pub(super) sender: Option<SocketAddr>,
    pub(super) answers: SyncSender<GatewayAnswer>,
}

/// What all threads share.
pub(super) struct GatewayServer {
    pub(super) options: NetworkAccess,
    pub(super) listen: SocketAddr,
    pub(super) clients: GatewayClients,
    pub(super) counts: GatewayCounts,
    /// The run has ended.
    pub(super) closed: AtomicBool,
    rates: Mutex<RequestRates>,
    started: Instant,
    requests: SyncSender<GatewayRequest>,
    wake_handle: WakeHandle,
}

impl GatewayServer {
    pub(super) fn new(
        options: NetworkAccess,
        listen: SocketAddr,
        wake_handle: WakeHandle,
    ) -> (Self, Receiver<GatewayRequest>) {
        let (requests, receiver) = mpsc::sync_channel(WAITING);
        let server = Self {
            options,
            listen,
            clients: GatewayClients::new(),
            counts: GatewayCounts::default(),
            closed: AtomicBool::default(),
            rates: Mutex::new(RequestRates::new()),
            started: Instant::now(),
            requests,
            wake_handle,
        };
        (server, receiver)
    }

    pub(super) fn report(&self) -> GatewayReport {
        let report = self.counts.report(self.listen, self.options.read_only);
        GatewayReport { clients: self.clients.count(), ..report }
    }

    /// Time since the gateway was opened.
    pub(super) fn now(&self) -> std::time::Duration {
        self.started.elapsed()
    }

    /// Takes a frame that came in; what answers it comes back the other way.
    ///
    /// # Errors
    /// When it is no frame of the gateway, or too much was asked.
    pub(super) fn take(
        &self,
        frame: &[u8],
        host: IpAddr,
        client: &Arc<GatewayClient>,
        back: ReturnPath,
        objects: &SyncSender<ObjectRequest>,
    ) -> Result<(), GatewayRefusal> {
        let admitted = {
            let mut rates = self.rates.lock().unwrap_or_else(PoisonError::into_inner);
            rates.admit(host, self.now())
        };
        if !admitted {
            return Err(GatewayRefusal::TooManyRequests);
        }
        let message = gateway::parse(frame).map_err(|_| GatewayRefusal::Malformed)?;
        let Message { header, data } = message;
        let station = header.address.value();
        if station == 0 && header.kind != MailboxType::Coe {
            return Err(GatewayRefusal::Protocol);
        }
        let refusal = match screen(header.kind, data, self.options.read_only) {
            Ok(()) => None,
            Err(out) if out.answer.is_empty() => return Err(out.why),
            Err(out) => {
                self.counts.refuse(out.why);
                Some(out.answer)
            }
        };
        let place = self.clients.place(client).ok_or(GatewayRefusal::TooManyRequests)?;
        let ReturnPath { sender, answers } = back;
        let unanswered = GatewayWaiting { client: client.id, header, sender, answers, place };
        let (kind, data) = (header.kind, data.to_vec());
        let asked = if station == 0 {
            if let Some(refusal) = refusal {
                unanswered.give(Ok(refusal));
                return Ok(());
            }
            objects.try_send(ObjectRequest { data, unanswered }).map_err(drop)
        } else {
            self.ask(GatewayRequest::Message { station, kind, data, refusal, unanswered })
        };
        asked.map_err(|()| GatewayRefusal::TooManyRequests)
    }

    /// Asks the thread that runs the line.
    pub(super) fn ask(&self, request: GatewayRequest) -> Result<(), ()> {
        let asked = self.requests.try_send(request);
        self.wake_handle.wake();
        asked.map_err(drop)
    }

    /// The frames of an answer; none where there is none, which counts.
    pub(super) fn frames(&self, answer: &GatewayAnswer) -> Vec<Vec<u8>> {
        match &answer.outcome {
            Ok(messages) => frames(answer.header, messages),
            Err(why) => {
                self.counts.refuse(*why);
                Vec::new()
            }
        }
    }
}

/// The frames that carry mailbox messages back to who sent a request: with its address, and its counter. Of several,
/// each has the next counter, so that none is taken for a repetition.
fn frames(request: Header, mut messages: &[u8]) -> Vec<Vec<u8>> {
    let mut frames = Vec::new();
    let mut counter = request.counter;
    while let Ok(message) = Message::parse(messages) {
        let header = Header { kind: message.header.kind, counter, ..request };
        let mut frame = vec![0; gateway::MAX_LEN];
        if let Ok(len) = gateway::write(header, message.data, &mut frame) {
            frame.truncate(len);
            frames.push(frame);
        }
        if counter.value() != 0 {
            counter = counter.next();
        }
        let len = linesman_proto::mailbox::HEADER_LEN + message.data.len();
        messages = messages.get(len..).unwrap_or_default();
    }
    frames
}

#[cfg(test)]
mod tests {
    use linesman_proto::mailbox::{Counter, HEADER_LEN};

    use super::*;

    #[test]
    fn answers_have_the_address_and_the_counter_of_the_request() {
        let request = Header::from_bytes([10, 0, 0xE9, 0x03, 0x81, 0x73]);
        let mut messages = Vec::new();
        for body in [&[1_u8, 2][..], &[], &[3]] {
            let at = messages.len();
            messages.resize(at + HEADER_LEN + body.len(), 0);
            let header = Header::new(MailboxType::Coe, Counter::FIRST, 0);
            let write = |slot: &mut [u8]| {
                slot.copy_from_slice(body);
                Ok(body.len())
            };
            header.write_message(&mut messages[at..], write).unwrap();
        }
        let frames = frames(request, &messages);
        let read: Vec<_> = frames.iter().map(|frame| gateway::parse(frame).unwrap()).collect();
        assert_eq!(read.iter().map(|one| one.data).collect::<Vec<_>>(), [&[1, 2][..], &[], &[3]]);
        // 7, then 1: 0 would mean that nobody counts.
        let counters: Vec<_> = read.iter().map(|one| one.header.counter.value()).collect();
        assert_eq!(counters, [7, 1, 2]);
        for one in read {
            let header = one.header;
            assert_eq!((header.address, header.channel, header.priority), (request.address, 1, 2));
        }
        let uncounted = Header { counter: Counter::NONE, ..request };
        let counters = super::frames(uncounted, &messages);
        assert!(
            counters
                .iter()
                .all(|frame| gateway::parse(frame).unwrap().header.counter == Counter::NONE)
        );
        assert!(super::frames(request, &[1, 0, 0]).is_empty());
    }
}
