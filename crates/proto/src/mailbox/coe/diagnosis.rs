//! Messages of the diagnosis history, object 0x10F3: what a SubDevice has noted of itself.
//!
//! Reference: ETG.1020, diagnosis; the layout is that of the public SubDevice stack code. Code
//! (u32), flags (u16), text (u16), time (u64, ns), then parameters. The text is the number of a
//! pattern in the device description, into which the parameters go.

pub mod text_number;

use super::data_type::DataType;
use crate::mailbox::header::BufferTooSmall;

/// How serious a message is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Severity {
    /// 0: for information.
    Information,
    /// 1: a warning.
    Warning,
    /// 2: an error.
    Error,
    /// A value that is not defined, 3 to 15.
    Reserved(u8),
}

impl Severity {
    /// The severity with this number, of which four bits count.
    #[must_use]
    pub const fn from_code(code: u8) -> Self {
        match code & 0x0F {
            0 => Self::Information,
            1 => Self::Warning,
            2 => Self::Error,
            other => Self::Reserved(other),
        }
    }

    /// Its number, 0 to 15.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Information => 0,
            Self::Warning => 1,
            Self::Error => 2,
            Self::Reserved(code) => code & 0x0F,
        }
    }

    /// For people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Information => "information",
            Self::Warning => "warning",
            Self::Error => "error",
            Self::Reserved(_) => "message",
        }
    }
}

/// A message of the history.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct DiagnosisMessage<'a> {
    /// Low word: the kind of code, 0xE800 for that of an emergency, which then stands in the high
    /// word; 0xE000 to 0xE7FF are the vendor's.
    pub code: u32,
    /// How serious it is.
    pub severity: Severity,
    /// Whether the time is that of the local clock, not the system time.
    pub local_time: bool,
    /// Number of the text.
    pub text: u16,
    /// When it happened, in ns; 0 when the SubDevice has no clock.
    pub time_ns: u64,
    /// How many parameters there are.
    pub count: u8,
    /// The parameters, one behind the other; see [`DiagnosisMessage::parameters`].
    pub parameters: &'a [u8],
}

impl<'a> DiagnosisMessage<'a> {
    /// Bytes in front of the parameters.
    pub const HEADER_LEN: usize = 16;
    /// Low word of a code that is the vendor's.
    pub const VENDOR: u16 = 0xE000;
    /// Low word of a code whose high word is that of an emergency.
    pub const EMERGENCY: u16 = 0xE800;

    const LOCAL: u16 = 1 << 4;

    /// Reads the value of subindex 6 or higher; `None` when it is shorter than a message.
    #[must_use]
    pub fn parse(value: &'a [u8]) -> Option<Self> {
        let (head, parameters) = value.split_first_chunk::<16>()?;
        let [c0, c1, c2, c3, flags, count, t0, t1, time @ ..] = *head;
        Some(Self {
            code: u32::from_le_bytes([c0, c1, c2, c3]),
            severity: Severity::from_code(flags),
            local_time: u16::from(flags) & Self::LOCAL != 0,
            text: u16::from_le_bytes([t0, t1]),
            time_ns: u64::from_le_bytes(time),
            count,
            parameters,
        })
    }

    /// Writes it and tells how many bytes that were.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when they do not fit.
    pub fn write(&self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let len = Self::HEADER_LEN + self.parameters.len();
        let buffer = BufferTooSmall::check(buffer, len)?;
        let local = if self.local_time { Self::LOCAL } else { 0 };
        let flags = u16::from(self.severity.code()) | local | u16::from(self.count) << 8;
        buffer[..4].copy_from_slice(&self.code.to_le_bytes());
        buffer[4..6].copy_from_slice(&flags.to_le_bytes());
        buffer[6..8].copy_from_slice(&self.text.to_le_bytes());
        buffer[8..Self::HEADER_LEN].copy_from_slice(&self.time_ns.to_le_bytes());
        buffer[Self::HEADER_LEN..].copy_from_slice(self.parameters);
        Ok(len)
    }

    /// Its parameters, as many as can be read.
    pub fn parameters(&self) -> impl Iterator<Item = Parameter<'a>> {
        let mut rest = self.parameters;
        (0..self.count).map_while(move |_| {
            let (parameter, behind) = Parameter::split(rest)?;
            rest = behind;
            Some(parameter)
        })
    }
}

/// The range that the code of a message belongs to, by its low word.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum CodeRange {
    /// 0x0000 to 0xDFFF: not used.
    Unused,
    /// 0xE000 to 0xE7FF: the manufacturer's; the high word is often a product.
    Manufacturer,
    /// 0xE800: the high word is the code of an emergency.
    Emergency,
    /// 0xE801 to 0xEDFF: reserved for standards.
    Reserved,
    /// 0xEE00 to 0xEFFF: of the profile of the device.
    Profile,
    /// 0xF000 to 0xFFFF: not assigned.
    Unassigned,
}

impl CodeRange {
    /// The range of this code.
    #[must_use]
    pub const fn of(code: u32) -> Self {
        match code as u16 {
            0x0000..=0xDFFF => Self::Unused,
            0xE000..=0xE7FF => Self::Manufacturer,
            0xE800 => Self::Emergency,
            0xE801..=0xEDFF => Self::Reserved,
            0xEE00..=0xEFFF => Self::Profile,
            0xF000..=0xFFFF => Self::Unassigned,
        }
    }

    /// Its name, for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unused => "a range that is not used",
            Self::Manufacturer => "of the manufacturer",
            Self::Emergency => "of an emergency",
            Self::Reserved => "reserved for standards",
            Self::Profile => "of the profile of the device",
            Self::Unassigned => "a range that is not assigned",
        }
    }
}

