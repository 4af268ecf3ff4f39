//! The mailbox of a SubDevice: takes messages, answers them, repeats what was lost.
//!
//! Read first: ETG.1000.4 (mailbox), ETG.1000.6 (CoE). SyncManager 0 brings requests, SyncManager 1
//! takes answers. One request is worked on at a time; the next stays in its SyncManager, which tells
//! the MainDevice to wait.

mod coe;
mod information;
mod soe;

use std::collections::VecDeque;

use linesman_proto::mailbox::coe::{Emergency, Message as CoeMessage};
use linesman_proto::mailbox::{
    BufferTooSmall, Counter, ErrorReply, ErrorReplyCode, Header, MailboxError, MailboxType, Message,
};
use linesman_proto::sii::Protocols;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use self::coe::CoeServer;
use super::dictionary::Dictionary;
use crate::controller::Pdi;

/// The SyncManager that requests come by.
pub const REQUESTS: u8 = 0;
/// The SyncManager that answers leave by.
pub const ANSWERS: u8 = 1;
/// Messages that wait to be fetched; when there are more, no request is taken.
const WAITING: usize = 4;
/// How soon a full mailbox is looked at again, where its SyncManager tells nothing.
const LOOK_AGAIN: Span = Span::ms(1);

/// The mailbox.
#[derive(Clone, Debug)]
pub struct Mailbox {
    protocols: Protocols,
    coe: CoeServer,
    response_time: Span,
    /// The request that is worked on, and when that ends.
    request: Option<(Vec<u8>, Instant)>,
    last_received: Counter,
    sent: Counter,
    /// The last message in SyncManager 1, in case it is lost.
    last_message: Vec<u8>,
    outbox: VecDeque<Vec<u8>>,
    buffer: Vec<u8>,
}

impl Mailbox {
    /// A mailbox that speaks these protocols and answers after this time.
    #[must_use]
    pub fn new(response_time: Span, protocols: Protocols) -> Self {
        Self {
            protocols,
            coe: CoeServer::default(),
            response_time,
            request: None,
            last_received: Counter::NONE,
            sent: Counter::NONE,
            last_message: Vec::new(),
            outbox: VecDeque::new(),
            buffer: Vec::new(),
        }
    }

    /// INIT is left, or entered: whatever was under way is forgotten.
    pub fn restart(&mut self) {
        *self = Self::new(self.response_time, self.protocols);
    }

    /// Tells the MainDevice of an error on the device's own account.
    pub fn report(&mut self, emergency: Emergency, pdi: &Pdi<'_>) {
        let to_main_device = Header::new(MailboxType::Coe, Counter::NONE, 0);
        self.send(MailboxType::Coe, to_main_device, pdi, |body| {
            CoeMessage::Emergency(emergency).write(body)
        });
    }

    /// Does what can be done now, and says when to come again.
    pub fn serve(
        &mut self,
        now: Instant,
        pdi: &mut Pdi<'_>,
        dictionary: &mut Dictionary,
        state: AlState,
    ) -> Option<Instant> {
        self.repeat(pdi);
        self.take(now, pdi);
        if let Some((request, due)) = self.request.take() {
            if due <= now {
                self.answer(&request, pdi, dictionary, state);
                self.deliver(pdi);
                self.take(now, pdi);
            } else {
                self.request = Some((request, due));
            }
        }
        self.deliver(pdi);
        let due = self.request.as_ref().map(|(_, due)| *due);
        let again = (!self.outbox.is_empty()).then(|| now + LOOK_AGAIN);
        [due, again].into_iter().flatten().min()
    }

    /// The MainDevice did not get the last message: here it is again.
    fn repeat(&mut self, pdi: &mut Pdi<'_>) {
        if pdi.repeat_requested(ANSWERS) {
            if !pdi.mailbox_full(ANSWERS) && !self.last_message.is_empty() {
                pdi.write_sync_manager(ANSWERS, &self.last_message);
            }
            pdi.acknowledge_repeat(ANSWERS);
        }
    }

