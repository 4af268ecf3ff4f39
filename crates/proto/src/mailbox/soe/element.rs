//! Elements of an identification number, and the two forms of their data.
//!
//! Reference: ETG.1000.6, SoE (elements); IEC 61800-7-204 for what each holds. The bits are those of SOEM's `ec_soe`
//! (`EC_SOE_DATASTATE_B` 0x01 to `EC_SOE_DEFAULT_B` 0x80).

use super::Idn;

/// The element "data state".
pub const DATA_STATE: u8 = 0x01;
/// The element "name".
pub const NAME: u8 = 0x02;
/// The element "attribute".
pub const ATTRIBUTE: u8 = 0x04;
/// The element "unit".
pub const UNIT: u8 = 0x08;
/// The element "minimum".
pub const MINIMUM: u8 = 0x10;
/// The element "maximum".
pub const MAXIMUM: u8 = 0x20;
/// The element "value".
pub const VALUE: u8 = 0x40;
/// The element "default".
pub const DEFAULT: u8 = 0x80;

/// Bits and names of all elements, in the order in which a message carries them.
pub const ELEMENTS: [(u8, &str); 8] = [
    (DATA_STATE, "data state"),
    (NAME, "name"),
    (ATTRIBUTE, "attribute"),
    (UNIT, "unit"),
    (MINIMUM, "minimum"),
    (MAXIMUM, "maximum"),
    (VALUE, "value"),
    (DEFAULT, "default"),
];

/// The elements that these bits name, in words: `value`, `name, unit`; `no element`.
#[must_use]
pub fn elements_in_words(elements: u8) -> String {
    let named = ELEMENTS.iter().filter(|(bit, _)| elements & bit != 0).map(|(_, name)| *name);
    let named: Vec<&str> = named.collect();
    if named.is_empty() { "no element".to_owned() } else { named.join(", ") }
}

/// IDN S-0-0017: the list of all IDNs of the drive.
pub const ALL_NUMBERS: Idn = Idn(17);
/// IDN S-0-0025: the list of all procedure commands of the drive.
pub const ALL_COMMANDS: Idn = Idn(25);

/// Bytes in front of data of variable length: the length of them now, and the most it can have.
pub const LIST_HEADER_LEN: usize = 4;

/// Data of variable length: a list, a text.
///
/// Reference: IEC 61800-7-204, data of variable length: two lengths in bytes, two bytes each, then the elements.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct VariableData<'a> {
    /// The most bytes that it can have.
    pub most: u16,
    /// Its bytes.
    pub bytes: &'a [u8],
}

impl<'a> VariableData<'a> {
    /// The list in these bytes, which may be followed by others; `None` where they are fewer than it says.
    #[must_use]
    pub fn parse(value: &'a [u8]) -> Option<Self> {
        let ([low, high, most_low, most_high], list) = value.split_first_chunk()?;
        let bytes = list.get(..usize::from(u16::from_le_bytes([*low, *high])))?;
        Some(Self { most: u16::from_le_bytes([*most_low, *most_high]), bytes })
    }

    /// The bytes of it; `None` where it is longer than two bytes can tell.
    #[must_use]
    pub fn to_bytes(&self) -> Option<Vec<u8>> {
        let len = u16::try_from(self.bytes.len()).ok()?;
        Some([&len.to_le_bytes(), &self.most.to_le_bytes(), self.bytes].concat())
    }
}

/// IDNs of a list, such as the value of [`ALL_NUMBERS`]; `None` where it is shorter than it says.
#[must_use]
pub fn numbers_of_list(value: &[u8]) -> Option<Vec<Idn>> {
    let list = VariableData::parse(value)?.bytes;
    Some(list.as_chunks().0.iter().map(|number| Idn(u16::from_le_bytes(*number))).collect())
}

/// State of a procedure command: the element "data state" of its IDN.
///
/// Reference: IEC 61800-7-204, procedure command acknowledgement; the values are those of `E_SoE_CmdState` in the Beckhoff
/// Information System (`Tc2_Drive`): 3 done, 5 interrupted, 7 under way, 15 error.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct CommandState(pub u16);

/// Progress of a procedure command.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum CommandProgress {
    /// Nobody has set it.
    NotSet,
    /// It is set, and not enabled.
    Set,
    /// It is under way.
    Running,
    /// It is set, and its execution is interrupted.
    Interrupted,
    /// It was executed.
    Done,
    /// It came to an error.
    Failed,
}

