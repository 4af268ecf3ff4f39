//! Equipment beside devices and cables: supplies that several stations share, and stations that are
//! plugged in and out together.

use linesman_config::project::{IdentificationChoice, IdentificationWay, Project, ProjectGroup};
use linesman_sim::seed::Stream;
use linesman_sim::segment_file::{SegmentFile, Supply};

/// Supplies of a plant, at most.
const MOST_SUPPLIES: u64 = 4;
/// The number of the group's first device: no other device of a plant has an alias but twins, whose numbers begin lower.
const GROUP_ALIAS: u16 = 2_001;

/// Gives a plant supplies in some cases: the stations of a cabinet, which follow one another, hang on one of them.
pub(super) fn add_supplies(file: &mut SegmentFile, stream: &mut Stream) {
    if !stream.chance(0.5) {
        return;
    }
    // Terminals are fed by their coupler.
    let stations: Vec<String> = file
        .devices
        .iter()
        .filter(|device| device.cable_m.is_some())
        .map(|device| device.name.clone())
        .collect();
    let number = stream.between(1, MOST_SUPPLIES) as usize;
    let size = stations.len().div_ceil(number).max(2);
    let cabinets = stations.chunks(size).filter(|cabinet| cabinet.len() >= 2);
    file.supplies = cabinets
        .zip(1..)
        .map(|(cabinet, no)| Supply { name: format!("PS{no}"), devices: cabinet.to_vec() })
        .collect();
}

/// Makes one station at a cable a hot connect group in some cases, known by its alias: one that no ring runs through
/// and that nothing but its terminals hangs behind.
pub(super) fn add_group(file: &mut SegmentFile, project: &mut Project, stream: &mut Stream) {
    if !stream.chance(0.5) {
        return;
    }
    let Ok(tree) = project.tree() else { return };
    let is_cabled = |node: usize| {
        let name = project.devices.get(node).map(|device| device.name.as_str());
        file.devices
            .iter()
            .any(|device| Some(device.name.as_str()) == name && device.cable_m.is_some())
    };
    let is_end = |node: usize| {
        let on_ring = tree.link_above(node).is_some_and(|link| tree.is_on_ring(link));
        !on_ring && tree.subtree(node).iter().all(|inner| *inner == node || !is_cabled(*inner))
    };
    let fitting: Vec<usize> =
        (1..tree.len()).filter(|node| is_cabled(*node) && is_end(*node)).collect();
    let Some(first) = stream.pick(&fitting).copied() else { return };
    let Some(device) = project.devices.get_mut(first) else { return };
    device.alias = Some(GROUP_ALIAS);
    let name = device.name.clone();
    for device in file.devices.iter_mut().filter(|device| device.name == name) {
        device.alias = Some(GROUP_ALIAS);
    }
    let by = IdentificationWay::Alias;
    project.groups.push(ProjectGroup {
        name: "cart".to_owned(),
        first: name,
        members: Vec::new(),
        identification: Some(IdentificationChoice {
            by,
            value: None,
            register: None,
            compulsory: true,
        }),
        optional: false,
        places: Vec::new(),
    });
}
