//! Case of a seed: its kind, the plant and its features.

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;
use linesman_proto::topology::Route;
use linesman_sim::fault::KINDS;
use linesman_sim::seed::{Seed, Stream};
use linesman_sim::segment_file::{PlantOptions, SegmentFile, plant};

use super::perturb::Perturbation;
use crate::choice::AT_RUN_TIME;
use crate::habit::Habit;

/// Choices for a score.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ScoreOptions {
    /// Only this fault, one in each case.
    pub fault: Option<FaultName>,
    /// Only recordings are judged, and nobody asks for registers while they are made.
    pub capture_only: bool,
    /// Nothing is wrong in any case, but much is done that is no fault.
    pub healthy: bool,
    /// What is other than the diagnosis expects.
    pub perturb: Option<Perturbation>,
    /// How the MainDevice drives the line. With another habit than ours nobody asks for registers, and listeners are
    /// judged.
    pub habit: Habit,
    /// Whether what listeners heard is kept.
    pub keeps_heard: bool,
}

impl ScoreOptions {
    /// Whether the diagnosis beside the MainDevice is judged, which may ask for registers.
    #[must_use]
    pub fn judges_live(&self) -> bool {
        !self.capture_only && self.habit == Habit::Own
    }
}

/// What kind of case it is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum CaseKind {
    /// Nothing is wrong.
    Healthy,
    /// One fault.
    Single,
    /// One fault, among counters that are full of old errors.
    Masked,
    /// Two faults.
    Double,
}

/// A case as drawn: what is played.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its seed.
    pub seed: Seed,
    /// Its kind.
    pub kind: CaseKind,
    /// The faults to be put in.
    pub faults: Vec<FaultName>,
    /// The plant, without them.
    pub file: SegmentFile,
    /// Cycle of the process data.
    pub cycle: Span,
    /// Whether the card's counters are known.
    pub host_counters: bool,
    /// Whether SubDevices are in step with their clocks.
    pub clocks: bool,
    /// Whether the controllers count forwarded errors, as far as their type does.
    pub forwarded: bool,
    /// Whether what may begin early or late begins before the line is brought up.
    pub from_start: bool,
}

impl Case {
    /// Draws the case of a seed. `attempt` draws another plant for the same faults, where the one
    /// before has no place for them.
    #[must_use]
    pub fn draw(seed: u64, attempt: u32, options: &ScoreOptions) -> Self {
        let seed = Seed(seed);
        let mut stream = seed.stream("score");
        let (kind, faults) = faults(options, &mut stream);
        let mut stream = seed.stream(&format!("score plant {attempt}"));
        let has = |names: &[FaultName]| faults.iter().any(|name| names.contains(name));
        let ring = has(&[FaultName::RingOpen]) || stream.chance(0.12);
        let clocks = has(&CLOCKED) || stream.chance(0.2);
        let from_start = seed.stream("score begin").chance(0.5);
        let forwarded = !stream.chance(0.2);
        let host_counters = stream.chance(0.6);
        let cycle = Span::ms(*stream.pick(&[1, 2, 2, 4, 5]).unwrap_or(&2));
        let mut file = line(seed, attempt, ring, &mut stream);
        file.counts_forwarded = (!forwarded).then_some(false);
        file.noise_at_link_up = stream.chance(0.2).then_some(3.0);
        let is_masked = kind == CaseKind::Masked || (options.healthy && stream.chance(0.5));
        if is_masked {
            mask(&mut file, &mut stream);
        }
        if let Some(perturb) = options.perturb {
            perturb.plant(&mut file, &mut seed.stream("score perturbed"));
        }
        Self { seed, kind, faults, file, cycle, host_counters, clocks, forwarded, from_start }
    }
}

/// What shows only where SubDevices are in step with their clocks.
const CLOCKED: [FaultName; 4] = [
    FaultName::SyncLost,
    FaultName::ClockDrift,
    FaultName::ReferenceClockLost,
    FaultName::CycleTooFast,
];

