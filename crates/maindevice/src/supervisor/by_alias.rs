//! SubDevices that are never addressed by their position (FRM-28): found by their second address, the
//! station alias of their EEPROM, wherever they are plugged in.
//!
//! A controller answers to its alias while bit 24 of DL control (0x0100) is set (S2 2.2.2, 2.4.1). It is
//! set while they are looked for only: an alias may be anything, the station address of another as well.

use linesman_config::identity::mismatch;
use linesman_config::plan::{AddressingChoice, DevicePlan};
use linesman_proto::address::{RegisterAddress, StationAddress, StationAlias};
use linesman_proto::register::{STATION_ADDRESS, STATION_ALIAS};
use linesman_proto::sii::Identity;

use super::{Context, find, lose};
use crate::event::Event;
use crate::exchange::Target;
use crate::executor::lock;
use crate::procedure::{address, sii};

/// The byte of DL control whose lowest bit lets controllers answer to their alias.
const USE_ALIAS: RegisterAddress = RegisterAddress(0x0103);

/// The alias by which a SubDevice is to be found; `None` for one that is found by its position.
pub(super) fn alias_of(device: &DevicePlan) -> Option<StationAlias> {
    match device.settings.addressing {
        AddressingChoice::Alias => device.settings.alias,
        AddressingChoice::Auto | AddressingChoice::Position => None,
    }
}

/// Looks for those that are not there, and gives them their station addresses.
pub(super) async fn locate(context: &Context) {
    let wire = &context.wire;
    let wanted: Vec<(&DevicePlan, StationAlias)> = (context.plan.devices.iter())
        .filter(|device| !lock(&context.device_table).is_there(device.id))
        .filter_map(|device| Some((device, alias_of(device)?)))
        .collect();
    if wanted.is_empty() {
        return;
    }
    let _ = wire.write(Target::All, USE_ALIAS, &[1]).await;
    for (device, alias) in wanted {
        if !identify(context, device, alias).await {
            lose(context, device.id);
        }
    }
    let _ = wire.write(Target::All, USE_ALIAS, &[0]).await;
}

/// Whether who was seen at a place is one of those, whose alias was not loaded yet a moment ago: the next
/// search finds it.
pub(super) async fn is_one(context: &Context, place: Target, found: &Identity) -> bool {
    let same = |device: &DevicePlan| device.identity.product_code == found.product_code;
    let aliases: Vec<StationAlias> =
        context.plan.devices.iter().filter(|device| same(device)).filter_map(alias_of).collect();
    if aliases.is_empty() {
        return false;
    }
    let alias = context.wire.read(place, STATION_ALIAS.address, STATION_ALIAS.len).await;
    alias.is_ok_and(|reply| aliases.contains(&StationAlias(reply.word(0))))
}

/// Whether the SubDevice was found and has its address.
async fn identify(context: &Context, device: &DevicePlan, alias: StationAlias) -> bool {
    let (wire, id) = (&context.wire, device.id);
    let place = Target::Station(StationAddress(alias.0));
    let asked = wire.read(place, STATION_ADDRESS.address, STATION_ADDRESS.len).await;
    match asked.map_or(0, |reply| reply.wkc.0) {
        0 => return false,
        1 => {}
        count => {
            if lock(&context.device_table).add_stranger(Some(id), Identity::default()) {
                wire.emit(Event::AliasShared { id, alias, count });
            }
            return false;
        }
    }
    let found = sii::read_identity(wire, place).await.unwrap_or_default();
    let expected = device.identity;
    let anyone = expected == Identity::default();
    if let Some(mismatch) = mismatch(&expected, &found, device.revision_rule).filter(|_| !anyone) {
        if lock(&context.device_table).add_stranger(Some(id), found) {
            wire.emit(Event::WrongDevice { id, mismatch, expected, found });
        }
        return false;
    }
    wire.emit(Event::Identified { id, found });
    if address::assign(wire, place, device.station).await.is_err() {
        return false;
    }
    find(context, id, true);
    true
}
