//! Thread that answers messages to the MainDevice itself.

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread;
use std::time::{Duration, Instant};

use linesman_proto::mailbox::{BufferTooSmall, Counter, HEADER_LEN, Header, MailboxType, gateway};
use linesman_sim::device::dictionary::Dictionary;
use linesman_sim::device::mailbox::ObjectServer;

use super::admission::WAITING;
use super::commands::ObjectCommands;
use super::counts::GatewayRefusal;
use super::objects::dictionary;
use super::screen::error_reply;
use super::server::{GatewayRequest, GatewayServer, ObjectRequest};
use crate::online::OnlineState;
use crate::online::report::OnlineReport;
use crate::part::guard;

/// So long the objects are as they were: the thread that runs the line is asked no more often.
const FRESH: Duration = Duration::from_millis(50);
/// How long that thread may take.
const PATIENCE: Duration = Duration::from_secs(2);
/// Clients whose transfers are kept apart.
const CLIENTS: usize = 256;
/// How often it is looked whether the gateway is closed.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// What the thread knows.
struct ObjectThread {
    server: Arc<GatewayServer>,
    online: OnlineState,
    /// The objects, of which report they were made, and when.
    made: Option<MadeObjects>,
    /// Commands that clients have written into them.
    commands: ObjectCommands,
    /// The transfer of each client, and when it asked last.
    clients: BTreeMap<u64, (ObjectServer, Instant)>,
}

struct MadeObjects {
    dictionary: Dictionary,
    report: OnlineReport,
    at: Instant,
}

/// Starts the thread; gives the way to it.
pub(super) fn start(
    server: Arc<GatewayServer>,
    online: OnlineState,
) -> io::Result<SyncSender<ObjectRequest>> {
    let (sender, requests) = mpsc::sync_channel(WAITING);
    let commands = ObjectCommands::default();
    let mut thread =
        ObjectThread { server, online, made: None, commands, clients: BTreeMap::new() };
    thread::Builder::new().name("gateway objects".to_owned()).spawn(move || {
        // It is begun anew: nothing of it is worth keeping.
        while !thread.server.closed.load(Ordering::Acquire) {
            let ended = guard("objects of the mailbox gateway", "they are begun anew", || {
                thread.serve(&requests);
            });
            if ended.is_ok() {
                return;
            }
            thread.clients.clear();
        }
    })?;
    Ok(sender)
}

impl ObjectThread {
    fn serve(&mut self, requests: &Receiver<ObjectRequest>) {
        loop {
            match requests.recv_timeout(LOOK_EVERY) {
                Ok(ObjectRequest { data, unanswered }) => {
                    let outcome = self.answer(unanswered.client, &data);
                    unanswered.give(outcome);
                }
                Err(RecvTimeoutError::Timeout) => {
                    if self.server.closed.load(Ordering::Acquire) {
                        return;
                    }
                }
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn answer(&mut self, client: u64, data: &[u8]) -> Result<Vec<u8>, GatewayRefusal> {
        self.refresh()?;
        let Some(MadeObjects { dictionary, report, .. }) = &mut self.made else {
            return Err(GatewayRefusal::NotUp);
        };
        let now = Instant::now();
        if !self.clients.contains_key(&client) && self.clients.len() >= CLIENTS {
            let oldest = self.clients.iter().min_by_key(|(_, (_, last))| *last);
            if let Some(oldest) = oldest.map(|(client, _)| *client) {
                self.clients.remove(&oldest);
            }
        }
        let (server, last) = self.clients.entry(client).or_insert((ObjectServer::default(), now));
        *last = now;
        // A datagram holds the longest message.
        let answered = match server.answer(data, dictionary, gateway::MAX_UDP_MESSAGE) {
            Ok(bodies) => messages(&bodies),
            Err(code) => error_reply(code),
        };
        if self.commands.follow(dictionary, report) {
            self.made = None;
        }
        answered.map_err(|_| GatewayRefusal::TooLong)
    }

    /// The objects are made anew when they are old.
    fn refresh(&mut self) -> Result<(), GatewayRefusal> {
        if self.made.as_ref().is_some_and(|made| made.at.elapsed() < FRESH) {
            return Ok(());
        }
        let (reply, snapshot) = mpsc::sync_channel(1);
        let busy = |()| GatewayRefusal::TooManyRequests;
        self.server.ask(GatewayRequest::Snapshot(reply)).map_err(busy)?;
        let snapshot = snapshot.recv_timeout(PATIENCE).map_err(|_| GatewayRefusal::NoAnswer)?;
        let snapshot = snapshot.ok_or(GatewayRefusal::NotUp)?;
        let report = self.online.report(&snapshot).ok_or(GatewayRefusal::NotUp)?;
        let counted = self.commands.counted_from_base(report.clone());
        let dictionary = dictionary(&counted, &self.commands);
        self.made = Some(MadeObjects { dictionary, report, at: Instant::now() });
        Ok(())
    }
}

/// Mailbox messages with these bodies, one behind the other.
fn messages(bodies: &[Vec<u8>]) -> Result<Vec<u8>, BufferTooSmall> {
    let mut messages = Vec::new();
    for body in bodies {
        let at = messages.len();
        messages.resize(at + HEADER_LEN + body.len(), 0);
        let header = Header::new(MailboxType::Coe, Counter::NONE, 0);
        header.write_message(&mut messages[at..], |slot| {
            slot.copy_from_slice(body);
            Ok(body.len())
        })?;
    }
    Ok(messages)
}
