//! Storage of a device's SII: key `sii` of a device.

use serde::{Deserialize, Serialize};

use crate::device::EmulatedSii;
use crate::device::library::Built;

/// Where the SII of a device lies, and who reads it.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum SiiPlace {
    /// In an EEPROM that nobody but controller and MainDevice reads.
    #[default]
    Eeprom,
    /// In an EEPROM that its software reads, too, on the way to PREOP: the MainDevice has to leave it
    /// to the device before (register 0x0500), else the device refuses with 0x0050.
    Shared,
    /// In the memory of its processor, which plays the EEPROM.
    Emulated,
}

impl SiiPlace {
    /// What the key says for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Eeprom => "eeprom",
            Self::Shared => "shared",
            Self::Emulated => "emulated",
        }
    }

    /// Whether only a device with a processor can have it.
    #[must_use]
    pub const fn needs_processor(self) -> bool {
        match self {
            Self::Eeprom => false,
            Self::Shared | Self::Emulated => true,
        }
    }

    /// The device with its SII there.
    pub(crate) fn apply(self, mut built: Built) -> Built {
        match self {
            Self::Eeprom => {}
            Self::Shared => built.firmware.read_sii(),
            Self::Emulated => {
                let image = built.sii.clone();
                built.firmware = Box::new(EmulatedSii::new(built.firmware, image));
            }
        }
        built
    }
}
