//! SDO transfers: expedited, normal, segmented, with or without complete access.
//!
//! Reference: ETG.1000.6, SDO; the messages are those of `proto::mailbox::coe`.

use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::sdo::{Abort, Initial, Request, Response, Segment};
use linesman_proto::mailbox::coe::{CoeError, Message, ObjectAddress};
use linesman_proto::mailbox::error_reply::ErrorReplyCode;
use linesman_proto::mailbox::{BufferTooSmall, MailboxType};
use linesman_proto::time::Span;

use super::multiplexer::Multiplexer;
use crate::exchange::ExchangeError;

/// An SDO transfer that came to nothing.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SdoError {
    /// The SubDevice ended it.
    #[error("SubDevice {} aborted access to {object}: {code}", id.no())]
    Aborted {
        /// Which.
        id: DeviceId,
        /// What was asked for.
        object: ObjectAddress,
        /// Why.
        code: SdoAbortCode,
    },
    /// No answer came.
    #[error(
        "SubDevice {} did not answer the access to {object} within {patience}; its mailbox takes \
         messages, so its software is slow or stuck", id.no()
    )]
    NoAnswer {
        /// Which.
        id: DeviceId,
        /// What was asked for.
        object: ObjectAddress,
        /// How long it was waited for.
        patience: Span,
    },
    /// It does not fetch what is written to its mailbox.
    #[error("the mailbox of SubDevice {} stays full: its software does not read it", id.no())]
    MailboxFull {
        /// Which.
        id: DeviceId,
    },
    /// It answers with a mailbox error.
    #[error("SubDevice {} refuses the message: {}", id.no(), code.text())]
    Mailbox {
        /// Which.
        id: DeviceId,
        /// Why.
        code: ErrorReplyCode,
    },
    /// It has no mailbox, or none is open in its state.
    #[error("SubDevice {} has no open mailbox: it needs one, and a state from PREOP up", id.no())]
    NotOpen {
        /// Which.
        id: DeviceId,
    },
    /// It answers something that does not belong there.
    #[error("SubDevice {} answers the access to {object} with {found}", id.no())]
    Protocol {
        /// Which.
        id: DeviceId,
        /// What was asked for.
        object: ObjectAddress,
        /// What came.
        found: String,
    },
    /// It cannot be reached.
    #[error(transparent)]
    Exchange(#[from] ExchangeError),
    /// The message does not fit into its mailbox.
    #[error(transparent)]
    TooSmall(#[from] BufferTooSmall),
}

struct Transfer<'a, 'b> {
    multiplexer: &'a mut Multiplexer<'b>,
    object: ObjectAddress,
    patience: Span,
}

/// A transfer longer than this is not believed.
const LONGEST: usize = 16 << 20;

/// Fetches an object.
pub(crate) async fn upload(
    multiplexer: &mut Multiplexer<'_>,
    object: ObjectAddress,
    complete: bool,
    patience: Span,
) -> Result<Vec<u8>, SdoError> {
    let mut transfer = Transfer { multiplexer, object, patience };
    let answer = transfer.ask(Request::Upload { object, complete }).await?;
    let (mut data, size) = match response(&answer) {
        Ok(Response::Upload { initial, .. }) => (initial.data().to_vec(), initial.size()),
        other => return Err(transfer.unexpected(other)),
    };
    let size = usize::try_from(size).unwrap_or(LONGEST).min(LONGEST);
    let mut toggle = false;
    while data.len() < size {
        let answer = transfer.ask(Request::UploadSegment { toggle }).await?;
        let last = match response(&answer) {
            Ok(Response::UploadSegment(segment)) if segment.toggle == toggle => {
                data.extend_from_slice(segment.data);
                segment.last || segment.data.is_empty()
            }
            other => return Err(transfer.unexpected(other)),
        };
        toggle = !toggle;
        if last {
            break;
        }
    }
    Ok(data)
}

/// Brings an object.
pub(crate) async fn download(
    multiplexer: &mut Multiplexer<'_>,
    object: ObjectAddress,
    complete: bool,
    data: &[u8],
    patience: Span,
) -> Result<(), SdoError> {
    let mailbox_size = multiplexer.out_size();
    let mut transfer = Transfer { multiplexer, object, patience };
    let initial = Initial::of(data, mailbox_size);
    let mut rest = data.get(initial.data().len()..).unwrap_or_default();
    let answer = transfer.ask(Request::Download { object, complete, initial }).await?;
    match response(&answer) {
        Ok(Response::Download { .. }) => {}
        other => return Err(transfer.unexpected(other)),
    }
    let mut toggle = false;
    while !rest.is_empty() {
        let segment = Segment::of(rest, toggle, mailbox_size);
        rest = &rest[segment.data.len()..];
        let answer = transfer.ask(Request::DownloadSegment(segment)).await?;
        match response(&answer) {
            Ok(Response::DownloadSegment { toggle: back }) if back == toggle => {}
            other => return Err(transfer.unexpected(other)),
        }
        toggle = !toggle;
    }
    Ok(())
}

/// The SDO response in the data of a CoE message.
fn response(data: &[u8]) -> Result<Response<'_>, CoeError> {
    match Message::parse(data)? {
        Message::SdoResponse(response) => Ok(response),
        Message::Emergency(_)
        | Message::SdoRequest(_)
        | Message::Abort(_)
        | Message::Information(_)
        | Message::Pdo { .. } => Err(CoeError::UnknownSpecifier { what: "response", specifier: 0 }),
    }
}

impl Transfer<'_, '_> {
    /// Sends a request and waits for the message that answers it.
    async fn ask(&mut self, request: Request<'_>) -> Result<Vec<u8>, SdoError> {
        let until = self.multiplexer.now() + self.patience;
        let message = Message::SdoRequest(request);
        self.multiplexer.send(MailboxType::Coe, |body| message.write(body), until).await?;
        let (id, object) = (self.multiplexer.id(), self.object);
        loop {
            let Some(data) = self.multiplexer.receive_coe(until).await? else {
                return Err(SdoError::NoAnswer { id, object, patience: self.patience });
            };
            match Message::parse(&data) {
                Ok(Message::Abort(Abort { object: about, code, .. })) if about == object => {
                    let code = SdoAbortCode(code);
                    return Err(SdoError::Aborted { id, object, code });
                }
                Ok(Message::SdoResponse(
                    Response::Upload { object: about, .. }
                    | Response::Download { object: about, .. },
                )) if about != object => {
                    // The late answer to a transfer that was given up.
                }
                Ok(Message::SdoResponse(_)) => return Ok(data),
                Ok(
                    Message::Abort(_)
                    | Message::Emergency(_)
                    | Message::SdoRequest(_)
                    | Message::Information(_)
                    | Message::Pdo { .. },
                )
                | Err(_) => {}
            }
        }
    }

    fn unexpected(&self, found: Result<Response<'_>, CoeError>) -> SdoError {
        let found = match found {
            Ok(response) => format!("{response:?}"),
            Err(error) => error.to_string(),
        };
        SdoError::Protocol { id: self.multiplexer.id(), object: self.object, found }
    }
}
