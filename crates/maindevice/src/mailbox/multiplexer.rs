//! The mailbox of one SubDevice: sending, and handing on what is fetched.
//!
//! Reference: S1 8.2 (mailbox mode of SyncManagers, repeat), ETG.1000.4. Writing into a full mailbox
//! and reading from an empty one is denied by the SyncManager, working counter 0.

mod fetch;

use linesman_config::plan::DevicePlan;
use linesman_config::plan::ethernet::{FullPause, MAILBOX_STATUSES};
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::ads::AmsNetId;
use linesman_proto::mailbox::coe::Message as CoeMessage;
use linesman_proto::mailbox::{self, Counter, Header, MailboxType, Message, eoe, soe};
use linesman_proto::register::{SYNC_MANAGER, SmStatus};
use linesman_proto::sii::{MailboxPair, Protocols};
use linesman_proto::time::{Instant, Span};

use super::MailboxQueues;
use super::ethernet::UnansweredFragments;
use super::failure::Why;
use super::pass::PassedTransfer;
use crate::event::Event;
use crate::exchange::{ExchangeError, Reply, Request, Target};
use crate::executor::Wire;
use crate::executor::wire::Exchanging;

const OUT: u16 = 0;
const IN: u16 = 1;
const STATUS_AT: u16 = 5;
const FIRST_POLL: Span = Span::us(500);
const SLOWEST_POLL: Span = Span::ms(10);
/// A mailbox whose bit the cycle reads is looked into all the same once in so long while an answer is
/// waited for: cyclic frames may be lost.
const UNSEEN: Span = Span::ms(50);

/// A register byte of one of the two SyncManagers.
fn byte_of(manager: u16, at: u16) -> RegisterAddress {
    RegisterAddress(SYNC_MANAGER.address.0 + manager * SYNC_MANAGER.len + at)
}

/// One mailbox.
pub(crate) struct Multiplexer {
    wire: Wire,
    queues: MailboxQueues,
    id: DeviceId,
    target: Target,
    areas: MailboxPair,
    standard: MailboxPair,
    bootstrap: Option<MailboxPair>,
    protocols: Protocols,
    /// Counter of the last message that was sent; `None` before the first.
    sent: Option<Counter>,
    /// Counter of the last message that was fetched; `NONE` before the first, and of a SubDevice that does not count.
    received: Counter,
    /// The SubDevice has begun anew, and nobody has fetched a message since.
    first_is_due: bool,
    /// A message was asked for again: what comes may be one that we have had.
    fetched_again: bool,
    /// A frame that fetched was lost, and the SubDevice has not been asked yet to put its message in again.
    repetition_due: bool,
    /// True unless the SubDevice left it unanswered when it was last asked to put a message in again.
    repeats_on_request: bool,
    /// A message is missing: its frame was lost, and the SubDevice did not put it in again.
    missing: bool,
    /// An operation was given up whose answer may still come.
    late: bool,
    /// What came during this operation that is no message: how often, and the last of it in words.
    rubbish: Option<(u32, String)>,
    /// The transfer of a client of the mailbox gateway.
    pub(super) passed: PassedTransfer,
    /// How often a message was sent or fetched again after a frame was lost.
    repetitions: u32,
    /// When a fragment of an Ethernet frame was sent or came.
    last_frame: Option<Instant>,
    fragments: UnansweredFragments,
    /// True if the mailbox to us held something when the last fragment was written; `None`: not known, or looked into since.
    holds: Option<bool>,
    full_pause: FullPause,
    /// Its NetId, for AoE.
    net_id: AmsNetId,
    /// Number of the last ADS request.
    invoke_id: u32,
}

impl Multiplexer {
    /// `None` for a SubDevice without a mailbox.
    pub(crate) fn new(wire: &Wire, queues: &MailboxQueues, device: &DevicePlan) -> Option<Self> {
        let mailbox = device.mailbox?;
        Some(Self {
            wire: wire.clone(),
            queues: queues.clone(),
            id: device.id,
            target: Target::Station(device.station),
            areas: mailbox.areas,
            standard: mailbox.areas,
            bootstrap: mailbox.bootstrap,
            protocols: mailbox.protocols,
            sent: None,
            received: Counter::NONE,
            first_is_due: false,
            fetched_again: false,
            repetition_due: false,
            repeats_on_request: true,
            missing: false,
            late: false,
            rubbish: None,
            passed: PassedTransfer::default(),
            repetitions: 0,
            last_frame: None,
            fragments: UnansweredFragments::default(),
            holds: None,
            full_pause: FullPause::default(),
            net_id: device
                .net_id()
                .unwrap_or(AmsNetId::of_main_device([127, 0, 0, 1]).of_sub_device(device.station)),
            invoke_id: 0,
        })
    }

