//! Messages of others, passed on: those of clients of the mailbox gateway.
//!
//! Reference: ETG.8200; ETG.1000.6 for what answers what. A message goes out as it came, but for its mailbox header,
//! which is ours; what answers it comes back as it is. Between the messages of one transfer (the segments of an
//! object, the packets of a file) nobody else may speak to the SubDevice, or it would give the transfer up: whether
//! one is under way is read off the messages.

use linesman_proto::ads::AmsHeader;
use linesman_proto::mailbox::coe::information::Body;
use linesman_proto::mailbox::coe::sdo::{Request, Response};
use linesman_proto::mailbox::coe::{Message as CoeMessage, ObjectAddress};
use linesman_proto::mailbox::foe::{Message as FoeMessage, chunk_len};
use linesman_proto::mailbox::{
    BufferTooSmall, Counter, ErrorReply, ErrorReplyCode, Header, MailboxType, soe,
};

use super::failure::{Step, Why};
use super::transaction::MailboxTransaction;

/// All answers to one message together, in bytes: an object list is at most half as long.
const LONGEST: usize = 256 << 10;

/// What is known of the transfer whose messages are passed on.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct PassedTransfer {
    /// More messages of it are to come.
    pub(crate) under_way: bool,
    /// The last packet of a file has come: its acknowledgement is not answered.
    file_read: bool,
}

/// Passes a message on, and gives the mailbox messages that answer it, one behind the other; none where it is not
/// answered.
pub(crate) async fn pass(
    transaction: &mut MailboxTransaction<'_>,
    kind: MailboxType,
    data: &[u8],
) -> Result<Vec<u8>, Why> {
    let before = std::mem::take(&mut transaction.multiplexer.passed);
    transaction.say(kind, |body| copy(data, body)).await?;
    let mut answers = Vec::new();
    if !is_answered(kind, data, before) {
        return Ok(answers);
    }
    let mut number = 0;
    loop {
        let answer = match transaction.hear(kind).await {
            Ok(answer) => answer,
            Err(Why::Mailbox { code }) => {
                append_error(&mut answers, code)?;
                return Ok(answers);
            }
            Err(why) => return Err(why),
        };
        // ADS numbers its requests, and a SubDevice may send some of its own.
        let may_be_other = transaction.multiplexer.may_be_late() || kind == MailboxType::Aoe;
        if may_be_other && !belongs(kind, data, &answer) {
            transaction.multiplexer.unasked(kind, answer);
            continue;
        }
        append(&mut answers, kind, &answer)?;
        if answers.len() > LONGEST {
            return Err(Why::TooLong { limit: LONGEST });
        }
        if !continues(kind, &answer) {
            let chunk = chunk_len(transaction.multiplexer.in_size());
            transaction.multiplexer.passed = transfer(kind, data, &answer, chunk);
            return Ok(answers);
        }
        number += 1;
        transaction.step = Step::Fragment(number);
        transaction.wait_anew();
    }
}

/// Writes a body that is ready.
pub(super) fn copy(data: &[u8], body: &mut [u8]) -> Result<usize, BufferTooSmall> {
    let (needed, available) = (data.len(), body.len());
    let slot = body.get_mut(..needed).ok_or(BufferTooSmall { needed, available })?;
    slot.copy_from_slice(data);
    Ok(needed)
}

fn append(answers: &mut Vec<u8>, kind: MailboxType, data: &[u8]) -> Result<(), Why> {
    let at = answers.len();
    answers.resize(at + linesman_proto::mailbox::HEADER_LEN + data.len(), 0);
    let header = Header::new(kind, Counter::NONE, 0);
    header.write_message(&mut answers[at..], |body| copy(data, body))?;
    Ok(())
}

fn append_error(answers: &mut Vec<u8>, code: ErrorReplyCode) -> Result<(), Why> {
    let mut body = [0; ErrorReply::LEN];
    ErrorReply { code }.write(&mut body)?;
    append(answers, MailboxType::Error, &body)
}

