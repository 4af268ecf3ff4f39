//! The CoE server: SDO transfers and questions about the dictionary.
//!
//! Read first: ETG.1000.6, SDO and SDO information. One transfer in segments is under way at a time;
//! a new request ends it.

use linesman_proto::mailbox::ErrorReplyCode;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::sdo::{Abort, Initial, Request, Response, Segment};
use linesman_proto::mailbox::coe::{CoeError, Message, ObjectAddress};
use linesman_proto::state::AlState;

use super::{Answers, Served, information};
use crate::device::dictionary::{Dictionary, LARGEST};
use crate::device::software_fault::RefusedWith;

/// The server.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(super) struct CoeServer {
    transfer: Option<ServedSdo>,
}

/// A transfer that takes several messages.
#[derive(Clone, PartialEq, Eq, Debug)]
enum ServedSdo {
    Upload { object: ObjectAddress, data: Vec<u8>, sent: usize, toggle: bool },
    Download { object: ObjectAddress, complete: bool, size: usize, data: Vec<u8>, toggle: bool },
}

impl CoeServer {
    /// Answers a request. `room` is the length of the mailbox that the answers go into.
    pub(super) fn answer(
        &mut self,
        request: &[u8],
        served: &mut Served<'_>,
        room: usize,
    ) -> Result<Answers, ErrorReplyCode> {
        let Served { dictionary, software_faults, state, .. } = served;
        match Message::parse(request) {
            Ok(Message::SdoRequest(request)) => {
                match begun(&request)
                    .and_then(|object| Some((object, software_faults.refuses_sdo(object.index)?)))
                {
                    Some((object, RefusedWith::Abort(code))) => {
                        self.transfer = None;
                        Ok(vec![abort(object, code)])
                    }
                    Some((_, RefusedWith::ErrorReply(code))) => Err(code),
                    None => Ok(vec![self.sdo(request, dictionary, *state, room)]),
                }
            }
            Ok(Message::Abort(_)) => {
                self.transfer = None;
                Ok(Vec::new())
            }
            Ok(Message::Information(message)) => information::answer(message, dictionary, room),
            Ok(Message::Emergency(_) | Message::SdoResponse(_) | Message::Pdo { .. }) => {
                Err(ErrorReplyCode::ServiceNotSupported)
            }
            Err(CoeError::CutOff { .. }) => Err(ErrorReplyCode::SizeTooShort),
            Err(CoeError::ReservedService { .. }) => Err(ErrorReplyCode::InvalidHeader),
            Err(CoeError::UnknownSpecifier { .. }) => {
                self.transfer = None;
                let object = ObjectAddress::new(0, 0);
                Ok(vec![abort(object, SdoAbortCode::COMMAND_SPECIFIER)])
            }
            Err(CoeError::UnknownOpcode { .. }) => {
                Ok(information::refuse(SdoAbortCode::UNSUPPORTED_ACCESS))
            }
        }
    }

    fn sdo(
        &mut self,
        request: Request<'_>,
        dictionary: &mut Dictionary,
        state: AlState,
        room: usize,
    ) -> Vec<u8> {
        match request {
            Request::Upload { object, complete } => {
                self.transfer = None;
                let data = if complete {
                    dictionary.upload_all(object, state)
                } else {
                    dictionary.upload(object, state)
                };
                match data {
                    Ok(data) => self.begin_upload(object, complete, data, room),
                    Err(code) => abort(object, code),
                }
            }
            Request::UploadSegment { toggle } => self.upload_segment(toggle, room),
            Request::Download { object, complete, initial } => {
                self.transfer = None;
                self.begin_download(object, complete, initial, dictionary, state)
            }
            Request::DownloadSegment(segment) => self.download_segment(segment, dictionary, state),
        }
    }

    fn begin_upload(
        &mut self,
        object: ObjectAddress,
        complete: bool,
        data: Vec<u8>,
        room: usize,
    ) -> Vec<u8> {
        let initial = Initial::of(&data, room);
        let body = write(&Message::SdoResponse(Response::Upload { object, complete, initial }));
        if !initial.is_complete() {
            let sent = initial.data().len();
            self.transfer = Some(ServedSdo::Upload { object, data, sent, toggle: false });
        }
        body
    }

