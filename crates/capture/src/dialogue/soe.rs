//! Parameters of drives (IDNs) that are read and written.

use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::mailbox::soe::{Message, Operation, elements_in_words};

use super::report::{MailboxProtocol, TransferOutcome};
use super::transfer::Store;
use super::{MailboxMessage, OpenTransfers};

/// Takes a message of type SoE.
pub(super) fn message(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
) {
    let Some(told) = Message::parse(message.body) else { return };
    let what = match told.operation {
        Operation::ReadRequest | Operation::ReadResponse => "read-idn",
        Operation::WriteRequest | Operation::WriteResponse => "write-idn",
        Operation::Notification => "notification",
        Operation::Emergency => "emergency",
        Operation::Reserved(_) => return,
    };
    if matches!(told.operation, Operation::Notification | Operation::Emergency) {
        let index = store.open(message, MailboxProtocol::SoE, what);
        if let Some(transfer) = store.get(index) {
            transfer.object = Some(ObjectAddress::new(told.number, 0));
            transfer.text = Some(about(&told));
            transfer.push(told.data);
            transfer.outcome = TransferOutcome::Told;
        }
        return;
    }
    let is_answer = matches!(told.operation, Operation::ReadResponse | Operation::WriteResponse);
    let is_open = store.get(mailbox.soe).is_some_and(|open| {
        open.what == what && (is_answer || open.outcome == TransferOutcome::Unfinished)
    });
    if !is_open {
        mailbox.soe = store.open(message, MailboxProtocol::SoE, what);
    }
    let Some(transfer) = store.get(mailbox.soe) else { return };
    transfer.messages += u32::from(is_open);
    // Of a part the number says how many follow.
    if !told.incomplete {
        transfer.object = Some(ObjectAddress::new(told.number, 0));
        transfer.text = Some(about(&told));
    }
    let carries = matches!(told.operation, Operation::ReadResponse | Operation::WriteRequest);
    if let Some(refusal) = told.refusal() {
        transfer.text = Some(format!("{}: {}", about(&told), refusal.text()));
        transfer.end(message.when, TransferOutcome::Refused, Some(u32::from(refusal.0)));
        mailbox.soe = None;
        return;
    }
    if carries {
        transfer.push(told.data);
    }
    match (is_answer, told.incomplete) {
        (true, true) => transfer.end(message.when, TransferOutcome::Unfinished, None),
        (true, false) => {
            transfer.end(message.when, TransferOutcome::Done, None);
            mailbox.soe = None;
        }
        (false, true) => transfer.outcome = TransferOutcome::Unfinished,
        (false, false) => transfer.outcome = TransferOutcome::Unanswered,
    }
}

/// Elements and drive, in words.
fn about(message: &Message<'_>) -> String {
    format!("{} of drive {}", elements_in_words(message.elements), message.drive)
}
