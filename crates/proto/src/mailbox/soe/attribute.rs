//! Attribute of an identification number: what its value is, and how it is shown.
//!
//! Reference: IEC 61800-7-204, attribute of a parameter; the bits are those of SOEM's `ec_SoEattributet`, whose length 0
//! is one byte, which IEC 61800-7-204 reserves for values that are no lists.

use std::fmt;

use crate::state::AlState;

/// The element "attribute".
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct SoeAttribute(pub u32);

/// Length of a value.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ValueLength {
    /// So many bytes: 2, 4 or 8.
    Fixed(u8),
    /// As many as it says itself, in elements of so many bytes: 1, 2, 4 or 8.
    List(u8),
    /// A length that has no meaning.
    Reserved,
}

/// Form in which a value is shown.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum DisplayFormat {
    /// 0: bits.
    Binary,
    /// 1: a decimal number without a sign.
    Unsigned,
    /// 2: a decimal number with a sign.
    Signed,
    /// 3: a hexadecimal number.
    Hexadecimal,
    /// 4: a text.
    Text,
    /// 5: an IDN.
    Idn,
    /// 6: a number with floating point.
    Float,
    /// 7: reserved; SERCOS III has times here.
    Reserved,
}

impl SoeAttribute {
    const LENGTH_AT: u32 = 16;
    const LIST: u32 = 1 << 18;
    const COMMAND: u32 = 1 << 19;
    const FORMAT_AT: u32 = 20;
    const DECIMALS_AT: u32 = 24;
    const PROTECTED_AT: u32 = 28;

    /// Bits 28, 29 and 30: it cannot be written in PREOP, SAFEOP and OP.
    pub const PROTECTED: u32 = 0x7 << Self::PROTECTED_AT;
    /// Bits 29 and 30: it can be written in PREOP alone.
    pub const PRE_OP_ONLY: u32 = 0x6 << Self::PROTECTED_AT;

    /// An attribute with conversion factor 1.
    #[must_use]
    pub const fn new(length: ValueLength, format: DisplayFormat, decimals: u8) -> Self {
        let (bytes, list) = match length {
            ValueLength::Fixed(bytes) => (bytes, 0),
            ValueLength::List(bytes) => (bytes, Self::LIST),
            ValueLength::Reserved => (1, 0),
        };
        let length = bytes.trailing_zeros() & 0x3;
        Self(
            1 | length << Self::LENGTH_AT
                | list
                | (format as u32) << Self::FORMAT_AT
                | (decimals as u32 & 0xF) << Self::DECIMALS_AT,
        )
    }

    /// The same with other bits set.
    #[must_use]
    pub const fn with(self, bits: u32) -> Self {
        Self(self.0 | bits)
    }

    /// The same of a procedure command.
    #[must_use]
    pub const fn of_command(self) -> Self {
        self.with(Self::COMMAND)
    }

    /// The attribute in these bytes; `None` for fewer than four.
    #[must_use]
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        bytes.first_chunk().map(|attribute| Self(u32::from_le_bytes(*attribute)))
    }

    /// Factor that gives a value in its unit, beside the decimal places.
    #[must_use]
    pub const fn conversion_factor(self) -> u16 {
        (self.0 & 0xFFFF) as u16
    }

    /// Length of the value.
    #[must_use]
    pub const fn length(self) -> ValueLength {
        let bytes = 1 << (self.0 >> Self::LENGTH_AT & 0x3);
        match (self.0 & Self::LIST != 0, bytes) {
            (true, bytes) => ValueLength::List(bytes),
            (false, 1) => ValueLength::Reserved,
            (false, bytes) => ValueLength::Fixed(bytes),
        }
    }

    /// True for a procedure command.
    #[must_use]
    pub const fn is_command(self) -> bool {
        self.0 & Self::COMMAND != 0
    }

    /// Form in which the value is shown.
    #[must_use]
    pub const fn format(self) -> DisplayFormat {
        match self.0 >> Self::FORMAT_AT & 0x7 {
            0 => DisplayFormat::Binary,
            1 => DisplayFormat::Unsigned,
            2 => DisplayFormat::Signed,
            3 => DisplayFormat::Hexadecimal,
            4 => DisplayFormat::Text,
            5 => DisplayFormat::Idn,
            6 => DisplayFormat::Float,
            _ => DisplayFormat::Reserved,
        }
    }

    /// Decimal places of the value, 0 to 15.
    #[must_use]
    pub const fn decimals(self) -> u8 {
        (self.0 >> Self::DECIMALS_AT & 0xF) as u8
    }

    /// True if the value cannot be written in this state: PREOP is phase 2 of SERCOS, SAFEOP 3, OP 4.
    #[must_use]
    pub const fn is_protected_in(self, state: AlState) -> bool {
        let phase = match state {
            AlState::Init | AlState::Boot => return true,
            AlState::PreOp => 0,
            AlState::SafeOp => 1,
            AlState::Op => 2,
        };
        self.0 >> (Self::PROTECTED_AT + phase) & 1 != 0
    }

    /// States in which the value can be written, in words.
    #[must_use]
    pub fn writable_in(self) -> String {
        let states = [AlState::PreOp, AlState::SafeOp, AlState::Op];
        let open = states.into_iter().filter(|state| !self.is_protected_in(*state));
        let open: Vec<String> = open.map(|state| state.to_string()).collect();
        if open.is_empty() { "no state".to_owned() } else { open.join(", ") }
    }
}

