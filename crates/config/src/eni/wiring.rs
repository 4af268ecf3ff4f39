//! Order and wiring of the SubDevices: `AutoIncAddr` and `PreviousPort`.

use std::collections::BTreeMap;

use linesman_proto::address::Path;
use linesman_proto::port::Port;
use linesman_proto::topology::{End, Tree, Wired};

use super::sub_device::FileDevice;
use crate::esi::EsiError;

/// Brings the SubDevices into the order of their positions, where the file says them.
pub(super) fn sort(devices: &mut [FileDevice]) -> Result<(), EsiError> {
    let mut stations = BTreeMap::new();
    let mut positions = BTreeMap::new();
    for device in devices.iter() {
        let name = device.plan.name.clone();
        let station = device.plan.station.0;
        if let Some(other) = stations.insert(station, name.clone()) {
            let reason = format!("PhysAddr {station} is that of \"{other}\" already");
            return Err(device.error("Info", device.line, reason));
        }
        if let Some(position) = device.position
            && let Some(other) = positions.insert(position, name)
        {
            let reason =
                format!("AutoIncAddr says position {position}, which \"{other}\" has already");
            return Err(device.error("Info", device.line, reason));
        }
    }
    if positions.len() == devices.len() {
        devices.sort_by_key(|device| device.position);
    }
    Ok(())
}

/// Whether the file says how they are wired.
pub(super) fn is_said(devices: &[FileDevice]) -> bool {
    devices.len() < 2 || devices.iter().any(|device| device.previous.is_some())
}

/// How they are wired. Where the file says nothing, one hangs on the next port of the one before it.
pub(super) fn tree(devices: &[FileDevice]) -> Result<Tree, EsiError> {
    let nodes: BTreeMap<u16, usize> =
        devices.iter().enumerate().map(|(node, one)| (one.plan.station.0, node)).collect();
    let said = devices.iter().any(|device| device.previous.is_some());
    let mut wired = Vec::with_capacity(devices.len());
    for (node, device) in devices.iter().enumerate() {
        let on = match device.previous {
            Some((line, station, port)) => {
                let Some(before) = nodes.get(&station) else {
                    let reason = format!("no Slave has the PhysAddr {station}");
                    return Err(device.error("PreviousPort", line, reason));
                };
                End::Controller(*before, port)
            }
            None if node > 0 && !said => End::Controller(node - 1, Port::B),
            None => End::MainDevice(Path::A),
        };
        wired.push(Wired { on, entry: device.entry });
    }
    Tree::from_wiring(&wired, None).map_err(|error| {
        // Which of them it is stands in the error by number; the first that says anything is a place.
        let device = devices.iter().find(|device| device.previous.is_some());
        let line = device.and_then(|device| device.previous).map_or(1, |(line, ..)| line);
        EsiError::new(
            line,
            "Config/Slave/PreviousPort",
            format!("the wiring does not fit: {error}"),
        )
    })
}
