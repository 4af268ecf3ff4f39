//! Hook of a program that uses SOEM between PREOP and SAFEOP (`PO2SOconfig`): its start-up
//! commands, and SYNC0.

use linesman_config::plan::ClockSettings;
use linesman_config::start_up::{StartUpAction, Transition};
use linesman_proto::register::{
    CYCLIC_UNIT_CONTROL, START_TIME, SYNC_ACTIVATION, SYNC0_CYCLE_TIME, SYSTEM_TIME,
};

use super::bus::{Bus, RETURN};
use super::device::Device;
use super::mailbox;

/// How much later than now the first SYNC0 is, in ns: `SyncDelay`.
const SYNC_DELAY: u64 = 100_000_000;
/// Cyclic operation and SYNC0.
const SYNC0: u8 = 0x03;

/// Does it.
pub(super) async fn run(bus: &Bus, device: &mut Device) {
    let commands = std::mem::take(&mut device.hook.start_up);
    for command in commands.iter().filter(|one| one.transition == Transition::PRE_OP_TO_SAFE_OP) {
        match &command.action {
            StartUpAction::CoeDownload { object, complete_access, data } => {
                mailbox::download(bus, device, *object, *complete_access, data).await;
            }
            StartUpAction::RegisterWrite { address, data } => {
                bus.write(device.target(), address.0, data, RETURN).await;
            }
            // The examples of SOEM show none of these.
            StartUpAction::SetAddresses { .. }
            | StartUpAction::WriteIdn { .. }
            | StartUpAction::Ads { .. }
            | StartUpAction::WriteFile { .. }
            | StartUpAction::SendVendorMessage { .. } => {}
        }
    }
    device.hook.start_up = commands;
    if let Some(clock) = device.hook.clock {
        start_sync0(bus, device, &clock).await;
    }
}

/// Starts SYNC0 at a whole multiple of its cycle (`ecx_dcsync0`).
async fn start_sync0(bus: &Bus, device: &Device, clock: &ClockSettings) {
    let target = device.target();
    let activation = SYNC_ACTIVATION.address.0;
    bus.write(target, activation, &[0], RETURN).await;
    bus.write(target, CYCLIC_UNIT_CONTROL.address.0, &[0], RETURN).await;
    let now = bus.read(target, SYSTEM_TIME.address.0, 8, RETURN).await;
    let cycle = clock.sync0_cycle.as_nanos().max(1);
    let from = u64::from_le_bytes(now.bytes(0)).wrapping_add(SYNC_DELAY);
    let first =
        (from / cycle * cycle).wrapping_add(cycle).wrapping_add_signed(clock.sync0_shift_ns);
    bus.write(target, START_TIME.address.0, &first.to_le_bytes(), RETURN).await;
    let cycle = u32::try_from(cycle).unwrap_or(u32::MAX);
    bus.write(target, SYNC0_CYCLE_TIME.address.0, &cycle.to_le_bytes(), RETURN).await;
    bus.write(target, activation, &[SYNC0], RETURN).await;
}
