//! Servo drive profile over EtherCAT: reading and writing the elements of identification numbers (IDN).
//!
//! Read first: ETG.1000.6, SoE; IEC 61800-7-204 for what IDNs are; facts 6.7.

mod attribute;
mod element;

use std::fmt;

use super::header::BufferTooSmall;

pub use attribute::{DisplayFormat, SoeAttribute, ValueLength};
pub use element::{
    ALL_COMMANDS, ALL_NUMBERS, ATTRIBUTE, CommandProgress, CommandState, DATA_STATE, DEFAULT,
    ELEMENTS, LIST_HEADER_LEN, MAXIMUM, MINIMUM, NAME, UNIT, VALUE, VariableData,
    elements_in_words, numbers_of_list,
};

/// Bytes in front of the data.
pub const SOE_HEADER_LEN: usize = 4;

const OPERATION: u8 = 0x07;
const INCOMPLETE: u8 = 0x08;
const ERROR: u8 = 0x10;
const DRIVE_AT: u32 = 5;

/// What is asked or answered.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Operation {
    /// 1: read.
    ReadRequest,
    /// 2: what was read.
    ReadResponse,
    /// 3: write.
    WriteRequest,
    /// 4: it was written.
    WriteResponse,
    /// 5: something is told without having been asked for.
    Notification,
    /// 6: an emergency.
    Emergency,
    /// Reserved.
    Reserved(u8),
}

impl Operation {
    const fn from_code(code: u8) -> Self {
        match code {
            1 => Self::ReadRequest,
            2 => Self::ReadResponse,
            3 => Self::WriteRequest,
            4 => Self::WriteResponse,
            5 => Self::Notification,
            6 => Self::Emergency,
            other => Self::Reserved(other),
        }
    }

    const fn code(self) -> u8 {
        match self {
            Self::ReadRequest => 1,
            Self::ReadResponse => 2,
            Self::WriteRequest => 3,
            Self::WriteResponse => 4,
            Self::Notification => 5,
            Self::Emergency => 6,
            Self::Reserved(other) => other,
        }
    }
}

/// An identification number: `S-0-0032`, `P-0-0150`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Idn(pub u16);

impl Idn {
    /// From `S-0-0032` or `P-1-0007`.
    #[must_use]
    pub fn from_text(text: &str) -> Option<Self> {
        let mut parts = text.split('-');
        let kind = match parts.next()? {
            "S" | "s" => 0,
            "P" | "p" => 1_u16 << 15,
            _ => return None,
        };
        let set: u16 = parts.next()?.parse().ok().filter(|set| *set < 8)?;
        let number: u16 = parts.next()?.parse().ok().filter(|number| *number < 4096)?;
        parts.next().is_none().then_some(Self(kind | set << 12 | number))
    }
}

impl fmt::Display for Idn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.0 >> 15 == 0 { 'S' } else { 'P' };
        write!(f, "{kind}-{}-{:04}", self.0 >> 12 & 0x07, self.0 & 0x0FFF)
    }
}

/// A message: what follows the mailbox header of a message of type SoE.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Message<'a> {
    /// What is asked or answered.
    pub operation: Operation,
    /// More is to come; `number` tells how many messages.
    pub incomplete: bool,
    /// The drive refuses: its data are a code.
    pub error: bool,
    /// Which drive of the device, 0..=7.
    pub drive: u8,
    /// The elements, by their bits: [`ELEMENTS`].
    pub elements: u8,
    /// The IDN, or how many messages follow.
    pub number: u16,
    /// The data.
    pub data: &'a [u8],
}

impl<'a> Message<'a> {
    /// The message in these bytes; `None` for fewer than a header has.
    #[must_use]
    pub fn parse(bytes: &'a [u8]) -> Option<Self> {
        let ([first, elements, low, high], data) = bytes.split_first_chunk()?;
        Some(Self {
            operation: Operation::from_code(first & OPERATION),
            incomplete: first & INCOMPLETE != 0,
            error: first & ERROR != 0,
            drive: first >> DRIVE_AT,
            elements: *elements,
            number: u16::from_le_bytes([*low, *high]),
            data,
        })
    }

    /// Why the drive refuses; `None` when it does not.
    #[must_use]
    pub fn refusal(&self) -> Option<SoeError> {
        let code = self.data.first_chunk().map_or(0, |code| u16::from_le_bytes(*code));
        self.error.then_some(SoeError(code))
    }