impl DisplayFormat {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Binary => "binary",
            Self::Unsigned => "unsigned",
            Self::Signed => "signed",
            Self::Hexadecimal => "hexadecimal",
            Self::Text => "text",
            Self::Idn => "IDN",
            Self::Float => "float",
            Self::Reserved => "reserved",
        }
    }
}

impl fmt::Display for ValueLength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(bytes) => write!(f, "{bytes} bytes"),
            Self::List(1) => f.write_str("list of 1 byte each"),
            Self::List(bytes) => write!(f, "list of {bytes} bytes each"),
            Self::Reserved => f.write_str("reserved length"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attribute_says_length_format_and_protection() {
        // attribute, length, format, decimals, command, states in which it is writable
        let table = [
            (
                0x0001_0001,
                ValueLength::Fixed(2),
                DisplayFormat::Binary,
                0,
                false,
                "PREOP, SAFEOP, OP",
            ),
            (0x7022_0001, ValueLength::Fixed(4), DisplayFormat::Signed, 0, false, "no state"),
            (
                0x0113_0001,
                ValueLength::Fixed(8),
                DisplayFormat::Unsigned,
                1,
                false,
                "PREOP, SAFEOP, OP",
            ),
            (0x7055_0001, ValueLength::List(2), DisplayFormat::Idn, 0, false, "no state"),
            (0x6044_0001, ValueLength::List(1), DisplayFormat::Text, 0, false, "PREOP"),
            (
                0x0009_0001,
                ValueLength::Fixed(2),
                DisplayFormat::Binary,
                0,
                true,
                "PREOP, SAFEOP, OP",
            ),
            (
                0x0F30_0001,
                ValueLength::Reserved,
                DisplayFormat::Hexadecimal,
                15,
                false,
                "PREOP, SAFEOP, OP",
            ),
            (0x3066_0001, ValueLength::List(4), DisplayFormat::Float, 0, false, "OP"),
        ];
        for (bits, length, format, decimals, command, writable) in table {
            let attribute = SoeAttribute(bits);
            assert_eq!(attribute.length(), length, "{bits:#X}");
            assert_eq!(attribute.format(), format, "{bits:#X}");
            assert_eq!(attribute.decimals(), decimals, "{bits:#X}");
            assert_eq!(attribute.is_command(), command, "{bits:#X}");
            assert_eq!(attribute.writable_in(), writable, "{bits:#X}");
            assert_eq!(attribute.conversion_factor(), 1);
            let mut made = SoeAttribute::new(length, format, decimals).with(bits & 0x7000_0000);
            if command {
                made = made.of_command();
            }
            assert_eq!(made, attribute, "{bits:#X}");
        }
        assert!(SoeAttribute(0).is_protected_in(AlState::Init), "there is no mailbox");
        assert_eq!(SoeAttribute::parse(&[1, 0, 0x22]), None);
        assert_eq!(SoeAttribute::parse(&[1, 0, 0x22, 0x70]), Some(SoeAttribute(0x7022_0001)));
    }
}