/// True if a SubDevice answers such a message.
fn is_answered(kind: MailboxType, data: &[u8], before: PassedTransfer) -> bool {
    match kind {
        MailboxType::Coe => {
            !matches!(CoeMessage::parse(data), Ok(CoeMessage::Abort(_) | CoeMessage::Pdo { .. }))
        }
        MailboxType::Foe => match FoeMessage::parse(data) {
            Ok(FoeMessage::Error { .. }) => false,
            Ok(FoeMessage::Ack { .. }) => !before.file_read,
            Ok(
                FoeMessage::Read { .. }
                | FoeMessage::Write { .. }
                | FoeMessage::Data { .. }
                | FoeMessage::Busy { .. },
            )
            | Err(_) => true,
        },
        MailboxType::Soe => soe::Message::parse(data).is_none_or(|message| {
            let tells = matches!(
                message.operation,
                soe::Operation::Notification | soe::Operation::Emergency
            );
            !(tells || message.operation == soe::Operation::WriteRequest && message.incomplete)
        }),
        MailboxType::Error
        | MailboxType::Aoe
        | MailboxType::Eoe
        | MailboxType::Voe
        | MailboxType::Reserved(_) => true,
    }
}

/// True if another message follows this answer without being asked for.
fn continues(kind: MailboxType, answer: &[u8]) -> bool {
    match kind {
        MailboxType::Coe => {
            matches!(CoeMessage::parse(answer), Ok(CoeMessage::Information(message)) if message.incomplete)
        }
        MailboxType::Soe => soe::Message::parse(answer).is_some_and(|message| message.incomplete),
        MailboxType::Error
        | MailboxType::Aoe
        | MailboxType::Eoe
        | MailboxType::Foe
        | MailboxType::Voe
        | MailboxType::Reserved(_) => false,
    }
}

/// False if an answer is about something else than the message, such as the late one to a transfer that was given
/// up.
fn belongs(kind: MailboxType, data: &[u8], answer: &[u8]) -> bool {
    if kind == MailboxType::Aoe {
        return match (AmsHeader::parse(data), AmsHeader::parse(answer)) {
            (Ok((asked, _)), Ok((answered, _))) => {
                answered.is_answer() && answered.invoke_id == asked.invoke_id
            }
            (Err(_), _) | (_, Err(_)) => true,
        };
    }
    if kind != MailboxType::Coe {
        return true;
    }
    let (Ok(asked), Ok(answered)) = (CoeMessage::parse(data), CoeMessage::parse(answer)) else {
        return true;
    };
    match (asked, answered) {
        (CoeMessage::SdoRequest(asked), CoeMessage::SdoResponse(answered)) => {
            match (asked_object(&asked), answered_object(&answered)) {
                (Some(asked), Some(answered)) => asked.index == answered.index,
                (None, None) => true,
                (Some(_), None) | (None, Some(_)) => false,
            }
        }
        (CoeMessage::Information(_), CoeMessage::Information(answer)) => {
            matches!(answer.body, Body::Answer { .. } | Body::Error { .. })
        }
        (CoeMessage::Information(_), CoeMessage::SdoResponse(_))
        | (CoeMessage::SdoRequest(_), CoeMessage::Information(_)) => false,
        _ => true,
    }
}

/// The object that a request begins with; `None` for a segment.
fn asked_object(request: &Request<'_>) -> Option<ObjectAddress> {
    match request {
        Request::Upload { object, .. } | Request::Download { object, .. } => Some(*object),
        Request::UploadSegment { .. } | Request::DownloadSegment(_) => None,
    }
}

/// The object that an answer names; `None` for a segment.
fn answered_object(response: &Response<'_>) -> Option<ObjectAddress> {
    match response {
        Response::Upload { object, .. } | Response::Download { object, .. } => Some(*object),
        Response::UploadSegment(_) | Response::DownloadSegment { .. } => None,
    }
}