impl CommandState {
    const SET: u16 = 0x0001;
    const ENABLED: u16 = 0x0002;
    const NOT_EXECUTED: u16 = 0x0004;
    const ERROR: u16 = 0x0008;

    /// Value that a MainDevice writes to set a command and enable its execution.
    pub const SET_AND_ENABLE: u16 = 3;
    /// Value that takes a command back.
    pub const CANCEL: u16 = 0;

    /// The state in these bytes; `None` for fewer than two.
    #[must_use]
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        bytes.first_chunk().map(|state| Self(u16::from_le_bytes(*state)))
    }

    /// The state that tells this progress.
    #[must_use]
    pub const fn of(progress: CommandProgress) -> Self {
        Self(match progress {
            CommandProgress::NotSet => 0,
            CommandProgress::Set => Self::SET,
            CommandProgress::Running => Self::SET | Self::ENABLED | Self::NOT_EXECUTED,
            CommandProgress::Interrupted => Self::SET | Self::NOT_EXECUTED,
            CommandProgress::Done => Self::SET | Self::ENABLED,
            CommandProgress::Failed => Self::SET | Self::ENABLED | Self::NOT_EXECUTED | Self::ERROR,
        })
    }

    /// Progress of the command.
    #[must_use]
    pub const fn progress(self) -> CommandProgress {
        let (error, waits) = (self.0 & Self::ERROR != 0, self.0 & Self::NOT_EXECUTED != 0);
        let (enabled, set) = (self.0 & Self::ENABLED != 0, self.0 & Self::SET != 0);
        match (error, waits, enabled, set) {
            (true, _, _, _) => CommandProgress::Failed,
            (false, true, true, _) => CommandProgress::Running,
            (false, true, false, _) => CommandProgress::Interrupted,
            (false, false, true, _) => CommandProgress::Done,
            (false, false, false, true) => CommandProgress::Set,
            (false, false, false, false) => CommandProgress::NotSet,
        }
    }
}

impl CommandProgress {
    /// True if its execution has ended, well or not.
    #[must_use]
    pub const fn has_ended(self) -> bool {
        matches!(self, Self::Done | Self::Failed)
    }

    /// In words.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::NotSet => "not set",
            Self::Set => "set, not enabled",
            Self::Running => "still running",
            Self::Interrupted => "interrupted",
            Self::Done => "done",
            Self::Failed => "error",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn list_of_numbers_is_as_long_as_it_says() {
        let list = [4, 0, 8, 0, 17, 0, 1, 0x80, 9, 9];
        assert_eq!(numbers_of_list(&list), Some(vec![ALL_NUMBERS, Idn(0x8001)]));
        assert_eq!(numbers_of_list(&list[..7]), None);
        assert_eq!(numbers_of_list(&[0, 0, 0]), None);
        assert_eq!(numbers_of_list(&[0, 0, 0, 0]), Some(Vec::new()));
        let parsed = VariableData::parse(&list).unwrap();
        assert_eq!(parsed, VariableData { most: 8, bytes: &list[4..8] });
        assert_eq!(parsed.to_bytes().as_deref(), Some(&list[..8]));
        let long = VariableData { most: 0, bytes: &[0; 0x1_0000] };
        assert_eq!(long.to_bytes(), None);
    }

    #[test]
    fn elements_are_named_in_their_order() {
        for (elements, words) in [
            (VALUE, "value"),
            (UNIT | NAME, "name, unit"),
            (0x81, "data state, default"),
            (0, "no element"),
        ] {
            assert_eq!(elements_in_words(elements), words);
        }
        let all = ELEMENTS.iter().fold(0, |all, (bit, _)| all | bit);
        assert_eq!(all, 0xFF);
    }

    #[test]
    fn data_state_of_a_command_tells_its_progress() {
        let table = [
            (0, CommandProgress::NotSet),
            (1, CommandProgress::Set),
            (2, CommandProgress::Done),
            (3, CommandProgress::Done),
            (5, CommandProgress::Interrupted),
            (7, CommandProgress::Running),
            (9, CommandProgress::Failed),
            (15, CommandProgress::Failed),
            (0x0107, CommandProgress::Running),
        ];
        for (state, progress) in table {
            assert_eq!(CommandState(state).progress(), progress, "{state}");
            assert_eq!(CommandState::of(progress).progress(), progress, "{state}");
        }
        assert_eq!(CommandState::parse(&[7, 0]), Some(CommandState(7)));
        assert_eq!(CommandState::parse(&[7]), None);
    }
}
