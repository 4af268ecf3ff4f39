//! Identification numbers of the drive: name, unit, attribute, limits, and the source of each value.
//!
//! Reference: IEC 61800-7-204 for the S parameters; P parameters are the drive's own. Velocities are in 2⁻¹⁸ turns per second,
//! positions in 2⁻²⁰ turns, as in its telegrams.

use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::mailbox::soe::{
    ALL_COMMANDS, ALL_NUMBERS, DisplayFormat, Idn, SoeAttribute, ValueLength, VariableData,
};
use linesman_proto::time::Span;

use crate::device::dictionary::Dictionary;

/// P-0-0150: writable in PREOP alone.
pub(in crate::device) const BRAKE_DELAY: Idn = Idn(0x8000 | 150);
/// P-0-0151: a text.
pub(in crate::device) const NOTES: Idn = Idn(0x8000 | 151);
/// The most bytes of that text.
pub(in crate::device) const NOTES_LEN: u16 = 240;

/// A parameter.
#[derive(Debug)]
pub(super) struct DriveParameter {
    pub(super) idn: Idn,
    pub(super) name: &'static str,
    /// Empty where there is none.
    pub(super) unit: &'static str,
    pub(super) attribute: SoeAttribute,
    /// Least and greatest value.
    pub(super) limits: Option<(i64, i64)>,
    pub(super) source: ValueSource,
    pub(super) rule: WriteRule,
}

