//! Error codes of refused files.
//!
//! Reference: ETG.1000.6, FoE, error codes.

use std::fmt;

/// The code of an FoE error message.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct FoeErrorCode(pub u32);

/// Declares the codes: a constant for each, and the table.
macro_rules! error_codes {
    ($($constant:ident $code:literal $text:literal => $action:literal;)+) => {
        impl FoeErrorCode {
            $(#[doc = concat!("`", stringify!($code), "`: ", $text, ".")]
            pub const $constant: Self = Self($code);)+

            /// All codes that the specification names, in order of their numbers.
            pub const NAMED: &'static [Self] = &[$(Self::$constant),+];

            /// What it means, without a full stop; for numbers without a name a general text.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self.0 {
                    $($code => $text,)+
                    _ => "unknown FoE error",
                }
            }

            /// What to do about it, in one sentence.
            #[must_use]
            pub const fn action(self) -> &'static str {
                match self.0 {
                    $($code => $action,)+
                    _ => "Look the number up in the SubDevice's manual.",
                }
            }
        }
    };
}

error_codes! {
    UNDEFINED 0x8000 "no reason is given"
        => "Look at the SubDevice itself: its diagnosis history, its emergency messages.";
    NOT_FOUND 0x8001 "there is no file of this name"
        => "Compare the name, with its extension and its case, with the SubDevice's manual.";
    ACCESS_DENIED 0x8002 "access is denied"
        => "The file can be accessed in one direction only, or not at present.";
    DISK_FULL 0x8003 "there is no room left for the file"
        => "The file is longer than the SubDevice can store: check that it is the right one.";
    ILLEGAL 0x8004 "the request is illegal"
        => "Take a capture of the transfer: a message came that has no place there.";
    WRONG_PACKET 0x8005 "the packet number is wrong"
        => "A packet was lost or came twice: repeat the transfer.";
    EXISTS 0x8006 "the file exists already"
        => "Choose another name, or remove the file first.";
    NO_USER 0x8007 "there is no such user"
        => "Use the user that the SubDevice's manual names.";
    BOOTSTRAP_ONLY 0x8008 "the file can be accessed in BOOT only"
        => "Take the SubDevice to BOOT and repeat the transfer.";
    NOT_IN_BOOTSTRAP 0x8009 "the file cannot be accessed in BOOT"
        => "Take the SubDevice to PREOP and repeat the transfer.";
    NO_RIGHTS 0x800A "the password is wrong"
        => "Use the password that the SubDevice's manual names.";
    PROGRAM_ERROR 0x800B "the file could not be written to its memory, or is no such file"
        => "Check that it is a file of the kind that the SubDevice expects, then repeat.";
    CHECKSUM 0x800C "the checksum of the file is wrong"
        => "The file is damaged: get it anew.";
    WRONG_FIRMWARE 0x800D "the firmware does not fit the hardware"
        => "Get the firmware for exactly this type of SubDevice.";
    NO_FILE 0x800F "there is no file to read"
        => "Write the file first.";
}

impl fmt::Display for FoeErrorCode {
    /// Text and number.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (FoE error 0x{:04X})", self.text(), self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_a_text_of_its_own_and_an_action() {
        for pair in FoeErrorCode::NAMED.windows(2) {
            assert!(pair[0] < pair[1]);
            assert_ne!(pair[0].text(), pair[1].text());
        }
        for code in FoeErrorCode::NAMED {
            assert!(code.action().ends_with('.'), "{code}");
        }
        assert_eq!(FoeErrorCode(0x1234).to_string(), "unknown FoE error (FoE error 0x1234)");
        assert_eq!(
            FoeErrorCode(0x8003).to_string(),
            "there is no room left for the file (FoE error 0x8003)"
        );
    }
}
