//! Set-up of a SubDevice before a step: SyncManagers and FMMUs.
//!
//! Reference: ETG.1000.6; the order is that of public MainDevices. Watchdogs keep the times the
//! SubDevice has unless others are chosen.

use linesman_config::plan::{DevicePlan, WatchdogSettings};
use linesman_proto::address::{RegisterAddress, WorkingCounter};
use linesman_proto::register::{
    self, EscInformation, FMMU, FmmuConfig, SII_ACCESS_ECAT, SYNC_MANAGER, SmControl,
    SyncManagerConfig,
};
use linesman_proto::sii::MailboxPair;

use crate::exchange::{ExchangeError, Request, Target};
use crate::executor::Wire;

/// Offset of the activate byte of a SyncManager (0x0806).
const SM_ACTIVATE: u16 = 6;

/// The SyncManagers that serve a mailbox: 0 takes what the MainDevice writes, 1 gives.
#[must_use]
pub fn mailbox_sync_managers(areas: MailboxPair) -> [SyncManagerConfig; 2] {
    let MailboxPair { receive, send } = areas;
    [
        SyncManagerConfig::enabled(receive.offset, receive.size, SmControl::MAILBOX_OUT),
        SyncManagerConfig::enabled(send.offset, send.size, SmControl::MAILBOX_IN),
    ]
}

/// Before INIT to PREOP, or to BOOT: nothing left of an earlier run, the mailbox set up, the EEPROM
/// offered to the SubDevice.
///
/// # Errors
/// [`ExchangeError`] when it does not answer.
pub async fn before_mailbox(
    wire: &Wire,
    device: &DevicePlan,
    areas: Option<MailboxPair>,
) -> Result<(), ExchangeError> {
    let target = Target::Station(device.station);
    let reply =
        wire.read_one(target, register::ESC_TYPE.address, EscInformation::LEN as u16).await?;
    let information = EscInformation::from_bytes(reply.bytes(0));
    let mailbox = areas.map(mailbox_sync_managers).unwrap_or_default();
    let mut managers: Vec<u8> = mailbox.iter().flat_map(|manager| manager.to_bytes()).collect();
    if information.features.fixed_configuration() {
        managers.truncate(if areas.is_some() { managers.len() } else { 0 });
    } else {
        managers.resize(usize::from(information.sync_managers.min(16)) * SyncManagerConfig::LEN, 0);
        let fmmus = usize::from(information.fmmus.min(16)) * FmmuConfig::LEN;
        // While a SyncManager is on, its other bytes are locked; off it is when the frame has ended.
        let off = (SYNC_MANAGER.address, vec![0; managers.len()]);
        write_all(wire, target, vec![(FMMU.address, vec![0; fmmus]), off]).await?;
    }
    let mut writes = vec![(SYNC_MANAGER.address, managers)];
    if let Some((index, fmmu)) = &device.mailbox_state
        && let Some(address) = FMMU.at(u16::from(*index))
    {
        writes.push((address, fmmu.to_bytes().to_vec()));
    }
    writes.push((SII_ACCESS_ECAT.address, vec![1]));
    write_all(wire, target, writes).await
}

/// Before PREOP to SAFEOP: where process data lie, and how they are guarded.
///
/// # Errors
/// [`ExchangeError`] when it does not answer.
pub async fn before_safe_op(wire: &Wire, device: &DevicePlan) -> Result<(), ExchangeError> {
    let target = Target::Station(device.station);
    let (mut off, mut on) = (Vec::new(), Vec::new());
    for (index, manager) in &device.sync_managers {
        let Some(address) = SYNC_MANAGER.at(u16::from(*index)) else { continue };
        // It may be on, of an earlier try.
        off.push((RegisterAddress(address.0 + SM_ACTIVATE), vec![0]));
        on.push((address, manager.to_bytes().to_vec()));
    }
    for (index, fmmu) in &device.fmmus {
        if let Some(address) = FMMU.at(u16::from(*index)) {
            on.push((address, fmmu.to_bytes().to_vec()));
        }
    }
    let WatchdogSettings { divider, pdi, process_data } = device.settings.watchdog;
    let watchdogs = [
        (register::WATCHDOG_DIVIDER, divider),
        (register::WATCHDOG_TIME_PDI, pdi),
        (register::WATCHDOG_TIME_PROCESS_DATA, process_data),
    ];
    on.extend(
        watchdogs.into_iter().filter_map(|(register, value)| {
            Some((register.address, value?.to_le_bytes().to_vec()))
        }),
    );
    write_all(wire, target, off).await?;
    write_all(wire, target, on).await
}

/// After the way down from SAFEOP or OP: what served process data is switched off, so that a SubDevice that
/// does not do so itself adds nothing more to working counters.
///
/// # Errors
/// [`ExchangeError`] when it does not answer.
pub async fn after_process_data(wire: &Wire, device: &DevicePlan) -> Result<(), ExchangeError> {
    /// Offset of the activate byte of an FMMU (0x060C).
    const FMMU_ACTIVATE: u16 = 12;
    let managers = device.sync_managers.iter().filter_map(|(index, _)| {
        Some(RegisterAddress(SYNC_MANAGER.at(u16::from(*index))?.0 + SM_ACTIVATE))
    });
    let fmmus = device.fmmus.iter().filter_map(|(index, _)| {
        Some(RegisterAddress(FMMU.at(u16::from(*index))?.0 + FMMU_ACTIVATE))
    });
    let off = fmmus.chain(managers).map(|address| (address, vec![0])).collect();
    write_all(wire, Target::Station(device.station), off).await
}

/// Writes in order, as many as fit to a frame. When one was not taken, or a frame was lost, all are
/// written once more, each when the one before has been taken: what comes late must not undo what
/// belongs behind it.
pub(crate) async fn write_all(
    wire: &Wire,
    target: Target,
    writes: Vec<(RegisterAddress, Vec<u8>)>,
) -> Result<(), ExchangeError> {
    let writes: Vec<_> = writes.into_iter().filter(|(_, bytes)| !bytes.is_empty()).collect();
    let sent: Vec<_> = (writes.iter())
        .map(|(address, bytes)| wire.submit(Request::write(target, *address, bytes)))
        .collect();
    let mut all_taken = true;
    for reply in sent {
        all_taken &= reply.await.is_ok_and(|reply| reply.wkc == WorkingCounter(1));
    }
    if all_taken {
        return Ok(());
    }
    for (address, bytes) in &writes {
        wire.write_one(target, *address, bytes).await?;
    }
    Ok(())
}
