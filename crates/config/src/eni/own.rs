//! Ownership of the bytes of the cyclic datagrams: what the FMMUs of the SubDevices say, checked
//! against the file's own numbers.

use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::{AL_STATUS, FmmuConfig};
use linesman_proto::sii::Direction;

use super::cyclic::{FileDatagram, FileTask};
use super::sub_device::{FileDevice, fmmus_of};
use crate::esi::EsiError;
use crate::plan::layout::{DEFAULT_UNIT, MAILBOX_STATES};
use crate::plan::{
    DatagramPlan, FramePlan, Ownership, PathView, Plan, Presence, Role, SyncUnit, Task, expect,
};

/// Makes the tasks of the plan.
pub(super) fn own(
    tasks: &[FileTask],
    mailbox_states: Option<u32>,
    plan: &mut Plan,
) -> Result<(), EsiError> {
    let states = mailbox_states.unwrap_or(MAILBOX_STATES.0);
    for file in tasks {
        let mut task = Task {
            name: file.name.clone(),
            cycle: file.cycle,
            io_at: file.io_at,
            sync_units: Vec::new(),
            frames: Vec::new(),
        };
        for frame in &file.frames {
            let mut planned =
                FramePlan { ahead: frame.ahead, repeats: frame.repeats, ..FramePlan::default() };
            for datagram in &frame.datagrams {
                let datagram = one(datagram, states, &mut task.sync_units, plan)?;
                planned.datagrams.push(datagram);
            }
            task.frames.push(planned);
        }
        if task.sync_units.is_empty() {
            task.sync_units.push(SyncUnit { name: DEFAULT_UNIT.to_owned(), devices: Vec::new() });
        }
        plan.tasks.push(task);
    }
    Ok(())
}

fn one(
    file: &FileDatagram,
    states: u32,
    units: &mut Vec<SyncUnit>,
    plan: &mut Plan,
) -> Result<DatagramPlan, EsiError> {
    let mut ownership = Vec::new();
    if let DatagramAddress::Logical(start) = file.address {
        for direction in [Direction::Outputs, Direction::Inputs] {
            if file.serves(direction) {
                ownership.extend(claims(file, start.0, direction, plan)?);
            }
        }
    }
    let role = role(file, states, &ownership);
    let sync_unit = (role == Role::ProcessData).then(|| {
        let name = file.sync_unit.as_deref().unwrap_or(DEFAULT_UNIT);
        let at = units.iter().position(|unit| unit.name == name).unwrap_or_else(|| {
            units.push(SyncUnit { name: name.to_owned(), devices: Vec::new() });
            units.len() - 1
        });
        let devices = &mut units[at].devices;
        devices.extend(ownership.iter().map(|owned| owned.device));
        devices.sort_unstable();
        devices.dedup();
        at
    });
    let (command, address, len) = (file.command, file.address, file.len);
    Ok(DatagramPlan { command, address, len, role, sync_unit, ownership })
}

#[allow(
    clippy::wildcard_enum_match_arm,
    reason = "what the guards do not take is other, whatever its command"
)]
fn role(file: &FileDatagram, states: u32, ownership: &[Ownership]) -> Role {
    let at_al_status =
        matches!(file.address, DatagramAddress::Physical(_, at) if at == AL_STATUS.address);
    let latched = matches!(file.address, DatagramAddress::Physical(_, RegisterAddress(0x0900)));
    match file.command {
        _ if !ownership.is_empty() => Role::ProcessData,
        Command::Lrd if file.logical().is_some_and(|all| all.contains(&u64::from(states))) => {
            Role::MailboxStates
        }
        Command::Brd if at_al_status => Role::Presence,
        Command::Nop if latched => Role::LatchedTime,
        Command::Armw | Command::Frmw if file.is_time() => Role::ReferenceClock,
        Command::Apwr | Command::Fpwr | Command::Bwr if file.is_time() => Role::ClockShift,
        _ => Role::Other,
    }
}

