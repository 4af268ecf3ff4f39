//! Files that are read and written.

use linesman_proto::mailbox::foe::Message;

use super::report::{MailboxProtocol, TransferOutcome};
use super::transfer::Store;
use super::{MailboxMessage, OpenTransfers};

/// Takes a message of type FoE. `chunk` is how many bytes of a file a packet has at most, where that is known.
pub(super) fn message(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
    chunk: Option<usize>,
) {
    let Ok(told) = Message::parse(message.body) else { return };
    let (what, name) = match told {
        Message::Read { name, .. } => ("read-file", name),
        Message::Write { name, .. } => ("write-file", name),
        Message::Data { .. }
        | Message::Ack { .. }
        | Message::Error { .. }
        | Message::Busy { .. } => {
            return follows(store, mailbox, message, &told, chunk);
        }
    };
    mailbox.foe = store.open(message, MailboxProtocol::FoE, what);
    if let Some(transfer) = store.get(mailbox.foe) {
        transfer.text = Some(text(name));
    }
}

fn follows(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
    told: &Message<'_>,
    chunk: Option<usize>,
) {
    if mailbox.foe.is_none() {
        // It began before the recording.
        let is_read = match told {
            Message::Data { .. } => !message.is_request,
            Message::Ack { .. } | Message::Busy { .. } => message.is_request,
            Message::Error { .. } | Message::Read { .. } | Message::Write { .. } => false,
        };
        let what = if is_read { "read-file" } else { "write-file" };
        mailbox.foe = store.open(message, MailboxProtocol::FoE, what);
        if let Some(transfer) = store.get(mailbox.foe) {
            (transfer.messages, transfer.asked) = (0, None);
        }
    }
    let Some(transfer) = store.get(mailbox.foe) else { return };
    transfer.messages += 1;
    match told {
        Message::Data { data, .. } => {
            // The first packet tells how long they are.
            let len = data.len() as u32;
            let full = chunk.map_or(*transfer.announced.get_or_insert(len), |chunk| chunk as u32);
            transfer.announced = Some(full);
            transfer.push(data);
            let is_last = len < full;
            transfer.end(
                message.when,
                if is_last { TransferOutcome::Done } else { TransferOutcome::Unfinished },
                None,
            );
        }
        Message::Ack { .. } => {
            transfer.answered = Some(message.when);
            match transfer.outcome {
                TransferOutcome::Done => mailbox.foe = None,
                TransferOutcome::Unanswered => transfer.outcome = TransferOutcome::Unfinished,
                TransferOutcome::Refused | TransferOutcome::Unfinished | TransferOutcome::Told => {}
            }
        }
        Message::Error { code, text: reason } => {
            let name = transfer.text.take().unwrap_or_default();
            transfer.text =
                Some(format!("{name}: {} {}", code.text(), text(reason)).trim().to_owned());
            transfer.end(message.when, TransferOutcome::Refused, Some(code.0));
            mailbox.foe = None;
        }
        Message::Busy { .. } | Message::Read { .. } | Message::Write { .. } => {
            transfer.answered = Some(message.when);
        }
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes)
        .trim_matches('\0')
        .chars()
        .filter(|one| !one.is_control())
        .collect()
}
