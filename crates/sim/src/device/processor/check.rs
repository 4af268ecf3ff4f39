//! What a device checks before it enters a state: SyncManagers and watchdog.
//!
//! Read first: ETG.1000.6, state transitions; the codes are those that the public SubDevice stack
//! code gives.

use linesman_proto::register::{self as r, SmDirection, SmMode, SyncManagerConfig};
use linesman_proto::sii::Direction;
use linesman_proto::state::AlStatusCode;

use super::areas::Areas;
use crate::controller::Pdi;
use crate::device::mailbox::{ANSWERS, REQUESTS};

/// The shortest mailbox that the specification allows, in bytes.
const SHORTEST_MAILBOX: u16 = 0x22;
/// Where process-data RAM begins.
const RAM: u16 = 0x1000;

/// Whether both SyncManagers of the mailbox are set up. `longest` is the longest one that the device
/// takes.
pub(super) fn mailbox(pdi: &Pdi<'_>, longest: u16) -> bool {
    let (Some(requests), Some(answers)) = (pdi.sync_manager(REQUESTS), pdi.sync_manager(ANSWERS))
    else {
        return false;
    };
    let sound = |manager: &SyncManagerConfig, direction: SmDirection| {
        manager.activate.enable()
            && manager.control.mode() == SmMode::Mailbox
            && manager.control.direction() == direction
            && (SHORTEST_MAILBOX..=longest).contains(&manager.length)
            && is_in_ram(manager, pdi)
    };
    sound(&requests, SmDirection::MainDeviceWrites)
        && sound(&answers, SmDirection::MainDeviceReads)
        && !overlap(&requests, &answers)
}

/// Whether all process data are set up; if not, the code to show. `mailbox` says whether SyncManagers
/// 0 and 1 are those of a mailbox.
pub(super) fn process_data(
    pdi: &Pdi<'_>,
    areas: &Areas,
    mailbox: bool,
) -> Result<(), AlStatusCode> {
    let mut others = if mailbox { vec![REQUESTS, ANSWERS] } else { Vec::new() };
    for direction in [Direction::Inputs, Direction::Outputs] {
        let (way, code) = match direction {
            Direction::Inputs => {
                (SmDirection::MainDeviceReads, AlStatusCode::INVALID_INPUT_CONFIGURATION)
            }
            Direction::Outputs => {
                (SmDirection::MainDeviceWrites, AlStatusCode::INVALID_OUTPUT_CONFIGURATION)
            }
        };
        for (index, len) in areas.lengths(direction) {
            if !buffer(pdi, index, len, way, &others) {
                return Err(code);
            }
            others.push(index);
        }
    }
    let watched = watched(pdi, areas);
    if areas.len(Direction::Outputs) > 0
        && watched
        && pdi.register_u16(r::WATCHDOG_TIME_PROCESS_DATA.address) == 0
    {
        return Err(AlStatusCode::INVALID_WATCHDOG);
    }
    Ok(())
}

/// Whether outputs are to trigger the watchdog.
pub(super) fn watched(pdi: &Pdi<'_>, areas: &Areas) -> bool {
    areas
        .lengths(Direction::Outputs)
        .filter_map(|(index, _)| pdi.sync_manager(index))
        .any(|manager| manager.control.watchdog())
}

/// Whether a SyncManager for `len` bytes of process data is set up, apart from `others`. Without
/// process data it has to be off.
fn buffer(pdi: &Pdi<'_>, index: u8, len: usize, direction: SmDirection, others: &[u8]) -> bool {
    let Some(manager) = pdi.sync_manager(index) else { return len == 0 };
    let on = manager.activate.enable() && manager.length > 0;
    if len == 0 || !on {
        return len == 0 && !on;
    }
    usize::from(manager.length) == len
        && manager.control.mode() == SmMode::Buffered
        && manager.control.direction() == direction
        && is_in_ram(&manager, pdi)
        && !others
            .iter()
            .filter_map(|other| pdi.sync_manager(*other))
            .any(|other| other.activate.enable() && overlap(&manager, &other))
}

/// Whether all its buffers lie in process-data RAM.
fn is_in_ram(manager: &SyncManagerConfig, pdi: &Pdi<'_>) -> bool {
    let end = u32::from(manager.start.0) + manager.memory_len();
    let ram_end = usize::from(RAM) + pdi.ram(RAM..u16::MAX).len();
    manager.start.0 >= RAM && end as usize <= ram_end
}

fn overlap(one: &SyncManagerConfig, other: &SyncManagerConfig) -> bool {
    let (from, to) = (u32::from(one.start.0), u32::from(one.start.0) + one.memory_len());
    let other_from = u32::from(other.start.0);
    let other_to = other_from + other.memory_len();
    from < other_to && other_from < to
}
