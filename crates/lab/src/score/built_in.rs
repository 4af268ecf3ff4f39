//! Faults that are so from the start, and why a case cannot be played.

use linesman_config::fault::FaultName;
use linesman_sim::seed::Stream;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

use super::case::Case;
use super::draw::{Drawn, Offer, When, draw, when};
use crate::choice::Ground;
use crate::lab::LabError;

/// Why a case ends early.
pub(super) enum Stop {
    /// This plant has no place for the faults.
    NoPlace,
    /// It cannot be played at all.
    Failed(String),
}

impl From<LabError> for Stop {
    fn from(error: LabError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// The segment with those faults in it that are so from the start.
pub(super) fn with_built_in(
    case: &Case,
    stream: &mut Stream,
) -> Result<(SegmentFile, Vec<Drawn>), Stop> {
    let is_early = |name: FaultName| when(name, case.from_start) == When::FromStart;
    let names: Vec<FaultName> =
        case.faults.iter().copied().filter(|name| is_early(*name)).collect();
    let mut file = case.file.clone();
    let mut built_in = Vec::new();
    if names.is_empty() {
        return Ok((file, built_in));
    }
    let project = case.file.project().map_err(|_| Stop::NoPlace)?;
    let tree = project.tree().map_err(|_| Stop::NoPlace)?;
    let devices: Vec<String> = project.devices.iter().map(|device| device.name.clone()).collect();
    let cabled = vec![true; tree.links().len()];
    let ground = Ground { tree: &tree, names: &devices, cabled: &cabled };
    for name in names {
        let offer = Offer {
            ground: &ground,
            file: &case.file,
            clocked: &[],
            reference: None,
            when: When::FromStart,
        };
        let drawn = (0..10).find_map(|_| draw(name, &offer, stream)).ok_or(Stop::NoPlace)?;
        if name == FaultName::TwinsSwapped && case.from_start {
            give_aliases(&mut file, &drawn.choice.entry);
        }
        file.faults.push(drawn.choice.entry.clone());
        built_in.push(drawn);
    }
    Ok((file, built_in))
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