    /// The SubDevice begins anew, and so does counting.
    pub(crate) fn reset(&mut self) {
        (self.sent, self.received, self.first_is_due) = (None, Counter::NONE, true);
        (self.fetched_again, self.missing, self.late) = (false, false, false);
        (self.repetition_due, self.repeats_on_request) = (false, true);
        self.passed = PassedTransfer::default();
        self.fragments = UnansweredFragments::default();
        self.holds = None;
    }

    /// It is the mailbox of BOOT from now on, or that of all other states. False when it has none
    /// for BOOT.
    pub(crate) fn set_boots(&mut self, boots: bool) -> bool {
        let areas = if boots { self.bootstrap } else { Some(self.standard) };
        self.areas = areas.unwrap_or(self.standard);
        areas.is_some()
    }

    /// True if a transfer of a client of the mailbox gateway is under way.
    pub(crate) fn is_passing(&self) -> bool {
        self.passed.under_way
    }

    /// How often a message was sent or fetched again after a frame was lost; it wraps.
    pub(crate) fn repetitions(&self) -> u32 {
        self.repetitions
    }

    /// When a fragment of an Ethernet frame was sent or came; `None`: never.
    pub(crate) fn last_frame(&self) -> Option<Instant> {
        self.last_frame
    }

    /// A fragment of an Ethernet frame was sent.
    pub(crate) fn fragment_sent(&mut self) {
        self.fragments.sent(self.wire.now());
    }

    /// Its NetId: that of the plan, else one made of its station address.
    pub(crate) fn net_id(&self) -> AmsNetId {
        self.net_id
    }

    /// The number of the next ADS request. It is not begun anew with the SubDevice, so that no late answer has it.
    pub(crate) fn next_invoke_id(&mut self) -> u32 {
        self.invoke_id = self.invoke_id.wrapping_add(1);
        self.invoke_id
    }

    pub(crate) fn now(&self) -> Instant {
        self.wire.now()
    }

    pub(crate) async fn pause(&self, span: Span) {
        self.wire.sleep(span).await;
    }

    pub(crate) fn id(&self) -> DeviceId {
        self.id
    }

    /// Bytes a message of ours may have.
    pub(crate) fn out_size(&self) -> usize {
        usize::from(self.areas.receive.size)
    }

    /// Bytes a message to us may have.
    pub(crate) fn in_size(&self) -> usize {
        usize::from(self.areas.send.size)
    }

    /// Whether its SII says that it speaks a protocol. One that names none may speak any.
    pub(crate) fn speaks(&self, kind: MailboxType) -> bool {
        let bit = match kind {
            MailboxType::Coe => Protocols::COE,
            MailboxType::Foe => Protocols::FOE,
            MailboxType::Eoe => Protocols::EOE,
            MailboxType::Soe => Protocols::SOE,
            MailboxType::Error | MailboxType::Aoe | MailboxType::Voe | MailboxType::Reserved(_) => {
                return true;
            }
        };
        self.protocols == Protocols::default() || self.protocols.has(bit)
    }

    /// An operation begins. What is left of one that was given up is fetched first.
    pub(crate) async fn begin(&mut self) {
        self.rubbish = None;
        self.missing = false;
        if self.late {
            self.drain().await;
        }
    }

    /// An operation was given up.
    pub(crate) fn failed(&mut self, why: &Why) {
        self.late |= why.leaves_answer_behind();
    }

    /// Whether an answer may be that to an operation which was given up.
    pub(crate) fn may_be_late(&self) -> bool {
        self.late
    }

    /// True if a message has gone missing since the last call.
    pub(crate) fn take_missing(&mut self) -> bool {
        std::mem::take(&mut self.missing)
    }

    /// What was waited for has come, though late.
    pub(crate) fn all_late_ones_came(&mut self) {
        self.late = false;
    }

    /// What came during this operation that is no message, in words.
    pub(crate) fn rubbish(&self) -> Option<String> {
        self.rubbish.as_ref().map(|(count, last)| match count {
            1 => last.clone(),
            count => format!("{count} times, last: {last}"),
        })
    }