/// A parameter of a message.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Parameter<'a> {
    /// A value of a data type, lowest byte first.
    Value(DataType, &'a [u8]),
    /// Bytes.
    Bytes(&'a [u8]),
    /// A text of single bytes.
    Text(&'a [u8]),
    /// A text of two bytes a letter.
    WideText(&'a [u8]),
    /// The number of another text.
    TextNumber(u16),
}

impl<'a> Parameter<'a> {
    /// The first parameter, and what is behind it. `None` when it is cut off or its length cannot be
    /// known.
    fn split(bytes: &'a [u8]) -> Option<(Self, &'a [u8])> {
        let (kind, rest) = bytes.split_first_chunk()?;
        let kind = u16::from_le_bytes(*kind);
        let (class, low) = (kind >> 12, kind & 0x0FFF);
        let len = match class {
            0 => usize::from(DataType(low).bits()?).div_ceil(8),
            1..=3 => usize::from(low),
            4 => 2,
            _ => return None,
        };
        let (value, rest) = rest.split_at_checked(len)?;
        let parameter = match class {
            0 => Self::Value(DataType(low), value),
            1 => Self::Bytes(value),
            2 => Self::Text(value),
            3 => Self::WideText(value),
            _ => Self::TextNumber(u16::from_le_bytes(*value.first_chunk()?)),
        };
        Some((parameter, rest))
    }

    /// Puts it behind others. A value or text of more than 4,095 bytes is cut.
    pub fn push_to(&self, parameters: &mut Vec<u8>) {
        const LONGEST: usize = 0x0FFF;
        let cut = |value: &'a [u8]| value.get(..LONGEST).unwrap_or(value);
        let own;
        let (kind, value) = match *self {
            Self::Value(data_type, value) => (data_type.0 & 0x0FFF, cut(value)),
            Self::Bytes(value) => (0x1000 | cut(value).len() as u16, cut(value)),
            Self::Text(value) => (0x2000 | cut(value).len() as u16, cut(value)),
            Self::WideText(value) => (0x3000 | cut(value).len() as u16, cut(value)),
            Self::TextNumber(number) => {
                own = number.to_le_bytes();
                (0x4000, &own[..])
            }
        };
        parameters.extend(kind.to_le_bytes());
        parameters.extend(value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_these_bytes() {
        let mut parameters = Vec::new();
        Parameter::Value(DataType::USINT, &[0x3C]).push_to(&mut parameters);
        Parameter::Text(b"ab").push_to(&mut parameters);
        Parameter::TextNumber(0x1234).push_to(&mut parameters);
        let message = DiagnosisMessage {
            code: 0x0BEA_E000,
            severity: Severity::Warning,
            local_time: true,
            text: 0x4101,
            time_ns: 0x0102,
            count: 3,
            parameters: &parameters,
        };
        let mut bytes = [0; 64];
        let len = message.write(&mut bytes).unwrap();
        let expected = [
            0x00, 0xE0, 0xEA, 0x0B, 0x11, 3, 0x01, 0x41, 2, 1, 0, 0, 0, 0, 0, 0, //
            0x05, 0x00, 0x3C, 0x02, 0x20, b'a', b'b', 0x00, 0x40, 0x34, 0x12,
        ];
        assert_eq!(bytes[..len], expected);
        assert_eq!(DiagnosisMessage::parse(&expected), Some(message));
        let read: Vec<Parameter<'_>> = message.parameters().collect();
        assert_eq!(
            read,
            [
                Parameter::Value(DataType::USINT, &[0x3C]),
                Parameter::Text(b"ab"),
                Parameter::TextNumber(0x1234)
            ]
        );
        assert!(message.write(&mut bytes[..len - 1]).is_err());
    }

    // proves: SW-08
    #[test]
    fn the_five_messages_of_the_sources_are_read_with_type_flags_and_time() {
        let table = [
            (0x02, Severity::Error, 0x4413, 5_000_000_000_u64),
            (0x01, Severity::Warning, 0x4101, 4_000_000_000),
            (0x12, Severity::Error, 0x8406, 3_000_000_000),
            (0x00, Severity::Information, 0x0002, 2_000_000_000),
            (0x10, Severity::Information, 0x0003, 1_000_000_000),
        ];
        for (flags, severity, text, time_ns) in table {
            let mut bytes = vec![0x00, 0xE0, 0x15, 0x1B, flags, 1];
            bytes.extend_from_slice(&u16::to_le_bytes(text));
            bytes.extend_from_slice(&u64::to_le_bytes(time_ns));
            bytes.extend_from_slice(&[0x05, 0x00, 0x07]);
            let message = DiagnosisMessage::parse(&bytes).unwrap();
            assert_eq!((message.code, message.severity), (0x1B15_E000, severity), "{text:04X}");
            assert_eq!((message.text, message.time_ns), (text, time_ns));
            assert_eq!(message.local_time, flags & 0x10 != 0, "{text:04X}");
            let parameters: Vec<Parameter<'_>> = message.parameters().collect();
            assert_eq!(parameters, [Parameter::Value(DataType::USINT, &[7])], "{text:04X}");
        }
    }

    #[test]
    fn parameters_that_are_cut_off_end_the_list() {
        for rest in [&[0x07, 0x00, 1, 2, 3][..], &[0x05], &[0x09, 0x00, 1], &[0, 0xF0, 1], &[]] {
            let message = DiagnosisMessage {
                code: 0,
                severity: Severity::Error,
                local_time: false,
                text: 0,
                time_ns: 0,
                count: 2,
                parameters: rest,
            };
            assert_eq!(message.parameters().count(), 0, "{rest:?}");
        }
        assert_eq!(DiagnosisMessage::parse(&[0; 15]), None);
    }
}
