//! Finding and setting up SubDevices, as `ecx_config_init` does: all are reset by broadcast and counted, each is given
//! a station address by its place, who it is and what it needs is read from its EEPROM, and it is sent to PREOP.

use linesman_maindevice::Target;
use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{self, DlStatus, Features, SmControl, SyncManagerConfig};
use linesman_proto::sii::word::{
    MAILBOX_PROTOCOLS, PRODUCT_CODE, REVISION, SERIAL_NUMBER, STANDARD_MAILBOX, VENDOR_ID,
};
use linesman_proto::sii::{SyncManagerKind, WordAddress};
use linesman_proto::time::Span;

use super::bus::{Bus, RETURN, SURELY};
use super::device::{Device, ERROR, Hook, INIT, Mailbox, PRE_OP};
use super::eeprom::{self, Categories};
use super::states;

/// How long SubDevices are counted: `EC_TIMEOUTSAFE`.
const COUNTING: Span = Span::ms(20);
/// Where the mailbox that SubDevices send is described.
const SEND_MAILBOX: WordAddress = WordAddress(STANDARD_MAILBOX.value() + 2);
/// Controls of the mailbox `SyncManager`s: `EC_DEFAULTMBXSM0`, `EC_DEFAULTMBXSM1`.
const MAILBOX_CONTROLS: [SmControl; 2] = [SmControl(0x26), SmControl(0x22)];

/// Writes that bring all SubDevices to what they are after power-on (`ecx_set_slaves_to_default`).
const DEFAULTS: [(u16, &[u8]); 13] = [
    // Ports as their links are.
    (0x0101, &[0]),
    // Which events the IRQ field shows.
    (0x0200, &[4, 0]),
    (0x0300, &[0; 8]),
    (0x0600, &[0; 48]),
    (0x0800, &[0; 32]),
    (0x0981, &[0]),
    (0x0910, &[0; 4]),
    (0x0930, &[0x00, 0x10]),
    (0x0934, &[0x00, 0x0C]),
    (0x0103, &[0]),
    (0x0120, &[(INIT | ERROR) as u8, 0]),
    (0x0500, &[2]),
    (0x0500, &[0]),
];

/// All SubDevices in PREOP, or on the way there; empty when there is none.
pub(super) async fn configure(bus: &Bus, hooks: &[Hook]) -> Vec<Device> {
    let count = detect(bus).await;
    for (at, data) in DEFAULTS {
        bus.write(Target::All, at, data, SURELY).await;
    }
    let mut devices: Vec<Device> = (0..count).map(Device::new).collect();
    for (device, hook) in devices.iter_mut().zip(hooks) {
        device.hook = hook.clone();
    }
    for device in &mut devices {
        address(bus, device).await;
    }
    identify(bus, &mut devices).await;
    for at in 0..devices.len() {
        let (before, rest) = devices.split_at_mut(at);
        if let Some(device) = rest.first_mut() {
            describe(bus, device, before).await;
        }
    }
    devices
}

/// How many there are; a few writes before make some old controllers answer.
async fn detect(bus: &Bus) -> u16 {
    bus.write(Target::All, 0x0103, &[0], SURELY).await;
    for _ in 0..2 {
        bus.write(Target::All, 0x0120, &(INIT | ERROR).to_le_bytes(), SURELY).await;
    }
    bus.read(Target::All, register::ESC_TYPE.address.0, 2, COUNTING).await.wkc.0
}

/// Gives a SubDevice its address, by its place.
async fn address(bus: &Bus, device: &mut Device) {
    let place = device.place();
    bus.read(place, register::PDI_CONTROL.address.0, 2, SURELY).await;
    bus.write(place, 0x0010, &device.station.to_le_bytes(), SURELY).await;
    // The first one throws away frames that are none of EtherCAT.
    let control: u16 = if device.position == 0 { 1 } else { 0 };
    bus.write(place, register::DL_CONTROL.address.0, &control.to_le_bytes(), SURELY).await;
    device.station = bus.read(place, 0x0010, 2, RETURN).await.word(0);
    let target = device.target();
    let alias = register::STATION_ALIAS.address.0;
    device.alias = bus.read(target, alias, 2, SURELY).await.word(0);
    // How many bytes the EEPROM gives at once.
    bus.read(target, register::SII_CONTROL_STATUS.address.0, 2, SURELY).await;
    eeprom::ask(bus, device, VENDOR_ID).await;
}

