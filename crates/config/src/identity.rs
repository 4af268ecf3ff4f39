//! Identity of a SubDevice, and when two identities count as the same.
//!
//! Reference: SII words 8..15, object 0x1018; the comparison modes are those of the ESI attribute
//! `CheckRevisionNo` (ETG.2000).

use std::fmt;

pub use linesman_proto::sii::Identity;
use serde::{Deserialize, Serialize};

/// How a found revision is compared with the planned one.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum RevisionRule {
    /// Any revision will do.
    Any,
    /// The same number (`EQ`).
    #[default]
    Equal,
    /// The same or a higher number (`EQ_OR_G`).
    EqualOrGreater,
    /// The same low word (`LW_EQ`).
    LowWordEqual,
    /// The same low word, and the same or a higher high word (`LW_EQ_HW_EQ_OR_G`).
    LowWordEqualHighWordEqualOrGreater,
    /// The same high word (`HW_EQ`).
    HighWordEqual,
    /// The same or a higher high word (`HW_EQ_OR_G`).
    HighWordEqualOrGreater,
}

impl RevisionRule {
    /// The rule that a word of the ESI attribute `CheckRevisionNo` names (ETG.2000); `None` for any other
    /// word.
    #[must_use]
    pub fn from_esi(word: &str) -> Option<Self> {
        Some(match word {
            "NONE" => Self::Any,
            "EQ" => Self::Equal,
            "EQ_OR_G" => Self::EqualOrGreater,
            "LW_EQ" => Self::LowWordEqual,
            "LW_EQ_HW_EQ_OR_G" => Self::LowWordEqualHighWordEqualOrGreater,
            "HW_EQ" => Self::HighWordEqual,
            "HW_EQ_OR_G" => Self::HighWordEqualOrGreater,
            _ => return None,
        })
    }

    /// Whether a device of revision `found` may stand where `planned` was planned.
    #[must_use]
    pub const fn accepts(self, planned: u32, found: u32) -> bool {
        let (low, high) = (planned & 0xFFFF, planned >> 16);
        let (found_low, found_high) = (found & 0xFFFF, found >> 16);
        match self {
            Self::Any => true,
            Self::Equal => found == planned,
            Self::EqualOrGreater => found >= planned,
            Self::LowWordEqual => found_low == low,
            Self::LowWordEqualHighWordEqualOrGreater => found_low == low && found_high >= high,
            Self::HighWordEqual => found_high == high,
            Self::HighWordEqualOrGreater => found_high >= high,
        }
    }
}

/// In what a found identity differs from the planned one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mismatch {
    /// Another vendor.
    Vendor,
    /// Another product.
    Product,
    /// A revision that the rule does not accept.
    Revision,
    /// Another serial number.
    Serial,
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Vendor => "vendor",
            Self::Product => "product code",
            Self::Revision => "revision",
            Self::Serial => "serial number",
        })
    }
}

/// Compares what was `planned` with what was `found`; `None` when it fits.
///
/// A planned serial number of 0 is not compared.
#[must_use]
pub fn mismatch(planned: &Identity, found: &Identity, rule: RevisionRule) -> Option<Mismatch> {
    if planned.vendor_id != found.vendor_id {
        Some(Mismatch::Vendor)
    } else if planned.product_code != found.product_code {
        Some(Mismatch::Product)
    } else if !rule.accepts(planned.revision, found.revision) {
        Some(Mismatch::Revision)
    } else if planned.serial_number != 0 && planned.serial_number != found.serial_number {
        Some(Mismatch::Serial)
    } else {
        None
    }
}

/// An identity as people compare it: in hexadecimal, the serial number only when there is one.
#[must_use]
pub fn text(identity: &Identity) -> String {
    let Identity { vendor_id, product_code, revision, serial_number } = identity;
    let mut text = format!(
        "vendor 0x{vendor_id:08X}, product 0x{product_code:08X}, revision 0x{revision:08X}"
    );
    if *serial_number != 0 {
        text.push_str(&format!(", serial {serial_number}"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use RevisionRule::*;

    // proves: HC-03 partial
    #[test]
    fn revisions_are_compared_by_rule() {
        let planned = 0x0012_0003;
        let table = [
            (Any, 0, true),
            (Equal, 0x0012_0003, true),
            (Equal, 0x0013_0003, false),
            (EqualOrGreater, 0x0013_0000, true),
            (EqualOrGreater, 0x0012_0002, false),
            (LowWordEqual, 0x0001_0003, true),
            (LowWordEqual, 0x0012_0004, false),
            (LowWordEqualHighWordEqualOrGreater, 0x0013_0003, true),
            (LowWordEqualHighWordEqualOrGreater, 0x0011_0003, false),
            (HighWordEqual, 0x0012_0009, true),
            (HighWordEqual, 0x0013_0003, false),
            (HighWordEqualOrGreater, 0x0013_0000, true),
            (HighWordEqualOrGreater, 0x0011_0003, false),
        ];
        for (rule, found, expected) in table {
            assert_eq!(rule.accepts(planned, found), expected, "{rule:?} 0x{found:08X}");
        }
    }

    #[test]
    fn words_of_descriptions_name_rules() {
        assert_eq!(RevisionRule::from_esi("EQ_OR_G"), Some(EqualOrGreater));
        assert_eq!(
            RevisionRule::from_esi("LW_EQ_HW_EQ_OR_G"),
            Some(LowWordEqualHighWordEqualOrGreater)
        );
        assert_eq!(RevisionRule::from_esi("SIMILAR"), None);
    }

    #[test]
    fn the_first_difference_is_named() {
        let planned = Identity { vendor_id: 2, product_code: 5, revision: 7, serial_number: 9 };
        assert_eq!(mismatch(&planned, &planned, Equal), None);
        let check = |found: Identity| mismatch(&planned, &found, Equal);
        assert_eq!(check(Identity { vendor_id: 3, ..planned }), Some(Mismatch::Vendor));
        assert_eq!(check(Identity { product_code: 3, ..planned }), Some(Mismatch::Product));
        assert_eq!(check(Identity { revision: 3, ..planned }), Some(Mismatch::Revision));
        assert_eq!(check(Identity { serial_number: 3, ..planned }), Some(Mismatch::Serial));
        let any_serial = Identity { serial_number: 0, ..planned };
        assert_eq!(mismatch(&any_serial, &planned, Equal), None);
    }
}
