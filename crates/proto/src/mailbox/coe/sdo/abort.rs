//! The end of an SDO transfer that failed.
//!
//! Reference: ETG.1000.6, Abort SDO transfer. Command 0x80, address of the object, 32-bit code.

use super::command::{SDO_LEN, specifier};
use crate::mailbox::coe::message::CoeError;
use crate::mailbox::coe::object::ObjectAddress;
use crate::mailbox::header::BufferTooSmall;

const ABORT: u8 = 0x80;

/// Either side ends a transfer.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Abort {
    /// The object whose transfer ends.
    pub object: ObjectAddress,
    /// Why, as a number.
    pub code: u32,
}

impl Abort {
    /// Whether an SDO message, of either direction, is an abort.
    #[must_use]
    pub(crate) fn is_meant(body: &[u8]) -> bool {
        body.first().is_some_and(|&command| specifier(command) == specifier(ABORT))
    }

    pub(crate) fn parse(body: &[u8]) -> Result<Self, CoeError> {
        let (&[_, low, high, subindex, a, b, c, d], _) = CoeError::first(body, "SDO abort")?;
        Ok(Self {
            object: ObjectAddress::from_bytes([low, high, subindex]),
            code: u32::from_le_bytes([a, b, c, d]),
        })
    }

    pub(crate) fn write(self, body: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let [low, high, subindex] = self.object.to_bytes();
        let [a, b, c, d] = self.code.to_le_bytes();
        let bytes = [ABORT, low, high, subindex, a, b, c, d];
        BufferTooSmall::check(body, SDO_LEN)?.copy_from_slice(&bytes);
        Ok(SDO_LEN)
    }
}
