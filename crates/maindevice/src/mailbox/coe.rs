//! SDO transfers: expedited, normal, segmented, with or without complete access.
//!
//! Reference: ETG.1000.6, SDO; the messages are those of `proto::mailbox::coe`.

use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::sdo::{Abort, Initial, Request, Response, Segment};
use linesman_proto::mailbox::coe::{CoeError, Message, ObjectAddress, ObjectIndex};

use super::failure::{Step, Why};
use super::transaction::MailboxTransaction;

/// A transfer longer than this is not believed.
const LONGEST: usize = 16 << 20;

/// Fetches an object.
pub(crate) async fn upload(
    transaction: &mut MailboxTransaction<'_>,
    object: ObjectAddress,
    complete: bool,
) -> Result<Vec<u8>, Why> {
    let mut transfer = SdoTransfer { transaction, object, complete };
    let result = transfer.upload().await;
    transfer.end(result).await
}

/// Brings an object.
pub(crate) async fn download(
    transaction: &mut MailboxTransaction<'_>,
    object: ObjectAddress,
    complete: bool,
    data: &[u8],
) -> Result<(), Why> {
    let mut transfer = SdoTransfer { transaction, object, complete };
    let result = transfer.download(data).await;
    transfer.end(result).await
}

struct SdoTransfer<'a, 'b> {
    transaction: &'a mut MailboxTransaction<'b>,
    object: ObjectAddress,
    complete: bool,
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

/// An answer, as messages name it.
fn name(response: &Response<'_>) -> String {
    match response {
        Response::Download { object, .. } => format!("the answer to a download of {object}"),
        Response::DownloadSegment { .. } => "the answer to a segment of a download".to_owned(),
        Response::Upload { object, .. } => format!("the answer to an upload of {object}"),
        Response::UploadSegment(_) => "a segment of an upload".to_owned(),
    }
}

const TURNED: &str = "the toggle bit turned";

fn wrong(expected: &'static str, found: impl Into<String>) -> Why {
    Why::Protocol { expected, found: found.into() }
}

impl SdoTransfer<'_, '_> {
    async fn upload(&mut self) -> Result<Vec<u8>, Why> {
        let (object, complete) = (self.object, self.complete);
        let expected = "the answer to an upload";
        let answer = self
            .ask(Request::Upload { object, complete }, expected, |answer| {
                matches!(answer, Response::Upload { .. })
            })
            .await?;
        let Ok(Response::Upload { initial, .. }) = response(&answer) else {
            return Err(wrong(expected, "something else"));
        };
        let size = usize::try_from(initial.size()).unwrap_or(usize::MAX);
        if size > LONGEST {
            return Err(Why::TooLong { limit: LONGEST });
        }
        let mut data = initial.data().to_vec();
        let (mut toggle, mut number) = (false, 0);
        while data.len() < size {
            number += 1;
            self.transaction.step = Step::Segment(number);
            let expected = "a segment of the upload";
            let answer = self
                .ask(Request::UploadSegment { toggle }, expected, |answer| {
                    matches!(answer, Response::UploadSegment(_))
                })
                .await?;
            let Ok(Response::UploadSegment(segment)) = response(&answer) else {
                return Err(wrong(expected, "something else"));
            };
            if segment.toggle != toggle {
                return Err(wrong(TURNED, "a segment with the toggle bit of the one before"));
            }
            data.extend_from_slice(segment.data);
            if data.len() > size {
                let found = format!("{} bytes, although {size} were announced", data.len());
                return Err(wrong("no more than was announced", found));
            }
            if data.len() < size && (segment.last || segment.data.is_empty()) {
                let found = format!("the end after {} of {size} bytes", data.len());
                return Err(wrong("all that was announced", found));
            }
            toggle = !toggle;
        }
        Ok(data)
    }