/// Source of a value.
#[derive(Clone, Copy, Debug)]
pub(super) enum ValueSource {
    /// It is always this number.
    Number(u64),
    /// The entry of the dictionary whose index is the IDN: what the application has.
    Entry,
    /// These bytes.
    Bytes(&'static [u8]),
    /// The list of these IDNs.
    Numbers(&'static [u16]),
    /// The list of all IDNs.
    AllNumbers,
    /// The list of all procedure commands.
    AllCommands,
    /// Value written to a procedure command, which takes this time.
    Command(Span),
}

/// Outcome of a write to the value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum WriteRule {
    /// It cannot be changed.
    Never,
    /// It is part of the process data.
    Cyclic,
    /// The drive can do this one alone, in PREOP: others are not supported.
    AsItIs,
    /// It is taken within the limits.
    Taken,
}

const FIXED: u32 = SoeAttribute::PROTECTED;
const PRE_OP_ONLY: u32 = SoeAttribute::PRE_OP_ONLY;
const WORD: ValueLength = ValueLength::Fixed(2);
const DOUBLE: ValueLength = ValueLength::Fixed(4);
const VELOCITY: &str = "2^-18 rev/s";
const POSITION: &str = "2^-20 rev";
/// Greatest velocity: 100 turns per second.
const MOST_VELOCITY: i64 = 100 << 18;
/// Telegram type: what the AT and the MDT hold is told by the lists S-0-0016 and S-0-0024.
const CONFIGURED_TELEGRAM: u64 = 7;

const fn parameter(
    idn: Idn,
    name: &'static str,
    attribute: SoeAttribute,
    source: ValueSource,
    rule: WriteRule,
) -> DriveParameter {
    DriveParameter { idn, name, unit: "", attribute, limits: None, source, rule }
}

const fn number(
    idn: u16,
    name: &'static str,
    (length, format): (ValueLength, DisplayFormat),
    source: ValueSource,
) -> DriveParameter {
    let attribute = SoeAttribute::new(length, format, 0).with(FIXED);
    parameter(Idn(idn), name, attribute, source, WriteRule::Never)
}

const fn list(idn: Idn, name: &'static str, source: ValueSource) -> DriveParameter {
    let attribute = SoeAttribute::new(ValueLength::List(2), DisplayFormat::Idn, 0).with(FIXED);
    parameter(idn, name, attribute, source, WriteRule::Never)
}

const fn command(idn: u16, name: &'static str, takes: Span) -> DriveParameter {
    let attribute = SoeAttribute::new(WORD, DisplayFormat::Binary, 0).of_command();
    parameter(Idn(idn), name, attribute, ValueSource::Command(takes), WriteRule::Taken)
}

/// A list of a telegram: it is written in PREOP, as it is.
const fn telegram(idn: u16, name: &'static str, numbers: &'static [u16]) -> DriveParameter {
    let attribute =
        SoeAttribute::new(ValueLength::List(2), DisplayFormat::Idn, 0).with(PRE_OP_ONLY);
    parameter(Idn(idn), name, attribute, ValueSource::Numbers(numbers), WriteRule::AsItIs)
}

const TEXT: ValueLength = ValueLength::List(1);

/// All parameters in the order of their IDNs.
pub(super) const PARAMETERS: &[DriveParameter] = &[
    number(11, "Class 1 diagnostic (C1D)", (WORD, DisplayFormat::Binary), ValueSource::Number(0)),
    number(12, "Class 2 diagnostic (C2D)", (WORD, DisplayFormat::Binary), ValueSource::Number(0)),
    DriveParameter {
        attribute: SoeAttribute::new(WORD, DisplayFormat::Binary, 0).with(PRE_OP_ONLY),
        rule: WriteRule::AsItIs,
        ..number(
            15,
            "Telegram type parameter",
            (WORD, DisplayFormat::Binary),
            ValueSource::Number(CONFIGURED_TELEGRAM),
        )
    },
    telegram(16, "Configuration list of AT", &[135, 51]),
    list(ALL_NUMBERS, "IDN-list of all operation data", ValueSource::AllNumbers),
    telegram(24, "Configuration list of MDT", &[134, 36]),
    list(ALL_COMMANDS, "IDN-list of all procedure commands", ValueSource::AllCommands),
    parameter(
        Idn(30),
        "Manufacturer version",
        SoeAttribute::new(TEXT, DisplayFormat::Text, 0).with(FIXED),
        ValueSource::Bytes(b"virtual drive 1"),
        WriteRule::Never,
    ),
    DriveParameter {
        unit: VELOCITY,
        limits: Some((-MOST_VELOCITY, MOST_VELOCITY)),
        rule: WriteRule::Cyclic,
        ..number(36, "Velocity command value", (DOUBLE, DisplayFormat::Signed), ValueSource::Entry)
    },
    DriveParameter {
        unit: VELOCITY,
        ..number(
            40,
            "Velocity feedback value 1",
            (DOUBLE, DisplayFormat::Signed),
            ValueSource::Entry,
        )
    },
    DriveParameter {
        unit: POSITION,
        ..number(
            51,
            "Position feedback 1 value",
            (DOUBLE, DisplayFormat::Signed),
            ValueSource::Entry,
        )
    },
    DriveParameter {
        unit: VELOCITY,
        limits: Some((0, MOST_VELOCITY)),
        ..parameter(
            Idn(91),
            "Bipolar velocity limit value",
            SoeAttribute::new(DOUBLE, DisplayFormat::Unsigned, 0),
            ValueSource::Entry,
            WriteRule::Taken,
        )
    },
    command(99, "Reset class 1 diagnostic", Span::ms(20)),
    DriveParameter {
        rule: WriteRule::Cyclic,
        ..number(134, "Master control word", (WORD, DisplayFormat::Binary), ValueSource::Entry)
    },
    number(135, "Drive status word", (WORD, DisplayFormat::Binary), ValueSource::Entry),
    DriveParameter {
        unit: "ms",
        limits: Some((0, 10_000)),
        ..parameter(
            BRAKE_DELAY,
            "Switch-off delay of the brake",
            SoeAttribute::new(WORD, DisplayFormat::Unsigned, 1).with(PRE_OP_ONLY),
            ValueSource::Entry,
            WriteRule::Taken,
        )
    },
    parameter(
        NOTES,
        "Commissioning notes",
        SoeAttribute::new(TEXT, DisplayFormat::Text, 0),
        ValueSource::Entry,
        WriteRule::Taken,
    ),
    // It turns the axis, which must be enabled for it.
    command(0x8000 | 160, "Calibrate the commutation offset", Span::s(2)),
];

impl DriveParameter {
    /// The parameter of the first drive with this IDN.
    pub(super) fn find(idn: Idn) -> Option<&'static Self> {
        PARAMETERS.iter().find(|parameter| parameter.idn == idn)
    }

