//! CoE abort codes: why a SubDevice, or a MainDevice, broke off an SDO transfer.
//!
//! Read first: ETG.1000.6, CoE, SDO abort codes; they extend those of CiA 301. An abort is an
//! answer, not a fault of the network: the mailbox works, the request does not suit the object.

use std::fmt;

/// The number in an SDO abort message.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct SdoAbortCode(pub u32);

impl SdoAbortCode {
    /// The bare number.
    #[must_use]
    pub const fn value(self) -> u32 {
        self.0
    }

    /// What it means.
    #[must_use]
    pub fn explain(self) -> AbortCode {
        lookup(self.0)
    }
}

impl fmt::Display for SdoAbortCode {
    /// Number and text: `0x06010002 Attempt to write a read only object`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:08X} {}", self.0, self.explain().text)
    }
}

/// All there is to say about one abort code.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AbortCode {
    /// The number.
    pub code: SdoAbortCode,
    /// Whether the number itself is known; if not, text, cause and action are those of its class.
    pub known: bool,
    /// The text that goes into messages, without a full stop.
    pub text: &'static str,
    /// The usual cause, in one or two sentences.
    pub cause: &'static str,
    /// What to do about it.
    pub action: &'static str,
    /// Where the code comes from.
    pub reference: &'static str,
}

/// What an abort code means. There is an answer for every number: an unknown one gets that of its
/// class, which the upper half tells.
#[must_use]
pub fn lookup(code: u32) -> AbortCode {
    let wanted = SdoAbortCode(code);
    match ALL.binary_search_by_key(&wanted, |entry| entry.code) {
        Ok(index) => ALL[index],
        Err(_) => AbortCode { code: wanted, ..class_of(code) },
    }
}

/// Declares the codes: a constant of [`SdoAbortCode`] for each, and the table.
macro_rules! abort_codes {
    ($(
        $constant:ident $code:literal $reference:ident, $text:literal;
        $cause:literal => $action:expr;
    )+) => {
        impl SdoAbortCode {
            $(#[doc = concat!("`", stringify!($code), "`: ", $text, ".")]
            pub const $constant: Self = Self($code);)+
        }

        /// All codes that the specifications name, in order of their numbers.
        pub const ALL: &[AbortCode] = &[$(AbortCode {
            code: SdoAbortCode::$constant,
            known: true,
            text: $text,
            cause: $cause,
            action: $action,
            reference: $reference,
        }),+];
    };
}

const ETG: &str = "ETG.1000.6, SDO abort codes";
const CIA: &str = "CiA 301, SDO abort codes";

const MANUAL_OF_OBJECT: &str =
    "Compare index, subindex, length and value with the object in the SubDevice's manual.";
const OWN_DICTIONARY: &str = "Look into the SubDevice's own dictionary (`linesman sdo WHERE DEVICE list`): \
     objects differ between types and revisions.";
const STATE_FIRST: &str = "Take the SubDevice to PREOP and repeat the request; assignments of PDOs \
     can be changed only there.";
const PDO_SIZE: &str = "Map fewer or shorter objects into this PDO.";
const DEVICE_SIDE: &str = "Look at the SubDevice itself: its display, its diagnosis history \
     (object 0x10F3), its emergency messages.";
const MAILBOX_CAPTURE: &str =
    "Take a capture of the mailbox messages and look at the transfer from its first message on.";

