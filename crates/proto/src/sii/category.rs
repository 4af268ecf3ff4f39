//! Categories: what follows the fixed words from word 0x40 on, each with its type and its length in
//! words, ended by type 0xFFFF.
//!
//! Reference: ETG.2010 table of category types. Types without a layout here are kept as they are,
//! in order: vendors use 1..=9 and everything from 0x8000 on for themselves.

use std::fmt;

use super::clock::OpMode;
use super::fmmu::FmmuUsage;
use super::general::General;
use super::pdo::Pdo;
use super::strings::Strings;
use super::sync_manager::SyncManager;

/// One category with its content.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub enum Category {
    /// Type 10.
    Strings(Strings),
    /// Type 30. It is much bigger than the others, and there is one of it.
    General(Box<General>),
    /// Type 40. An odd number of usages gains one [`FmmuUsage::Unused`] when it is built.
    Fmmu(Vec<FmmuUsage>),
    /// Type 41.
    SyncManagers(Vec<SyncManager>),
    /// Type 50: inputs of the MainDevice.
    TxPdos(Vec<Pdo>),
    /// Type 51: outputs of the MainDevice.
    RxPdos(Vec<Pdo>),
    /// Type 60.
    OpModes(Vec<OpMode>),
    /// Any other type.
    Raw(RawCategory),
}

impl Category {
    /// Its type.
    #[must_use]
    pub const fn kind(&self) -> CategoryKind {
        match self {
            Self::Strings(_) => CategoryKind::Strings,
            Self::General(_) => CategoryKind::General,
            Self::Fmmu(_) => CategoryKind::Fmmu,
            Self::SyncManagers(_) => CategoryKind::SyncManagers,
            Self::TxPdos(_) => CategoryKind::TxPdos,
            Self::RxPdos(_) => CategoryKind::RxPdos,
            Self::OpModes(_) => CategoryKind::OpModes,
            Self::Raw(raw) => raw.kind,
        }
    }
}

/// A category that is kept as it is.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct RawCategory {
    kind: CategoryKind,
    data: Vec<u8>,
}

impl RawCategory {
    /// Wraps the data of a category; `None` when the type is the end marker or has a layout of its
    /// own ([`CategoryKind::is_raw`]), or when the data are not whole words or too many.
    #[must_use]
    pub fn new(kind: CategoryKind, data: Vec<u8>) -> Option<Self> {
        let fits = data.len().is_multiple_of(2) && data.len() / 2 <= usize::from(u16::MAX);
        (kind.is_raw() && fits).then_some(Self { kind: CategoryKind::from_code(kind.code()), data })
    }

    /// Wraps whole words of an image whose type has no layout.
    pub(super) fn from_image(kind: CategoryKind, data: &[u8]) -> Self {
        Self { kind, data: data.to_vec() }
    }

    /// Its type.
    #[must_use]
    pub const fn kind(&self) -> CategoryKind {
        self.kind
    }

    /// Its data: a whole number of words.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        &self.data
    }
}

/// Type of a category.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum CategoryKind {
    /// 0: nothing.
    Nop,
    /// 10: texts.
    Strings,
    /// 20: data types; rarely used.
    DataTypes,
    /// 30: names, mailbox details, E-bus current, ports.
    General,
    /// 40: usage of FMMUs.
    Fmmu,
    /// 41: SyncManager defaults.
    SyncManagers,
    /// 42: which SyncManager each FMMU belongs to; layout not settled among public sources.
    FmmuExtended,
    /// 43: sync units; layout not settled among public sources.
    SyncUnits,
    /// 50: inputs of the MainDevice.
    TxPdos,
    /// 51: outputs of the MainDevice.
    RxPdos,
    /// 60: operation modes with distributed clocks.
    OpModes,
    /// 0xFFFF: end of the image's used part.
    End,
    /// Another type: 1..=9 device-specific, 0x8000 and above vendor-specific, the rest unknown.
    Other(u16),
}

impl CategoryKind {
    /// The type with this code.
    #[must_use]
    pub const fn from_code(code: u16) -> Self {
        match code {
            0 => Self::Nop,
            10 => Self::Strings,
            20 => Self::DataTypes,
            30 => Self::General,
            40 => Self::Fmmu,
            41 => Self::SyncManagers,
            42 => Self::FmmuExtended,
            43 => Self::SyncUnits,
            50 => Self::TxPdos,
            51 => Self::RxPdos,
            60 => Self::OpModes,
            0xFFFF => Self::End,
            other => Self::Other(other),
        }
    }

    /// The code in the image.
    #[must_use]
    pub const fn code(self) -> u16 {
        match self {
            Self::Nop => 0,
            Self::Strings => 10,
            Self::DataTypes => 20,
            Self::General => 30,
            Self::Fmmu => 40,
            Self::SyncManagers => 41,
            Self::FmmuExtended => 42,
            Self::SyncUnits => 43,
            Self::TxPdos => 50,
            Self::RxPdos => 51,
            Self::OpModes => 60,
            Self::End => 0xFFFF,
            Self::Other(code) => code,
        }
    }

    /// Whether categories of this type are kept as they are.
    #[must_use]
    pub const fn is_raw(self) -> bool {
        // Through the code, so that `Other(10)` is not mistaken for something unknown.
        match Self::from_code(self.code()) {
            Self::Nop | Self::DataTypes | Self::FmmuExtended | Self::SyncUnits | Self::Other(_) => {
                true
            }
            Self::Strings
            | Self::General
            | Self::Fmmu
            | Self::SyncManagers
            | Self::TxPdos
            | Self::RxPdos
            | Self::OpModes
            | Self::End => false,
        }
    }
}

impl fmt::Display for CategoryKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Nop => "NOP",
            Self::Strings => "Strings",
            Self::DataTypes => "DataTypes",
            Self::General => "General",
            Self::Fmmu => "FMMU",
            Self::SyncManagers => "SyncM",
            Self::FmmuExtended => "FMMU_EX",
            Self::SyncUnits => "SyncUnit",
            Self::TxPdos => "TxPDO",
            Self::RxPdos => "RxPDO",
            Self::OpModes => "DC",
            Self::End => "End",
            Self::Other(code) => return write!(f, "category {code}"),
        };
        write!(f, "{name} ({})", self.code())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_keeps_its_type() {
        for code in 0..=u16::MAX {
            assert_eq!(CategoryKind::from_code(code).code(), code);
        }
    }

    #[test]
    fn only_categories_without_a_layout_are_raw() {
        assert!(RawCategory::new(CategoryKind::Other(3), vec![1, 2]).is_some());
        assert!(RawCategory::new(CategoryKind::FmmuExtended, vec![]).is_some());
        assert_eq!(RawCategory::new(CategoryKind::Other(10), vec![1, 2]), None);
        assert_eq!(RawCategory::new(CategoryKind::End, vec![]), None);
        assert_eq!(RawCategory::new(CategoryKind::Other(3), vec![1]), None);
        assert_eq!(RawCategory::new(CategoryKind::Other(3), vec![0; 0x2_0000]), None);
    }
}