/// What the SubDevices own of a datagram in one direction, and where it goes in the process image:
/// its bytes in their order, without those of nobody.
fn claims(
    file: &FileDatagram,
    start: u32,
    direction: Direction,
    plan: &mut Plan,
) -> Result<Vec<Ownership>, EsiError> {
    let mut claims: Vec<(Ownership, DeviceId)> = Vec::new();
    let len = u16::try_from(file.len).unwrap_or(u16::MAX);
    for device in &plan.devices {
        for fmmu in fmmus_of(device, direction) {
            let start = linesman_proto::address::LogicalAddress(start);
            let Some(overlap) = fmmu.overlap(start, len) else { continue };
            let from = usize::from(overlap.datagram_offset);
            let range = from..from + usize::from(overlap.length);
            let masks = masks(fmmu, overlap.fmmu_offset, overlap.length);
            let owned = Ownership { device: device.id, direction, range, image_at: 0, masks };
            claims.push((owned, device.id));
        }
    }
    claims.sort_by_key(|(owned, _)| (owned.range.start, owned.masks[0].trailing_zeros()));
    let base = match direction {
        Direction::Outputs => plan.outputs_len,
        Direction::Inputs => plan.inputs_len,
    };
    // The byte behind the last one that is somebody's, in the datagram and in the process image.
    let (mut behind, mut image) = (0_usize, base);
    let mut done: Vec<Ownership> = Vec::with_capacity(claims.len());
    for (mut owned, id) in claims {
        for other in done.iter().rev().take_while(|other| other.range.end > owned.range.start) {
            if let Some(byte) = shared(other, &owned) {
                let name = |id: DeviceId| plan.device(id).map_or("", |device| device.name.as_str());
                return Err(file.error(format!(
                    "byte {byte} of its {} belongs to \"{}\" and to \"{}\"",
                    if direction == Direction::Inputs { "inputs" } else { "outputs" },
                    name(other.device),
                    name(owned.device),
                )));
            }
        }
        // Only bytes that are shared begin before the end of those before them.
        owned.image_at = image - behind.saturating_sub(owned.range.start);
        if owned.range.end > behind {
            behind = owned.range.end;
            image = owned.image_at + owned.range.len();
        }
        if let Some(device) = plan.devices.get_mut(id.index()) {
            let mine = match direction {
                Direction::Outputs => &mut device.outputs,
                Direction::Inputs => &mut device.inputs,
            };
            let none = mine.start == mine.end;
            let begin = if none { owned.image_at } else { mine.start.min(owned.image_at) };
            *mine = begin..mine.end.max(owned.image_at + owned.range.len());
        }
        done.push(owned);
    }
    match direction {
        Direction::Outputs => plan.outputs_len = image,
        Direction::Inputs => plan.inputs_len = image,
    }
    Ok(done)
}

/// Which bits of the first and last byte of a piece of an FMMU are mapped.
fn masks(fmmu: &FmmuConfig, offset: u16, len: u16) -> [u8; 2] {
    let first = if offset == 0 { 0xFF << (fmmu.logical_start_bit & 7) } else { 0xFF };
    let ends = u32::from(offset) + u32::from(len) >= u32::from(fmmu.length);
    let last = if ends { 0xFF >> (7 - (fmmu.logical_stop_bit & 7)) } else { 0xFF };
    [first, last]
}

/// A byte of which both own the same bits.
fn shared(one: &Ownership, other: &Ownership) -> Option<usize> {
    let from = one.range.start.max(other.range.start);
    let to = one.range.end.min(other.range.end);
    (from..to).find(|byte| {
        one.mask_of(byte - one.range.start) & other.mask_of(byte - other.range.start) != 0
    })
}

/// Whether the file's expected working counters and lengths are those that follow from its FMMUs.
pub(super) fn agree(
    devices: &[FileDevice],
    tasks: &[FileTask],
    plan: &Plan,
) -> Result<(), EsiError> {
    let present = Presence::full(plan.devices.len());
    let files = tasks.iter().flat_map(|task| &task.frames).flat_map(|frame| &frame.datagrams);
    for (file, (.., datagram)) in files.zip(plan.datagrams()) {
        let Some(expected) = file.expected.filter(|_| datagram.role.is_judged()) else { continue };
        let follows = expect::expect(datagram, &present, PathView::Merged).0;
        if follows != expected {
            return Err(file.error(format!(
                "Cnt {expected}, but the FMMUs and the number of SubDevices give {follows}"
            )));
        }
    }
    for (file, device) in devices.iter().zip(&plan.devices) {
        for direction in [Direction::Outputs, Direction::Inputs] {
            let runs = file.image(direction);
            let said: u64 = runs.iter().map(|run| run.len).sum();
            let mapped: u64 =
                fmmus_of(device, direction).map(|fmmu| u64::from(fmmu.bit_len())).sum();
            let Some(first) = runs.first() else { continue };
            // Bits of a byte that is not full are mapped along.
            let most = said + 7 * runs.len() as u64;
            if mapped > 0 && !(said..=most).contains(&mapped) {
                let reason = format!("BitLength {said}, but its FMMUs map {mapped} bits");
                return Err(file.error("ProcessData", first.line, reason));
            }
        }
    }
    Ok(())
}
