//! The five states of the EtherCAT state machine, as a value of four bits.
//!
//! Read first: S2 2.5.1 and 2.5.2 (registers 0x0120, 0x0130) and ETG.1000.6, EtherCAT state
//! machine. The four bits are one *value*, never a set of flags: 3 is BOOT, not INIT with PREOP.
//! Only a broadcast read breaks that rule, since it ORs what all controllers answer; for its data
//! there is [`OredStates`].

use std::fmt;

/// A state of the EtherCAT state machine.
///
/// The order is the one of "how far up is it": INIT, BOOT, PREOP, SAFEOP, OP. BOOT ranks right
/// above INIT, the only state it can be entered from and left to.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum AlState {
    /// No mailbox, no process data: registers and SII only.
    Init,
    /// Firmware update: FoE over the bootstrap mailbox, nothing else.
    Boot,
    /// Mailbox, no process data.
    PreOp,
    /// Mailbox and inputs; outputs stay in their safe state.
    SafeOp,
    /// Mailbox, inputs and outputs.
    Op,
}

impl AlState {
    /// All five, in their order.
    pub const ALL: [Self; 5] = [Self::Init, Self::Boot, Self::PreOp, Self::SafeOp, Self::Op];

    /// The value of the four-bit field: 1 INIT, 2 PREOP, 3 BOOT, 4 SAFEOP, 8 OP.
    #[must_use]
    pub const fn bits(self) -> u8 {
        match self {
            Self::Init => 1,
            Self::PreOp => 2,
            Self::Boot => 3,
            Self::SafeOp => 4,
            Self::Op => 8,
        }
    }

    /// What the data of a broadcast read of AL status say about the states of all who answered.
    #[must_use]
    pub const fn from_or(value: u8) -> OredStates {
        OredStates(value)
    }

    /// The name as engineers write it: `INIT`, `BOOT`, `PREOP`, `SAFEOP`, `OP`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Init => "INIT",
            Self::Boot => "BOOT",
            Self::PreOp => "PREOP",
            Self::SafeOp => "SAFEOP",
            Self::Op => "OP",
        }
    }

    /// The state a person wrote, in either case, with or without the hyphen of `PRE-OP`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let letters =
            name.bytes().filter(|byte| *byte != b'-').map(|byte| byte.to_ascii_uppercase());
        Self::ALL.into_iter().find(|state| letters.clone().eq(state.name().bytes()))
    }

    /// Whether the mailbox works in this state. In BOOT it does, for FoE only.
    #[must_use]
    pub const fn has_mailbox(self) -> bool {
        match self {
            Self::Init => false,
            Self::Boot | Self::PreOp | Self::SafeOp | Self::Op => true,
        }
    }

    /// Whether inputs are valid in this state.
    #[must_use]
    pub const fn has_inputs(self) -> bool {
        match self {
            Self::Init | Self::Boot | Self::PreOp => false,
            Self::SafeOp | Self::Op => true,
        }
    }

    /// Whether outputs take effect in this state.
    #[must_use]
    pub const fn has_outputs(self) -> bool {
        match self {
            Self::Init | Self::Boot | Self::PreOp | Self::SafeOp => false,
            Self::Op => true,
        }
    }
}

impl fmt::Display for AlState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The four-bit state field of AL control or AL status: one of the five states, or a value that
/// names none (0, 5, 6, 7, 9..=15), kept as it is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum StateValue {
    /// A state.
    Known(AlState),
    /// A value without a meaning.
    Unknown(u8),
}

impl StateValue {
    /// The value in the low four bits of `bits`; the others are ignored.
    #[must_use]
    #[inline]
    pub const fn from_bits(bits: u8) -> Self {
        match bits & 0x0F {
            1 => Self::Known(AlState::Init),
            2 => Self::Known(AlState::PreOp),
            3 => Self::Known(AlState::Boot),
            4 => Self::Known(AlState::SafeOp),
            8 => Self::Known(AlState::Op),
            unknown => Self::Unknown(unknown),
        }
    }

    /// The value for the four-bit field.
    #[must_use]
    #[inline]
    pub const fn bits(self) -> u8 {
        match self {
            Self::Known(state) => state.bits(),
            Self::Unknown(bits) => bits & 0x0F,
        }
    }

    /// The state, if the value names one.
    #[must_use]
    #[inline]
    pub const fn state(self) -> Option<AlState> {
        match self {
            Self::Known(state) => Some(state),
            Self::Unknown(_) => None,
        }
    }
}

impl fmt::Display for StateValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known(state) => state.fmt(f),
            Self::Unknown(bits) => write!(f, "UNKNOWN({bits})"),
        }
    }
}

/// AL status of many controllers, ORed together by a broadcast read.
///
/// 0x19 is no state: it says that somebody is in OP (only OP has bit 3), somebody is in INIT (bit 0
/// without bit 1 is INIT) and somebody shows an error. Where the sum is ambiguous this type says
/// so: 3 is one controller in BOOT, or one in INIT and another in PREOP. SAFEOP and OP never hide,
/// since each has a bit of its own; INIT and PREOP hide behind BOOT.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct OredStates(u8);

impl OredStates {
    /// The ORed byte as it was read.
    #[must_use]
    pub const fn value(self) -> u8 {
        self.0
    }

    /// Whether at least one of them signals an error (bit 4).
    #[must_use]
    #[inline]
    pub const fn any_error(self) -> bool {
        self.0 & 0x10 != 0
    }

    /// The one state that all who answered are in; `None` when they differ or it cannot be told.
    ///
    /// A controller that answers 0, which is no state, does not show in the sum.
    #[must_use]
    #[inline]
    pub const fn all_in(self) -> Option<AlState> {
        match self.0 & 0x0F {
            1 => Some(AlState::Init),
            2 => Some(AlState::PreOp),
            4 => Some(AlState::SafeOp),
            8 => Some(AlState::Op),
            _ => None,
        }
    }

