//! The state word that a control program sees of each SubDevice, and its text.
//!
//! Reference: vendor documentation of the cyclic `State` variable (low byte device state, high byte
//! link state). The word sums up what the MainDevice knows; no register holds it.

use std::fmt;
use std::str::FromStr;

use crate::port::{Port, PortMap};
use crate::state::al_state::{AlState, StateValue};

/// A SubDevice's state word: software in the low byte, wiring in the high byte.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct DeviceState(pub u16);

impl DeviceState {
    /// OP, and nothing wrong.
    pub const OP: Self = Self::new(StateValue::Known(AlState::Op));

    /// The SubDevice signals an error in AL status.
    pub const ERROR: u16 = 0x0010;
    /// Vendor, product, revision or serial number read is not the configured one.
    pub const WRONG_IDENTITY: u16 = 0x0020;
    /// A command of the start-up list failed.
    pub const INIT_ERROR: u16 = 0x0040;
    /// The SubDevice is switched off in the configuration.
    pub const DISABLED: u16 = 0x0080;
    /// The SubDevice does not answer.
    pub const NOT_PRESENT: u16 = 0x0100;
    /// A port has a link but no communication, or its loop is closed all the same.
    pub const LINK_ERROR: u16 = 0x0200;
    /// A port where a neighbour is configured has none.
    pub const MISSING_LINK: u16 = 0x0400;
    /// A port where no neighbour is configured has one.
    pub const ADDITIONAL_LINK: u16 = 0x0800;

    /// The bit of a port that the link bits are about: 0x1000 for A to 0x8000 for D.
    #[must_use]
    pub const fn port_bit(port: Port) -> u16 {
        0x1000 << port.index()
    }

    /// A word with nothing but a state.
    #[must_use]
    pub const fn new(state: StateValue) -> Self {
        Self(state.bits() as u16)
    }

    /// This word with `bits` set; use the constants of this type.
    #[must_use]
    pub const fn with(self, bits: u16) -> Self {
        Self(self.0 | bits)
    }

    /// This word with a port marked as the one that the link bits are about.
    #[must_use]
    pub const fn at_port(self, port: Port) -> Self {
        self.with(Self::port_bit(port))
    }

    /// The state in the low four bits. INIT for a SubDevice that is not present.
    #[must_use]
    pub const fn state(self) -> StateValue {
        StateValue::from_bits(self.0 as u8)
    }

    /// Whether all of `bits` are set; use the constants of this type.
    #[must_use]
    pub const fn contains(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// The ports that the link bits are about. The word does not say which bit is about which port
    /// when several are set.
    #[must_use]
    pub fn ports(self) -> PortMap<bool> {
        PortMap::from_fn(|port| self.contains(Self::port_bit(port)))
    }

    /// The low byte, as the interface of function blocks hands it out.
    #[must_use]
    pub const fn device_byte(self) -> u8 {
        self.0 as u8
    }

    /// The high byte: 0 when nothing is wrong with the wiring.
    #[must_use]
    pub const fn link_byte(self) -> u8 {
        (self.0 >> 8) as u8
    }
}

impl fmt::Display for DeviceState {
    /// As the vendor's online list writes it: `OP`, `ERR SAFEOP`, `INIT NO_COMM`, `OP LNK_MIS B`,
    /// `INIT VPRS INIT_ERR LNK_ADD C`.
    ///
    /// The list is not known to write the link error and the disabled bit; they appear here as
    /// `LNK_ERR` and `DISABLED`. Ports stand behind the last link word.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.contains(Self::ERROR) {
            f.write_str("ERR ")?;
        }
        write!(f, "{}", self.state())?;
        for (bit, word) in WORDS {
            if self.contains(bit) {
                write!(f, " {word}")?;
            }
        }
        for (port, concerned) in self.ports().iter() {
            if *concerned {
                write!(f, " {port}")?;
            }
        }
        Ok(())
    }
}

/// The words behind the state in the text, in their order.
const WORDS: [(u16, &str); 7] = [
    (DeviceState::WRONG_IDENTITY, "VPRS"),
    (DeviceState::INIT_ERROR, "INIT_ERR"),
    (DeviceState::DISABLED, "DISABLED"),
    (DeviceState::NOT_PRESENT, "NO_COMM"),
    (DeviceState::LINK_ERROR, "LNK_ERR"),
    (DeviceState::MISSING_LINK, "LNK_MIS"),
    (DeviceState::ADDITIONAL_LINK, "LNK_ADD"),
];

/// Not the text of a state word.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "`{given}` is no state: expected a state (INIT, BOOT, PREOP, SAFEOP, OP), before it ERR if it \
     signals an error, behind it any of VPRS, INIT_ERR, DISABLED, NO_COMM, LNK_ERR, LNK_MIS, LNK_ADD \
     with the ports A to D, such as `OP LNK_MIS B`"
)]
pub struct NoDeviceState {
    /// What was given.
    pub given: String,
}

impl FromStr for DeviceState {
    type Err = NoDeviceState;

