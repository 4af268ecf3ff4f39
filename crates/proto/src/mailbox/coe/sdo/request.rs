//! SDO requests of the MainDevice.
//!
//! Reference: ETG.1000.6, SDO. Client command specifiers: 0 download segment, 1 download, 2
//! upload, 3 upload segment; 4 is an [`Abort`](super::Abort), 5 and 6 (block transfer) EtherCAT
//! does not use.

use super::command::{COMPLETE, SDO_LEN, TOGGLE, specifier};
use super::payload::{First, Initial, Segment};
use crate::mailbox::coe::message::CoeError;
use crate::mailbox::coe::object::ObjectAddress;
use crate::mailbox::header::BufferTooSmall;

const DOWNLOAD_SEGMENT: u8 = 0;
const DOWNLOAD: u8 = 1;
const UPLOAD: u8 = 2;
const UPLOAD_SEGMENT: u8 = 3;

/// An SDO request.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Request<'a> {
    /// Take these data.
    Download {
        /// The entry, or where complete access begins.
        object: ObjectAddress,
        /// Complete access: all entries at once; subindex 0 takes two bytes then.
        complete: bool,
        /// The data, or their beginning.
        initial: Initial<'a>,
    },
    /// Take the next part of the data.
    DownloadSegment(Segment<'a>),
    /// Give me the data.
    Upload {
        /// The entry, or where complete access begins.
        object: ObjectAddress,
        /// Complete access: all entries at once; subindex 0 takes two bytes then.
        complete: bool,
    },
    /// Give me the next part of the data.
    UploadSegment {
        /// `false` for the first segment, then turning.
        toggle: bool,
    },
}

impl<'a> Request<'a> {
    /// Reads what follows the CoE header of a message with service 2.
    pub(crate) fn parse(body: &'a [u8]) -> Result<Self, CoeError> {
        let (&[command], _) = CoeError::first(body, "SDO request")?;
        match specifier(command) {
            DOWNLOAD_SEGMENT => {
                Segment::parse(body, "SDO download segment").map(Self::DownloadSegment)
            }
            DOWNLOAD => {
                let First { object, complete, initial } = Initial::parse(body, "SDO download")?;
                Ok(Self::Download { object, complete, initial })
            }
            UPLOAD => {
                let (&[_, low, high, subindex], _) = CoeError::first(body, "SDO upload")?;
                let object = ObjectAddress::from_bytes([low, high, subindex]);
                Ok(Self::Upload { object, complete: command & COMPLETE != 0 })
            }
            UPLOAD_SEGMENT => Ok(Self::UploadSegment { toggle: command & TOGGLE != 0 }),
            specifier => Err(CoeError::UnknownSpecifier { what: "request", specifier }),
        }
    }

    /// Writes what follows the CoE header.
    pub(crate) fn write(&self, body: &mut [u8]) -> Result<usize, BufferTooSmall> {
        match *self {
            Self::Download { object, complete, initial } => {
                First { object, complete, initial }.write(DOWNLOAD, body)
            }
            Self::DownloadSegment(segment) => segment.write(DOWNLOAD_SEGMENT, body),
            Self::Upload { object, complete } => {
                let [low, high, subindex] = object.to_bytes();
                let command = UPLOAD << 5 | if complete { COMPLETE } else { 0 };
                let bytes = [command, low, high, subindex, 0, 0, 0, 0];
                BufferTooSmall::check(body, SDO_LEN)?.copy_from_slice(&bytes);
                Ok(SDO_LEN)
            }
            Self::UploadSegment { toggle } => {
                let command = UPLOAD_SEGMENT << 5 | if toggle { TOGGLE } else { 0 };
                let bytes = [command, 0, 0, 0, 0, 0, 0, 0];
                BufferTooSmall::check(body, SDO_LEN)?.copy_from_slice(&bytes);
                Ok(SDO_LEN)
            }
        }
    }
}
