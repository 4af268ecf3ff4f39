//! Lookup of what a MainDevice needs from an image, without walking the categories itself.
//!
//! Nothing here allocates. Where a category is there more than once, the first counts for Strings,
//! General, FMMU and SyncManagers; PDOs and operation modes of all are taken together.

use super::category::Category;
use super::clock::OpMode;
use super::fmmu::FmmuUsage;
use super::general::General;
use super::image::Image;
use super::mailbox::MailboxPair;
use super::pdo::{Direction, Pdo};
use super::strings::{StringIndex, Strings};
use super::sync_manager::{SyncManager, SyncManagerKind};

/// Size of the process data of one SyncManager.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct ProcessData {
    /// Number of the SyncManager.
    pub sync_manager: u8,
    /// Which way they flow.
    pub direction: Direction,
    /// Bits of the PDOs assigned to it by default.
    pub bits: u32,
    /// The same in bytes, rounded up: the length the SyncManager needs.
    pub bytes: u32,
}

/// Picks the content of the first category of one sort.
macro_rules! first {
    ($image:expr, $variant:ident) => {
        $image.categories.iter().find_map(|category| {
            if let Category::$variant(content) = category { Some(content) } else { None }
        })
    };
}

impl Image {
    /// The texts.
    #[must_use]
    pub fn strings(&self) -> Option<&Strings> {
        first!(self, Strings)
    }

    /// The text with this number; `None` for number 0 and for numbers that do not exist.
    #[must_use]
    pub fn text(&self, index: StringIndex) -> Option<&str> {
        self.strings()?.text(index)
    }

    /// Category General.
    #[must_use]
    pub fn general(&self) -> Option<&General> {
        first!(self, General).map(Box::as_ref)
    }

    /// Its name in full, such as "EL2004 4K. Dig. Ausgang 24V, 0.5A".
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.text(self.general()?.name)
    }

    /// Its order (type) name, such as "EL2004".
    #[must_use]
    pub fn order(&self) -> Option<&str> {
        self.text(self.general()?.order)
    }

    /// The group it is sold under, such as "DigOut".
    #[must_use]
    pub fn group(&self) -> Option<&str> {
        self.text(self.general()?.group)
    }

    /// What each FMMU is meant for, FMMU 0 first; empty when nothing is said.
    #[must_use]
    pub fn fmmu_usages(&self) -> &[FmmuUsage] {
        first!(self, Fmmu).map_or(&[], Vec::as_slice)
    }

    /// The SyncManagers, SyncManager 0 first; empty when nothing is said.
    #[must_use]
    pub fn sync_managers(&self) -> &[SyncManager] {
        first!(self, SyncManagers).map_or(&[], Vec::as_slice)
    }

    /// The PDOs of one direction, assigned or not, in the order of the image.
    pub fn pdos(&self, direction: Direction) -> impl Iterator<Item = &Pdo> {
        self.categories.iter().flat_map(move |category| match (category, direction) {
            (Category::TxPdos(pdos), Direction::Inputs)
            | (Category::RxPdos(pdos), Direction::Outputs) => pdos.as_slice(),
            (
                Category::Strings(_)
                | Category::General(_)
                | Category::Fmmu(_)
                | Category::SyncManagers(_)
                | Category::TxPdos(_)
                | Category::RxPdos(_)
                | Category::OpModes(_)
                | Category::Raw(_),
                Direction::Inputs | Direction::Outputs,
            ) => &[],
        })
    }

    /// The operation modes with distributed clocks; the first is the default.
    pub fn op_modes(&self) -> impl Iterator<Item = &OpMode> {
        self.categories.iter().flat_map(|category| match category {
            Category::OpModes(modes) => modes.as_slice(),
            Category::Strings(_)
            | Category::General(_)
            | Category::Fmmu(_)
            | Category::SyncManagers(_)
            | Category::TxPdos(_)
            | Category::RxPdos(_)
            | Category::Raw(_) => &[],
        })
    }

    /// Bits of the PDOs that are assigned to this SyncManager by default.
    ///
    /// 0 also when the image has no PDOs at all; then the dictionary (0x1C12, 0x1C13), the ESI or
    /// the SyncManager's own length must tell.
    #[must_use]
    pub fn pdo_bits(&self, sync_manager: u8, direction: Direction) -> u32 {
        let assigned = |pdo: &&Pdo| pdo.sync_manager == Some(sync_manager);
        self.pdos(direction).filter(assigned).map(Pdo::bits).fold(0, u32::saturating_add)
    }

    /// Size of the process data of each SyncManager for outputs or inputs, in their order.
    pub fn process_data(&self) -> impl Iterator<Item = ProcessData> {
        (0..=u8::MAX).zip(self.sync_managers()).filter_map(|(sync_manager, record)| {
            let direction = match record.kind {
                SyncManagerKind::Outputs => Direction::Outputs,
                SyncManagerKind::Inputs => Direction::Inputs,
                SyncManagerKind::Unused
                | SyncManagerKind::MailboxOut
                | SyncManagerKind::MailboxIn
                | SyncManagerKind::Other(_) => return None,
            };
            let bits = self.pdo_bits(sync_manager, direction);
            Some(ProcessData { sync_manager, direction, bits, bytes: bits.div_ceil(8) })
        })
    }

    /// The standard mailbox, when the SubDevice has one.
    #[must_use]
    pub fn mailbox(&self) -> Option<&MailboxPair> {
        self.standard_mailbox.is_present().then_some(&self.standard_mailbox)
    }

    /// Current from the E-bus in mA: positive is consumed, negative is supplied. `None` when the
    /// image does not say.
    #[must_use]
    pub fn ebus_current_ma(&self) -> Option<i16> {
        self.general().map(|general| general.ebus_current_ma)
    }
}
