//! Requests that are not passed on whatever the state of the line, and what is answered then.

use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::sdo::{Abort, Request};
use linesman_proto::mailbox::coe::{Message as CoeMessage, ObjectAddress};
use linesman_proto::mailbox::foe::{FoeErrorCode, Message as FoeMessage};
use linesman_proto::mailbox::{
    BufferTooSmall, Counter, ErrorReply, ErrorReplyCode, Header, MailboxType,
};

use super::counts::GatewayRefusal;

/// Room for a refusal, in bytes.
const ROOM: usize = 64;

/// A request that is not passed on.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct ScreenedOut {
    pub(super) why: GatewayRefusal,
    /// The mailbox message that says so in the words of its protocol; empty where nothing is answered.
    pub(super) answer: Vec<u8>,
}

/// Looks whether a request may be passed on.
///
/// # Errors
/// [`ScreenedOut`] when it may not.
pub(super) fn screen(kind: MailboxType, data: &[u8], read_only: bool) -> Result<(), ScreenedOut> {
    match kind {
        // EoE: the IP stack of this computer routes to its SubDevices itself (ETG.8200).
        MailboxType::Eoe | MailboxType::Error | MailboxType::Reserved(_) => {
            Err(ScreenedOut { why: GatewayRefusal::Protocol, answer: Vec::new() })
        }
        MailboxType::Coe if !read_only || only_reads(data) => Ok(()),
        MailboxType::Aoe | MailboxType::Foe | MailboxType::Soe | MailboxType::Voe if !read_only => {
            Ok(())
        }
        MailboxType::Coe
        | MailboxType::Aoe
        | MailboxType::Foe
        | MailboxType::Soe
        | MailboxType::Voe => {
            let answer = refusal(kind, data).unwrap_or_default();
            Err(ScreenedOut { why: GatewayRefusal::ReadOnly, answer })
        }
    }
}

/// True if a CoE message changes nothing: an upload, its end, or a question about the dictionary.
fn only_reads(data: &[u8]) -> bool {
    match CoeMessage::parse(data) {
        Ok(CoeMessage::SdoRequest(request)) => {
            matches!(request, Request::Upload { .. } | Request::UploadSegment { .. })
        }
        Ok(CoeMessage::Information(_) | CoeMessage::Abort(_)) => true,
        Ok(CoeMessage::Emergency(_) | CoeMessage::SdoResponse(_) | CoeMessage::Pdo { .. })
        | Err(_) => false,
    }
}

/// "Read-only" in the words of a protocol.
fn refusal(kind: MailboxType, data: &[u8]) -> Result<Vec<u8>, BufferTooSmall> {
    match kind {
        MailboxType::Coe => {
            let object = match CoeMessage::parse(data) {
                Ok(CoeMessage::SdoRequest(Request::Download { object, .. })) => object,
                _ => ObjectAddress::default(),
            };
            let abort = Abort { object, code: SdoAbortCode::READ_ONLY.value() };
            message(kind, |body| CoeMessage::Abort(abort).write(body))
        }
        MailboxType::Foe => {
            let error = FoeMessage::Error { code: FoeErrorCode::ACCESS_DENIED, text: b"read-only" };
            message(kind, |body| error.write(body))
        }
        MailboxType::Error
        | MailboxType::Aoe
        | MailboxType::Eoe
        | MailboxType::Soe
        | MailboxType::Voe
        | MailboxType::Reserved(_) => error_reply(ErrorReplyCode::ServiceNotSupported),
    }
}

/// A mailbox error reply, as a message.
pub(super) fn error_reply(code: ErrorReplyCode) -> Result<Vec<u8>, BufferTooSmall> {
    message(MailboxType::Error, |body| ErrorReply { code }.write(body))
}

fn message(
    kind: MailboxType,
    write: impl FnOnce(&mut [u8]) -> Result<usize, BufferTooSmall>,
) -> Result<Vec<u8>, BufferTooSmall> {
    let mut bytes = vec![0; ROOM];
    let len = Header::new(kind, Counter::NONE, 0).write_message(&mut bytes, write)?;
    bytes.truncate(len);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use linesman_proto::mailbox::Message;

    use super::*;

    /// The data of a message, as they are screened.
    fn screened(kind: MailboxType, data: &[u8]) -> Option<GatewayRefusal> {
        let why = |read_only| screen(kind, data, read_only).err().map(|out| out.why);
        if let Some(why) = why(false) {
            assert_eq!(why, GatewayRefusal::Protocol);
        }
        why(true)
    }

    #[test]
    fn read_only_lets_uploads_and_questions_through_and_nothing_else() {
        use MailboxType::{Aoe, Coe, Foe, Soe, Voe};
        let upload = [0, 0x20, 0x40, 0x18, 0x10, 1, 0, 0, 0, 0];
        let segment = [0, 0x20, 0x60, 0, 0, 0, 0, 0, 0, 0];
        let abort = [0, 0x20, 0x80, 0x18, 0x10, 1, 0, 0, 4, 5];
        let list = [0, 0x80, 1, 0, 0, 0, 1, 0];
        for reads in [&upload[..], &segment, &abort, &list] {
            assert_eq!(screened(Coe, reads), None, "{reads:?}");
        }
        let download = [0, 0x20, 0x23, 0x10, 0x80, 1, 7, 0, 0, 0];
        let download_segment = [0, 0x20, 0x01, 1, 2, 3, 4, 5, 6, 7];
        for changes in [&download[..], &download_segment, &[0, 0x50, 1], &[0, 0], &[]] {
            assert_eq!(screened(Coe, changes), Some(GatewayRefusal::ReadOnly), "{changes:?}");
        }
        for kind in [Aoe, Foe, Soe, Voe] {
            assert_eq!(screened(kind, &[1, 0, 0, 0, 0, 0]), Some(GatewayRefusal::ReadOnly));
        }
    }

    #[test]
    fn refusals_of_a_read_only_gateway_are_answers_of_the_protocol() {
        let answer = |kind, data: &[u8]| screen(kind, data, true).unwrap_err().answer;
        let download = [0, 0x20, 0x23, 0x10, 0x80, 1, 7, 0, 0, 0];
        let aborted = answer(MailboxType::Coe, &download);
        let abort = Message::parse(&aborted).unwrap();
        let expected = Abort { object: ObjectAddress::new(0x8010, 1), code: 0x0601_0002 };
        assert_eq!(CoeMessage::parse(abort.data), Ok(CoeMessage::Abort(expected)));
        let file = answer(MailboxType::Foe, &[2, 0, 0, 0, 0, 0, b'a']);
        let error = FoeMessage::parse(Message::parse(&file).unwrap().data).unwrap();
        assert!(matches!(error, FoeMessage::Error { code: FoeErrorCode::ACCESS_DENIED, .. }));
        let drive = answer(MailboxType::Soe, &[3, 0x40, 32, 0, 1]);
        assert_eq!(Message::parse(&drive).unwrap().header.kind, MailboxType::Error);
    }

    #[test]
    fn ethernet_errors_and_reserved_types_are_never_passed_on() {
        use MailboxType::{Eoe, Error, Reserved};
        for kind in [Eoe, Error, Reserved(6), Reserved(14)] {
            let out = screen(kind, &[0; 8], false).unwrap_err();
            assert_eq!((out.why, out.answer.len()), (GatewayRefusal::Protocol, 0), "{kind}");
        }
    }
}
