//! One transaction through a mailbox: requests and answers, until it is done.

use linesman_proto::ads::{AmsAddress, AmsNetId};
use linesman_proto::mailbox::{BufferTooSmall, MailboxType};
use linesman_proto::time::{Instant, Span};

use super::failure::{MailboxFailure, Step, Why};
use super::multiplexer::Multiplexer;
use super::progress::{FileBusy, FileProgress, PROGRESS_INTERVAL};
use super::request::MailboxRequest;
use super::soe::{self, IdnElements};
use super::{aoe, coe, ethernet, foe, information, pass, settings, voe};

/// A SubDevice that writes what it got into its flash memory answers late: a file takes more patience
/// than an object.
const FILE_PATIENCE: Span = Span::s(10);

/// Sender of ADS requests where a request names none: the MainDevice of this computer.
const OWN_ADDRESS: AmsAddress = AmsAddress {
    net_id: AmsNetId::of_main_device([127, 0, 0, 1]),
    port: AmsAddress::MAIN_DEVICE_PORT,
};

/// An operation under way.
pub(crate) struct MailboxTransaction<'a> {
    pub(crate) multiplexer: &'a mut Multiplexer,
    /// How far it has come.
    pub(crate) step: Step,
    /// How long each answer is waited for.
    pub(crate) patience: Span,
    until: Instant,
    /// Time from which progress is told again.
    next_progress: Instant,
}

/// Does an operation from its first message to its last.
pub(crate) async fn perform(
    multiplexer: &mut Multiplexer,
    request: &MailboxRequest,
    patience: Span,
) -> Result<Vec<u8>, MailboxFailure> {
    let operation = request.operation();
    let id = multiplexer.id();
    let (mut step, protocol) = (Step::Before, operation.protocol());
    let result = if multiplexer.speaks(protocol) {
        multiplexer.begin().await;
        let until = multiplexer.now();
        let patience = match protocol {
            MailboxType::Foe => patience.max(FILE_PATIENCE),
            MailboxType::Error
            | MailboxType::Aoe
            | MailboxType::Eoe
            | MailboxType::Coe
            | MailboxType::Soe
            | MailboxType::Voe
            | MailboxType::Reserved(_) => patience,
        };
        let next_progress = until;
        let mut transaction =
            MailboxTransaction { multiplexer, step, patience, until, next_progress };
        let result = transaction.go(request).await;
        step = transaction.step;
        result
    } else {
        Err(Why::NotSpoken { protocol })
    };
    result.map_err(|why| {
        multiplexer.failed(&why);
        MailboxFailure { id, operation, step, why }
    })
}

impl MailboxTransaction<'_> {
    async fn go(&mut self, request: &MailboxRequest) -> Result<Vec<u8>, Why> {
        match request {
            MailboxRequest::Upload { object, complete } => {
                coe::upload(self, *object, *complete).await
            }
            MailboxRequest::Download { object, complete, data } => {
                coe::download(self, *object, *complete, data).await.map(|()| Vec::new())
            }
            MailboxRequest::ObjectList { list } => information::list(self, *list).await,
            MailboxRequest::DescribeObject { index } => information::object(self, *index).await,
            MailboxRequest::DescribeEntry { object, values } => {
                information::entry(self, *object, *values).await
            }
            MailboxRequest::SetAddresses { port, parameters } => {
                settings::set_addresses(self, *port, parameters).await.map(|()| Vec::new())
            }
            MailboxRequest::SendFrame { port, number, frame } => {
                ethernet::send_frame(self, *port, *number, frame).await
            }
            MailboxRequest::ReadIdn { drive, idn, elements } => {
                let (drive, idn, elements) = (*drive, *idn, *elements);
                soe::read(self, IdnElements { drive, idn, elements }).await
            }
            MailboxRequest::WriteIdn { drive, idn, elements, data } => {
                let (drive, idn, elements) = (*drive, *idn, *elements);
                let about = IdnElements { drive, idn, elements };
                soe::write(self, about, data).await.map(|()| Vec::new())
            }
            MailboxRequest::ReadFile { name, password } => foe::read(self, name, *password).await,
            MailboxRequest::WriteFile { name, password, data } => {
                foe::write(self, name, *password, data).await.map(|()| Vec::new())
            }
            MailboxRequest::Ads { net_id, port, source, command, data } => {
                let net_id = net_id.unwrap_or(self.multiplexer.net_id());
                let target = AmsAddress { net_id, port: *port };
                aoe::ask(self, target, source.unwrap_or(OWN_ADDRESS), *command, data).await
            }
            MailboxRequest::SendVendorMessage { data, answer_within } => {
                voe::send(self, data, *answer_within).await
            }
            MailboxRequest::Pass { kind, data, .. } => pass::pass(self, *kind, data).await,
        }
    }

    /// Sends a message; `write` writes what follows the mailbox header. Its answer is waited for from
    /// now on.
    pub(crate) async fn say(
        &mut self,
        kind: MailboxType,
        write: impl FnOnce(&mut [u8]) -> Result<usize, BufferTooSmall>,
    ) -> Result<(), Why> {
        if self.step == Step::Before {
            self.step = Step::Request;
        }
        self.until = self.multiplexer.now() + self.patience;
        let full = Why::MailboxFull { patience: self.patience };
        if self.multiplexer.send(kind, write, self.until).await? { Ok(()) } else { Err(full) }
    }

    /// The next message of this protocol.
    pub(crate) async fn hear(&mut self, kind: MailboxType) -> Result<Vec<u8>, Why> {
        match self.multiplexer.receive(kind, self.until).await? {
            Some(data) => Ok(data),
            None => {
                let rubbish = self.multiplexer.rubbish();
                Err(Why::NoAnswer { patience: self.patience, rubbish })
            }
        }
    }

    /// Something came, and more is to come: it is waited for as long again.
    pub(crate) fn wait_anew(&mut self) {
        self.until = self.multiplexer.now() + self.patience;
    }

    /// Tells how far a file has come, if it is time.
    pub(crate) fn tell_progress(&mut self, busy: Option<FileBusy>) {
        let now = self.multiplexer.now();
        if now < self.next_progress {
            return;
        }
        self.next_progress = now + PROGRESS_INTERVAL;
        let (done, total) = match self.step {
            Step::Packet { done, total, .. } => (done, total),
            Step::Before | Step::Request | Step::Segment(_) | Step::Fragment(_) => (0, None),
        };
        self.multiplexer.progress(FileProgress { done, total, busy });
    }

    /// An answer may or may not come: it is waited for so long.
    pub(crate) fn wait_no_longer_than(&mut self, span: Span) {
        self.until = self.multiplexer.now() + span;
    }

    /// Says something without caring for the answer, and whether it is heard.
    pub(crate) async fn mention(
        &mut self,
        kind: MailboxType,
        write: impl FnOnce(&mut [u8]) -> Result<usize, BufferTooSmall>,
    ) {
        let now = self.multiplexer.now();
        // Who does not take it has forgotten the operation anyway, or will be asked anew.
        let _ = self.multiplexer.send(kind, write, now).await;
    }
}