/// Reads who they are and where their mailboxes are: asked of all, then fetched from all.
async fn identify(bus: &Bus, devices: &mut [Device]) {
    let words = [PRODUCT_CODE, REVISION, SERIAL_NUMBER, STANDARD_MAILBOX];
    for (field, next) in words.into_iter().enumerate() {
        for device in &mut *devices {
            device.identity[field] = eeprom::answer(bus, device).await;
            eeprom::ask(bus, device, next).await;
        }
    }
    for device in devices {
        let [offset, len] = halves(eeprom::answer(bus, device).await);
        if len > 0 {
            device.mailbox = Some(Mailbox { out: (offset, len), ..Mailbox::default() });
            eeprom::ask(bus, device, SEND_MAILBOX).await;
        }
    }
}

/// Reads what a SubDevice needs, sets up its mailbox and sends it to PREOP.
async fn describe(bus: &Bus, device: &mut Device, before: &[Device]) {
    if let Some(mut mailbox) = device.mailbox {
        let [offset, len] = halves(eeprom::answer(bus, device).await);
        mailbox.back = (offset, if len == 0 { mailbox.out.1 } else { len });
        device.mailbox = Some(mailbox);
        eeprom::ask(bus, device, MAILBOX_PROTOCOLS).await;
    }
    let target = device.target();
    let features = bus.read(target, register::ESC_FEATURES.address.0, 2, SURELY).await.word(0);
    device.has_clock = Features(features).distributed_clocks();
    let dl_status = bus.read(target, register::DL_STATUS.address.0, 2, SURELY).await.word(0);
    device.dl_status = DlStatus(dl_status);
    bus.read(target, register::PORT_DESCRIPTOR.address.0, 2, SURELY).await;
    states::reach(bus, device, INIT, states::TIMEOUT).await;
    if let Some(mut mailbox) = device.mailbox {
        [mailbox.protocols, _] = halves(eeprom::answer(bus, device).await);
        device.mailbox = Some(mailbox);
        set_up_mailbox(device, mailbox);
    }
    match before.iter().find(|one| one.is_like(device)) {
        Some(twin) => {
            device.coe_details = twin.coe_details;
            device.sync_managers = twin.sync_managers;
        }
        None => {
            let mut categories = Categories::default();
            categories.general(bus, device).await;
            categories.sync_managers(bus, device).await;
            categories.fmmus(bus, device).await;
        }
    }
    if device.mailbox.is_some() {
        let both: Vec<u8> =
            device.sync_managers[..2].iter().flat_map(|one| one.to_bytes()).collect();
        bus.write(target, register::SYNC_MANAGER.address.0, &both, SURELY).await;
    }
    eeprom::to_pdi(bus, device).await;
    states::request(bus, device, PRE_OP | ERROR, SURELY).await;
}

/// The `SyncManager`s of a mailbox, unless the EEPROM says otherwise.
fn set_up_mailbox(device: &mut Device, mailbox: Mailbox) {
    for (at, (start, len)) in [mailbox.out, mailbox.back].into_iter().enumerate() {
        let start = RegisterAddress(start);
        device.sync_managers[at] = SyncManagerConfig::enabled(start, len, MAILBOX_CONTROLS[at]);
    }
    device.kinds[..4].copy_from_slice(&[
        SyncManagerKind::MailboxOut,
        SyncManagerKind::MailboxIn,
        SyncManagerKind::Outputs,
        SyncManagerKind::Inputs,
    ]);
}

/// Low and high half of a word of four bytes.
const fn halves(word: u32) -> [u16; 2] {
    [word as u16, (word >> 16) as u16]
}
