//! SDO information: lists and descriptions of objects and entries, their fragments put together.

use linesman_proto::mailbox::coe::information::{
    Answer, Body, EntryDescription, ListKind, Message, ObjectDescription, ObjectList,
};
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};

use super::report::{MailboxProtocol, TransferOutcome};
use super::transfer::{MailboxTransfer, Store};
use super::{MailboxMessage, OpenTransfers};

/// Takes a message of SDO information.
pub(super) fn message(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
    told: &Message<'_>,
) {
    let whole = |index: ObjectIndex| Some(ObjectAddress { index, subindex: 0 });
    let (what, object) = match told.body {
        Body::ListRequest { list } => {
            mailbox.information = store.open(message, MailboxProtocol::CoE, "object-list");
            if let Some(transfer) = store.get(mailbox.information) {
                transfer.text = Some(list_name(list).to_owned());
            }
            return;
        }
        Body::ObjectRequest { index } => ("object-description", whole(index)),
        Body::EntryRequest { object, .. } => ("entry-description", Some(object)),
        Body::Answer { to, fragment } => {
            return answer(store, mailbox, message, told.incomplete, (to, fragment));
        }
        Body::Error { code } => {
            let index = mailbox.information.take();
            let index = index.or_else(|| store.open(message, MailboxProtocol::CoE, "abort"));
            if let Some(transfer) = store.get(index) {
                transfer.messages += 1;
                transfer.end(message.when, TransferOutcome::Refused, Some(code));
            }
            return;
        }
    };
    mailbox.information = store.open(message, MailboxProtocol::CoE, what);
    if let Some(transfer) = store.get(mailbox.information) {
        transfer.object = object;
    }
}

fn answer(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
    is_incomplete: bool,
    (to, fragment): (Answer, &[u8]),
) {
    let what = match to {
        Answer::List => "object-list",
        Answer::Object => "object-description",
        Answer::Entry => "entry-description",
    };
    if store.get(mailbox.information).is_none_or(|open| open.what != what) {
        mailbox.information = store.open(message, MailboxProtocol::CoE, what);
        if let Some(transfer) = store.get(mailbox.information) {
            transfer.messages = 0;
        }
    }
    let Some(transfer) = store.get(mailbox.information) else { return };
    transfer.messages += 1;
    transfer.push(fragment);
    let outcome = if is_incomplete { TransferOutcome::Unfinished } else { TransferOutcome::Done };
    transfer.end(message.when, outcome, None);
    if !is_incomplete {
        describe(transfer, to);
        mailbox.information = None;
    }
}

/// Says what the whole answer says.
fn describe(transfer: &mut MailboxTransfer, to: Answer) {
    let data = &transfer.data;
    let said = match to {
        Answer::List => ObjectList::parse(data).ok().map(|list| match list.counts() {
            Some([all, rx, tx, backup, settings]) => format!(
                "{all} objects, {rx} for outputs, {tx} for inputs, {backup} backup, {settings} settings"
            ),
            None => format!("{}: {} objects", list_name(list.kind), list.indices().count()),
        }),
        Answer::Object => ObjectDescription::parse(data).ok().map(|object| {
            let address = ObjectAddress { index: object.index, subindex: 0 };
            transfer.object.get_or_insert(address);
            let (name, last) = (object.name_text(), object.max_subindex);
            format!("{name}, {}, entries to {last}", object.data_type)
        }),
        Answer::Entry => EntryDescription::parse(data).ok().map(|entry| {
            transfer.object.get_or_insert(entry.object);
            format!("{}, {}, {} bits", entry.name_text(), entry.data_type, entry.bits)
        }),
    };
    transfer.text = said.or(transfer.text.take());
}

const fn list_name(list: ListKind) -> &'static str {
    match list {
        ListKind::Counts => "lengths of the lists",
        ListKind::All => "all objects",
        ListKind::RxPdoMappable => "objects for outputs",
        ListKind::TxPdoMappable => "objects for inputs",
        ListKind::Backup => "objects for backup",
        ListKind::Settings => "settings",
        ListKind::Other(_) => "a list that is not defined",
    }
}
