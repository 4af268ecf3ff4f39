//! Payload of SDO messages: the first message of a transfer, and the segments that follow.
//!
//! Reference: ETG.1000.6, SDO. The layouts are the same in both directions; only the specifiers in
//! the upper three bits of the command differ.

use super::command::{COMPLETE, SDO_LEN, TOGGLE};
use crate::mailbox::coe::message::{COE_HEADER_LEN, CoeError};
use crate::mailbox::coe::object::ObjectAddress;
use crate::mailbox::header::{BufferTooSmall, HEADER_LEN};

const EXPEDITED: u8 = 0x02;
const SIZE_INDICATED: u8 = 0x01;
const LAST: u8 = 0x01;

/// Data bytes a segment has room for without making the message longer than the shortest.
const SHORT_SEGMENT: usize = 7;

/// One to four bytes within the first message.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Expedited {
    bytes: [u8; 4],
    len: u8,
}

impl Expedited {
    /// These bytes; `None` unless there are one to four.
    #[must_use]
    pub fn new(data: &[u8]) -> Option<Self> {
        let len = u8::try_from(data.len()).ok().filter(|len| (1..=4).contains(len))?;
        let mut bytes = [0; 4];
        bytes[..data.len()].copy_from_slice(data);
        Some(Self { bytes, len })
    }

    /// The bytes.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.len)]
    }
}

/// What the first message of a transfer carries.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Initial<'a> {
    /// Everything, as it is at most four bytes.
    Expedited(Expedited),
    /// As much as fits.
    Normal {
        /// Size of the whole in bytes.
        size: u32,
        /// The first bytes, at most `size` of them. Segments follow when they are fewer.
        data: &'a [u8],
    },
}

impl<'a> Initial<'a> {
    /// The first message that carries `whole` through a mailbox of `mailbox_size` bytes.
    ///
    /// Data beyond 4 GiB cannot be announced and are left out; no mailbox gets there.
    #[must_use]
    pub fn of(whole: &'a [u8], mailbox_size: usize) -> Self {
        if let Some(expedited) = Expedited::new(whole) {
            return Self::Expedited(expedited);
        }
        let size = u32::try_from(whole.len()).unwrap_or(u32::MAX);
        let room = mailbox_size.saturating_sub(HEADER_LEN + COE_HEADER_LEN + SDO_LEN);
        Self::Normal { size, data: &whole[..whole.len().min(room)] }
    }

    /// The bytes it carries.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        match self {
            Self::Expedited(expedited) => expedited.data(),
            Self::Normal { data, .. } => data,
        }
    }

    /// Size of the whole in bytes, of which [`Initial::data`] is the beginning.
    #[must_use]
    pub const fn size(&self) -> u32 {
        match self {
            Self::Expedited(expedited) => expedited.len as u32,
            Self::Normal { size, .. } => *size,
        }
    }

    /// Whether segments follow.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        usize::try_from(self.size()).is_ok_and(|size| self.data().len() >= size)
    }

    /// Reads command, address and data. The caller has looked at the specifier.
    pub(super) fn parse(body: &'a [u8], what: &'static str) -> Result<First<'a>, CoeError> {
        let (&[command, low, high, subindex, a, b, c, d], rest) = CoeError::first(body, what)?;
        let object = ObjectAddress::from_bytes([low, high, subindex]);
        let four = [a, b, c, d];
        let initial = if command & EXPEDITED != 0 {
            // Without a size it is up to the object how many of the four count.
            let unused = if command & SIZE_INDICATED != 0 { (command >> 2) & 0x03 } else { 0 };
            Self::Expedited(Expedited { bytes: four, len: 4 - unused }.normalized())
        } else {
            let size = u32::from_le_bytes(four);
            let len = usize::try_from(size).map_or(rest.len(), |size| rest.len().min(size));
            Self::Normal { size, data: &rest[..len] }
        };
        Ok(First { object, complete: command & COMPLETE != 0, initial })
    }
}

impl Expedited {
    /// With zeros behind the data, so that equal data are equal values.
    fn normalized(mut self) -> Self {
        self.bytes[usize::from(self.len)..].fill(0);
        self
    }
}

/// Command, address and data of the first message of a transfer.
pub(super) struct First<'a> {
    pub(super) object: ObjectAddress,
    pub(super) complete: bool,
    pub(super) initial: Initial<'a>,
}

impl First<'_> {
    /// Writes it under this specifier.
    pub(super) fn write(&self, specifier: u8, body: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let complete = if self.complete { COMPLETE } else { 0 };
        let (bits, four, data): (u8, [u8; 4], &[u8]) = match &self.initial {
            Initial::Expedited(expedited) => {
                (EXPEDITED | SIZE_INDICATED | (4 - expedited.len) << 2, expedited.bytes, &[])
            }
            Initial::Normal { size, data } => (SIZE_INDICATED, size.to_le_bytes(), data),
        };
        let len = SDO_LEN + data.len();
        let body = BufferTooSmall::check(body, len)?;
        body[0] = specifier << 5 | complete | bits;
        body[1..4].copy_from_slice(&self.object.to_bytes());
        body[4..SDO_LEN].copy_from_slice(&four);
        body[SDO_LEN..].copy_from_slice(data);
        Ok(len)
    }
}

/// A part of a transfer that did not fit into the first message.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Segment<'a> {
    /// `false` in the first segment, then turning; a segment with the toggle bit of the one before
    /// is a repetition.
    pub toggle: bool,
    /// Whether it is the last.
    pub last: bool,
    /// Its data.
    pub data: &'a [u8],
}

impl<'a> Segment<'a> {
    /// The segment that carries the beginning of `rest` through a mailbox of `mailbox_size` bytes.
    #[must_use]
    pub fn of(rest: &'a [u8], toggle: bool, mailbox_size: usize) -> Self {
        // A mailbox too small for the shortest message is no reason never to get to the end: the
        // message that results does not fit when it is written.
        let room = mailbox_size.saturating_sub(HEADER_LEN + COE_HEADER_LEN + 1).max(SHORT_SEGMENT);
        let data = &rest[..rest.len().min(room)];
        Self { toggle, last: data.len() == rest.len(), data }
    }

    pub(super) fn parse(body: &'a [u8], what: &'static str) -> Result<Self, CoeError> {
        let (&[command], rest) = CoeError::first(body, what)?;
        // Only the shortest message has bytes to fill up; in longer ones the length tells.
        let len = if rest.len() <= SHORT_SEGMENT {
            let unused = usize::from((command >> 1) & 0x07);
            rest.len().min(SHORT_SEGMENT - unused)
        } else {
            rest.len()
        };
        let (toggle, last) = (command & TOGGLE != 0, command & LAST != 0);
        Ok(Self { toggle, last, data: &rest[..len] })
    }

    /// Writes it under this specifier, filled up to the shortest message.
    pub(super) fn write(&self, specifier: u8, body: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let unused = SHORT_SEGMENT.saturating_sub(self.data.len());
        let len = 1 + self.data.len() + unused;
        let body = BufferTooSmall::check(body, len)?;
        let toggle = if self.toggle { TOGGLE } else { 0 };
        body[0] = specifier << 5 | toggle | (unused as u8) << 1 | u8::from(self.last);
        let (data, filling) = body[1..].split_at_mut(self.data.len());
        data.copy_from_slice(self.data);
        filling.fill(0);
        Ok(len)
    }
}
