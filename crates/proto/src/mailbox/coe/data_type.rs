//! Data types of objects, of PDO entries, and of the SII.
//!
//! Reference: ETG.1020 (base data types), ETG.1000.6, object dictionary; names as ESI files spell
//! them. Types without a fixed length (texts, structures) have no bit size.

use std::fmt;

/// A data type by its number in the dictionary.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct DataType(pub u16);

/// One row of the table: number, name, size in bits.
struct Row {
    code: u16,
    name: &'static str,
    bits: Option<u16>,
}

const fn sized(code: u16, name: &'static str, bits: u16) -> Row {
    Row { code, name, bits: Some(bits) }
}

const fn variable(code: u16, name: &'static str) -> Row {
    Row { code, name, bits: None }
}

/// All types with a name, by number.
const TABLE: &[Row] = &[
    sized(0x0001, "BOOL", 1),
    sized(0x0002, "SINT", 8),
    sized(0x0003, "INT", 16),
    sized(0x0004, "DINT", 32),
    sized(0x0005, "USINT", 8),
    sized(0x0006, "UINT", 16),
    sized(0x0007, "UDINT", 32),
    sized(0x0008, "REAL", 32),
    variable(0x0009, "STRING"),
    variable(0x000A, "OCTET_STRING"),
    variable(0x000B, "UNICODE_STRING"),
    sized(0x000C, "TIME_OF_DAY", 48),
    sized(0x000D, "TIME_DIFFERENCE", 48),
    sized(0x0010, "INT24", 24),
    sized(0x0011, "LREAL", 64),
    sized(0x0012, "INT40", 40),
    sized(0x0013, "INT48", 48),
    sized(0x0014, "INT56", 56),
    sized(0x0015, "LINT", 64),
    sized(0x0016, "UINT24", 24),
    sized(0x0018, "UINT40", 40),
    sized(0x0019, "UINT48", 48),
    sized(0x001A, "UINT56", 56),
    sized(0x001B, "ULINT", 64),
    sized(0x001D, "GUID", 128),
    sized(0x001E, "BYTE", 8),
    sized(0x001F, "WORD", 16),
    sized(0x0020, "DWORD", 32),
    variable(0x0021, "PDO_MAPPING"),
    variable(0x0023, "IDENTITY"),
    variable(0x0029, "SYNC_PARAMETER"),
    variable(0x002A, "RECORD"),
    variable(0x002B, "BACKUP_PARAMETER"),
    variable(0x002C, "MODULAR_DEVICE_PROFILE"),
    sized(0x002D, "BITARR8", 8),
    sized(0x002E, "BITARR16", 16),
    sized(0x002F, "BITARR32", 32),
    sized(0x0030, "BIT1", 1),
    sized(0x0031, "BIT2", 2),
    sized(0x0032, "BIT3", 3),
    sized(0x0033, "BIT4", 4),
    sized(0x0034, "BIT5", 5),
    sized(0x0035, "BIT6", 6),
    sized(0x0036, "BIT7", 7),
    sized(0x0037, "BIT8", 8),
    variable(0x0260, "ARRAY_OF_INT"),
    variable(0x0261, "ARRAY_OF_SINT"),
    variable(0x0262, "ARRAY_OF_DINT"),
    variable(0x0263, "ARRAY_OF_UDINT"),
    variable(0x0281, "ERROR_SETTING"),
    variable(0x0282, "DIAGNOSIS_HISTORY"),
    variable(0x0283, "SYNC_STATUS"),
    variable(0x0284, "SYNC_SETTING"),
    variable(0x0285, "FSOE_FRAME"),
    variable(0x0286, "FSOE_COMMUNICATION_PARAMETER"),
];

impl DataType {
    /// One bit, in PDOs and complete access; one byte in SDO transfer.
    pub const BOOL: Self = Self(0x0001);
    /// Signed, 8 bits.
    pub const SINT: Self = Self(0x0002);
    /// Signed, 16 bits.
    pub const INT: Self = Self(0x0003);
    /// Signed, 32 bits.
    pub const DINT: Self = Self(0x0004);
    /// Unsigned, 8 bits.
    pub const USINT: Self = Self(0x0005);
    /// Unsigned, 16 bits.
    pub const UINT: Self = Self(0x0006);
    /// Unsigned, 32 bits.
    pub const UDINT: Self = Self(0x0007);
    /// Floating point, 32 bits.
    pub const REAL: Self = Self(0x0008);
    /// Text of visible characters.
    pub const STRING: Self = Self(0x0009);
    /// Bytes.
    pub const OCTET_STRING: Self = Self(0x000A);
    /// Floating point, 64 bits.
    pub const LREAL: Self = Self(0x0011);
    /// Signed, 64 bits.
    pub const LINT: Self = Self(0x0015);
    /// Unsigned, 64 bits.
    pub const ULINT: Self = Self(0x001B);

    /// Every type with a name, by number.
    pub fn named() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|row| Self(row.code))
    }

    /// The type with this name, as ESI files spell it.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        TABLE.iter().find(|row| row.name == name).map(|row| Self(row.code))
    }

    /// Its name, when it has one.
    #[must_use]
    pub fn name(self) -> Option<&'static str> {
        self.row().map(|row| row.name)
    }

    /// Its size in bits, when all values have the same.
    #[must_use]
    pub fn bits(self) -> Option<u16> {
        self.row()?.bits
    }

    fn row(self) -> Option<&'static Row> {
        let place = TABLE.binary_search_by_key(&self.0, |row| row.code).ok()?;
        TABLE.get(place)
    }
}

impl fmt::Display for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "data type 0x{:04X}", self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_rise_and_names_are_unique() {
        for pair in TABLE.windows(2) {
            assert!(pair[0].code < pair[1].code, "{}", pair[1].name);
        }
        for data_type in DataType::named() {
            let name = data_type.name().unwrap();
            assert_eq!(DataType::from_name(name), Some(data_type), "{name}");
        }
    }

    #[test]
    fn sizes_are_those_of_the_specification() {
        for (name, bits) in [
            ("BOOL", Some(1)),
            ("USINT", Some(8)),
            ("INT", Some(16)),
            ("REAL", Some(32)),
            ("LREAL", Some(64)),
            ("INT24", Some(24)),
            ("UINT56", Some(56)),
            ("TIME_OF_DAY", Some(48)),
            ("GUID", Some(128)),
            ("BITARR16", Some(16)),
            ("BIT7", Some(7)),
            ("STRING", None),
            ("IDENTITY", None),
        ] {
            assert_eq!(DataType::from_name(name).unwrap().bits(), bits, "{name}");
        }
        assert_eq!(DataType(0x7FFF).name(), None);
        assert_eq!(DataType(0x7FFF).to_string(), "data type 0x7FFF");
    }
}
