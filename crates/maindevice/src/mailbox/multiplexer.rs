//! The mailbox of one SubDevice: sending, fetching, counting, repeating.
//!
//! Reference: S1 8.2 (mailbox mode of SyncManagers, repeat), ETG.1000.4. Writing into a full mailbox
//! and reading from an empty one is denied by the SyncManager, working counter 0.

use linesman_config::plan::DevicePlan;
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::mailbox::coe::Message as CoeMessage;
use linesman_proto::mailbox::{self, Counter, Header, MailboxType, Message};
use linesman_proto::register::{SYNC_MANAGER, SmActivate, SmPdiControl, SmStatus};
use linesman_proto::sii::MailboxPair;
use linesman_proto::time::{Instant, Span};

use super::SdoError;
use crate::event::Event;
use crate::exchange::{ExchangeError, Request, Target};
use crate::executor::Wire;
use crate::supervisor::Context;

const OUT: u16 = 0;
const IN: u16 = 1;
const STATUS_AT: u16 = 5;
const ACTIVATE_AT: u16 = 6;
const PDI_CONTROL_AT: u16 = 7;
const FIRST_POLL: Span = Span::us(500);
const SLOWEST_POLL: Span = Span::ms(10);
const REPEAT_LIMIT: Span = Span::ms(100);

/// A register byte of one of the two SyncManagers.
fn byte_of(manager: u16, at: u16) -> RegisterAddress {
    RegisterAddress(SYNC_MANAGER.address.0 + manager * SYNC_MANAGER.len + at)
}

/// One mailbox.
pub(crate) struct Multiplexer<'a> {
    wire: &'a Wire,
    id: DeviceId,
    target: Target,
    areas: MailboxPair,
    sent: Counter,
    received: Counter,
}

impl<'a> Multiplexer<'a> {
    pub(crate) fn new(context: &'a Context, device: &DevicePlan) -> Option<Self> {
        Some(Self {
            wire: &context.wire,
            id: device.id,
            target: Target::Station(device.station),
            areas: device.mailbox?.areas,
            sent: Counter::NONE,
            received: Counter::NONE,
        })
    }

    /// The SubDevice begins anew, and so does counting.
    pub(crate) fn reset(&mut self) {
        (self.sent, self.received) = (Counter::NONE, Counter::NONE);
    }

    pub(crate) fn now(&self) -> Instant {
        self.wire.now()
    }

    pub(crate) fn id(&self) -> DeviceId {
        self.id
    }

    /// Bytes a message of ours may have.
    pub(crate) fn out_size(&self) -> usize {
        usize::from(self.areas.receive.size)
    }

    /// Sends a message: `write` writes what follows the mailbox header.
    pub(crate) async fn send(
        &mut self,
        kind: MailboxType,
        write: impl FnOnce(&mut [u8]) -> Result<usize, mailbox::BufferTooSmall>,
        until: Instant,
    ) -> Result<(), SdoError> {
        self.sent = self.sent.next();
        let mut buffer = vec![0; self.out_size()];
        Header::new(kind, self.sent, 0).write_message(&mut buffer, write)?;
        let mut pause = FIRST_POLL;
        let mut uncertain = false;
        loop {
            let request = Request::write(self.target, self.areas.receive.offset, &buffer);
            match self.wire.submit(request).await {
                Ok(reply) if reply.answered() => return Ok(()),
                // Full, unless the SubDevice does not answer at all. After a lost frame it is our own
                // message that fills it.
                Ok(_) => {
                    if self.is_full(OUT).await? && uncertain {
                        return Ok(());
                    }
                }
                Err(error @ ExchangeError::WorkingCounter { .. }) => return Err(error.into()),
                Err(ExchangeError::NoReply { .. }) => uncertain = true,
            }
            if self.wire.now() >= until {
                return Err(SdoError::MailboxFull { id: self.id });
            }
            self.wire.sleep(pause).await;
            pause = (pause * 2).min(SLOWEST_POLL);
        }
    }

    async fn is_full(&self, manager: u16) -> Result<bool, ExchangeError> {
        let reply = self.wire.read_one(self.target, byte_of(manager, STATUS_AT), 1).await?;
        Ok(SmStatus(reply.bytes::<1>(0)[0]).mailbox_full())
    }

