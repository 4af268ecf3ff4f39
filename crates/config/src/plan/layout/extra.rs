//! Cyclic datagrams that carry no process data: clocks, mailbox bits, who is there (FRM-11).

use linesman_proto::address::LogicalAddress;
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::{AL_STATUS, FmmuConfig, RECEIVE_TIME, SYSTEM_TIME};
use linesman_proto::sii::FmmuUsage;

use super::super::{DatagramPlan, Plan, PlannedDevice, Role};
use super::{MAILBOX_STATES, PlanOptions};

/// So much of the system time is read and written: its low half.
const TIME_LEN: usize = 4;
/// The SyncManager that serves the mailbox in.
const MAILBOX_IN: u16 = 1;

fn datagram(command: Command, address: DatagramAddress, len: usize, role: Role) -> DatagramPlan {
    DatagramPlan { command, address, len, role, sync_unit: None, ownership: Vec::new() }
}

/// What goes before the process data of the first task.
pub(super) fn head(
    plan: &mut Plan,
    devices: &[PlannedDevice],
    options: &PlanOptions,
) -> Vec<DatagramPlan> {
    let mut head = Vec::new();
    if options.clock_datagrams
        && let Some(reference) = plan.reference_clock()
    {
        // A NOP keeps a place in the frame.
        let latched = DatagramAddress::Physical(0, RECEIVE_TIME.address);
        head.push(datagram(Command::Nop, latched, TIME_LEN, Role::LatchedTime));
        // By position: before its station address is there, the clocks must run already. Groups that come
        // and go move positions; then by its station address.
        let (command, at) = match devices.get(reference.index()) {
            Some(planned) if !plan.groups.is_empty() => (Command::Frmw, planned.station.0),
            Some(_) | None => (Command::Armw, 0_u16.wrapping_sub(reference.index() as u16)),
        };
        let time = DatagramAddress::Physical(at, SYSTEM_TIME.address);
        head.push(datagram(command, time, TIME_LEN, Role::ReferenceClock));
    }
    if options.mailbox_states {
        let count = map_mailboxes(plan, devices);
        if count > 0 {
            let states = DatagramAddress::Logical(MAILBOX_STATES);
            head.push(datagram(Command::Lrd, states, count.div_ceil(8), Role::MailboxStates));
        }
    }
    head
}

/// Gives each SubDevice with a mailbox, and an FMMU for it, its bit.
fn map_mailboxes(plan: &mut Plan, devices: &[PlannedDevice]) -> usize {
    let mut count = 0_usize;
    for (device, planned) in plan.devices.iter_mut().zip(devices) {
        let usages = &planned.profile.fmmus;
        let index = usages.iter().position(|usage| *usage == FmmuUsage::MailboxState);
        let (Some(_), Some(index)) = (device.mailbox, index) else { continue };
        let at = LogicalAddress(MAILBOX_STATES.0 + (count / 8) as u32);
        if let Some(fmmu) = FmmuConfig::mailbox_full(at, (count % 8) as u8, MAILBOX_IN) {
            device.mailbox_state = Some((index as u8, fmmu));
            count += 1;
        }
    }
    count
}

/// The broadcast read of the AL status that closes the last frame: its working counter says how
/// many SubDevices the frame reached.
pub(super) fn presence_monitor() -> DatagramPlan {
    datagram(Command::Brd, DatagramAddress::Physical(0, AL_STATUS.address), 2, Role::Presence)
}

/// The FMMU of a mailbox comes behind those of the process data, where it does not anyway.
pub(super) fn settle_mailbox_fmmus(plan: &mut Plan) {
    for device in &mut plan.devices {
        let used = device.fmmus.len() as u8;
        if let Some((index, _)) = &mut device.mailbox_state {
            *index = used.max(*index);
        }
    }
}
