//! What a SubDevice is told before a step: SyncManagers and FMMUs.
//!
//! Reference: ETG.1000.6; the order is that of public MainDevices. Watchdogs keep the times the
//! SubDevice has.

use linesman_config::plan::DevicePlan;
use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{
    self, EscInformation, FMMU, FmmuConfig, SII_ACCESS_ECAT, SYNC_MANAGER, SmControl,
    SyncManagerConfig,
};

use crate::exchange::{ExchangeError, Target};
use crate::executor::Wire;

/// The SyncManagers that serve a mailbox: 0 takes what the MainDevice writes, 1 gives.
#[must_use]
pub fn mailbox_sync_managers(device: &DevicePlan) -> Option<[SyncManagerConfig; 2]> {
    let areas = device.mailbox?.areas;
    Some([
        SyncManagerConfig::enabled(
            areas.receive.offset,
            areas.receive.size,
            SmControl::MAILBOX_OUT,
        ),
        SyncManagerConfig::enabled(areas.send.offset, areas.send.size, SmControl::MAILBOX_IN),
    ])
}

/// Before INIT to PREOP: nothing left of an earlier run, the mailbox set up, the EEPROM offered to
/// the SubDevice.
///
/// # Errors
/// [`ExchangeError`] when it does not answer.
pub async fn before_pre_op(wire: &Wire, device: &DevicePlan) -> Result<(), ExchangeError> {
    let target = Target::Station(device.station);
    let reply =
        wire.read_one(target, register::ESC_TYPE.address, EscInformation::LEN as u16).await?;
    let information = EscInformation::from_bytes(reply.bytes(0));
    let fixed = information.features.fixed_configuration();
    if !fixed {
        let fmmus = usize::from(information.fmmus.min(16)) * FmmuConfig::LEN;
        write(wire, target, FMMU.address, &vec![0; fmmus]).await?;
        for index in 0..u16::from(information.sync_managers.min(16)) {
            clear_sync_manager(wire, target, index).await?;
        }
    }
    if let Some(managers) = mailbox_sync_managers(device) {
        for (manager, index) in managers.into_iter().zip(0..) {
            set_sync_manager(wire, target, index, manager).await?;
        }
    }
    if let Some((index, fmmu)) = &device.mailbox_state
        && let Some(address) = FMMU.at(u16::from(*index))
    {
        write(wire, target, address, &fmmu.to_bytes()).await?;
    }
    wire.write_one(target, SII_ACCESS_ECAT.address, &[1]).await?;
    Ok(())
}

/// Before PREOP to SAFEOP: where process data lie, and how they are guarded.
///
/// # Errors
/// [`ExchangeError`] when it does not answer.
pub async fn before_safe_op(wire: &Wire, device: &DevicePlan) -> Result<(), ExchangeError> {
    let target = Target::Station(device.station);
    for (index, manager) in &device.sync_managers {
        clear_sync_manager(wire, target, u16::from(*index)).await?;
        set_sync_manager(wire, target, u16::from(*index), *manager).await?;
    }
    for (index, fmmu) in &device.fmmus {
        if let Some(address) = FMMU.at(u16::from(*index)) {
            write(wire, target, address, &fmmu.to_bytes()).await?;
        }
    }
    Ok(())
}

async fn set_sync_manager(
    wire: &Wire,
    target: Target,
    index: u16,
    manager: SyncManagerConfig,
) -> Result<(), ExchangeError> {
    match SYNC_MANAGER.at(index) {
        Some(address) => write(wire, target, address, &manager.to_bytes()).await,
        None => Ok(()),
    }
}

/// Switches a SyncManager off, then clears it: while it is on, its other bytes cannot be written.
async fn clear_sync_manager(wire: &Wire, target: Target, index: u16) -> Result<(), ExchangeError> {
    const ACTIVATE: u16 = 6;
    let Some(address) = SYNC_MANAGER.at(index) else { return Ok(()) };
    write(wire, target, RegisterAddress(address.0 + ACTIVATE), &[0]).await?;
    write(wire, target, address, &[0; SyncManagerConfig::LEN]).await
}

async fn write(
    wire: &Wire,
    target: Target,
    address: RegisterAddress,
    bytes: &[u8],
) -> Result<(), ExchangeError> {
    if bytes.is_empty() {
        return Ok(());
    }
    wire.write_one(target, address, bytes).await.map(|_| ())
}
