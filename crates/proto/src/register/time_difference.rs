//! System time difference (0x092C): how far the local copy of the system time is off, as a mean.
//!
//! Reference: S2 2.15.2.4; S1 9.1.3. Not two's complement: the low 31 bits are the magnitude in ns, and the
//! highest bit is set while the local copy is ahead or equal. Some old documents have the sign the other way
//! round, so the magnitude is certain and the sign a hint.

use crate::time::Span;

/// What a controller shows at 0x092C.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct SystemTimeDifference(pub u32);

impl SystemTimeDifference {
    const AHEAD: u32 = 1 << 31;

    /// A difference of so many ns, of which 31 bits count, with its sign.
    #[must_use]
    pub const fn new(magnitude_ns: u32, is_ahead: bool) -> Self {
        Self(magnitude_ns & !Self::AHEAD | if is_ahead { Self::AHEAD } else { 0 })
    }

    /// How far the local copy is off, to whichever side.
    #[must_use]
    pub const fn magnitude(self) -> Span {
        Span::ns((self.0 & !Self::AHEAD) as u64)
    }

    /// Whether the local copy is ahead of what was received, or equal to it.
    #[must_use]
    pub const fn is_ahead(self) -> bool {
        self.0 & Self::AHEAD != 0
    }

    /// By how much the local copy is ahead, in ns; negative while it is behind.
    #[must_use]
    pub const fn ahead_ns(self) -> i64 {
        let magnitude = (self.0 & !Self::AHEAD) as i64;
        if self.is_ahead() { magnitude } else { -magnitude }
    }
}

impl From<[u8; 4]> for SystemTimeDifference {
    /// As it stands in the register: little-endian.
    fn from(bytes: [u8; 4]) -> Self {
        Self(u32::from_le_bytes(bytes))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::register::{SYSTEM_TIME_DIFFERENCE, decode};

    #[test]
    fn the_sign_is_the_highest_bit() {
        let ahead = SystemTimeDifference::from([0x78, 0, 0, 0x80]);
        assert_eq!((ahead.ahead_ns(), ahead.magnitude()), (120, Span::ns(120)));
        let behind = SystemTimeDifference::from([0x78, 0, 0, 0x00]);
        assert_eq!((behind.ahead_ns(), behind.magnitude()), (-120, Span::ns(120)));
    }

    proptest! {
        #[test]
        fn what_is_put_in_comes_out(magnitude in 0u32..1 << 31, is_ahead: bool) {
            let shown = SystemTimeDifference::new(magnitude, is_ahead);
            prop_assert_eq!(shown.magnitude(), Span::ns(magnitude.into()));
            prop_assert_eq!(shown.is_ahead(), is_ahead);
            let ns = i64::from(magnitude);
            prop_assert_eq!(shown.ahead_ns(), if is_ahead { ns } else { -ns });
            prop_assert_eq!(SystemTimeDifference::from(shown.0.to_le_bytes()), shown);
        }

        /// The table tells people the same number, from the side of what was received.
        #[test]
        fn the_table_reads_it_alike(raw: u32) {
            let told = decode(&SYSTEM_TIME_DIFFERENCE, &raw.to_le_bytes());
            let ns = format!("{} ns", -SystemTimeDifference(raw).ahead_ns());
            prop_assert_eq!(&told[0].text, &ns);
        }
    }
}
