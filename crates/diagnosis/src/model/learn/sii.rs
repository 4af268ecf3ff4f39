//! The SII as it is read through registers 0x0502 to 0x050F.

use std::collections::BTreeMap;

use linesman_proto::address::{DeviceId, StationAlias};
use linesman_proto::register::{SiiCommand, SiiControl};
use linesman_proto::sii::word;

use super::{Answer, part, word_at};
use crate::model::{Device, NetworkModel, Seen};

const CONTROL: u16 = 0x0502;
const ADDRESS: u16 = 0x0504;
const DATA: u16 = 0x0508;

/// Reads of the SII under way.
#[derive(Clone, Default, Debug)]
pub(super) struct Transfers {
    by_device: BTreeMap<DeviceId, SiiRead>,
}

#[derive(Clone, Copy, Default, Debug)]
struct SiiRead {
    address: u32,
    /// A read was asked for, and is not known to have failed.
    is_read: bool,
    eight_bytes: bool,
    is_ready: bool,
}

impl Transfers {
    /// A controller's registers were written.
    pub(super) fn written(&mut self, id: DeviceId, answer: &Answer<'_>) {
        let (data, start) = (answer.written(), answer.ado);
        if start.0 > ADDRESS || start.0 < 0x0500 {
            return;
        }
        let transfer = self.by_device.entry(id).or_default();
        if let Some(bytes) = part(data, start, ADDRESS, 4).and_then(|bytes| bytes.first_chunk()) {
            transfer.address = u32::from_le_bytes(*bytes);
        }
        if let Some(control) = word_at(data, start, CONTROL) {
            let command = SiiControl(control).command();
            transfer.is_read = command == SiiCommand::Read;
            transfer.is_ready = false;
        }
    }

    /// A controller's registers were read.
    pub(super) fn read(&mut self, model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
        let (data, start) = (answer.reply.data(), answer.ado);
        if start.0 > DATA || start.0 < 0x0500 {
            return;
        }
        let Some(transfer) = self.by_device.get_mut(&id) else { return };
        if let Some(control) = word_at(data, start, CONTROL) {
            let control = SiiControl(control);
            transfer.is_ready = !control.busy();
            transfer.eight_bytes = control.reads_eight_bytes();
            transfer.is_read &= !control.command_failed() || control.busy();
        }
        if !(transfer.is_read && transfer.is_ready) {
            return;
        }
        let wanted = if transfer.eight_bytes { 8 } else { 4 };
        let Some(bytes) = part(data, start, DATA, wanted).or(part(data, start, DATA, 4)) else {
            return;
        };
        let Some(device) = model.devices.get_mut(id.index()) else { return };
        if device.sii.record(transfer.address, bytes) {
            learn(device, answer);
            model.touch();
        }
    }
}

fn learn(device: &mut Device, answer: &Answer<'_>) {
    let seen = |value| Seen::new(value, answer.at, Some(answer.frame));
    let identity = &mut device.identity;
    let fields = [
        (&mut identity.vendor_id, word::VENDOR_ID),
        (&mut identity.product_code, word::PRODUCT_CODE),
        (&mut identity.revision, word::REVISION),
        (&mut identity.serial, word::SERIAL_NUMBER),
    ];
    for (field, at) in fields {
        if field.is_none() {
            *field = device.sii.long(at).map(seen);
        }
    }
    if device.alias.is_none() {
        device.alias = device.sii.word(word::STATION_ALIAS).map(StationAlias);
    }
    let (order, name) = (device.sii.order(), device.sii.name());
    // The name stands in until the type is read.
    if device.type_name.is_none() || order.is_some() && device.type_name == name {
        device.type_name = order.or(name);
    }
    if device.power.is_none() {
        let seen = |value| Seen::new(value, answer.at, Some(answer.frame));
        device.power = device.sii.power().map(seen);
    }
}