    /// Writes it to the start of a buffer and tells how many bytes that were.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when it does not fit; the buffer is untouched then.
    pub fn write(&self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let len = SOE_HEADER_LEN + self.data.len();
        let buffer = BufferTooSmall::check(buffer, len)?;
        let flag = |on, bit| if on { bit } else { 0 };
        buffer[0] = self.operation.code() & OPERATION
            | flag(self.incomplete, INCOMPLETE)
            | flag(self.error, ERROR)
            | self.drive << DRIVE_AT;
        buffer[1] = self.elements;
        buffer[2..SOE_HEADER_LEN].copy_from_slice(&self.number.to_le_bytes());
        buffer[SOE_HEADER_LEN..].copy_from_slice(self.data);
        Ok(len)
    }
}

/// Why a drive refuses an access.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct SoeError(pub u16);

impl SoeError {
    /// What it means.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self.0 {
            0x1001 => "there is no such IDN",
            0x1009 => "invalid access to element 1",
            0x2001 | 0x4001 | 0x5001 | 0x6001 => "it has no such element",
            0x2002 | 0x3002 | 0x4002 | 0x5002 | 0x6002 | 0x7002 => "the data are too short",
            0x2003 | 0x3003 | 0x4003 | 0x5003 | 0x6003 | 0x7003 => "the data are too long",
            0x2004 | 0x3004 | 0x4004 | 0x5004 | 0x6004 | 0x7004 => "it cannot be changed",
            0x2005 | 0x3005 | 0x4005 | 0x5005 | 0x6005 | 0x7005 => {
                "it is write-protected in this state"
            }
            0x7006 => "the value is below the minimum",
            0x7007 => "the value is above the maximum",
            0x7008 => "the value is not supported",
            0x7009 => "it is write-protected by a password",
            0x700A => "it is configured as cyclic data and cannot be written besides",
            0x700B => "invalid indirect addressing",
            0x700C => "it is write-protected by other settings",
            0x7010 => "the procedure command is active already",
            0x7011 => "the procedure command cannot be interrupted",
            0x7012 => "the procedure command cannot be executed in this state",
            0x7013 => "the procedure command cannot be executed with these parameters",
            0x7014 => "no data are expected",
            _ => "unknown SoE error",
        }
    }

    /// What to do about it, in one sentence without a full stop.
    #[must_use]
    pub const fn action(self) -> &'static str {
        match self.0 {
            0x1001 => "check the IDN, and that the drive has it with this firmware",
            0x7006..=0x7008 => "write a value between the IDN's minimum and maximum",
            0x2005 | 0x3005 | 0x4005 | 0x5005 | 0x6005 | 0x7005 | 0x7012 => {
                "write it in another state: most IDNs in PREOP"
            }
            0x700A => "set it through the process data, or take it out of these",
            _ => "check IDN, element and length against the manual of the drive",
        }
    }
}

impl fmt::Display for SoeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} {}", self.0, self.text())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn messages_are_these_bytes() {
        let message = Message {
            operation: Operation::WriteRequest,
            incomplete: false,
            error: false,
            drive: 1,
            elements: VALUE,
            number: Idn::from_text("P-1-0002").unwrap().0,
            data: &[9],
        };
        let mut buffer = [0; 8];
        assert_eq!(message.write(&mut buffer), Ok(5));
        assert_eq!(buffer[..5], [0x23, 0x40, 0x02, 0x90, 9]);
        let refused = Message::parse(&[0x14, 0x40, 36, 0, 0x04, 0x70]).unwrap();
        assert_eq!(refused.refusal(), Some(SoeError(0x7004)));
        assert_eq!(refused.refusal().unwrap().to_string(), "0x7004 it cannot be changed");
        assert_eq!(Message::parse(&[1, 2, 3]), None);
    }

    #[test]
    fn identification_numbers_have_names() {
        for text in ["S-0-0000", "S-0-0032", "P-0-0150", "S-7-4095"] {
            assert_eq!(Idn::from_text(text).unwrap().to_string(), text);
        }
        for wrong in ["", "S", "S-0", "X-0-0001", "S-8-0001", "S-0-4096", "S-0-1-2"] {
            assert_eq!(Idn::from_text(wrong), None, "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn what_is_read_is_written_again(bytes in prop::collection::vec(any::<u8>(), 0..40)) {
            if let Some(message) = Message::parse(&bytes) {
                let mut buffer = [0; 64];
                let len = message.write(&mut buffer).unwrap();
                prop_assert_eq!(&buffer[..len], &bytes[..]);
            }
        }
    }
}