abort_codes! {
    TOGGLE_BIT 0x0503_0000 ETG, "Toggle bit not changed";
        "A segment of a long transfer came twice, or one was lost."
        => MAILBOX_CAPTURE;
    TIMEOUT 0x0504_0000 ETG, "SDO protocol timeout";
        "The other side did not go on with the transfer in time."
        => "Repeat the request; if it comes back, give the SubDevice more time for this object.";
    COMMAND_SPECIFIER 0x0504_0001 ETG, "Command specifier not valid or unknown";
        "The SubDevice does not know this kind of SDO request."
        => MAILBOX_CAPTURE;
    BLOCK_SIZE 0x0504_0002 CIA, "Invalid block size";
        "Block transfer, which EtherCAT does not use, went wrong behind a gateway."
        => MAILBOX_CAPTURE;
    BLOCK_SEQUENCE 0x0504_0003 CIA, "Invalid sequence number";
        "Block transfer, which EtherCAT does not use, went wrong behind a gateway."
        => MAILBOX_CAPTURE;
    BLOCK_CRC 0x0504_0004 CIA, "CRC error";
        "Block transfer, which EtherCAT does not use, went wrong behind a gateway."
        => MAILBOX_CAPTURE;
    OUT_OF_MEMORY 0x0504_0005 ETG, "Out of memory";
        "The SubDevice has no room for the value."
        => "Send less at once, or repeat the request when the SubDevice is less busy.";
    UNSUPPORTED_ACCESS 0x0601_0000 ETG, "Unsupported access to an object";
        "The object exists but cannot be accessed in this way or in this state."
        => STATE_FIRST;
    WRITE_ONLY 0x0601_0001 ETG, "Attempt to read a write only object";
        "The object can be written but not read."
        => "Do not read it; the manual names the object that shows the effect.";
    READ_ONLY 0x0601_0002 ETG, "Attempt to write a read only object";
        "The object cannot be written, or not in this revision of the device or in this state."
        => OWN_DICTIONARY;
    SUBINDEX_0_NOT_ZERO 0x0601_0003 ETG,
        "Subindex cannot be written, subindex 0 must be 0 for write access";
        "The list is in use: its number of entries stands in subindex 0 and is not 0."
        => "Write 0 to subindex 0 first, then the entries, then the number of entries.";
    COMPLETE_ACCESS 0x0601_0004 ETG, "Complete access not supported";
        "The SubDevice, or this object, does not take all subindices in one transfer."
        => "Access the subindices one by one, or switch complete access off for this SubDevice.";
    EXCEEDS_MAILBOX 0x0601_0005 ETG, "Object length exceeds mailbox size";
        "The value does not fit into the mailbox, and the SubDevice does not split it."
        => "Access the subindices one by one, or make the mailbox longer if the device allows it.";
    MAPPED_TO_RXPDO 0x0601_0006 ETG, "Object mapped to RxPDO, SDO download blocked";
        "The value comes with the cyclic outputs, so it cannot be set over the mailbox as well."
        => "Set the value in the process data, or take the object out of the RxPDO.";
    NO_OBJECT 0x0602_0000 ETG, "The object does not exist in the object dictionary";
        "The SubDevice has no such object, often because it is of another revision, or another \
         module is in the slot."
        => OWN_DICTIONARY;
    NOT_MAPPABLE 0x0604_0041 ETG, "The object cannot be mapped into the PDO";
        "The object may not be exchanged as process data, or not in this direction."
        => MANUAL_OF_OBJECT;
    PDO_LENGTH 0x0604_0042 ETG,
        "Number and length of the objects to be mapped would exceed the PDO length";
        "The PDO is full."
        => PDO_SIZE;
    PARAMETER_INCOMPATIBLE 0x0604_0043 ETG, "General parameter incompatibility";
        "The value contradicts another setting of the SubDevice."
        => MANUAL_OF_OBJECT;
    INTERNAL_INCOMPATIBLE 0x0604_0047 ETG, "General internal incompatibility in the device";
        "The SubDevice cannot combine this value with its inner state."
        => DEVICE_SIDE;
    HARDWARE_ERROR 0x0606_0000 ETG, "Access failed due to a hardware error";
        "A part of the SubDevice that the object belongs to does not work."
        => DEVICE_SIDE;
    LENGTH_MISMATCH 0x0607_0010 ETG,
        "Data type does not match, length of service parameter does not match";
        "The value has another length than the object."
        => MANUAL_OF_OBJECT;
    TOO_LONG 0x0607_0012 ETG, "Data type does not match, length of service parameter too high";
        "The value is longer than the object."
        => MANUAL_OF_OBJECT;
    TOO_SHORT 0x0607_0013 ETG, "Data type does not match, length of service parameter too low";
        "The value is shorter than the object."
        => MANUAL_OF_OBJECT;
    NO_SUBINDEX 0x0609_0011 ETG, "Subindex does not exist";
        "The object exists but has no such entry; lists may be shorter than their maximum."
        => "Read subindex 0, which holds the number of entries.";
    VALUE_RANGE 0x0609_0030 ETG, "Value range of parameter exceeded";
        "The SubDevice does not accept this value."
        => MANUAL_OF_OBJECT;
    VALUE_TOO_HIGH 0x0609_0031 ETG, "Value of parameter written too high";
        "The value is above what the object accepts."
        => MANUAL_OF_OBJECT;
    VALUE_TOO_LOW 0x0609_0032 ETG, "Value of parameter written too low";
        "The value is below what the object accepts."
        => MANUAL_OF_OBJECT;
    MODULE_LIST 0x0609_0033 ETG, "Detected module list does not match configured module list";
        "The modules written to object 0xF030 are not those that the SubDevice finds."
        => "Compare objects 0xF030 (configured) and 0xF050 (detected) entry by entry: the first \
            difference is the slot to look at.";
    MAXIMUM_BELOW_MINIMUM 0x0609_0036 ETG, "Maximum value is less than minimum value";
        "Two limits were written in an order that makes them contradict for a moment, or for good."
        => "Write the limits in the other order, or correct them.";
    RESOURCE_NOT_AVAILABLE 0x060A_0023 CIA, "Resource not available";
        "What the request needs is in use, such as a connection behind a gateway."
        => "Repeat the request later.";
    GENERAL_ERROR 0x0800_0000 ETG, "General error";
        "The SubDevice gives no reason."
        => DEVICE_SIDE;
    NOT_TRANSFERRED 0x0800_0020 ETG, "Data cannot be transferred or stored to the application";
        "The SubDevice's application did not take the value, or memory for it could not be written."
        => DEVICE_SIDE;
    LOCAL_CONTROL 0x0800_0021 ETG,
        "Data cannot be transferred or stored to the application because of local control";
        "Somebody operates the SubDevice at its own panel or over another interface."
        => "End the local operation, then repeat the request.";
    DEVICE_STATE 0x0800_0022 ETG,
        "Data cannot be transferred or stored to the application because of the present device \
         state";
        "The object can be accessed in other states only: PDO assignments (0x1C12, 0x1C13) in \
         PREOP."
        => STATE_FIRST;
    NO_DICTIONARY 0x0800_0023 ETG,
        "Object dictionary dynamic generation failed or no object dictionary present";
        "The SubDevice has no list of its objects, or could not make one."
        => "Use the device description (ESI) as the list of objects.";
    NO_DATA 0x0800_0024 CIA, "No data available";
        "There is nothing to read at this moment."
        => "Repeat the request later.";
}

