//! Return codes of ADS.

use std::fmt;

use crate::mailbox::abort_code::SdoAbortCode;

/// A return code: in the AMS header where a message did not reach its target, else the result of a service.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct AdsCode(pub u32);

impl AdsCode {
    /// Bytes of a code.
    pub const LEN: usize = 4;
    /// No error.
    pub const OK: Self = Self(0);
    /// The NetId has no such port.
    pub const PORT_NOT_FOUND: Self = Self(0x6);
    /// The NetId is another one.
    pub const MACHINE_NOT_FOUND: Self = Self(0x7);
    /// The command is unknown.
    pub const UNKNOWN_COMMAND: Self = Self(0x8);
    /// The length in the AMS header is wrong.
    pub const BAD_LENGTH: Self = Self(0xE);
    /// General error of the device.
    pub const GENERAL: Self = Self(0x700);
    /// The device does not offer the service.
    pub const SERVICE_NOT_SUPPORTED: Self = Self(0x701);
    /// No such index group.
    pub const BAD_INDEX_GROUP: Self = Self(0x702);
    /// No such index offset.
    pub const BAD_INDEX_OFFSET: Self = Self(0x703);
    /// Reading or writing is not permitted.
    pub const NOT_PERMITTED: Self = Self(0x704);
    /// The number of bytes does not match.
    pub const BAD_SIZE: Self = Self(0x705);
    /// Values that the service does not take.
    pub const BAD_DATA: Self = Self(0x706);
    /// The device is not ready.
    pub const NOT_READY: Self = Self(0x707);
    /// The device is busy.
    pub const BUSY: Self = Self(0x708);
    /// Not enough memory.
    pub const NO_MEMORY: Self = Self(0x70A);
    /// Nothing of that name.
    pub const NOT_FOUND: Self = Self(0x70C);
    /// The device is in a state in which it does not do that.
    pub const INVALID_STATE: Self = Self(0x712);
    /// The device gave no answer in time.
    pub const TIMEOUT: Self = Self(0x719);

    /// Meaning in words; `None` for a code that no service of Linesman gives.
    #[must_use]
    pub const fn meaning(self) -> Option<&'static str> {
        Some(match self {
            Self::OK => "no error",
            Self::PORT_NOT_FOUND => "target port not found",
            Self::MACHINE_NOT_FOUND => "target machine not found",
            Self::UNKNOWN_COMMAND => "unknown command",
            Self::BAD_LENGTH => "wrong length in the AMS header",
            Self::GENERAL => "general device error",
            Self::SERVICE_NOT_SUPPORTED => "service not supported",
            Self::BAD_INDEX_GROUP => "invalid index group",
            Self::BAD_INDEX_OFFSET => "invalid index offset",
            Self::NOT_PERMITTED => "reading or writing not permitted",
            Self::BAD_SIZE => "parameter size not correct",
            Self::BAD_DATA => "invalid parameter value",
            Self::NOT_READY => "device not ready",
            Self::BUSY => "device busy",
            Self::NO_MEMORY => "out of memory",
            Self::NOT_FOUND => "not found",
            Self::INVALID_STATE => "device in an invalid state",
            Self::TIMEOUT => "device timeout",
            Self(_) => return None,
        })
    }

    /// Next step of whoever gets it, in one sentence with a full stop.
    #[must_use]
    pub const fn action(self) -> &'static str {
        match self {
            Self::PORT_NOT_FOUND => "Take the AMS port that the manual of the SubDevice names.",
            Self::MACHINE_NOT_FOUND => {
                "Ask with the NetId that was written to the SubDevice, or write it anew."
            }
            Self::UNKNOWN_COMMAND | Self::SERVICE_NOT_SUPPORTED => {
                "Look into the manual for the commands of ADS that the SubDevice takes."
            }
            Self::BAD_INDEX_GROUP | Self::BAD_INDEX_OFFSET | Self::NOT_FOUND => {
                "Check index group and offset: objects are in group 0xF302, offset index * 65536 + subindex."
            }
            Self::NOT_PERMITTED => "Check whether it can be read or written, and in which state.",
            Self::BAD_LENGTH | Self::BAD_SIZE => "Check the number of bytes.",
            Self::BAD_DATA => "Check the value against its limits.",
            Self::NOT_READY | Self::BUSY | Self::TIMEOUT => "Wait a moment, then repeat.",
            Self::INVALID_STATE => "Take it to the state that the manual asks for, then repeat.",
            Self(_) => "Look the code up in the manual of the SubDevice.",
        }
    }

    /// The code by which an abort of an SDO transfer is told; the abort code itself is read apart
    /// ([`index::LAST_SDO_ERROR`](super::index::LAST_SDO_ERROR)). No source says which codes the vendor takes: the groups
    /// of abort codes (ETG.1000.6, table 40) are mapped by their meaning.
    #[must_use]
    pub const fn of_abort(code: SdoAbortCode) -> Self {
        match code.value() {
            0x0504_0000 => Self::TIMEOUT,
            0x0504_0005 => Self::NO_MEMORY,
            0x0601_0000..=0x0601_FFFF => Self::NOT_PERMITTED,
            0x0602_0000 => Self::NOT_FOUND,
            0x0607_0000..=0x0607_FFFF => Self::BAD_SIZE,
            0x0609_0011 => Self::BAD_INDEX_OFFSET,
            0x0609_0030..=0x0609_0036 => Self::BAD_DATA,
            0x0800_0021 | 0x0800_0022 => Self::INVALID_STATE,
            _ => Self::GENERAL,
        }
    }
}

impl fmt::Display for AdsCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.meaning() {
            Some(meaning) => write!(f, "0x{:X} {meaning}", self.0),
            None => write!(f, "0x{:X}", self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aborts_are_told_by_the_code_of_their_meaning() {
        for (abort, code) in [
            (0x0504_0000, AdsCode::TIMEOUT),
            (0x0601_0002, AdsCode::NOT_PERMITTED),
            (0x0602_0000, AdsCode::NOT_FOUND),
            (0x0607_0010, AdsCode::BAD_SIZE),
            (0x0609_0011, AdsCode::BAD_INDEX_OFFSET),
            (0x0609_0031, AdsCode::BAD_DATA),
            (0x0800_0022, AdsCode::INVALID_STATE),
            (0x0800_0000, AdsCode::GENERAL),
            (0, AdsCode::GENERAL),
        ] {
            assert_eq!(AdsCode::of_abort(SdoAbortCode(abort)), code, "{abort:08x}");
        }
        assert_eq!(AdsCode(0x702).to_string(), "0x702 invalid index group");
        assert_eq!(AdsCode(0x9811).to_string(), "0x9811");
    }
}
