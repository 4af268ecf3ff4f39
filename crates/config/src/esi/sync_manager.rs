//! SyncManagers and FMMUs: elements `Sm` and `Fmmu` (ETG.2000).

use linesman_proto::address::RegisterAddress;
use linesman_proto::sii::{FmmuUsage, SyncManagerKind};

use super::error::EsiError;
use super::value;
use super::xml::Element;

/// A SyncManager.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EsiSyncManager {
    /// What it is for.
    pub kind: SyncManagerKind,
    /// First byte.
    pub start: RegisterAddress,
    /// Default length in bytes; 0 where the PDOs tell.
    pub size: u16,
    /// Control byte.
    pub control: u8,
    /// It is to be switched on.
    pub enable: bool,
    /// Switched on in OP only.
    pub op_only: bool,
    /// There is no such SyncManager: FMMUs lead to the address without one.
    pub is_virtual: bool,
}

/// An FMMU.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct EsiFmmu {
    /// What it is for.
    pub usage: FmmuUsage,
    /// The SyncManager whose data it maps, where that is said.
    pub sync_manager: Option<u8>,
}

/// The SyncManager of an element `Sm`.
pub(super) fn sync_manager(element: &Element) -> Result<EsiSyncManager, EsiError> {
    let kind = match element.text() {
        "MBoxOut" => SyncManagerKind::MailboxOut,
        "MBoxIn" => SyncManagerKind::MailboxIn,
        "Outputs" => SyncManagerKind::Outputs,
        "Inputs" => SyncManagerKind::Inputs,
        "" | "Unused" => SyncManagerKind::Unused,
        other => {
            let reason = format!("\"{other}\", expected MBoxOut, MBoxIn, Outputs or Inputs");
            return Err(element.error(reason));
        }
    };
    let is_virtual = element.flag("Virtual")?;
    // Bit 0 switches on, bit 3 does so in OP only (as the SII has them).
    let enable: u8 = match element.attribute("Enable") {
        Some(text) => match value::flag(text) {
            Ok(on) => u8::from(on),
            Err(_) => element.attribute_number("Enable")?.unwrap_or(0),
        },
        None => 0,
    };
    Ok(EsiSyncManager {
        kind,
        start: RegisterAddress(element.attribute_number("StartAddress")?.unwrap_or(0)),
        size: element.attribute_number("DefaultSize")?.unwrap_or(0),
        control: element.attribute_number("ControlByte")?.unwrap_or(0),
        enable: enable & 0x01 != 0,
        op_only: element.flag("OpOnly")? || enable & 0x08 != 0,
        is_virtual,
    })
}

/// The FMMU of an element `Fmmu`.
pub(super) fn fmmu(element: &Element) -> Result<EsiFmmu, EsiError> {
    let usage = match element.text() {
        "Outputs" => FmmuUsage::Outputs,
        "Inputs" => FmmuUsage::Inputs,
        "MBoxState" => FmmuUsage::MailboxState,
        "" | "Unused" => FmmuUsage::Unused,
        // Used at run time, by the MainDevice as it likes.
        "DynamicOutputs" | "DynamicInputs" | "Dynamic" => FmmuUsage::Unspecified,
        other => {
            let reason = format!("\"{other}\", expected Outputs, Inputs or MBoxState");
            return Err(element.error(reason));
        }
    };
    Ok(EsiFmmu { usage, sync_manager: element.attribute_number("Sm")? })
}