/// What can be said of a code that the table does not have, by its upper half.
const fn class_of(code: u32) -> AbortCode {
    let (text, cause, action) = match code >> 16 {
        0x0503 | 0x0504 => {
            ("Unknown protocol error", "The transfer itself went wrong.", MAILBOX_CAPTURE)
        }
        0x0601 => {
            ("Unknown access error", "The object cannot be accessed in this way.", MANUAL_OF_OBJECT)
        }
        0x0602 => ("Unknown object error", "The object is not there.", OWN_DICTIONARY),
        0x0604 => (
            "Unknown parameter error",
            "The value does not go with other settings.",
            MANUAL_OF_OBJECT,
        ),
        0x0606 => ("Unknown hardware error", "A part of the SubDevice failed.", DEVICE_SIDE),
        0x0607 => {
            ("Unknown length error", "The value has the wrong type or length.", MANUAL_OF_OBJECT)
        }
        0x0609 => {
            ("Unknown value error", "The SubDevice does not accept the value.", MANUAL_OF_OBJECT)
        }
        0x060A => ("Unknown resource error", "Something needed is in use.", DEVICE_SIDE),
        0x0800 => {
            ("Unknown application error", "The SubDevice's application refused.", DEVICE_SIDE)
        }
        _ => (
            "Unknown abort code",
            "The specifications do not name this number; it is the manufacturer's own.",
            "Look the number up in the SubDevice's manual.",
        ),
    };
    AbortCode {
        code: SdoAbortCode(code),
        known: false,
        text,
        cause,
        action,
        reference: "ETG.1000.6, SDO abort codes: not listed",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_order_and_complete_in_every_entry() {
        assert!(ALL.is_sorted_by(|a, b| a.code < b.code), "codes out of order or twice");
        for entry in ALL {
            let code = entry.code;
            assert!(!entry.text.is_empty() && !entry.text.ends_with('.'), "{code}");
            assert!(entry.cause.ends_with('.'), "{code}: cause is no sentence");
            assert!(entry.action.ends_with('.') && entry.action.len() > 15, "{code}: no action");
            assert!(entry.known && !entry.reference.is_empty(), "{code}");
        }
    }

    // proves: SW-10
    #[test]
    fn the_refusals_of_the_sources() {
        let table = [
            (0x0601_0002, "Attempt to write a read only object"),
            (0x0602_0000, "The object does not exist in the object dictionary"),
            (0x0601_0004, "Complete access not supported"),
        ];
        for (code, text) in table {
            assert_eq!(lookup(code).text, text);
        }
        assert_eq!(
            SdoAbortCode::READ_ONLY.to_string(),
            "0x06010002 Attempt to write a read only object"
        );
    }

    #[test]
    fn unknown_codes_get_the_answer_of_their_class() {
        let table = [
            (0x0504_0009, "Unknown protocol error"),
            (0x0609_0099, "Unknown value error"),
            (0x0800_0099, "Unknown application error"),
            (0x1234_5678, "Unknown abort code"),
            (0, "Unknown abort code"),
        ];
        for (code, text) in table {
            let entry = lookup(code);
            assert_eq!((entry.text, entry.known, entry.code.value()), (text, false, code));
            assert!(entry.cause.ends_with('.') && entry.action.ends_with('.'), "{text}");
        }
    }

    /// Every class that the table uses is one that an unknown code can fall into.
    #[test]
    fn classes_cover_the_table() {
        for entry in ALL {
            let stranger = entry.code.value() | 0xFFFF;
            assert_ne!(lookup(stranger).text, "Unknown abort code", "{}", entry.code);
        }
    }
}