    /// The entry of the dictionary that has its value.
    pub(super) const fn entry(&self) -> ObjectAddress {
        ObjectAddress { index: ObjectIndex(self.idn.0), subindex: 0 }
    }

    /// The most bytes that its value can have, without those in front of a list.
    pub(super) fn most(&self) -> u16 {
        match (self.source, self.attribute.length()) {
            (_, ValueLength::Fixed(bytes)) => u16::from(bytes),
            (ValueSource::Numbers(numbers), _) => 2 * numbers.len() as u16,
            (ValueSource::Bytes(bytes), _) => bytes.len() as u16,
            (ValueSource::AllNumbers, _) => 2 * PARAMETERS.len() as u16,
            (ValueSource::AllCommands, _) => 2 * commands().count() as u16,
            (_, ValueLength::List(_) | ValueLength::Reserved) => NOTES_LEN,
        }
    }

    /// Its value, but for that of a procedure command; of a list without the bytes in front of it.
    pub(super) fn value(&self, dictionary: &Dictionary) -> Vec<u8> {
        let number = |number: u64| number.to_le_bytes()[..usize::from(self.most())].to_vec();
        let list = |numbers: &[u16]| numbers.iter().flat_map(|idn| idn.to_le_bytes()).collect();
        let of = |parameter: &Self| parameter.idn.0;
        match self.source {
            ValueSource::Number(fixed) => number(fixed),
            ValueSource::Bytes(bytes) => bytes.to_vec(),
            ValueSource::Numbers(numbers) => list(numbers),
            ValueSource::AllNumbers => list(&PARAMETERS.iter().map(of).collect::<Vec<_>>()),
            ValueSource::AllCommands => list(&commands().map(of).collect::<Vec<_>>()),
            ValueSource::Command(_) => number(0),
            ValueSource::Entry => {
                let entry = dictionary.find(self.entry()).and_then(|at| dictionary.entry(at));
                entry.map(|entry| entry.value.clone()).unwrap_or_default()
            }
        }
    }

    /// Bytes of its value as a message carries them.
    pub(super) fn carried(&self, value: &[u8]) -> Vec<u8> {
        match self.attribute.length() {
            ValueLength::Fixed(_) | ValueLength::Reserved => value.to_vec(),
            ValueLength::List(_) => of_variable_length(value, self.most()),
        }
    }

    /// A limit in the length of the value.
    pub(super) fn limit(&self, limit: i64) -> Vec<u8> {
        limit.to_le_bytes()[..usize::from(self.most()).min(8)].to_vec()
    }

    /// The number in the bytes of a value, by its format.
    pub(super) fn number(&self, value: &[u8]) -> i64 {
        let number = value.iter().rev().fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
        let unused = 64_u32.saturating_sub(8 * value.len() as u32);
        if self.attribute.format() == DisplayFormat::Signed && unused < 64 {
            (number << unused).cast_signed() >> unused
        } else {
            number.cast_signed()
        }
    }
}

fn commands() -> impl Iterator<Item = &'static DriveParameter> {
    PARAMETERS.iter().filter(|parameter| parameter.attribute.is_command())
}

/// The length now, the most it can have, and the data.
pub(super) fn of_variable_length(bytes: &[u8], most: u16) -> Vec<u8> {
    VariableData { most, bytes }.to_bytes().unwrap_or_default()
}