    fn found_rubbish(&mut self, what: String) {
        let count = self.rubbish.as_ref().map_or(0, |(count, _)| *count);
        self.rubbish = Some((count.saturating_add(1), what));
    }

    /// Sends a message: `write` writes what follows the mailbox header. False when the mailbox stays
    /// full.
    pub(crate) async fn send(
        &mut self,
        kind: MailboxType,
        write: impl FnOnce(&mut [u8]) -> Result<usize, mailbox::BufferTooSmall>,
        until: Instant,
    ) -> Result<bool, Why> {
        // The SubDevice may know the counter of somebody who spoke before us, and would take a message
        // of the same one for a repetition: the first one is not counted.
        let counter = self.sent.map_or(Counter::NONE, Counter::next);
        let mut buffer = vec![0; self.out_size()];
        Header::new(kind, counter, 0).write_message(&mut buffer, write)?;
        self.sent = Some(counter);
        let mut pause = FIRST_POLL;
        let mut uncertain = false;
        let is_frame = kind == MailboxType::Eoe;
        if is_frame {
            self.last_frame = Some(self.wire.now());
        }
        loop {
            let request = Request::write(self.target, self.areas.receive.offset, &buffer);
            let writing = self.wire.submit(request);
            // Fragments come one behind the other, and find the mailbox full more often than not: why one is not taken, and
            // whether the SubDevice has something itself, is read in the same frame.
            let statuses = is_frame.then(|| self.read_statuses());
            let written = writing.await;
            let full = match statuses {
                Some(statuses) => self.take_statuses(statuses.await),
                None => None,
            };
            match written {
                Ok(reply) if reply.answered() => {
                    // One without a counter that was taken twice is answered twice.
                    self.late |= uncertain && counter == Counter::NONE;
                    if is_frame {
                        self.full_pause.accepted(self.wire.now());
                    }
                    return Ok(true);
                }
                // Full, unless the SubDevice does not answer at all. After a lost frame it is our own
                // message that fills it.
                Ok(_) => {
                    let full = match full {
                        Some(full) => full,
                        None => self.is_full(OUT).await?,
                    };
                    if full && uncertain {
                        return Ok(true);
                    }
                }
                Err(error @ ExchangeError::WorkingCounter { .. }) => return Err(error.into()),
                Err(ExchangeError::NoReply { .. }) => {
                    uncertain = true;
                    self.repetitions = self.repetitions.wrapping_add(1);
                }
            }
            if is_frame {
                // Frames go both ways at once: it may wait for room for its own.
                self.drain_unless_empty().await;
            }
            if self.wire.now() >= until {
                return Ok(false);
            }
            if is_frame {
                pause = self.full_pause.refused(self.wire.now());
            }
            self.wire.sleep(pause).await;
            pause = (pause * 2).min(SLOWEST_POLL);
        }
    }

    /// Reads the statuses of both SyncManagers, behind what was submitted before.
    fn read_statuses(&self) -> Exchanging {
        self.wire.submit(Request::read(self.target, byte_of(OUT, STATUS_AT), MAILBOX_STATUSES))
    }

    /// Notes whether the mailbox to us holds something, and says whether the other one is full; `None` where nobody answered.
    fn take_statuses(&mut self, answer: Result<Reply, ExchangeError>) -> Option<bool> {
        let reply = answer.ok().filter(Reply::answered);
        let full =
            |at| reply.as_ref().map(|reply| SmStatus(reply.bytes::<1>(at)[0]).mailbox_full());
        self.holds = full(usize::from(MAILBOX_STATUSES) - 1);
        full(0)
    }

    async fn is_full(&self, manager: u16) -> Result<bool, ExchangeError> {
        let reply = self.wire.read_one(self.target, byte_of(manager, STATUS_AT), 1).await?;
        Ok(SmStatus(reply.bytes::<1>(0)[0]).mailbox_full())
    }

    /// The next message of a protocol that answers somebody; everything else is handed on meanwhile.
    pub(crate) async fn receive(
        &mut self,
        kind: MailboxType,
        until: Instant,
    ) -> Result<Option<Vec<u8>>, Why> {
        let mut pause = FIRST_POLL;
        loop {
            if let Some(buffer) = self.fetch().await? {
                if let Some(data) = self.dispatch(&buffer, Some(kind))? {
                    // What was sent before has been dealt with, unless this is the answer to a still earlier request.
                    if !self.late {
                        self.fragments = UnansweredFragments::default();
                    }
                    return Ok(Some(data));
                }
                // A SubDevice that talks without end about other things is not listened to for ever.
                if self.wire.now() < until {
                    continue;
                }
            }
            if self.wire.now() >= until {
                return Ok(None);
            }
            if self.queues.is_mapped(self.id) {
                let rest = until.since(self.wire.now());
                self.queues.mail(self.id, self.wire.sleep(UNSEEN.min(rest))).await;
            } else {
                self.wire.sleep(pause).await;
                pause = (pause * 2).min(SLOWEST_POLL);
            }
        }
    }