/// The transfer after a message and its last answer. A packet of a file that holds less than `chunk` bytes is the
/// last.
fn transfer(kind: MailboxType, data: &[u8], answer: &[u8], chunk: usize) -> PassedTransfer {
    match kind {
        MailboxType::Coe => {
            let (Ok(CoeMessage::SdoRequest(request)), Ok(CoeMessage::SdoResponse(response))) =
                (CoeMessage::parse(data), CoeMessage::parse(answer))
            else {
                return PassedTransfer::default();
            };
            let under_way = match (request, response) {
                (_, Response::Upload { initial, .. }) => !initial.is_complete(),
                (_, Response::UploadSegment(segment)) => !segment.last,
                (Request::Download { initial, .. }, Response::Download { .. }) => {
                    !initial.is_complete()
                }
                (Request::DownloadSegment(segment), Response::DownloadSegment { .. }) => {
                    !segment.last
                }
                (_, Response::Download { .. } | Response::DownloadSegment { .. }) => false,
            };
            PassedTransfer { under_way, file_read: false }
        }
        MailboxType::Foe => match (FoeMessage::parse(data), FoeMessage::parse(answer)) {
            // The acknowledgement of the last packet is to come, and belongs to it.
            (_, Ok(FoeMessage::Data { data, .. })) => {
                PassedTransfer { under_way: true, file_read: data.len() < chunk }
            }
            (_, Ok(FoeMessage::Error { .. }) | Err(_)) => PassedTransfer::default(),
            (Ok(FoeMessage::Data { data: sent, .. }), Ok(FoeMessage::Ack { .. })) => {
                PassedTransfer { under_way: sent.len() >= chunk, file_read: false }
            }
            (_, Ok(_)) => PassedTransfer { under_way: true, file_read: false },
        },
        MailboxType::Error
        | MailboxType::Aoe
        | MailboxType::Eoe
        | MailboxType::Soe
        | MailboxType::Voe
        | MailboxType::Reserved(_) => PassedTransfer::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Room of a packet in the tests.
    const CHUNK: usize = 4;

    fn foe(message: FoeMessage<'_>) -> Vec<u8> {
        let mut bytes = vec![0; 32];
        let len = message.write(&mut bytes).unwrap();
        bytes.truncate(len);
        bytes
    }

    #[test]
    fn transfer_of_an_object_lasts_until_its_last_segment() {
        let under_way = |asked: &[u8], answer: &[u8]| {
            transfer(MailboxType::Coe, asked, answer, CHUNK).under_way
        };
        let upload = [0, 0x20, 0x40, 0x08, 0x10, 0, 0, 0, 0, 0];
        // Four bytes at once; 20 bytes of which 2 are here.
        assert!(!under_way(&upload, &[0, 0x30, 0x43, 0x08, 0x10, 0, 1, 2, 3, 4]));
        assert!(under_way(&upload, &[0, 0x30, 0x41, 0x08, 0x10, 0, 20, 0, 0, 0, 1, 2]));
        let segment = [0, 0x20, 0x60, 0, 0, 0, 0, 0, 0, 0];
        assert!(under_way(&segment, &[0, 0x30, 0x00, 1, 2, 3, 4, 5, 6, 7]));
        assert!(!under_way(&segment, &[0, 0x30, 0x01, 1, 2, 3, 4, 5, 6, 7]));
        let download = [0, 0x20, 0x21, 0x10, 0x80, 1, 20, 0, 0, 0, 1, 2];
        let taken = [0, 0x30, 0x60, 0x10, 0x80, 1, 0, 0, 0, 0];
        assert!(under_way(&download, &taken));
        let segment_taken = [0, 0x30, 0x20, 0, 0, 0, 0, 0, 0, 0];
        assert!(under_way(&[0, 0x20, 0x00, 1, 2, 3, 4, 5, 6, 7], &segment_taken));
        assert!(!under_way(&[0, 0x20, 0x01, 1, 2, 3, 4, 5, 6, 7], &segment_taken));
        // An abort ends it, and a question about the dictionary is none.
        assert!(!under_way(&segment, &[0, 0x20, 0x80, 0x08, 0x10, 0, 0, 0, 4, 5]));
        assert!(!under_way(&[0, 0x80, 1, 0, 0, 0, 1, 0], &[0, 0x80, 2, 0, 0, 0, 1, 0]));
    }

    #[test]
    fn transfer_of_a_file_lasts_until_its_last_packet_is_acknowledged() {
        let after = |asked: FoeMessage<'_>, answer: FoeMessage<'_>| {
            transfer(MailboxType::Foe, &foe(asked), &foe(answer), CHUNK)
        };
        let ack = |packet| FoeMessage::Ack { packet };
        let data = |packet, data| FoeMessage::Data { packet, data };
        let full = after(ack(1), data(2, &[1, 2, 3, 4]));
        assert_eq!(full, PassedTransfer { under_way: true, file_read: false });
        let last = after(ack(2), data(3, &[1]));
        assert_eq!(last, PassedTransfer { under_way: true, file_read: true });
        // The acknowledgement of the last packet is answered by nobody, that of others is.
        assert!(is_answered(MailboxType::Foe, &foe(ack(2)), full));
        assert!(!is_answered(MailboxType::Foe, &foe(ack(3)), last));
        assert!(after(data(1, &[1, 2, 3, 4]), ack(1)).under_way);
        assert!(!after(data(2, &[]), ack(2)).under_way);
        assert!(after(data(2, &[1]), FoeMessage::Busy { done: 0, total: 0, text: b"" }).under_way);
    }

    #[test]
    fn messages_that_nobody_answers_are_not_waited_for() {
        let answered = |kind, data: &[u8]| is_answered(kind, data, PassedTransfer::default());
        assert!(!answered(MailboxType::Coe, &[0, 0x20, 0x80, 0x08, 0x10, 0, 0, 0, 4, 5]), "abort");
        assert!(answered(MailboxType::Coe, &[0, 0x20, 0x40, 0x08, 0x10, 0, 0, 0, 0, 0]));
        assert!(!answered(MailboxType::Foe, &[5, 0, 0, 0x80, 0, 0]), "error");
        // SoE: a write request of which more is to come, a notification.
        assert!(!answered(MailboxType::Soe, &[0x0B, 0x40, 1, 0, 7]));
        assert!(!answered(MailboxType::Soe, &[0x05, 0x40, 1, 0, 7]));
        assert!(answered(MailboxType::Soe, &[0x03, 0x40, 1, 0, 7]));
        assert!(answered(MailboxType::Voe, &[]) && answered(MailboxType::Aoe, &[]));
    }

    #[test]
    fn fragments_are_collected_and_late_answers_about_others_are_left_out() {
        let coe = MailboxType::Coe;
        assert!(continues(coe, &[0, 0x80, 0x82, 0, 1, 0, 1, 0]));
        assert!(!continues(coe, &[0, 0x80, 0x02, 0, 0, 0, 1, 0]));
        assert!(continues(MailboxType::Soe, &[0x0A, 0x40, 1, 0, 7]));
        let upload = [0, 0x20, 0x40, 0x18, 0x10, 1, 0, 0, 0, 0];
        let answer = |index: u8| [0, 0x30, 0x43, index, 0x10, 1, 1, 2, 3, 4];
        assert!(belongs(coe, &upload, &answer(0x18)));
        assert!(!belongs(coe, &upload, &answer(0x08)));
        assert!(!belongs(coe, &upload, &[0, 0x30, 0x01, 1, 2, 3, 4, 5, 6, 7]), "a segment");
        assert!(!belongs(coe, &upload, &[0, 0x80, 0x02, 0, 0, 0, 1, 0]), "a list");
        assert!(belongs(coe, &upload, &[0, 0x20, 0x80, 0x18, 0x10, 1, 0, 0, 2, 6]), "an abort");
        let ads = |flags: u16, invoke_id| AmsHeader { flags, invoke_id, ..AmsHeader::default() };
        let asked = ads(4, 7).message(&[]);
        assert!(belongs(MailboxType::Aoe, &asked, &ads(5, 7).message(&[0; 4])));
        assert!(!belongs(MailboxType::Aoe, &asked, &ads(5, 6).message(&[0; 4])), "a late one");
        assert!(!belongs(MailboxType::Aoe, &asked, &ads(4, 7).message(&[])), "its own request");
    }
}
