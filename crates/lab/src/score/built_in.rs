//! Built-in faults, which are there from the start, and reasons for which a case cannot be played.

use linesman_config::fault::FaultName;
use linesman_config::project::Project;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::topology::{End, Tree};
use linesman_sim::seed::Stream;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

use super::case::Case;
use super::draw::{Drawn, Offer, When, draw, when};
use crate::choice::LineOutline;
use crate::lab::LabError;

/// Why a case ends early.
#[derive(Debug)]
pub(super) enum EarlyEnd {
    /// This plant has no place for the faults.
    NoPlace,
    /// It cannot be played at all.
    Failed(String),
}

impl From<LabError> for EarlyEnd {
    fn from(error: LabError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// The segment with those faults in it that are so from the start.
pub(super) fn with_built_in(
    case: &Case,
    stream: &mut Stream,
) -> Result<(SegmentFile, Vec<Drawn>), EarlyEnd> {
    let is_early = |name: FaultName| when(name, case.from_start) == When::FromStart;
    let names: Vec<FaultName> =
        case.faults.iter().copied().filter(|name| is_early(*name)).collect();
    let mut file = case.file.clone();
    let mut built_in = Vec::new();
    if names.is_empty() {
        return Ok((file, built_in));
    }
    let project = case.file.project().map_err(|_| EarlyEnd::NoPlace)?;
    let tree = project.tree().map_err(|_| EarlyEnd::NoPlace)?;
    let devices: Vec<String> = project.devices.iter().map(|device| device.name.clone()).collect();
    let cabled = vec![true; tree.links().len()];
    let outline = LineOutline { tree: &tree, names: &devices, cabled: &cabled };
    for name in names {
        let offer = Offer {
            outline: &outline,
            file: &case.file,
            clocked: &[],
            reference: None,
            when: When::FromStart,
        };
        let drawn = (0..10).find_map(|_| draw(name, &offer, stream)).ok_or(EarlyEnd::NoPlace)?;
        if name == FaultName::TwinsSwapped && case.from_start {
            give_aliases(&mut file, &drawn.choice.entry);
        }
        file.faults.push(drawn.choice.entry.clone());
        built_in.push(drawn);
    }
    Ok((file, built_in))
}

/// Whom a device that nobody planned has pushed on, and in whose planned places the equal ones stand that are in
/// a row with it, those without a planned place counted on.
pub(super) fn around_extra(
    project: &Project,
    tree: &Tree,
    entry: &FaultEntry,
) -> Option<(Option<DeviceId>, Vec<DeviceId>)> {
    let word = |key: &str| {
        let value = entry.parameters.get(key)?.to_string();
        Some(value.trim_matches('"').to_owned())
    };
    let (on, type_name) = (word("on")?, word("type")?);
    let end = match on.split_once('.') {
        None => End::MainDevice(Path::A),
        Some((name, port)) => {
            let node = project.devices.iter().position(|device| device.name == name)?;
            End::Controller(node, Port::from_letter(port.chars().next()?)?)
        }
    };
    let alike = |node: &usize| {
        project.devices.get(*node).is_some_and(|planned| {
            planned.type_name == type_name && planned.alias.is_none() && planned.serial.is_none()
        })
    };
    let pushed = tree.opposite(end).and_then(|far| far.node());
    let only = |node: usize| tree.children(node).all(|(_, child)| Some(child) == pushed);
    let before = end.node().filter(|node| alike(node) && only(*node));
    let behind = pushed.filter(alike);
    let row = |node: usize| tree.in_a_row(node, |other| alike(&other));
    let mut equals: Vec<usize> = before.into_iter().chain(behind).collect();
    for node in equals.clone() {
        let others = row(node).into_iter().filter(|other| !equals.contains(other));
        equals.extend(others.collect::<Vec<_>>());
    }
    // All behind the extra one stand one place further on; the row has one place more than planned.
    let position = |node: usize| tree.position(node);
    let last = equals.iter().filter_map(|node| position(*node)).max();
    let place = |position: usize| {
        let node = tree.order().get(position).copied().unwrap_or(position);
        DeviceId(node as u32)
    };
    let mut places: Vec<DeviceId> = equals.iter().map(|node| DeviceId(*node as u32)).collect();
    places.extend(last.map(|last| place(last + 1)));
    places.extend(pushed.map(|node| DeviceId(node as u32)).filter(|_| !equals.is_empty()));
    Some((pushed.map(|node| DeviceId(node as u32)), places))
}

/// Lets the project know two devices by name.
fn give_aliases(file: &mut SegmentFile, entry: &FaultEntry) {
    let named = entry.devices.iter().flatten().zip(1_001..);
    for (name, alias) in named {
        for device in file.devices.iter_mut().filter(|device| device.name == *name) {
            device.alias = Some(alias);
        }
    }
}
