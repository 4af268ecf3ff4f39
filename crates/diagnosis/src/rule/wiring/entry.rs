//! A SubDevice that answers though the port by which it is entered has no link: frames come in by another one.

use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::register::table;
use linesman_proto::topology::End;

use super::PLUGGED;
use crate::finding::{Condition, Evidence, Place, Symptom};
use crate::model::{Device, NetworkModel, Seen};

/// The port by which frames come in, where it is not the one that should be: that has no link, another one has, and
/// the SubDevice answers. Not in a ring, whose SubDevices are reached from both sides; but the first one is reached by card A where
/// somebody processes its copies, all of them or those of either card.
pub(in crate::rule) fn entered_otherwise(model: &NetworkModel, device: &Device) -> Option<Port> {
    let tree = model.tree.as_ref();
    let traffic = &model.traffic;
    let is_ring = tree
        .is_some_and(|tree| tree.closes_at().is_some() || tree.first(Path::B).is_some())
        || traffic.broadcasts.came_in_copies();
    let status = device.dl.last?;
    // It was asked by the frame that showed its links; a list tells both at the same time.
    let is_there = device.answered.is_some() && device.silent.is_none();
    let wanted = wanted(model, device);
    // Where positions may have moved, a plan with another entry is for the comparison with it.
    let is_first = matches!(model.opposite(device.id, wanted), Some(End::MainDevice(Path::A)));
    let by_either = traffic.broadcasts.split().map(|split| split.at);
    let by_a = traffic.broadcasts.processed_alone().filter(|alone| alone.value == Path::A);
    let reached = by_either.max(by_a.map(|alone| alone.at));
    let is_reached = is_first && reached.is_some_and(|at| at >= status.at);
    let is_either = is_ring && !is_reached;
    if is_either || !is_there || (wanted != Port::A && traffic.recording.frames() > 0) {
        return None;
    }
    let has_link = |port: Port| status.value.port_state(port).link;
    let mut others = Port::ALL.into_iter().filter(|port| *port != wanted && has_link(*port));
    let is_known = |port: &Port| is_free(model, device, *port);
    let first = others.clone().next()?;
    (!has_link(wanted)).then(|| others.find(is_known).unwrap_or(first))
}

/// The port by which it should be entered.
fn wanted(model: &NetworkModel, device: &Device) -> Port {
    let tree =
        model.tree.as_ref().filter(|tree| model.tree_is_planned && device.id.index() < tree.len());
    tree.map_or(Port::A, |tree| tree.entry(device.id.index()))
}

/// Whether nothing is planned at a port.
fn is_free(model: &NetworkModel, device: &Device, port: Port) -> bool {
    model.opposite(device.id, port).is_none()
}

/// SubDevices that are plugged in the wrong way round, as their links tell.
pub(super) fn conditions(model: &NetworkModel, known: &[Condition]) -> Vec<Condition> {
    let reversed = model.devices.iter().filter_map(|device| {
        let entry = entered_otherwise(model, device)?;
        let place = Place::device(model.network, device.id);
        let is_told = known.iter().any(|one| one.page.code == PLUGGED.code && one.place == place);
        (!is_told).then(|| condition(model, device, entry, place))
    });
    reversed.collect()
}

fn condition(model: &NetworkModel, device: &Device, entry: Port, place: Place) -> Condition {
    let (id, label, wanted) = (device.id, model.label(device.id), wanted(model, device));
    let above = model.opposite(id, wanted);
    let is_first = matches!(above, Some(End::MainDevice(_)));
    let (cause, other) = if is_first {
        (FaultName::MainDeviceWrongPort, FaultName::PortsSwapped)
    } else {
        (FaultName::PortsSwapped, FaultName::DevicesSwapped)
    };
    let at = device.dl.last.map_or(model.now, |status| status.at);
    let frame = device.dl.last.and_then(|status| status.frame);
    let text =
        format!("{label} answers though port {wanted} has no link: frames come in by port {entry}");
    let seen = Seen::new((), at, frame);
    let shown = Evidence::register(id, table::DL_STATUS.address, &seen, text).port(wanted);
    let ports = [Some(End::Controller(id, wanted)), Some(End::Controller(id, entry)), above];
    let ends = ports.into_iter().flatten().chain(model.opposite(id, entry));
    let follows = ends.flat_map(|end| match end {
        End::Controller(id, port) => {
            vec![Symptom::LinkDown(id, port), Symptom::LinkCounted(id, port)]
        }
        End::MainDevice(_) => Vec::new(),
    });
    Condition::new(&PLUGGED, place, cause, at)
        .confidence(0.85)
        .or(other, 0.05)
        .confirmed(at)
        .shown_by(shown)
        .explaining(follows)
        .advise(format!(
            "Exchange the cables at ports {wanted} and {entry} of {label}: IN is port {wanted}."
        ))
}

/// Whether the device at an end of a link is plugged in the other way round, so that this end says nothing of the
/// link.
pub(in crate::rule) fn is_reversed(model: &NetworkModel, end: End) -> bool {
    let End::Controller(node, _) = end else { return false };
    model
        .device(DeviceId(node as u32))
        .is_some_and(|device| entered_otherwise(model, device).is_some())
}
