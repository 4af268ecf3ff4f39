//! Consent to writes: all but those of which nothing is known that they could harm.
//!
//! A register is written at once, whatever the line is doing; a wrong one closes a port, moves process
//! data or takes a SubDevice out of OP. What is only counted, masked or kept for users may be written
//! without further words.

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{Access, Description, pieces};

use crate::failure::Failure;

/// Why these bytes are not written there unless that is asked for expressly; `None` when nothing speaks
/// against it.
pub(super) fn objection(address: RegisterAddress, data: &[u8]) -> Option<Failure> {
    pieces(address, data).find_map(|piece| {
        let (name, reason) = match &piece.description {
            None if piece.address.value() >= PROCESS_RAM => (
                "process data RAM".to_owned(),
                "process data and mailboxes lie there, which somebody else exchanges".to_owned(),
            ),
            None => ("reserved".to_owned(), "no register is known there".to_owned()),
            Some(found) => (found.title(), effect(found, piece.data.len())?),
        };
        let reason = format!("{} ({name}) is not written just so: {reason}", piece.address);
        Some(Failure::new(reason, "if it is meant, say so with --force"))
    })
}

/// From here up there are no registers.
const PROCESS_RAM: u16 = linesman_proto::register::PROCESS_RAM_START.value();

/// What a write does; `None` for what does no harm.
fn effect(found: &Description, len: usize) -> Option<String> {
    let register = found.register;
    let access = |at: usize| register.ecat_access(found.offset + at as u16);
    if !(0..len).any(|at| access(at).writes()) {
        return Some("a MainDevice can only read it".to_owned());
    }
    // A write clears it: that is what it is for.
    if (0..len).all(|at| access(at) == Access::ReadClear) {
        return None;
    }
    let effect = match register.group {
        "User RAM" | "Interrupts" | "Error counters" => return None,
        "Station address" => "frames that are meant for the SubDevice do not reach it any more",
        "Write protection and reset" => "the SubDevice restarts, or takes no more writes",
        "Data link layer" => "a port that is closed cuts off everything behind it",
        "Application layer" => {
            "it changes the state of the SubDevice; `linesman state WHERE DEVICE --to STATE` does that step by step"
        }
        "Watchdog" => "outputs fall, or stay as they are, when they should not",
        "SII EEPROM interface" => {
            "it changes who may use the EEPROM, or what is in it; `linesman sii WHERE DEVICE write FILE` does that with a backup"
        }
        "PHY management interface" => "it changes how a port makes its link",
        "FMMU" | "SyncManager" => "process data and mailbox messages go elsewhere",
        "Distributed clocks: latch unit" => {
            "times that are latched are lost for whoever waits for them"
        }
        group if group.starts_with("Distributed clocks") => {
            "the clock, or the SyncSignals, of the SubDevice move"
        }
        "ESC-specific I/O" => "outputs of the SubDevice switch",
        _ => "it changes what the SubDevice does",
    };
    Some(effect.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_refused(address: u16, len: usize) -> bool {
        objection(RegisterAddress(address), &vec![0; len]).is_some()
    }

    #[test]
    fn what_counts_masks_or_is_for_users_is_written_without_further_words() {
        for (address, len) in [(0x0200, 2), (0x0300, 8), (0x0310, 4), (0x0442, 2), (0x0F80, 128)] {
            assert!(!is_refused(address, len), "0x{address:04X}");
        }
    }

    #[test]
    fn what_changes_the_line_needs_consent_wherever_it_lies_in_the_range() {
        let addresses = [
            0x0010, 0x0040, 0x0100, 0x0108, 0x0120, 0x0130, 0x0420, 0x0500, 0x0510, 0x0600, 0x0800,
            0x0910, 0x0980, 0x09A8, 0x0F00, 0x1000,
        ];
        for address in addresses {
            assert!(is_refused(address, 1), "0x{address:04X}");
        }
        // Counters, and what lies behind them.
        assert!(is_refused(0x0300, 0x0102));
        assert!(is_refused(0x0F80, 129));
        let why = objection(RegisterAddress(0x0130), &[8, 0]).unwrap().reason;
        assert!(why.contains("0x0130 (AL status)") && why.contains("only read"), "{why}");
    }
}
