//! The SubDevices as a table: who they are, as far as the input says it.

use linesman_diagnosis::report::{DeviceReport, Diagnosis};

use crate::output::{Paint, Table};

/// Most SubDevices that are listed unasked.
const MOST: usize = 16;

/// Whether the table is worth its lines unasked: a recording says who the SubDevices are, and nothing
/// else here does.
pub(crate) fn is_wanted(diagnosis: &Diagnosis) -> bool {
    let devices = &diagnosis.devices;
    is_recording(diagnosis)
        && devices.len() <= MOST
        && devices.iter().any(DeviceReport::has_identity)
        && devices.iter().all(|device| device.name.is_none())
}

/// Whether the input is a recording: whoever has it need not have the line.
pub(crate) fn is_recording(diagnosis: &Diagnosis) -> bool {
    diagnosis.source.starts_with("capture:")
}

/// A row for each SubDevice.
pub(crate) fn write(diagnosis: &Diagnosis, paint: Paint) -> String {
    let headings = ["no", "name", "station", "vendor", "product", "revision", "state"];
    let mut table = Table::new(&headings, paint);
    for device in &diagnosis.devices {
        table.row([
            device.no.to_string(),
            called(device),
            station(device),
            vendor(device),
            number(device.product_code),
            number(device.revision),
            state(device),
        ]);
    }
    table.render()
}

/// Name and type, as far as they are known: `Press feed (EL2004)`.
fn called(device: &DeviceReport) -> String {
    match (device.name.as_deref(), device.type_name.as_deref()) {
        (Some(name), Some(type_name)) => format!("{name} ({type_name})"),
        (Some(one), None) | (None, Some(one)) => one.to_owned(),
        (None, None) => "?".to_owned(),
    }
}

/// `0x1001`; nothing for one without an address.
pub(crate) fn station(device: &DeviceReport) -> String {
    device.station.map_or_else(String::new, |station| format!("0x{station:04X}"))
}

/// The number of the vendor, short as these numbers are: `0x2`.
pub(crate) fn vendor(device: &DeviceReport) -> String {
    device.vendor_id.map_or_else(|| "?".to_owned(), |vendor| format!("0x{vendor:X}"))
}

/// `0x044C2C52`, or `?` for what was not seen.
pub(crate) fn number(value: Option<u32>) -> String {
    value.map_or_else(|| "?".to_owned(), |value| format!("0x{value:08X}"))
}

/// `OP`, `PREOP 0x001E`, `no answer`, `not seen`.
pub(crate) fn state(device: &DeviceReport) -> String {
    if device.answers == Some(false) {
        return "no answer".to_owned();
    }
    match (device.state.as_deref(), device.al_status_code) {
        (Some(state), Some(code)) => format!("{state} 0x{code:04X}"),
        (Some(state), None) => state.to_owned(),
        (None, _) => "not seen".to_owned(),
    }
}
