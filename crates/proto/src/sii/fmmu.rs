//! Category 40, FMMU: what each FMMU of the controller is meant for, one byte each.
//!
//! Reference: ETG.2010; ETG.1000.6 §5.4. Byte *n* belongs to FMMU *n*.

/// What an FMMU is meant for. The value is the code in the image.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum FmmuUsage {
    /// 0x00: nothing is said; also what fills up to a whole word in many images.
    Unspecified,
    /// 0x01: outputs, which the SubDevice takes from the process image.
    Outputs,
    /// 0x02: inputs, which the SubDevice puts into the process image.
    Inputs,
    /// 0x03: state of the mailbox, bit 3 of register 0x080D.
    MailboxState,
    /// 0xFF: not used.
    Unused,
    /// Another code.
    Other(u8),
}

impl FmmuUsage {
    /// The usage with this code.
    #[must_use]
    pub const fn from_code(code: u8) -> Self {
        match code {
            0x00 => Self::Unspecified,
            0x01 => Self::Outputs,
            0x02 => Self::Inputs,
            0x03 => Self::MailboxState,
            0xFF => Self::Unused,
            other => Self::Other(other),
        }
    }

    /// The code in the image.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Unspecified => 0x00,
            Self::Outputs => 0x01,
            Self::Inputs => 0x02,
            Self::MailboxState => 0x03,
            Self::Unused => 0xFF,
            Self::Other(code) => code,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_keeps_its_meaning() {
        for code in 0..=u8::MAX {
            assert_eq!(FmmuUsage::from_code(code).code(), code);
        }
    }
}