    fn upload_segment(&mut self, asked: bool, room: usize) -> Vec<u8> {
        let Some(ServedSdo::Upload { object, data, sent, toggle }) = self.transfer.take() else {
            return abort(ObjectAddress::new(0, 0), SdoAbortCode::COMMAND_SPECIFIER);
        };
        if asked != toggle {
            return abort(object, SdoAbortCode::TOGGLE_BIT);
        }
        let segment = Segment::of(&data[sent..], toggle, room);
        let body = write(&Message::SdoResponse(Response::UploadSegment(segment)));
        if !segment.last {
            let sent = sent + segment.data.len();
            self.transfer = Some(ServedSdo::Upload { object, data, sent, toggle: !toggle });
        }
        body
    }

    fn begin_download(
        &mut self,
        object: ObjectAddress,
        complete: bool,
        initial: Initial<'_>,
        dictionary: &mut Dictionary,
        state: AlState,
    ) -> Vec<u8> {
        if initial.is_complete() {
            return match store(dictionary, object, complete, initial.data(), state) {
                Ok(()) => {
                    let answer = Message::SdoResponse(Response::Download { object, complete });
                    echo(initial.data(), write(&answer))
                }
                Err(code) => abort(object, code),
            };
        }
        let size = usize::try_from(initial.size()).unwrap_or(usize::MAX);
        if size > LARGEST {
            return abort(object, SdoAbortCode::OUT_OF_MEMORY);
        }
        let data = initial.data().to_vec();
        self.transfer = Some(ServedSdo::Download { object, complete, size, data, toggle: false });
        write(&Message::SdoResponse(Response::Download { object, complete }))
    }

    fn download_segment(
        &mut self,
        segment: Segment<'_>,
        dictionary: &mut Dictionary,
        state: AlState,
    ) -> Vec<u8> {
        let Some(ServedSdo::Download { object, complete, size, mut data, toggle }) =
            self.transfer.take()
        else {
            return abort(ObjectAddress::new(0, 0), SdoAbortCode::COMMAND_SPECIFIER);
        };
        if segment.toggle != toggle {
            return abort(object, SdoAbortCode::TOGGLE_BIT);
        }
        data.extend_from_slice(segment.data);
        if data.len() > size {
            return abort(object, SdoAbortCode::TOO_LONG);
        }
        if segment.last {
            if data.len() < size {
                return abort(object, SdoAbortCode::TOO_SHORT);
            }
            if let Err(code) = store(dictionary, object, complete, &data, state) {
                return abort(object, code);
            }
        } else {
            let toggle = !toggle;
            self.transfer = Some(ServedSdo::Download { object, complete, size, data, toggle });
        }
        write(&Message::SdoResponse(Response::DownloadSegment { toggle }))
    }
}

/// The four bytes of the answer that mean nothing: devices answer in the buffer of the request, as
/// recordings show, so that its data come back.
fn echo(data: &[u8], mut answer: Vec<u8>) -> Vec<u8> {
    const RESERVED: std::ops::Range<usize> = 6..10;
    if let Some(reserved) = answer.get_mut(RESERVED) {
        for (slot, byte) in reserved.iter_mut().zip(data) {
            *slot = *byte;
        }
    }
    answer
}

fn store(
    dictionary: &mut Dictionary,
    object: ObjectAddress,
    complete: bool,
    data: &[u8],
    state: AlState,
) -> Result<(), SdoAbortCode> {
    if complete {
        dictionary.download_all(object, data, state)
    } else {
        dictionary.download(object, data, state)
    }
}

/// The object that a transfer begins to be about; `None` amid one.
const fn begun(request: &Request<'_>) -> Option<ObjectAddress> {
    match request {
        Request::Upload { object, .. } | Request::Download { object, .. } => Some(*object),
        Request::UploadSegment { .. } | Request::DownloadSegment(_) => None,
    }
}

/// The end of a transfer that failed. SubDevices abort with the service of a request.
fn abort(object: ObjectAddress, code: SdoAbortCode) -> Vec<u8> {
    write(&Message::Abort(Abort { object, code: code.value() }))
}

/// A message as bytes.
pub(super) fn write(message: &Message<'_>) -> Vec<u8> {
    // No controller has memory for a longer mailbox, and no message is longer than its mailbox:
    // `Initial`, `Segment` and `Fragments` see to that.
    let mut bytes = vec![0; 2 * LARGEST];
    let len = message.write(&mut bytes).unwrap_or(0);
    bytes.truncate(len);
    bytes
}
