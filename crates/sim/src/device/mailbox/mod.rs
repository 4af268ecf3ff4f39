//! The mailbox of a SubDevice: takes messages, answers them, repeats what was lost.
//!
//! Read first: ETG.1000.4 (mailbox), ETG.1000.6 (CoE, EoE, FoE, SoE, VoE), ETG.1020 (AoE). SyncManager 0 brings requests,
//! SyncManager 1 takes answers. One request is worked on at a time; the next stays in its
//! SyncManager, which tells the MainDevice to wait.

mod aoe;
mod coe;
mod eoe;
mod foe;
mod information;
mod object_server;
mod outbox;
pub(super) mod soe;
mod voe;

use std::collections::VecDeque;

use linesman_proto::mailbox::coe::{Emergency, Message as CoeMessage};
use linesman_proto::mailbox::{
    Counter, ErrorReply, ErrorReplyCode, HEADER_LEN, Header, MailboxError, MailboxType, Message,
};
use linesman_proto::sii::Protocols;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use self::aoe::AoeServer;
use self::coe::CoeServer;
use self::eoe::EoePort;
pub use self::eoe::FragmentsLeftOut;
use self::foe::FoeServer;
pub use self::object_server::ObjectServer;
use self::outbox::{Envelope, Outbox};
use self::soe::SoeServer;
use super::dictionary::Dictionary;
use super::ethernet::EthernetSide;
use super::files::Files;
use super::software_fault::{SoftwareFault, SoftwareFaults};
use crate::controller::Pdi;

/// The SyncManager that requests come by.
pub const REQUESTS: u8 = 0;
/// The SyncManager that answers leave by.
pub const ANSWERS: u8 = 1;
/// Messages that wait to be fetched; when there are more, no request is taken.
const WAITING: usize = 4;
/// Emergencies that wait to be sent; further ones are forgotten.
const UNTOLD: usize = 8;
/// How soon a device looks at its Ethernet side again.
const SOONEST: Span = Span::us(100);
/// How soon a full mailbox is looked at again, where its SyncManager tells nothing.
const LOOK_AGAIN: Span = Span::ms(1);

/// What the mailbox serves: the parts of the device that messages are about.
#[derive(Debug)]
pub struct Served<'a> {
    /// The objects that CoE is about; without any there is no CoE.
    pub dictionary: &'a mut Dictionary,
    /// The files that FoE is about; without any there is no FoE.
    pub files: &'a mut Files,
    /// What is wrong with the device.
    pub software_faults: &'a mut SoftwareFaults,
    /// The state the device is in.
    pub state: AlState,
}

/// The mailbox.
#[derive(Debug)]
pub struct Mailbox {
    protocols: Protocols,
    aoe: AoeServer,
    coe: CoeServer,
    eoe: EoePort,
    foe: FoeServer,
    soe: SoeServer,
    response_time: Span,
    /// The request that is worked on, and when that ends.
    request: Option<(Vec<u8>, Instant)>,
    last_received: Counter,
    outbox: Outbox,
    emergencies: VecDeque<Emergency>,
    buffer: Vec<u8>,
}

impl Mailbox {
    /// A mailbox that speaks these protocols and answers after this time.
    #[must_use]
    pub fn new(response_time: Span, protocols: Protocols) -> Self {
        Self {
            protocols,
            aoe: AoeServer::default(),
            coe: CoeServer::default(),
            eoe: EoePort::default(),
            foe: FoeServer::default(),
            soe: SoeServer::default(),
            response_time,
            request: None,
            last_received: Counter::NONE,
            outbox: Outbox::default(),
            emergencies: VecDeque::new(),
            buffer: Vec::new(),
        }
    }

    /// INIT is left, or entered: whatever was under way is forgotten.
    pub fn restart(&mut self) {
        let eoe = std::mem::take(&mut self.eoe).restarted();
        *self = Self { eoe, ..Self::new(self.response_time, self.protocols) };
    }

    /// Frames of EoE go there from now on.
    pub fn connect(&mut self, side: EthernetSide) {
        self.eoe.connect(side);
    }

    /// The IP stack or switch that frames of EoE go to; `None`: there is none.
    #[must_use]
    pub const fn ethernet(&self) -> Option<&EthernetSide> {
        self.eoe.side()
    }

    /// The same, to hand frames to its ports.
    pub const fn ethernet_mut(&mut self) -> Option<&mut EthernetSide> {
        self.eoe.side_mut()
    }

    /// Fragments of Ethernet frames that were left out by a fault.
    #[must_use]
    pub const fn fragments_left_out(&self) -> FragmentsLeftOut {
        self.eoe.left_out()
    }

    /// The next message has this counter: the device sent others before.
    pub fn count_from(&mut self, next: Counter) {
        self.outbox.count_from(next);
    }

    /// Tells the MainDevice of an error on the device's own account, as soon as there is room.
    pub fn report(&mut self, emergency: Emergency) {
        if self.emergencies.len() < UNTOLD {
            self.emergencies.push_back(emergency);
        }
    }

    /// Does what can be done now, and says when to come again.
    pub fn serve(
        &mut self,
        now: Instant,
        pdi: &mut Pdi<'_>,
        served: &mut Served<'_>,
    ) -> Option<Instant> {
        let fills = !served.software_faults.has(SoftwareFault::MailboxNotFilled);
        if fills && pdi.repeat_requested(ANSWERS) {
            self.outbox.repeat(pdi);
            pdi.acknowledge_repeat(ANSWERS);
        }
        self.take(now, pdi, served);
        if let Some((request, due)) = self.request.take() {
            if due <= now {
                self.answer(&request, now, pdi, served);
                if fills {
                    self.outbox.deliver(pdi);
                }
                self.take(now, pdi, served);
            } else {
                self.request = Some((request, due));
            }
        }
        self.tell(served.state, now);
        let frames = self.frames(now, pdi, served);
        if fills {
            self.outbox.deliver(pdi);
        }
        let due = self.request.as_ref().map(|(_, due)| *due);
        let again = (self.outbox.len() > 0 && fills).then(|| now + LOOK_AGAIN);
        [due, again, frames, self.soe.next_end()].into_iter().flatten().min()
    }

