//! Synchronisation mode of a device: in step with itself, with frames, or with a signal of its clock.
//!
//! Read first: ETG.1020, synchronisation; 0x1C32 and 0x1C33, subindices 01 and 04; 0x0981.

use linesman_proto::state::AlStatusCode;

use crate::controller::SyncSignal;

/// Bits of subindex 04.
const FREE_RUN: u64 = 1 << 0;
const WITH_FRAMES: u64 = 1 << 1;
const WITH_CLOCK: u64 = 0b111 << 2;

/// Synchronisation mode of a device.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum SyncMode {
    /// Its own timer.
    FreeRun,
    /// The frames that bring outputs or fetch inputs.
    Frames,
    /// A signal of its clock.
    Clock(SyncSignal),
}

/// The mode that follows from what is wanted (0x1C3x:01), supported (04) and switched on (0x0981).
pub(super) fn mode(wanted: u64, supported: u64, activation: u8) -> Result<SyncMode, AlStatusCode> {
    const UNIT: u8 = 1 << 0;
    const SYNC0: u8 = 1 << 1;
    const SYNC1: u8 = 1 << 2;
    const WANTS_SYNC1: u64 = 3;
    if activation & UNIT != 0 {
        let clock = supported & WITH_CLOCK != 0;
        if !clock || activation & SYNC0 == 0 {
            return Err(AlStatusCode::INVALID_DC_SYNC_CONFIGURATION);
        }
        return match (wanted, activation & SYNC1 != 0) {
            (WANTS_SYNC1, true) => Ok(SyncMode::Clock(SyncSignal::Sync1)),
            (WANTS_SYNC1, false) => Err(AlStatusCode::INVALID_DC_SYNC_CONFIGURATION),
            _ => Ok(SyncMode::Clock(SyncSignal::Sync0)),
        };
    }
    match wanted {
        0 if supported & FREE_RUN == 0 => Err(AlStatusCode::FREE_RUN_NOT_SUPPORTED),
        0 => Ok(SyncMode::FreeRun),
        1 | 0x22 if supported & WITH_FRAMES == 0 => Err(AlStatusCode::SYNC_NOT_SUPPORTED),
        1 | 0x22 => Ok(SyncMode::Frames),
        2 | 3 => Err(AlStatusCode::INVALID_DC_SYNC_CONFIGURATION),
        _ => Err(AlStatusCode::SYNC_NOT_SUPPORTED),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: SYN-01 (U)
    #[test]
    fn the_mode_follows_from_objects_and_unit() {
        let all = FREE_RUN | WITH_FRAMES | WITH_CLOCK;
        let sync0 = SyncMode::Clock(SyncSignal::Sync0);
        // wanted, supported, activation, mode or code
        let table = [
            (0, all, 0x00, Ok(SyncMode::FreeRun)),
            (1, all, 0x00, Ok(SyncMode::Frames)),
            (0x22, all, 0x00, Ok(SyncMode::Frames)),
            (1, all, 0x03, Ok(sync0)),
            (2, all, 0x03, Ok(sync0)),
            (3, all, 0x07, Ok(SyncMode::Clock(SyncSignal::Sync1))),
            (2, all, 0x00, Err(0x0030)),
            (3, all, 0x03, Err(0x0030)),
            (1, all, 0x01, Err(0x0030)),
            (1, all, 0x05, Err(0x0030)),
            (1, FREE_RUN | WITH_FRAMES, 0x03, Err(0x0030)),
            (0, WITH_FRAMES, 0x00, Err(0x0027)),
            (1, FREE_RUN, 0x00, Err(0x0028)),
            (9, all, 0x00, Err(0x0028)),
        ];
        for (wanted, supported, activation, expected) in table {
            let found = mode(wanted, supported, activation).map_err(|code| code.0);
            assert_eq!(found, expected, "{wanted} of {supported:04X}, 0x0981 {activation:02X}");
        }
    }
}
