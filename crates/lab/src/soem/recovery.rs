//! Recovery of SubDevices that have left OP, as SOEM's `simple_test` does it (`ecatcheck`): a look
//! at the states of all; an error is acknowledged, SAFEOP becomes OP, who is below is set up anew,
//! who is lost is looked for by its place.

use linesman_maindevice::Target;
use linesman_proto::address::{RegisterAddress, StationAddress};
use linesman_proto::register::STATION_ADDRESS;
use linesman_proto::sii::word::{PRODUCT_CODE, REVISION, VENDOR_ID};
use linesman_proto::time::Span;

use super::bus::{Bus, RETURN};
use super::device::{Device, ERROR, INIT, NONE, OP, PRE_OP, SAFE_OP, SYNC_MANAGERS};
use super::mapping::{write_fmmu, write_sync_manager};
use super::{eeprom, hook, states};

/// How long each access may take: `EC_TIMEOUTMON`.
const MONITORING: Span = Span::us(500);
/// The station address of a SubDevice that is being looked at: `EC_TEMPNODE`.
const ASIDE: u16 = 0xFFFF;

/// Reads all states and does the next thing for each SubDevice that is not in OP. Says whether all are.
pub(super) async fn check(
    bus: &Bus,
    devices: &mut [Device],
    is_held: impl Fn(usize) -> bool,
) -> bool {
    states::read(bus, devices).await;
    let mut all = true;
    for (at, device) in devices.iter_mut().enumerate() {
        if is_held(at) {
            continue;
        }
        if device.state != OP {
            all = false;
            bring_on(bus, device).await;
        }
        if !device.is_lost {
            continue;
        }
        if device.state != NONE || recover(bus, device).await {
            device.is_lost = false;
        }
    }
    all
}

async fn bring_on(bus: &Bus, device: &mut Device) {
    match device.state {
        state if state == SAFE_OP | ERROR => {
            states::request(bus, device, SAFE_OP | ERROR, RETURN).await;
        }
        SAFE_OP => {
            states::request(bus, device, OP, RETURN).await;
        }
        NONE if !device.is_lost => {
            states::reach(bus, device, OP, RETURN).await;
            device.is_lost = device.state == NONE;
        }
        NONE => {}
        _ => {
            if reconfigure(bus, device).await {
                device.is_lost = false;
            }
        }
    }
}

/// Sets a SubDevice up anew, up to SAFEOP (`ecx_reconfig_slave`).
async fn reconfigure(bus: &Bus, device: &mut Device) -> bool {
    if !states::request(bus, device, INIT, MONITORING).await {
        return false;
    }
    eeprom::to_pdi(bus, device).await;
    if !states::reach(bus, device, INIT, states::TIMEOUT).await {
        return device.state != NONE;
    }
    for at in 0..SYNC_MANAGERS {
        if device.sync_managers[at].start != RegisterAddress(0) {
            write_sync_manager(bus, device, at).await;
        }
    }
    states::request(bus, device, PRE_OP, MONITORING).await;
    if states::reach(bus, device, PRE_OP, states::TIMEOUT).await {
        hook::run(bus, device).await;
        states::request(bus, device, SAFE_OP, MONITORING).await;
        states::reach(bus, device, SAFE_OP, states::TIMEOUT).await;
        for at in 0..device.fmmus.len() {
            write_fmmu(bus, device, at).await;
        }
    }
    device.state != NONE
}

/// Looks for a lost SubDevice at its place. One without an address gets its own back when it is the same as before
/// (`ecx_recover_slave`).
async fn recover(bus: &Bus, device: &mut Device) -> bool {
    let place = device.place();
    let reply = bus.read(place, STATION_ADDRESS.address.0, 2, MONITORING).await;
    let found = reply.word(0);
    if !reply.answered() {
        return false;
    }
    if found == device.station {
        return true;
    }
    if found != 0 {
        return false;
    }
    let aside = Target::Station(StationAddress(ASIDE));
    let address = STATION_ADDRESS.address.0;
    bus.write(aside, address, &[0; 2], Span::ns(0)).await;
    if !bus.write(place, address, &ASIDE.to_le_bytes(), MONITORING).await {
        bus.write(aside, address, &[0; 2], Span::ns(0)).await;
        return false;
    }
    let station = std::mem::replace(&mut device.station, ASIDE);
    let is_same = is_as_before(bus, device).await;
    device.station = station;
    let given = if is_same { station } else { 0 };
    bus.write(aside, address, &given.to_le_bytes(), MONITORING).await && is_same
}

/// Whether the SubDevice that is aside is the one that was lost.
async fn is_as_before(bus: &Bus, device: &mut Device) -> bool {
    eeprom::to_main_device(bus, device).await;
    let alias = linesman_proto::register::STATION_ALIAS.address.0;
    if bus.read(device.target(), alias, 2, MONITORING).await.word(0) != device.alias {
        return false;
    }
    for (field, at) in [(1, PRODUCT_CODE), (0, VENDOR_ID), (2, REVISION)] {
        if eeprom::word(bus, device, at).await != device.identity[field] {
            return false;
        }
    }
    true
}