    async fn download(&mut self, data: &[u8]) -> Result<(), Why> {
        if data.len() > LONGEST {
            return Err(Why::TooLong { limit: LONGEST });
        }
        let (object, complete) = (self.object, self.complete);
        let mailbox_size = self.transaction.multiplexer.out_size();
        let initial = Initial::of(data, mailbox_size);
        let mut rest = data.get(initial.data().len()..).unwrap_or_default();
        self.ask(Request::Download { object, complete, initial }, "the answer", |answer| {
            matches!(answer, Response::Download { .. })
        })
        .await?;
        let (mut toggle, mut number) = (false, 0);
        while !rest.is_empty() {
            number += 1;
            self.transaction.step = Step::Segment(number);
            let segment = Segment::of(rest, toggle, mailbox_size);
            rest = &rest[segment.data.len()..];
            let answer = self
                .ask(Request::DownloadSegment(segment), "the answer to a segment", |answer| {
                    matches!(answer, Response::DownloadSegment { .. })
                })
                .await?;
            if !matches!(response(&answer), Ok(Response::DownloadSegment { toggle: back }) if back == toggle)
            {
                return Err(wrong(TURNED, "the toggle bit of the segment before"));
            }
            toggle = !toggle;
        }
        Ok(())
    }

    /// Sends a request and waits for the message that answers it.
    async fn ask(
        &mut self,
        request: Request<'_>,
        expected: &'static str,
        fits: impl Fn(&Response<'_>) -> bool,
    ) -> Result<Vec<u8>, Why> {
        let message = Message::SdoRequest(request);
        self.transaction.say(MailboxType::Coe, |body| message.write(body)).await?;
        loop {
            let data = self.transaction.hear(MailboxType::Coe).await?;
            match Message::parse(&data) {
                Ok(Message::Abort(Abort { object, code })) if self.is_about(object) => {
                    return Err(Why::Aborted { code: SdoAbortCode(code) });
                }
                // The late answer to a transfer that was given up, about another object.
                Ok(Message::SdoResponse(
                    Response::Upload { object, .. } | Response::Download { object, .. },
                )) if !self.is_about(object) => {}
                Ok(Message::SdoResponse(response)) if fits(&response) => return Ok(data),
                // The same, about any object.
                Ok(Message::SdoResponse(_)) if self.transaction.multiplexer.may_be_late() => {}
                Ok(Message::SdoResponse(response)) => {
                    return Err(wrong(expected, name(&response)));
                }
                Ok(
                    Message::Abort(_)
                    | Message::Emergency(_)
                    | Message::SdoRequest(_)
                    | Message::Information(_)
                    | Message::Pdo { .. },
                ) => {}
                Err(error) => return Err(wrong(expected, error.to_string())),
            }
            self.transaction.multiplexer.unasked(MailboxType::Coe, data);
        }
    }

    /// Whether an answer that names an object is about ours. Which entry it names with complete
    /// access is up to the SubDevice; some name none when they abort a segment.
    fn is_about(&self, object: ObjectAddress) -> bool {
        let segment = matches!(self.transaction.step, Step::Segment(_));
        object == self.object
            || self.complete && object.index == self.object.index
            || segment && object.index == ObjectIndex(0)
    }

    /// Tells the SubDevice when we give a transfer up that it goes on with.
    async fn end<T>(&mut self, result: Result<T, Why>) -> Result<T, Why> {
        let Err(why) = &result else { return result };
        let code = match why {
            Why::NoAnswer { .. } => SdoAbortCode::TIMEOUT,
            Why::Protocol { expected, .. } if *expected == TURNED => SdoAbortCode::TOGGLE_BIT,
            Why::TooLong { .. } => SdoAbortCode::OUT_OF_MEMORY,
            Why::Protocol { .. } => SdoAbortCode::GENERAL_ERROR,
            Why::Aborted { .. }
            | Why::Ethernet { .. }
            | Why::Drive { .. }
            | Why::Ads { .. }
            | Why::File { .. }
            | Why::Mailbox { .. }
            | Why::MailboxFull { .. }
            | Why::Busy { .. }
            | Why::NoMailbox
            | Why::NotOpen
            | Why::NotSpoken { .. }
            | Why::TooSmall(_)
            | Why::Exchange(_)
            | Why::Crowded { .. }
            | Why::Abandoned => return result,
        };
        let abort = Message::Abort(Abort { object: self.object, code: code.value() });
        if matches!(self.transaction.step, Step::Segment(_)) {
            self.transaction.mention(MailboxType::Coe, |body| abort.write(body)).await;
        }
        result
    }
}
