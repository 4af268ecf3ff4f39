//! Couplers and junctions that can be the reference clock, and since which revision.
//!
//! Reference: S0 L735-757 ("use as potential reference clock"). A type that is not named here has no lowest
//! revision: with a clock of 64 bits it can be the reference.

/// Type, and the first revision that can be the reference clock. A type with its variant comes before the
/// type alone, which stands for its other variants too.
pub const SINCE: &[(&str, u16)] = &[
    ("BK1150", 16),
    ("CU1128", 0),
    ("EK1100", 17),
    ("EK1101", 17),
    ("EK1501-0010", 17),
    ("EK1501", 17),
    ("EK1122", 17),
    ("EK1521-0010", 18),
    ("EK1521", 18),
    ("EK1541", 16),
    ("EK1561", 16),
    ("EK1814", 16),
];

/// The first revision of a type that can be the reference clock; `None` for a type of which nothing is said.
/// A variant that is not named, as in `EK1100-0008`, is as its type.
#[must_use]
pub fn since(type_name: &str) -> Option<u16> {
    let bare = type_name.split('-').next().unwrap_or_default();
    let named = |wanted: &str| SINCE.iter().find(|(name, _)| *name == wanted);
    // `EK1501-0010-0017` is a variant with its revision.
    let variant = type_name.get(..bare.len() + 5).and_then(named);
    variant.or_else(|| named(bare)).map(|(_, since)| *since)
}

/// Whether a SubDevice of this type and revision (as its EEPROM has it: the number of the revision in the
/// high half) can be the reference clock, if it has a clock; 0 is an unknown revision, of which nothing is
/// doubted.
#[must_use]
pub fn is_possible(type_name: &str, revision: u32) -> bool {
    let least = since(type_name).map_or(0, u32::from);
    revision == 0 || revision >> 16 >= least
}

#[cfg(test)]
mod tests {
    use super::*;

    // S0 L743-757, the twelve rows: type with variant, and the revision from which on.
    // proves: DC-05
    #[test]
    fn the_twelve_rows_of_the_source_say_since_when() {
        for (row, variant) in [
            ("BK1150-0000-0016", "BK1150"),
            ("CU1128-0000-0000", "CU1128"),
            ("EK1100-0000-0017", "EK1100"),
            ("EK1101-0000-0017", "EK1101"),
            ("EK1501-0000-0017", "EK1501"),
            ("EK1501-0010-0017", "EK1501-0010"),
            ("EK1122-0000-0017", "EK1122"),
            ("EK1521-0000-0018", "EK1521"),
            ("EK1541-0000-0016", "EK1541"),
            ("EK1561-0000-0016", "EK1561"),
            ("EK1521-0010-0018", "EK1521-0010"),
            ("EK1814-0000-0016", "EK1814"),
        ] {
            let least: u16 = row.rsplit('-').next().unwrap().parse().unwrap();
            assert_eq!(since(variant), Some(least), "{row}");
            assert_eq!(since(row), Some(least), "{row}");
            let revision = |number: u16| u32::from(number) << 16 | 0x000A;
            assert!(
                is_possible(variant, revision(least)) && is_possible(variant, revision(least + 9))
            );
            if let Some(older) = least.checked_sub(1) {
                assert!(!is_possible(variant, revision(older)), "{row}");
            }
        }
        assert_eq!(SINCE.len(), 12);
    }

    #[test]
    fn types_are_known_with_and_without_their_variant() {
        assert_eq!(since("EK1100-0008"), Some(17));
        assert_eq!(since("EK11000"), None);
        assert_eq!(since("EL3104"), None);
        assert_eq!(since(""), None);
        assert!(is_possible("EL3104", 0x0001_0000) && is_possible("EK1100", 0));
    }
}