    /// Takes a request out of SyncManager 0.
    fn take(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        if self.request.is_some() || self.outbox.len() >= WAITING {
            return;
        }
        let len = pdi.sync_manager(REQUESTS).map_or(0, |manager| usize::from(manager.length));
        self.buffer.resize(len, 0);
        if pdi.read_sync_manager(REQUESTS, &mut self.buffer).is_some() {
            self.request = Some((self.buffer.clone(), now + self.response_time));
        }
    }

    /// Puts the next answer into SyncManager 1.
    fn deliver(&mut self, pdi: &mut Pdi<'_>) {
        if let Some(message) = self.outbox.front()
            && pdi.write_sync_manager(ANSWERS, message)
        {
            self.last_message = self.outbox.pop_front().unwrap_or_default();
        }
    }

    fn answer(
        &mut self,
        request: &[u8],
        pdi: &Pdi<'_>,
        dictionary: &mut Dictionary,
        state: AlState,
    ) {
        let message = match Message::parse(request) {
            Ok(message) => message,
            Err(MailboxError::HeaderCutOff { .. }) => return,
            Err(MailboxError::DataCutOff { .. }) => {
                let header = Header::parse(request);
                if let Ok(header) = header {
                    self.refuse(header, ErrorReplyCode::InvalidSize, pdi);
                }
                return;
            }
        };
        let header = message.header;
        if header.counter.repeats(self.last_received) {
            return;
        }
        self.last_received = header.counter;
        match header.kind {
            MailboxType::Coe if state != AlState::Boot && self.protocols.has(Protocols::COE) => {
                self.serve_coe(message, pdi, dictionary, state);
            }
            // Nobody answers an error with an error.
            MailboxType::Error => {}
            MailboxType::Soe if state != AlState::Boot && self.protocols.has(Protocols::SOE) => {
                if let Some(answer) = soe::answer(message.data) {
                    self.send(MailboxType::Soe, header, pdi, |body| copy(&answer, body));
                }
            }
            MailboxType::Coe
            | MailboxType::Aoe
            | MailboxType::Eoe
            | MailboxType::Foe
            | MailboxType::Soe
            | MailboxType::Voe
            | MailboxType::Reserved(_) => {
                self.refuse(header, ErrorReplyCode::UnsupportedProtocol, pdi);
            }
        }
    }

    fn serve_coe(
        &mut self,
        message: Message<'_>,
        pdi: &Pdi<'_>,
        dictionary: &mut Dictionary,
        state: AlState,
    ) {
        let room = answer_room(pdi);
        let mut coe = std::mem::take(&mut self.coe);
        let answers = coe.answer(message.data, dictionary, state, room);
        self.coe = coe;
        match answers {
            Ok(answers) => {
                for answer in answers {
                    self.send(MailboxType::Coe, message.header, pdi, |body| copy(&answer, body));
                }
            }
            Err(code) => self.refuse(message.header, code, pdi),
        }
    }

    /// Answers that a message cannot be handled at all.
    fn refuse(&mut self, to: Header, code: ErrorReplyCode, pdi: &Pdi<'_>) {
        self.send(MailboxType::Error, to, pdi, |body| ErrorReply { code }.write(body));
    }

    /// Queues a message. One that does not fit into the mailbox is not sent.
    fn send(
        &mut self,
        kind: MailboxType,
        to: Header,
        pdi: &Pdi<'_>,
        body: impl FnOnce(&mut [u8]) -> Result<usize, BufferTooSmall>,
    ) {
        let counter = self.sent.next();
        let mut buffer = vec![0; answer_room(pdi)];
        let header = Header { address: to.address, ..Header::new(kind, counter, 0) };
        if let Ok(len) = header.write_message(&mut buffer, body) {
            buffer.truncate(len);
            self.outbox.push_back(buffer);
            self.sent = counter;
        }
    }
}

/// Length of SyncManager 1.
fn answer_room(pdi: &Pdi<'_>) -> usize {
    pdi.sync_manager(ANSWERS).map_or(0, |manager| usize::from(manager.length))
}

/// Writes a body that is ready.
fn copy(body: &[u8], buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
    let (needed, available) = (body.len(), buffer.len());
    let slot = buffer.get_mut(..needed).ok_or(BufferTooSmall { needed, available })?;
    slot.copy_from_slice(body);
    Ok(needed)
}
