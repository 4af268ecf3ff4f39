//! Checks of a device before it enters a state: SyncManagers and watchdog.
//!
//! Read first: ETG.1000.6, state transitions; the codes are those that the public SubDevice stack
//! code gives.

use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::register::{self as r, SmDirection, SmMode, SyncManagerConfig};
use linesman_proto::sii::Direction;
use linesman_proto::state::AlStatusCode;

use super::areas::Areas;
use crate::controller::Pdi;
use crate::device::dictionary::Dictionary;
use crate::device::mailbox::{ANSWERS, REQUESTS};

/// The shortest mailbox that the specification allows, in bytes.
const SHORTEST_MAILBOX: u16 = 0x22;
/// Where process-data RAM begins.
const RAM: u16 = 0x1000;

/// Detected modules of a modular device.
const DETECTED_MODULES: ObjectIndex = ObjectIndex(0xF050);
/// Modules that the MainDevice expects.
const CONFIGURED_MODULES: ObjectIndex = ObjectIndex(0xF030);

/// Whether the modules of a modular device are those that the MainDevice has configured. One that
/// configures none (subindex 0 is 0) takes what there is; empty slots (ident 0) at the end do not
/// count.
pub(super) fn modules(dictionary: &Dictionary) -> Result<(), AlStatusCode> {
    let idents = |index| {
        let object = dictionary.object(index)?;
        let count = object.entry(0)?.as_number() as usize;
        let idents = object.entries.iter().skip(1).take(count).map(|entry| entry.as_number());
        let idents: Vec<u64> = idents.collect();
        let used = idents.iter().rposition(|ident| *ident != 0).map_or(0, |last| last + 1);
        Some(idents[..used].to_vec())
    };
    match (idents(CONFIGURED_MODULES), idents(DETECTED_MODULES)) {
        (Some(configured), Some(detected)) if !configured.is_empty() && configured != detected => {
            Err(AlStatusCode::MODULE_LIST_MISMATCH)
        }
        _ => Ok(()),
    }
}

/// How the software of a device reaches memory over a bus of 16 bits, PDI 0x08 and 0x0A (S2 2.6).
/// The bus itself has a line for single bytes (BHE), so it is the software that cannot begin at an
/// odd address; one whose maker lets a SyncManager begin there evidently can.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub enum BusAccess {
    /// In whole words: what begins at an odd address is refused (AL status code 0x0017).
    #[default]
    Words,
    /// In bytes where it has to.
    Bytes,
}

impl BusAccess {
    /// That of a device with these SyncManagers after power-on.
    #[must_use]
    pub fn of(starts: impl IntoIterator<Item = RegisterAddress>) -> Self {
        let odd = starts.into_iter().any(|start| !start.0.is_multiple_of(2));
        if odd { Self::Bytes } else { Self::Words }
    }

    /// Whether a SyncManager begins where the device can reach it.
    fn reaches(self, manager: &SyncManagerConfig, pdi: &Pdi<'_>) -> bool {
        let bus_of_words = matches!(pdi.register(r::PDI_CONTROL.address), 0x08 | 0x0A);
        self == Self::Bytes || !bus_of_words || manager.start.0.is_multiple_of(2)
    }
}

/// Whether both SyncManagers of the mailbox are set up. `longest` is the longest one that the device
/// takes, `wrong` the code for most of what can be wrong.
pub(super) fn mailbox(
    pdi: &Pdi<'_>,
    longest: u16,
    bus: BusAccess,
    wrong: AlStatusCode,
) -> Result<(), AlStatusCode> {
    let (Some(requests), Some(answers)) = (pdi.sync_manager(REQUESTS), pdi.sync_manager(ANSWERS))
    else {
        return Err(wrong);
    };
    let sound = |manager: &SyncManagerConfig, direction: SmDirection| {
        manager.activate.enable()
            && manager.control.mode() == SmMode::Mailbox
            && manager.control.direction() == direction
            && (SHORTEST_MAILBOX..=longest).contains(&manager.length)
            && is_in_ram(manager, pdi)
    };
    let both = sound(&requests, SmDirection::MainDeviceWrites)
        && sound(&answers, SmDirection::MainDeviceReads)
        && !overlap(&requests, &answers);
    if !both {
        Err(wrong)
    } else if [requests, answers].iter().all(|manager| bus.reaches(manager, pdi)) {
        Ok(())
    } else {
        Err(AlStatusCode::INVALID_SYNC_MANAGER)
    }
}

/// Whether all process data are set up; if not, the code to show. `mailbox` says whether SyncManagers
/// 0 and 1 are those of a mailbox.
pub(super) fn process_data(
    pdi: &Pdi<'_>,
    areas: &Areas,
    mailbox: bool,
    bus: BusAccess,
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
    let mut used = areas.lengths(Direction::Inputs).chain(areas.lengths(Direction::Outputs));
    let unreachable = |(index, _)| {
        let manager: Option<SyncManagerConfig> = pdi.sync_manager(index);
        manager.is_some_and(|used| used.activate.enable() && !bus.reaches(&used, pdi))
    };
    if used.any(unreachable) {
        return Err(AlStatusCode::INVALID_SYNC_MANAGER);
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
