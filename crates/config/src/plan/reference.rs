//! Which couplers and junctions can be the reference clock, and since which revision.
//!
//! Reference: S0 L735-757 ("use as potential reference clock"). A type that is not named here has no lowest
//! revision: with a clock of 64 bits it can be the reference.

/// Type, and the first revision that can be the reference clock.
const SINCE: &[(&str, u16)] = &[
    ("BK1150", 16),
    ("CU1128", 0),
    ("EK1100", 17),
    ("EK1101", 17),
    ("EK1122", 17),
    ("EK1501", 17),
    ("EK1521", 18),
    ("EK1541", 16),
    ("EK1561", 16),
    ("EK1814", 16),
];

/// The first revision of a type that can be the reference clock; `None` for a type of which nothing is said.
/// What follows the type, as in `EK1521-0010`, makes no difference.
#[must_use]
pub fn since(type_name: &str) -> Option<u16> {
    let bare = type_name.split('-').next().unwrap_or_default();
    SINCE.iter().find(|(name, _)| *name == bare).map(|(_, since)| *since)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_known_with_and_without_their_variant() {
        assert_eq!(since("EK1100"), Some(17));
        assert_eq!(since("EK1521-0010"), Some(18));
        assert_eq!(since("CU1128"), Some(0));
        assert_eq!(since("EK11000"), None);
        assert_eq!(since("EL3104"), None);
        assert_eq!(since(""), None);
    }
}
