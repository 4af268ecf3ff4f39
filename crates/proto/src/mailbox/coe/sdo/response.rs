//! SDO responses of a SubDevice.
//!
//! Reference: ETG.1000.6, SDO. Server command specifiers: 0 upload segment, 1 download segment, 2
//! upload, 3 download; 4 is an [`Abort`](super::Abort).

use super::command::{COMPLETE, SDO_LEN, TOGGLE, specifier};
use super::payload::{First, Initial, Segment};
use crate::mailbox::coe::message::CoeError;
use crate::mailbox::coe::object::ObjectAddress;
use crate::mailbox::header::BufferTooSmall;

const UPLOAD_SEGMENT: u8 = 0;
const DOWNLOAD_SEGMENT: u8 = 1;
const UPLOAD: u8 = 2;
const DOWNLOAD: u8 = 3;

/// An SDO response.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Response<'a> {
    /// The data have been taken, or their beginning.
    Download {
        /// The object of the request.
        object: ObjectAddress,
        /// Complete access, as in the request; not all SubDevices repeat it.
        complete: bool,
    },
    /// The segment has been taken.
    DownloadSegment {
        /// As in the request.
        toggle: bool,
    },
    /// Here are the data, or their beginning.
    Upload {
        /// The object of the request.
        object: ObjectAddress,
        /// Complete access, as in the request; not all SubDevices repeat it.
        complete: bool,
        /// The data, or their beginning.
        initial: Initial<'a>,
    },
    /// Here is the next part.
    UploadSegment(Segment<'a>),
}

impl<'a> Response<'a> {
    /// Reads what follows the CoE header of a message with service 3.
    pub(crate) fn parse(body: &'a [u8]) -> Result<Self, CoeError> {
        let (&[command], _) = CoeError::first(body, "SDO response")?;
        match specifier(command) {
            UPLOAD_SEGMENT => Segment::parse(body, "SDO upload segment").map(Self::UploadSegment),
            DOWNLOAD_SEGMENT => Ok(Self::DownloadSegment { toggle: command & TOGGLE != 0 }),
            UPLOAD => {
                let First { object, complete, initial } = Initial::parse(body, "SDO upload")?;
                Ok(Self::Upload { object, complete, initial })
            }
            DOWNLOAD => {
                let (&[_, low, high, subindex], _) = CoeError::first(body, "SDO download")?;
                let object = ObjectAddress::from_bytes([low, high, subindex]);
                Ok(Self::Download { object, complete: command & COMPLETE != 0 })
            }
            specifier => Err(CoeError::UnknownSpecifier { what: "response", specifier }),
        }
    }

    /// Writes what follows the CoE header.
    pub(crate) fn write(&self, body: &mut [u8]) -> Result<usize, BufferTooSmall> {
        match *self {
            Self::Upload { object, complete, initial } => {
                First { object, complete, initial }.write(UPLOAD, body)
            }
            Self::UploadSegment(segment) => segment.write(UPLOAD_SEGMENT, body),
            Self::Download { object, complete } => {
                let [low, high, subindex] = object.to_bytes();
                let command = DOWNLOAD << 5 | if complete { COMPLETE } else { 0 };
                let bytes = [command, low, high, subindex, 0, 0, 0, 0];
                BufferTooSmall::check(body, SDO_LEN)?.copy_from_slice(&bytes);
                Ok(SDO_LEN)
            }
            Self::DownloadSegment { toggle } => {
                let command = DOWNLOAD_SEGMENT << 5 | if toggle { TOGGLE } else { 0 };
                let bytes = [command, 0, 0, 0, 0, 0, 0, 0];
                BufferTooSmall::check(body, SDO_LEN)?.copy_from_slice(&bytes);
                Ok(SDO_LEN)
            }
        }
    }
}