    /// Whether some controller may be in this state: all its bits are in the sum.
    #[must_use]
    pub const fn possible(self, state: AlState) -> bool {
        self.0 & state.bits() == state.bits()
    }

    /// Whether some controller must be in this state: a bit of the sum has no other source.
    #[must_use]
    pub fn certain(self, state: AlState) -> bool {
        let others = AlState::ALL
            .into_iter()
            .filter(|other| *other != state && self.possible(*other))
            .fold(0, |bits, other| bits | other.bits());
        self.possible(state) && state.bits() & !others != 0
    }

    /// The highest state that some controller is certainly in.
    ///
    /// `None` when there is none: for 0, and for 3, which is BOOT, or INIT with PREOP. Reading the
    /// controllers one by one settles it.
    #[must_use]
    #[inline]
    pub const fn highest(self) -> Option<AlState> {
        match self.0 & 0x0F {
            8.. => Some(AlState::Op),
            4.. => Some(AlState::SafeOp),
            2 => Some(AlState::PreOp),
            1 => Some(AlState::Init),
            _ => None,
        }
    }
}

impl fmt::Display for OredStates {
    /// The states that are certain, lowest first, or the possible ones if none is: `INIT+OP`,
    /// `INIT?BOOT?PREOP?`; with ` ERR` behind when somebody signals an error.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut first = true;
        for state in AlState::ALL.into_iter().filter(|state| self.certain(*state)) {
            write!(f, "{}{state}", if first { "" } else { "+" })?;
            first = false;
        }
        if first {
            for state in AlState::ALL.into_iter().filter(|state| self.possible(*state)) {
                write!(f, "{state}?")?;
                first = false;
            }
        }
        if first {
            f.write_str("none")?;
        }
        if self.any_error() {
            f.write_str(" ERR")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use AlState::{Boot, Init, Op, PreOp, SafeOp};

    // proves: PLC-05 partial
    #[test]
    fn the_nibble_is_a_value_not_a_set_of_bits() {
        for bits in 0..=0xFFu8 {
            let expected = match bits & 0x0F {
                1 => StateValue::Known(Init),
                2 => StateValue::Known(PreOp),
                3 => StateValue::Known(Boot),
                4 => StateValue::Known(SafeOp),
                8 => StateValue::Known(Op),
                other => StateValue::Unknown(other),
            };
            let value = StateValue::from_bits(bits);
            assert_eq!(value, expected, "{bits:#04X}");
            assert_eq!(value.bits(), bits & 0x0F);
        }
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        for state in AlState::ALL {
            assert_eq!(AlState::from_name(state.name()), Some(state));
            assert_eq!(AlState::from_name(&state.name().to_lowercase()), Some(state));
        }
        assert_eq!(AlState::from_name("Safe-Op"), Some(SafeOp));
        assert_eq!(AlState::from_name("PRE-OP"), Some(PreOp));
        assert_eq!(AlState::from_name("OPERATIONAL"), None);
        assert_eq!(AlState::from_name(""), None);
    }

    #[test]
    fn states_rank_by_how_far_up_they_are() {
        assert!(Init < Boot && Boot < PreOp && PreOp < SafeOp && SafeOp < Op);
    }

    #[test]
    fn ored_states_say_what_is_certain_and_no_more() {
        // sum, all in, highest certain, text
        let table = [
            (0x00, None, None, "none"),
            (0x01, Some(Init), Some(Init), "INIT"),
            (0x02, Some(PreOp), Some(PreOp), "PREOP"),
            (0x03, None, None, "INIT?BOOT?PREOP?"),
            (0x04, Some(SafeOp), Some(SafeOp), "SAFEOP"),
            (0x08, Some(Op), Some(Op), "OP"),
            (0x0C, None, Some(Op), "SAFEOP+OP"),
            (0x0A, None, Some(Op), "PREOP+OP"),
            (0x0B, None, Some(Op), "OP"),
            (0x19, None, Some(Op), "INIT+OP ERR"),
            (0x12, Some(PreOp), Some(PreOp), "PREOP ERR"),
        ];
        for (sum, all_in, highest, text) in table {
            let states = AlState::from_or(sum);
            assert_eq!(states.all_in(), all_in, "{sum:#04X}: all in");
            assert_eq!(states.highest(), highest, "{sum:#04X}: highest");
            assert_eq!(states.to_string(), text, "{sum:#04X}: text");
        }
    }

    /// Whatever set of states is ORed: nothing certain is absent, nothing present is impossible.
    #[test]
    fn every_set_of_states_agrees_with_its_sum() {
        for set in 1..32u8 {
            let present: Vec<AlState> = AlState::ALL
                .into_iter()
                .enumerate()
                .filter(|(index, _)| set & (1 << index) != 0)
                .map(|(_, state)| state)
                .collect();
            let sum = present.iter().fold(0, |bits, state| bits | state.bits());
            let ored = AlState::from_or(sum);
            for state in AlState::ALL {
                if present.contains(&state) {
                    assert!(ored.possible(state), "{present:?}: {state} must be possible");
                }
                if ored.certain(state) {
                    assert!(present.contains(&state), "{present:?}: {state} must be present");
                }
            }
            if let Some(all) = ored.all_in() {
                assert!(present.iter().all(|state| *state == all), "{present:?}: not all in {all}");
            }
            if let Some(highest) = ored.highest() {
                assert_eq!(present.iter().max(), Some(&highest), "{present:?}");
            }
        }
    }
}
