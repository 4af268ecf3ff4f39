//! SDO transfers, expedited, normal and in segments; emergencies; PDOs through the mailbox.

use linesman_proto::mailbox::coe::sdo::{Abort, Initial, Request, Response};
use linesman_proto::mailbox::coe::{Emergency, Message, ObjectAddress};

use super::report::{MailboxProtocol, TransferOutcome};
use super::transfer::{MailboxTransfer, Store};
use super::{MailboxMessage, OpenTransfers, information};

/// Takes a message of type CoE.
pub(super) fn message(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
) {
    match Message::parse(message.body) {
        Ok(Message::SdoRequest(asked)) if message.is_request => {
            request(store, mailbox, message, &asked);
        }
        Ok(Message::SdoResponse(answer)) if !message.is_request => {
            response(store, mailbox, message, &answer);
        }
        Ok(Message::Abort(abort)) => aborted(store, mailbox, message, abort),
        Ok(Message::Information(told)) => {
            information::message(store, mailbox, message, &told);
        }
        Ok(Message::Emergency(emergency)) if !message.is_request => {
            emergency_told(store, message, &emergency);
        }
        Ok(Message::Pdo { .. }) => store.single(message, MailboxProtocol::CoE, "pdo"),
        // An answer in the mailbox for requests, or bytes that only begin like a message.
        Ok(Message::SdoRequest(_) | Message::SdoResponse(_) | Message::Emergency(_)) | Err(_) => {}
    }
}

fn request(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
    asked: &Request<'_>,
) {
    let (what, object, complete) = match asked {
        Request::Upload { object, complete } => ("upload", *object, *complete),
        Request::Download { object, complete, .. } => ("download", *object, *complete),
        Request::DownloadSegment(segment) => {
            if let Some(transfer) = store.get(mailbox.sdo) {
                transfer.messages += 1;
                transfer.form = Some("segmented");
                transfer.push(segment.data);
            }
            return;
        }
        Request::UploadSegment { .. } => {
            if let Some(transfer) = store.get(mailbox.sdo) {
                transfer.messages += 1;
            }
            return;
        }
    };
    mailbox.sdo = store.open(message, MailboxProtocol::CoE, what);
    if let Some(transfer) = store.get(mailbox.sdo) {
        (transfer.object, transfer.complete) = (Some(object), complete);
        if let Request::Download { initial, .. } = asked {
            begin(transfer, initial);
        }
    }
}

/// Takes the first data.
fn begin(transfer: &mut MailboxTransfer, initial: &Initial<'_>) {
    transfer.form = Some(match initial {
        Initial::Expedited(_) => "expedited",
        Initial::Normal { .. } => "normal",
    });
    transfer.announced = Some(initial.size());
    (transfer.size, transfer.data) = (0, Vec::new());
    transfer.push(initial.data());
}

fn is_whole(transfer: &MailboxTransfer) -> bool {
    transfer.announced.is_none_or(|announced| transfer.size >= u64::from(announced))
}

fn response(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
    answer: &Response<'_>,
) {
    // Of a request that was not recorded the answer names the object, unless it is a segment.
    let named = |what: &str, object: ObjectAddress, transfer: &MailboxTransfer| {
        transfer.what == what && transfer.object.is_some_and(|asked| asked.index == object.index)
    };
    let begins = match answer {
        Response::Upload { object, complete, .. } => Some(("upload", *object, *complete)),
        Response::Download { object, complete } => Some(("download", *object, *complete)),
        Response::UploadSegment(_) | Response::DownloadSegment { .. } => None,
    };
    if let Some((what, object, complete)) = begins {
        let is_asked = store.get(mailbox.sdo).is_some_and(|open| named(what, object, open));
        if !is_asked {
            mailbox.sdo = store.open(message, MailboxProtocol::CoE, what);
            if let Some(transfer) = store.get(mailbox.sdo) {
                (transfer.object, transfer.complete) = (Some(object), complete);
                transfer.messages = 0;
            }
        }
    }
    let Some(transfer) = store.get(mailbox.sdo) else { return };
    transfer.messages += 1;
    let is_over = match answer {
        Response::Upload { initial, .. } => {
            begin(transfer, initial);
            is_whole(transfer)
        }
        Response::Download { .. } => is_whole(transfer),
        Response::UploadSegment(segment) => {
            transfer.form = Some("segmented");
            transfer.push(segment.data);
            segment.last
        }
        Response::DownloadSegment { .. } => is_whole(transfer),
    };
    let outcome = if is_over { TransferOutcome::Done } else { TransferOutcome::Unfinished };
    transfer.end(message.when, outcome, None);
    if is_over {
        mailbox.sdo = None;
    }
}

/// Either side ends a transfer.
fn aborted(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
    abort: Abort,
) {
    let open = mailbox.sdo.take();
    let index = open.or_else(|| store.open(message, MailboxProtocol::CoE, "abort"));
    if let Some(transfer) = store.get(index) {
        transfer.object.get_or_insert(abort.object);
        transfer.messages += u32::from(open.is_some());
        transfer.end(message.when, TransferOutcome::Refused, Some(abort.code));
    }
}

fn emergency_told(store: &mut Store, message: &MailboxMessage<'_>, emergency: &Emergency) {
    let index = store.open(message, MailboxProtocol::CoE, "emergency");
    if let Some(transfer) = store.get(index) {
        transfer.push(&emergency.data);
        transfer.text = Some(emergency.class().text().to_owned());
        (transfer.outcome, transfer.code) =
            (TransferOutcome::Told, Some(u32::from(emergency.code)));
    }
}