    /// Reads what [`fmt::Display`] writes; also `LNK MIS` and `LNK:MIS`, as some lists have it.
    fn from_str(given: &str) -> Result<Self, NoDeviceState> {
        let joined = given.to_ascii_uppercase().replace("LNK ", "LNK_").replace("LNK:", "LNK_");
        let mut word = Self::default();
        let mut state = None;
        for part in joined.split_whitespace() {
            let mut letters = part.chars();
            let port = match (letters.next().and_then(Port::from_letter), letters.next()) {
                (Some(port), None) => Some(port),
                (Some(_) | None, _) => None,
            };
            let bits = WORDS.iter().find(|(_, name)| *name == part).map(|(bits, _)| *bits);
            match (state, port, bits) {
                (Some(_), Some(port), _) => word = word.at_port(port),
                (Some(_), None, Some(bits)) => word = word.with(bits),
                (None, None, None) if part == "ERR" => word = word.with(Self::ERROR),
                (None, None, None) => state = AlState::from_name(part),
                (Some(_) | None, _, _) => state = None,
            }
            if state.is_none() && part != "ERR" {
                return Err(NoDeviceState { given: given.to_owned() });
            }
        }
        let state = state.ok_or_else(|| NoDeviceState { given: given.to_owned() })?;
        Ok(word.with(u16::from(state.bits())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use AlState::{Init, Op, PreOp, SafeOp};

    const VPRS: u16 = DeviceState::WRONG_IDENTITY;
    const INIT_ERR: u16 = DeviceState::INIT_ERROR;
    const MISSING: u16 = DeviceState::MISSING_LINK;

    fn word(state: AlState, bits: u16) -> DeviceState {
        DeviceState::new(StateValue::Known(state)).with(bits)
    }

    // proves: PLC-05 partial, PLC-06 partial
    #[test]
    fn words_and_texts_of_the_online_list() {
        let table = [
            (word(Op, 0), 0x0008, "OP"),
            (word(SafeOp, DeviceState::ERROR), 0x0014, "ERR SAFEOP"),
            (word(PreOp, DeviceState::ERROR), 0x0012, "ERR PREOP"),
            (word(Op, MISSING).at_port(Port::B), 0x2408, "OP LNK_MIS B"),
            (word(Op, MISSING).at_port(Port::C), 0x4408, "OP LNK_MIS C"),
            (word(Op, MISSING).at_port(Port::D), 0x8408, "OP LNK_MIS D"),
            (word(Init, DeviceState::NOT_PRESENT), 0x0101, "INIT NO_COMM"),
            (word(Init, VPRS | INIT_ERR), 0x0061, "INIT VPRS INIT_ERR"),
            (word(Init, INIT_ERR | DeviceState::ERROR), 0x0051, "ERR INIT INIT_ERR"),
            (word(Init, DeviceState::ERROR | VPRS | INIT_ERR), 0x0071, "ERR INIT VPRS INIT_ERR"),
            (
                word(Init, VPRS | INIT_ERR | DeviceState::ADDITIONAL_LINK).at_port(Port::C),
                0x4861,
                "INIT VPRS INIT_ERR LNK_ADD C",
            ),
        ];
        for (word, value, text) in table {
            assert_eq!(word.0, value, "{text}");
            assert_eq!(word.to_string(), text);
            assert_eq!(text.parse(), Ok(word));
        }
    }

    #[test]
    fn texts_of_other_lists_are_read() {
        let expected = word(Op, MISSING).at_port(Port::B);
        for text in ["OP LNK MIS B", "op lnk_mis b", "OP  LNK:MIS B"] {
            assert_eq!(text.parse(), Ok(expected), "{text}");
        }
        for wrong in ["", "ERR", "RUN", "OP OP", "OP LNK_MIS E", "B OP", "NO_COMM"] {
            let error = wrong.parse::<DeviceState>().unwrap_err();
            assert!(error.to_string().contains("such as `OP LNK_MIS B`"), "{wrong}: {error}");
        }
    }

    // proves: PLC-05 partial, PLC-06 partial
    #[test]
    fn all_sixteen_bits_have_a_place() {
        assert_eq!(DeviceState(0x0080).to_string(), "UNKNOWN(0) DISABLED");
        assert_eq!(DeviceState(0x1208).to_string(), "OP LNK_ERR A");
        let bits = [
            DeviceState::ERROR,
            DeviceState::WRONG_IDENTITY,
            DeviceState::INIT_ERROR,
            DeviceState::DISABLED,
            DeviceState::NOT_PRESENT,
            DeviceState::LINK_ERROR,
            DeviceState::MISSING_LINK,
            DeviceState::ADDITIONAL_LINK,
        ];
        let ports = Port::ALL.map(DeviceState::port_bit);
        let all = bits.iter().chain(&ports).fold(0x000F, |all, bit| {
            assert_eq!(all & bit, 0, "{bit:#06X} is used twice");
            all | bit
        });
        assert_eq!(all, 0xFFFF);
    }

    #[test]
    fn the_link_byte_is_the_high_one() {
        // A link missing at port B is 0x24 in the interface of function blocks.
        assert_eq!(DeviceState(0x2408).link_byte(), 0x24);
        assert_eq!(DeviceState(0x2408).device_byte(), 0x08);
    }
}
