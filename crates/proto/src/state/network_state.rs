//! The state word that a control program sees of the whole network, and its text.
//!
//! Reference: vendor documentation of the cyclic `DevState` variable. As with [`DeviceState`](super::DeviceState), no
//! register holds it: it sums up what the MainDevice knows.

use std::fmt;

/// The network's state word; 0 is "all is well".
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct NetworkState(pub u16);

impl NetworkState {
    /// The card has no carrier.
    pub const LINK_ERROR: u16 = 0x0001;
    /// Process data are locked after a link error until somebody resets it.
    pub const LOCKED: u16 = 0x0002;
    /// The card at the far end of a ring has no carrier.
    pub const REDUNDANCY_LINK_ERROR: u16 = 0x0004;
    /// One of the two copies of a frame in a ring does not come back.
    pub const REDUNDANCY_FRAME_MISSING: u16 = 0x0008;
    /// The card took no more frames.
    pub const OUT_OF_SEND_RESOURCES: u16 = 0x0010;
    /// The MainDevice's own watchdog: the application did not give fresh outputs.
    pub const WATCHDOG: u16 = 0x0020;
    /// The card or its driver is not there.
    pub const DRIVER: u16 = 0x0040;
    /// A reset is under way.
    pub const RESET: u16 = 0x0080;
    /// At least one SubDevice is in INIT, or does not answer.
    pub const SOME_INIT: u16 = 0x0100;
    /// At least one SubDevice is in PREOP.
    pub const SOME_PREOP: u16 = 0x0200;
    /// At least one SubDevice is in SAFEOP.
    pub const SOME_SAFEOP: u16 = 0x0400;
    /// At least one SubDevice signals an error.
    pub const SOME_ERROR: u16 = 0x0800;
    /// The clocks are further apart than the window allows.
    pub const CLOCKS_APART: u16 = 0x1000;

    /// This word with `bits` set or cleared; use the constants of this type.
    #[must_use]
    pub const fn with(self, bits: u16, set: bool) -> Self {
        if set { Self(self.0 | bits) } else { Self(self.0 & !bits) }
    }

    /// Whether all of `bits` are set.
    #[must_use]
    pub const fn contains(self, bits: u16) -> bool {
        self.0 & bits == bits
    }
}

/// The texts, in the order of bits.
const TEXTS: [(u16, &str); 13] = [
    (NetworkState::LINK_ERROR, "link error"),
    (NetworkState::LOCKED, "I/O locked after link error (reset required)"),
    (NetworkState::REDUNDANCY_LINK_ERROR, "link error of the redundancy adapter"),
    (NetworkState::REDUNDANCY_FRAME_MISSING, "one frame missing (redundancy)"),
    (NetworkState::OUT_OF_SEND_RESOURCES, "out of send resources"),
    (NetworkState::WATCHDOG, "watchdog triggered"),
    (NetworkState::DRIVER, "Ethernet driver not found"),
    (NetworkState::RESET, "I/O reset active"),
    (NetworkState::SOME_INIT, "at least one device in INIT"),
    (NetworkState::SOME_PREOP, "at least one device in PREOP"),
    (NetworkState::SOME_SAFEOP, "at least one device in SAFEOP"),
    (NetworkState::SOME_ERROR, "at least one device in error"),
    (NetworkState::CLOCKS_APART, "clocks not in sync"),
];

impl fmt::Display for NetworkState {
    /// `OK`, or `Not OK` and what is not, joined by dashes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0 {
            return f.write_str("OK");
        }
        f.write_str("Not OK")?;
        for (bit, text) in TEXTS {
            if self.contains(bit) {
                write!(f, " - {text}")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: PLC-07 (U)
    #[test]
    fn each_of_the_thirteen_bits_has_a_text() {
        assert_eq!(NetworkState(0).to_string(), "OK");
        let all = TEXTS.iter().fold(0, |all, (bit, _)| all | bit);
        assert_eq!(all, 0x1FFF);
        // S0 L2573-2593, from the lowest bit on.
        let words = [
            "link error",
            "locked",
            "redundancy",
            "missing",
            "resources",
            "watchdog",
            "driver",
            "reset",
            "INIT",
            "PREOP",
            "SAFEOP",
            "in error",
            "clocks not in sync",
        ];
        for (at, word) in words.into_iter().enumerate() {
            let text = NetworkState(1 << at).to_string();
            assert!(text.contains(word), "{:#06X}: {text}", 1 << at);
        }
        let word = NetworkState::default()
            .with(NetworkState::SOME_SAFEOP, true)
            .with(NetworkState::SOME_ERROR, true);
        assert_eq!(word.0, 0x0C00);
        assert_eq!(
            word.to_string(),
            "Not OK - at least one device in SAFEOP - at least one device in error"
        );
        assert_eq!(word.with(NetworkState::SOME_ERROR, false).0, 0x0400);
    }
}
