//! AoE server: name, state and objects of the device by ADS.
//!
//! Reference: ETG.1020, AoE; header and services are those of `proto::ads`. The MainDevice gives the device its NetId;
//! until then it answers to any, and it forgets it with the mailbox. Objects are reached by index group 0xF302, by
//! reading, writing, or both in one go.

use linesman_proto::ads::{
    AMS_HEADER_LEN, AdsAnswer, AdsCode, AdsRequest, AmsAddress, AmsError, AmsHeader, AmsNetId,
    index,
};
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::mailbox::{ErrorReplyCode, HEADER_LEN};

use super::{Answers, Served};

/// Port of the first channel, as IO-Link masters number them from here.
const FIRST_CHANNEL: u16 = 0x1000;
/// Result and length in front of the bytes that are read.
const READ_HEADER_LEN: usize = 8;

/// The server.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct AoeServer {
    /// The NetId that the MainDevice has written.
    net_id: Option<AmsNetId>,
}

impl AoeServer {
    /// Answers a message. `room` is the length of the mailbox that the answer goes into.
    pub(super) fn answer(
        &mut self,
        message: &[u8],
        served: &mut Served<'_>,
        room: usize,
    ) -> Result<Answers, ErrorReplyCode> {
        let (header, data) = match AmsHeader::parse(message) {
            Ok(parsed) if parsed.0.is_request() => parsed,
            // Nobody answers an answer.
            Ok(_) => return Ok(Vec::new()),
            Err(AmsError::DataLength { header, .. }) if header.is_request() => {
                return Ok(vec![header.answer(AdsCode::BAD_LENGTH).message(&[])]);
            }
            Err(_) => return Err(ErrorReplyCode::SizeTooShort),
        };
        let request = AdsRequest::parse(header.command, data);
        let outcome = match request {
            Err(AdsCode::UNKNOWN_COMMAND) => Err(AdsCode::UNKNOWN_COMMAND),
            Ok(AdsRequest::Write {
                group: index::OWN_NET_ID,
                offset: index::OWN_NET_ID_OFFSET,
                data,
            }) => Ok(self.set_net_id(data)),
            _ if self.net_id.is_some_and(|own| own != header.target.net_id) => {
                Err(AdsCode::MACHINE_NOT_FOUND)
            }
            _ if ![FIRST_CHANNEL, AmsAddress::MAIN_DEVICE_PORT].contains(&header.target.port) => {
                Err(AdsCode::PORT_NOT_FOUND)
            }
            Err(code) => Ok(AdsAnswer::Refused(code)),
            Ok(request) => Ok(serve(&request, served, room).unwrap_or_else(AdsAnswer::Refused)),
        };
        Ok(vec![match outcome {
            Ok(answer) => header.answer(AdsCode::OK).message(&answer.to_bytes(header.command)),
            Err(code) => header.answer(code).message(&[]),
        }])
    }

    fn set_net_id(&mut self, data: &[u8]) -> AdsAnswer {
        match <[u8; 6]>::try_from(data) {
            Ok(bytes) => {
                self.net_id = Some(AmsNetId(bytes));
                AdsAnswer::Done
            }
            Err(_) => AdsAnswer::Refused(AdsCode::BAD_SIZE),
        }
    }
}

fn serve(
    request: &AdsRequest<'_>,
    served: &mut Served<'_>,
    room: usize,
) -> Result<AdsAnswer, AdsCode> {
    match *request {
        AdsRequest::DeviceInfo => {
            let name = ObjectAddress { index: ObjectIndex::DEVICE_NAME, subindex: 0 };
            let name = served.dictionary.upload(name, served.state).unwrap_or_default();
            let name = String::from_utf8_lossy(&name).into_owned();
            Ok(AdsAnswer::DeviceInfo { major: 1, minor: 0, build: 0, name })
        }
        AdsRequest::State => {
            Ok(AdsAnswer::State { ads: AdsAnswer::RUN, device: served.state.bits().into() })
        }
        AdsRequest::Read { group: index::SDO, offset, len } => read(served, offset, len, room),
        AdsRequest::Write { group: index::SDO, offset, data } => {
            write(served, offset, data).map(|()| AdsAnswer::Done)
        }
        AdsRequest::ReadWrite { group: index::SDO, offset, len, data } => {
            write(served, offset, data)?;
            read(served, offset, len, room)
        }
        AdsRequest::Read { .. } | AdsRequest::Write { .. } | AdsRequest::ReadWrite { .. } => {
            Err(AdsCode::BAD_INDEX_GROUP)
        }
        AdsRequest::Other(_) => Err(AdsCode::SERVICE_NOT_SUPPORTED),
    }
}

/// An object, no more than is asked for. It goes into one message: there are no segments.
fn read(served: &Served<'_>, offset: u32, len: u32, room: usize) -> Result<AdsAnswer, AdsCode> {
    let (object, complete) = index::object(offset);
    let data = match complete {
        true => served.dictionary.upload_all(object, served.state),
        false => served.dictionary.upload(object, served.state),
    };
    let mut data = data.map_err(AdsCode::of_abort)?;
    data.truncate(usize::try_from(len).unwrap_or(usize::MAX));
    let fits = HEADER_LEN + AMS_HEADER_LEN + READ_HEADER_LEN + data.len() <= room;
    if fits { Ok(AdsAnswer::Read(data)) } else { Err(AdsCode::BAD_SIZE) }
}

fn write(served: &mut Served<'_>, offset: u32, data: &[u8]) -> Result<(), AdsCode> {
    let (object, complete) = index::object(offset);
    let written = match complete {
        true => served.dictionary.download_all(object, data, served.state),
        false => served.dictionary.download(object, data, served.state),
    };
    written.map_err(AdsCode::of_abort)
}