fn faults(options: &ScoreOptions, stream: &mut Stream) -> (CaseKind, Vec<FaultName>) {
    let kind = match stream.below(100) {
        0..12 => CaseKind::Healthy,
        12..26 => CaseKind::Double,
        26..38 => CaseKind::Masked,
        _ => CaseKind::Single,
    };
    let catalogue = KINDS.iter().map(|kind| kind.name).collect::<Vec<_>>();
    let drawn = stream.pick(&catalogue).copied();
    // Behind a damaged card everything is hidden: it cannot be one of two that are both seen.
    let apart = |name: &FaultName| kind != CaseKind::Double || *name != FaultName::NicDamaged;
    let menu: Vec<FaultName> = AT_RUN_TIME.into_iter().filter(apart).collect();
    let physical = [stream.pick(&menu).copied(), stream.pick(&menu).copied()];
    if options.healthy {
        return (CaseKind::Healthy, Vec::new());
    }
    if let Some(fault) = options.fault {
        let kind = if kind == CaseKind::Masked { kind } else { CaseKind::Single };
        return (kind, vec![fault]);
    }
    let faults = match kind {
        CaseKind::Healthy => Vec::new(),
        CaseKind::Single => drawn.into_iter().collect(),
        // Old counters can hide only what is counted.
        CaseKind::Masked => physical.into_iter().flatten().take(1).collect(),
        CaseKind::Double => physical.into_iter().flatten().collect(),
    };
    (kind, faults)
}

/// A tree: mostly small, now and then up to 200 SubDevices.
///
/// A ring that leaves a junction by another port than its last is not drawn: what hangs behind the
/// later ports is processed by frames of the second card only, also while the ring is whole.
fn line(seed: Seed, attempt: u32, ring: bool, stream: &mut Stream) -> SegmentFile {
    let most = if stream.chance(0.04) { 200.0 } else { 40.0 };
    let target = stream.log_uniform(2.0, most).round() as usize;
    let all_types = stream.chance(0.2);
    for number in 0..8 {
        let options = PlantOptions {
            min_devices: target,
            max_devices: target + 2,
            ring: ring && number < 7,
            all_types,
            junction: false,
        };
        let file = plant(seed.child(&format!("line {attempt}.{number}")), &options);
        let tree = file.project().ok().and_then(|project| project.tree().ok());
        if tree.is_none_or(|tree| Route::intact(&tree).order().count() == tree.len()) {
            return file;
        }
    }
    plant(seed, &PlantOptions { max_devices: 40, ..PlantOptions::default() })
}

/// Old errors at many ports, some of them at the end of the counter.
fn mask(file: &mut SegmentFile, stream: &mut Stream) {
    file.old_counters = true;
    for device in &mut file.devices {
        for port in ["A", "B"] {
            for counter in ["frame", "physical", "lost_link"] {
                if stream.chance(0.25) {
                    let value =
                        if stream.chance(0.15) { 255 } else { stream.between(1, 240) as u8 };
                    device.counters.insert(format!("{port}.{counter}"), value);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_of_the_catalogue_and_every_kind_of_case_is_drawn() {
        let draw = |seed| faults(&ScoreOptions::default(), &mut Seed(seed).stream("score"));
        let drawn: Vec<_> = (0..2_000).map(draw).collect();
        for kind in KINDS {
            let count = drawn.iter().filter(|(_, faults)| faults.contains(&kind.name)).count();
            assert!(count >= 10, "{}: {count}", kind.name);
        }
        for kind in [CaseKind::Healthy, CaseKind::Single, CaseKind::Masked, CaseKind::Double] {
            let count = drawn.iter().filter(|(drawn, _)| *drawn == kind).count();
            assert!(count >= 150, "{kind:?}: {count}");
        }
    }

    #[test]
    fn the_same_seed_is_the_same_case() {
        let file = |seed| Case::draw(seed, 0, &ScoreOptions::default()).file;
        assert_eq!(file(5), file(5));
        assert_ne!(file(5), file(6));
    }
}