    /// Fetches and hands on what is there. True if there may be more.
    pub(crate) async fn drain(&mut self) -> bool {
        // A SubDevice that talks without end must not keep its jobs waiting.
        for _ in 0..16 {
            match self.fetch().await {
                // Nobody waits for an error reply, either.
                Ok(Some(buffer)) => drop(self.dispatch(&buffer, None)),
                Ok(None) | Err(_) => return false,
            }
        }
        true
    }

    /// Fetches and hands on what is there, unless nothing was when the last fragment was written.
    pub(crate) async fn drain_unless_empty(&mut self) {
        if self.holds != Some(false) {
            self.drain().await;
        }
    }

    /// Hands a message on by its type. What may be an answer of the protocol that is `wanted` is
    /// returned.
    fn dispatch(
        &mut self,
        buffer: &[u8],
        wanted: Option<MailboxType>,
    ) -> Result<Option<Vec<u8>>, Why> {
        let message = match Message::parse(buffer) {
            Ok(message) => message,
            Err(error) => {
                self.found_rubbish(error.to_string());
                return Ok(None);
            }
        };
        let kind = message.header.kind;
        match kind {
            MailboxType::Coe => match CoeMessage::parse(message.data) {
                Ok(CoeMessage::Emergency(emergency)) => {
                    self.wire.emit(Event::Emergency { id: self.id, emergency });
                    return Ok(None);
                }
                Ok(
                    CoeMessage::SdoRequest(_)
                    | CoeMessage::SdoResponse(_)
                    | CoeMessage::Abort(_)
                    | CoeMessage::Information(_),
                ) if wanted == Some(kind) => return Ok(Some(message.data.to_vec())),
                Ok(_) => {}
                Err(error) => self.found_rubbish(error.to_string()),
            },
            MailboxType::Error => match mailbox::ErrorReply::parse(message.data) {
                Ok(reply) => match (self.fragments.refused(self.wire.now()), wanted) {
                    (false, Some(_)) => return Err(Why::Mailbox { code: reply.code }),
                    (true, Some(_)) => self.found_rubbish(format!(
                        "an error reply that may be about an Ethernet fragment: {}",
                        reply.code
                    )),
                    (_, None) => {}
                },
                Err(error) => self.found_rubbish(error.to_string()),
            },
            MailboxType::Foe | MailboxType::Aoe | MailboxType::Voe if wanted == Some(kind) => {
                return Ok(Some(message.data.to_vec()));
            }
            // Frames and time stamps come unasked at any time.
            MailboxType::Eoe => {
                let answer = eoe::Message::parse(message.data);
                if wanted == Some(kind) && matches!(answer, Ok(eoe::Message::Response { .. })) {
                    return Ok(Some(message.data.to_vec()));
                }
                self.last_frame = Some(self.wire.now());
            }
            MailboxType::Soe if wanted == Some(kind) => {
                let operation = soe::Message::parse(message.data).map(|answer| answer.operation);
                if matches!(
                    operation,
                    Some(soe::Operation::ReadResponse | soe::Operation::WriteResponse)
                ) {
                    return Ok(Some(message.data.to_vec()));
                }
            }
            MailboxType::Reserved(code) => {
                self.found_rubbish(format!("a message of the reserved type {code}"));
            }
            MailboxType::Aoe | MailboxType::Foe | MailboxType::Soe | MailboxType::Voe => {}
        }
        self.unasked(kind, message.data.to_vec());
        Ok(None)
    }

    /// Tells how far a file has come.
    pub(crate) fn progress(&self, progress: super::FileProgress) {
        self.wire.emit(Event::FileProgress { id: self.id, progress });
    }

    /// Tells of a message that nobody waits for.
    pub(crate) fn unasked(&self, kind: MailboxType, data: Vec<u8>) {
        self.wire.emit(Event::Mailbox { id: self.id, kind, data });
    }
}
