//! Synchronisation types that a device supports: objects 0x1C32 and 0x1C33, subindex 04.
//!
//! Reference: ETG.1020, synchronisation; S0 L597-609.

use std::fmt;

/// The supported kinds of synchronisation.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct SyncTypes(pub u16);

/// Each flag and what it says.
const FLAGS: &[(u16, &str)] = &[
    (1 << 0, "free run"),
    (1 << 1, "in step with frames"),
    (1 << 2, "with SYNC0"),
    (1 << 3, "with SYNC1"),
    (1 << 4, "subordinated cycles"),
    (1 << 5, "shift by its own timer"),
    (1 << 6, "shift by SYNC1"),
    (1 << 10, "its delay should be measured"),
    (1 << 11, "its delay is fixed"),
    (1 << 14, "it measures its own times (write 1 to subindex 08)"),
];

impl SyncTypes {
    /// The entry of 0x1C32 and 0x1C33 that holds it.
    pub const SUBINDEX: u8 = 4;

    /// Whether it can keep step with SyncSignals.
    #[must_use]
    pub const fn with_clock(self) -> bool {
        self.0 & 0b1_1100 != 0
    }

    /// Whether it measures its own times when it is told to.
    #[must_use]
    pub const fn measures(self) -> bool {
        self.0 & 1 << 14 != 0
    }
}

impl fmt::Display for SyncTypes {
    /// `free run, in step with frames, with SYNC0; unknown bits 0x8000`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let set = FLAGS.iter().filter(|(bit, _)| self.0 & bit != 0);
        let words: Vec<_> = set.map(|(_, words)| *words).collect();
        f.write_str(if words.is_empty() { "nothing" } else { "" })?;
        f.write_str(&words.join(", "))?;
        match self.0 & !FLAGS.iter().fold(0, |all, (bit, _)| all | bit) {
            0 => Ok(()),
            unknown => write!(f, "; unknown bits 0x{unknown:04X}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // The two values of the source, S0 L597-609.
    // proves: SYN-22
    #[test]
    fn the_two_values_of_the_source_are_told_in_words() {
        let fixed = SyncTypes(0x0807);
        assert_eq!(
            fixed.to_string(),
            "free run, in step with frames, with SYNC0, its delay is fixed"
        );
        assert!(fixed.with_clock() && !fixed.measures());
        let dynamic = SyncTypes(0xC007);
        assert_eq!(
            dynamic.to_string(),
            "free run, in step with frames, with SYNC0, it measures its own times (write 1 to subindex 08); \
             unknown bits 0x8000"
        );
        assert!(dynamic.measures());
        assert_eq!(SyncTypes(0).to_string(), "nothing");
        assert!(!SyncTypes(3).with_clock());
    }
}