    /// Puts fragments of Ethernet frames among the messages that wait, and says when to look again. Room for an answer is
    /// left.
    fn frames(&mut self, now: Instant, pdi: &Pdi<'_>, served: &mut Served<'_>) -> Option<Instant> {
        if served.state == AlState::Boot || !self.protocols.has(Protocols::EOE) {
            return None;
        }
        let due = self.eoe.handle_timeout(now);
        while self.outbox.len() + 1 < WAITING
            && let Some(fragment) = self.eoe.poll_fragment(answer_room(pdi), served.software_faults)
        {
            self.outbox.push(MailboxType::Eoe, Envelope::UNASKED, fragment);
        }
        Some(due?.max(now + SOONEST))
    }

    /// Takes a request out of SyncManager 0.
    fn take(&mut self, now: Instant, pdi: &mut Pdi<'_>, served: &Served<'_>) {
        let dead = served.software_faults.has(SoftwareFault::MailboxNotRead);
        if dead || self.request.is_some() || self.outbox.len() >= WAITING {
            return;
        }
        let len = request_room(pdi);
        self.buffer.resize(len, 0);
        if pdi.read_sync_manager(REQUESTS, &mut self.buffer).is_some() {
            let due = now + self.response_time + served.software_faults.mailbox_delay();
            self.request = Some((self.buffer.clone(), due));
        }
    }

    /// Puts emergencies and notifications among the messages that wait, while there is room. In BOOT there is
    /// neither CoE nor SoE.
    fn tell(&mut self, state: AlState, now: Instant) {
        while state != AlState::Boot
            && self.outbox.len() < WAITING
            && let Some(emergency) = self.emergencies.pop_front()
        {
            let body = coe::write(&CoeMessage::Emergency(emergency));
            self.outbox.push(MailboxType::Coe, Envelope::UNASKED, body);
        }
        while state != AlState::Boot
            && self.outbox.len() < WAITING
            && let Some(body) = self.soe.poll_notification(now)
        {
            self.outbox.push(MailboxType::Soe, Envelope::UNASKED, body);
        }
    }

    fn answer(&mut self, request: &[u8], now: Instant, pdi: &Pdi<'_>, served: &mut Served<'_>) {
        let message = match Message::parse(request) {
            Ok(message) => message,
            Err(MailboxError::HeaderCutOff { .. }) => return,
            Err(MailboxError::DataCutOff { .. }) => {
                let header = Header::parse(request);
                if let Ok(header) = header {
                    self.refuse(header, ErrorReplyCode::InvalidSize);
                }
                return;
            }
        };
        let header = message.header;
        if header.counter.repeats(self.last_received) {
            return;
        }
        self.last_received = header.counter;
        let unsupported = || Err(ErrorReplyCode::UnsupportedProtocol);
        let boots = served.state == AlState::Boot;
        let answers = match header.kind {
            MailboxType::Coe if !boots && self.protocols.has(Protocols::COE) => {
                self.coe.answer(message.data, served, answer_room(pdi))
            }
            MailboxType::Aoe if !boots && self.protocols.has(Protocols::AOE) => {
                self.aoe.answer(message.data, served, answer_room(pdi))
            }
            MailboxType::Voe if !boots && self.protocols.has(Protocols::VOE) => {
                voe::answer(message.data, served)
            }
            MailboxType::Foe if !served.files.is_empty() => {
                let limits =
                    foe::MessageLimits { requests: request_room(pdi), answers: answer_room(pdi) };
                self.foe.answer(message.data, served.files, served.state, now, limits)
            }
            MailboxType::Eoe if !boots && self.protocols.has(Protocols::EOE) => {
                self.eoe.answer(message.data, now, served.software_faults)
            }
            MailboxType::Soe if !boots && self.protocols.has(Protocols::SOE) => {
                let room = answer_room(pdi).saturating_sub(HEADER_LEN);
                Ok(self.soe.answer(message.data, now, served, room))
            }
            // Nobody answers an error with an error.
            MailboxType::Error => return,
            MailboxType::Coe
            | MailboxType::Aoe
            | MailboxType::Eoe
            | MailboxType::Foe
            | MailboxType::Soe
            | MailboxType::Voe
            | MailboxType::Reserved(_) => unsupported(),
        };
        match answers {
            Ok(answers) => {
                for answer in answers {
                    self.outbox.push(header.kind, Envelope::answering(&header), answer);
                }
            }
            Err(code) => self.refuse(header, code),
        }
    }

    /// Answers that a message cannot be handled at all.
    fn refuse(&mut self, to: Header, code: ErrorReplyCode) {
        let mut body = vec![0; ErrorReply::LEN];
        if (ErrorReply { code }).write(&mut body).is_ok() {
            self.outbox.push(MailboxType::Error, Envelope::answering(&to), body);
        }
    }
}

/// Bodies of the answers to one request, in order.
type Answers = Vec<Vec<u8>>;

/// Length of SyncManager 0.
fn request_room(pdi: &Pdi<'_>) -> usize {
    pdi.sync_manager(REQUESTS).map_or(0, |manager| usize::from(manager.length))
}

/// Length of SyncManager 1.
fn answer_room(pdi: &Pdi<'_>) -> usize {
    pdi.sync_manager(ANSWERS).map_or(0, |manager| usize::from(manager.length))
}