    /// The next CoE message that answers somebody; everything else is handed on meanwhile.
    pub(crate) async fn receive_coe(
        &mut self,
        until: Instant,
    ) -> Result<Option<Vec<u8>>, SdoError> {
        let mut pause = FIRST_POLL;
        loop {
            if let Some(buffer) = self.fetch().await? {
                if let Some(data) = self.dispatch(&buffer)? {
                    return Ok(Some(data));
                }
                continue;
            }
            if self.wire.now() >= until {
                return Ok(None);
            }
            self.wire.sleep(pause).await;
            pause = (pause * 2).min(SLOWEST_POLL);
        }
    }

    /// Fetches and hands on what is there.
    pub(crate) async fn drain(&mut self) {
        // A SubDevice that talks without end must not keep its jobs waiting.
        for _ in 0..16 {
            match self.fetch().await {
                Ok(Some(buffer)) => {
                    if let Ok(Some(data)) = self.dispatch(&buffer) {
                        self.unasked(MailboxType::Coe, data);
                    }
                }
                Ok(None) | Err(_) => return,
            }
        }
    }

    /// The message in the mailbox, if there is a new one.
    async fn fetch(&mut self) -> Result<Option<Vec<u8>>, ExchangeError> {
        if !self.is_full(IN).await? {
            return Ok(None);
        }
        let area = self.areas.send;
        for _ in 0..3 {
            let read = Request::read(self.target, area.offset, area.size);
            match self.wire.submit(read).await {
                Ok(reply) if reply.answered() => {
                    let counter = Header::parse(&reply.data).map(|header| header.counter);
                    let counter = counter.unwrap_or_default();
                    if counter.repeats(self.received) {
                        return Ok(None);
                    }
                    self.received = counter;
                    return Ok(Some(reply.data));
                }
                Ok(_) => return Ok(None),
                Err(error @ ExchangeError::WorkingCounter { .. }) => return Err(error),
                // The frame got lost on its way there or back. If the message is gone from the
                // mailbox, the SubDevice is asked to put it in again.
                Err(ExchangeError::NoReply { .. }) => {
                    if !self.is_full(IN).await? {
                        self.ask_for_repetition().await?;
                    }
                }
            }
        }
        Ok(None)
    }

    async fn ask_for_repetition(&self) -> Result<(), ExchangeError> {
        let at = byte_of(IN, ACTIVATE_AT);
        let reply = self.wire.read_one(self.target, at, 1).await?;
        let activate = SmActivate(reply.bytes::<1>(0)[0]);
        let asked = !activate.repeat_request();
        let toggled = activate.with_repeat_request(asked);
        self.wire.write_one(self.target, at, &[toggled.0]).await?;
        let until = self.wire.now() + REPEAT_LIMIT;
        while self.wire.now() < until {
            let reply = self.wire.read_one(self.target, byte_of(IN, PDI_CONTROL_AT), 1).await?;
            let acknowledged = SmPdiControl(reply.bytes::<1>(0)[0]).repeat_acknowledge();
            if acknowledged == asked {
                return Ok(());
            }
            self.wire.sleep(FIRST_POLL).await;
        }
        Ok(())
    }

    /// Hands a message on by its type. CoE answers are returned.
    fn dispatch(&self, buffer: &[u8]) -> Result<Option<Vec<u8>>, SdoError> {
        let message = match Message::parse(buffer) {
            Ok(message) => message,
            Err(_) => return Ok(None),
        };
        match message.header.kind {
            MailboxType::Coe => match CoeMessage::parse(message.data) {
                Ok(CoeMessage::Emergency(emergency)) => {
                    self.wire.emit(Event::Emergency { id: self.id, emergency });
                    Ok(None)
                }
                Ok(
                    CoeMessage::SdoRequest(_)
                    | CoeMessage::SdoResponse(_)
                    | CoeMessage::Abort(_)
                    | CoeMessage::Information(_),
                ) => Ok(Some(message.data.to_vec())),
                Ok(CoeMessage::Pdo { .. }) | Err(_) => {
                    self.unasked(MailboxType::Coe, message.data.to_vec());
                    Ok(None)
                }
            },
            MailboxType::Error => match mailbox::ErrorReply::parse(message.data) {
                Ok(reply) => Err(SdoError::Mailbox { id: self.id, code: reply.code }),
                Err(_) => Ok(None),
            },
            kind @ (MailboxType::Aoe
            | MailboxType::Eoe
            | MailboxType::Foe
            | MailboxType::Soe
            | MailboxType::Voe
            | MailboxType::Reserved(_)) => {
                self.unasked(kind, message.data.to_vec());
                Ok(None)
            }
        }
    }

    fn unasked(&self, kind: MailboxType, data: Vec<u8>) {
        self.wire.emit(Event::Mailbox { id: self.id, kind, data });
    }
}
