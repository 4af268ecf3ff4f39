//! Mailbox messages put together: each request with its answer, all segments and fragments of it.
//!
//! A message is what was written to, or read from, process RAM at the start of a mailbox. Where the set-up of the
//! SyncManagers was recorded, other parts of the RAM are told apart by it; else a message is known by its header and
//! by what follows it. Read first: ETG.1000.4 mailbox, ETG.1000.6 CoE.

mod coe;
mod eoe;
mod foe;
mod information;
mod objects;
mod report;
mod soe;
mod transfer;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use linesman_diagnosis::model::NetworkModel;
use linesman_diagnosis::report::Number;
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::mailbox::error_reply::ErrorReply;
use linesman_proto::mailbox::{MailboxType, header};
use linesman_proto::register::SmMode;

pub(crate) use objects::PdoObjects;
pub use report::{MailboxProtocol, TransferOutcome, TransferReport};
pub use transfer::MailboxTransfer;

use crate::access::{DatagramAccess, DatagramTarget};
use eoe::Assemblies;
use transfer::{SeenAt, Store};

/// Process RAM begins here.
pub(crate) const FIRST_RAM: RegisterAddress = RegisterAddress(0x1000);

/// The dialogue of all mailboxes.
#[derive(Clone, Default, Debug)]
pub struct Dialogue {
    store: Store,
    mailboxes: BTreeMap<DatagramTarget, OpenTransfers>,
}

/// One mailbox: what is under way, as indexes of transfers.
#[derive(Clone, Default, Debug)]
struct OpenTransfers {
    sdo: Option<usize>,
    information: Option<usize>,
    foe: Option<usize>,
    soe: Option<usize>,
    eoe_setting: Option<usize>,
    eoe: Assemblies,
}

/// A message with its way.
#[derive(Clone, Copy, Debug)]
struct MailboxMessage<'a> {
    kind: MailboxType,
    body: &'a [u8],
    /// True if the MainDevice sent it.
    is_request: bool,
    target: DatagramTarget,
    when: SeenAt,
}

impl Dialogue {
    /// Takes a datagram.
    pub(crate) fn access(&mut self, model: &NetworkModel, access: &DatagramAccess<'_>) {
        let is_single =
            matches!(access.target, DatagramTarget::Station(_) | DatagramTarget::Position(_));
        if !is_single || access.address < FIRST_RAM || access.effect.multiple_write {
            return;
        }
        let (data, is_request) = match (access.written, access.read) {
            // Nobody has taken it: the mailbox was full, or there is none. It is sent again.
            (Some(written), None) if access.wkc.is_none_or(|wkc| wkc > 0) => (written, true),
            (None, Some(read)) => (read, false),
            (_, _) => return,
        };
        if is_process_data(model, access) {
            return;
        }
        let Some((kind, body)) = message(data) else { return };
        let when = SeenAt { at: access.at, frame: access.frame };
        let message = MailboxMessage { kind, body, is_request, target: access.target, when };
        self.message(model, &message);
    }

    fn message(&mut self, model: &NetworkModel, message: &MailboxMessage<'_>) {
        let mailbox = self.mailboxes.entry(message.target).or_default();
        let store = &mut self.store;
        match message.kind {
            MailboxType::Coe => coe::message(store, mailbox, message),
            MailboxType::Foe => foe::message(store, mailbox, message, chunk(model, message.target)),
            MailboxType::Eoe => eoe::message(store, mailbox, message),
            MailboxType::Soe => soe::message(store, mailbox, message),
            MailboxType::Error => error_reply(store, mailbox, message),
            MailboxType::Aoe => store.single(message, MailboxProtocol::Aoe, "message"),
            MailboxType::Voe => store.single(message, MailboxProtocol::Voe, "message"),
            MailboxType::Reserved(_) => {}
        }
    }

    /// Number of SubDevices that sent or were sent mailbox messages.
    #[must_use]
    pub fn mailboxes(&self) -> usize {
        self.mailboxes.len()
    }

    /// Objects that say what the process data of SubDevices consist of.
    pub(crate) fn pdo_objects(&self, model: &NetworkModel) -> BTreeMap<DeviceId, PdoObjects> {
        let mut all: BTreeMap<DeviceId, PdoObjects> = BTreeMap::new();
        for transfer in self.store.transfers.iter().filter(|one| PdoObjects::concerns(one)) {
            if let Some(id) = transfer.target.device(model) {
                all.entry(id).or_default().learn(transfer);
            }
        }
        all
    }

    /// The transfers in order of time, and how many were left out.
    pub(crate) fn report(&self, model: &NetworkModel) -> (Vec<TransferReport>, Number) {
        let transfers = self.store.transfers.iter();
        (
            transfers.map(|transfer| report::of(transfer, model)).collect(),
            self.store.left_out.into(),
        )
    }
}

/// Kind and body of a mailbox message, if the bytes can be one.
fn message(data: &[u8]) -> Option<(MailboxType, &[u8])> {
    let message = header::Message::parse(data).ok()?;
    (message.header.length > 0).then_some((message.header.kind, message.data))
}

/// True if a SyncManager that is no mailbox holds the address.
fn is_process_data(model: &NetworkModel, access: &DatagramAccess<'_>) -> bool {
    let Some(device) = access.target.device(model).and_then(|id| model.device(id)) else {
        return false;
    };
    device.set_up.sync_managers.values().any(|config| {
        config.control.mode() == SmMode::Buffered
            && config.is_active()
            && config.touches(access.address, 1)
    })
}

/// Bytes of a file that a packet has at most, by the length of the mailbox that was set up.
fn chunk(model: &NetworkModel, target: DatagramTarget) -> Option<usize> {
    let device = model.device(target.device(model)?)?;
    let mailbox = device.set_up.sync_managers.get(&0).filter(|config| config.is_active())?;
    Some(linesman_proto::mailbox::foe::chunk_len(usize::from(mailbox.length)))
}

/// The mailbox itself refuses a message: that which waits for its answer.
fn error_reply(store: &mut Store, mailbox: &mut OpenTransfers, message: &MailboxMessage<'_>) {
    let Ok(reply) = ErrorReply::parse(message.body) else { return };
    let OpenTransfers { sdo, information, foe, soe, eoe_setting, eoe: _ } = mailbox;
    let waiting = [sdo, information, foe, soe, eoe_setting];
    let found = waiting.into_iter().find_map(Option::take);
    let index = found.or_else(|| store.open(message, MailboxProtocol::Mailbox, "error-reply"));
    if let Some(transfer) = store.get(index) {
        transfer.text = Some(reply.code.text().to_owned());
        transfer.end(message.when, TransferOutcome::Refused, Some(u32::from(reply.code.code())));
    }
}
