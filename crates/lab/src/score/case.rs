//! Case of a seed: its kind, the plant and its features.

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;
use linesman_proto::topology::Route;
use linesman_sim::fault::KINDS;
use linesman_sim::seed::{Seed, Stream};
use linesman_sim::segment_file::{PlantOptions, SegmentFile, plant};
use serde::{Deserialize, Serialize};

use super::parts::span_ns;
use super::perturb::Perturbation;
use super::plant_extras::add_supplies;
use crate::choice::AT_RUN_TIME;
use crate::habit::Habit;

/// Choices for a score.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct ScoreOptions {
    /// Only this fault, one in each case.
    pub fault: Option<FaultName>,
    /// Only recordings are judged, and nobody asks for registers while they are made.
    pub capture_only: bool,
    /// Nothing is wrong in any case, but much is done that is no fault.
    pub healthy: bool,
    /// Time that healthy lines run on, disturbed now and then.
    #[serde(with = "span_ns")]
    pub healthy_for: Span,
    /// What is other than the diagnosis expects.
    pub perturb: Option<Perturbation>,
    /// How the MainDevice drives the line. With another habit than ours nobody asks for registers, and listeners are
    /// judged.
    pub habit: Habit,
    /// True if the parts that are blamed are exchanged one after the other, with a look again after each.
    pub tries_repairs: bool,
    /// True if a case that a set made right is played again with the cause that was named.
    pub proves_sets: bool,
    /// Whether what listeners heard is kept.
    pub keeps_heard: bool,
    /// True if plants and diagnoses are kept.
    pub keeps_reports: bool,
}

impl ScoreOptions {
    /// Whether the diagnosis beside the MainDevice is judged, which may ask for registers.
    #[must_use]
    pub fn judges_live(&self) -> bool {
        !self.capture_only && self.habit == Habit::Own
    }
}

/// What kind of case it is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
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
    /// Relation of two faults: their places, and the time between their beginnings.
    pub pair: FaultPair,
    /// Errors so rare that they do not matter, on a cable that is not at fault: hits per second.
    pub background: Option<f64>,
}

/// Two faults of one case.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct FaultPair {
    /// True if one lies behind the other; else neither does.
    pub is_in_line: bool,
    /// From the beginning of the first to that of the second.
    #[serde(with = "span_ns")]
    pub apart: Span,
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
        let ring = has(&[FaultName::RingOpen]) || stream.chance(0.5);
        let clocks = has(&CLOCKED) || stream.chance(0.5);
        let from_start = seed.stream("score begin").chance(0.5);
        let forwarded = !stream.chance(0.2);
        let host_counters = stream.chance(0.6);
        let cycle = Span::ms(*stream.pick(&[1, 2, 2, 4, 5]).unwrap_or(&2));
        let mut file = line(seed, attempt, ring, &mut stream);
        file.counts_forwarded = (!forwarded).then_some(false);
        file.noise_at_link_up = stream.chance(0.2).then_some(3.0);
        link_times(&mut file, &mut seed.stream("score link-up"));
        add_supplies(&mut file, &mut seed.stream("score supplies"));
        let mut extra = seed.stream("score beside");
        let is_masked =
            kind == CaseKind::Masked || extra.chance(if options.healthy { 0.5 } else { 0.25 });
        let mut pair = pair(&mut extra);
        // All else lies behind the card.
        pair.is_in_line |= has(&[FaultName::NicDamaged]);
        let has_background = kind == CaseKind::Single && extra.chance(0.15);
        let background = has_background.then(|| extra.log_uniform(0.2, 2.0));
        if is_masked {
            mask(&mut file, &mut stream);
        }
        if let Some(perturb) = options.perturb {
            perturb.plant(&mut file, &mut seed.stream("score perturbed"));
        }
        Self {
            seed,
            kind,
            faults,
            file,
            cycle,
            host_counters,
            clocks,
            forwarded,
            from_start,
            pair,
            background,
        }
    }
}

/// Relation of two faults: on one line or on branches, at one moment or up to three seconds apart.
fn pair(stream: &mut Stream) -> FaultPair {
    let is_in_line = stream.chance(0.6);
    let is_together = stream.chance(0.4);
    let apart = if is_together { Span::ZERO } else { Span::us(stream.between(1_000, 3_000_000)) };
    FaultPair { is_in_line, apart }
}

/// Links of cables come up in a time of their own: most plants have PHYs of one make, some are mixed.
fn link_times(file: &mut SegmentFile, stream: &mut Stream) {
    let draw = |stream: &mut Stream| stream.log_uniform(LINK_UP_MS.0, LINK_UP_MS.1).round();
    let of_plant = draw(stream);
    let is_mixed = stream.chance(0.3);
    for device in file.devices.iter_mut().filter(|device| device.cable_m.is_some()) {
        device.link_up_ms = Some(if is_mixed { draw(stream) } else { of_plant });
    }
}

/// A link comes up in 0.3 to 5 s: two PHYs that negotiate, by make and by chance.
const LINK_UP_MS: (f64, f64) = (300.0, 5_000.0);

/// What shows only where SubDevices are in step with their clocks.
const CLOCKED: [FaultName; 4] = [
    FaultName::SyncLost,
    FaultName::ClockDrift,
    FaultName::ReferenceClockLost,
    FaultName::CycleTooFast,
];

/// What is drawn of the catalogue. Lines of the score carry no Ethernet frames, so that a faulty EoE stack shows nowhere.
fn catalogue() -> impl Iterator<Item = FaultName> {
    KINDS.iter().map(|kind| kind.name).filter(|name| *name != FaultName::EoeFault)
}

fn faults(options: &ScoreOptions, stream: &mut Stream) -> (CaseKind, Vec<FaultName>) {
    let kind = match stream.below(100) {
        0..12 => CaseKind::Healthy,
        12..26 => CaseKind::Double,
        26..38 => CaseKind::Masked,
        _ => CaseKind::Single,
    };
    let catalogue = catalogue().collect::<Vec<_>>();
    let drawn = stream.pick(&catalogue).copied();
    let mut physical = [stream.pick(&AT_RUN_TIME).copied(), stream.pick(&AT_RUN_TIME).copied()];
    if physical == [Some(FaultName::NicDamaged); 2] {
        // There is one card that matters.
        physical[1] = Some(FaultName::CableDegraded);
    }
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

/// A tree of 2 to 200 SubDevices, as many of each order of magnitude.
///
/// A ring that leaves a junction by another port than its last is not drawn: what hangs behind the
/// later ports is processed by frames of the second card only, also while the ring is whole.
fn line(seed: Seed, attempt: u32, ring: bool, stream: &mut Stream) -> SegmentFile {
    let target = stream.log_uniform(2.0, 200.0).round() as usize;
    let all_types = stream.chance(0.5);
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
        for name in catalogue() {
            let count = drawn.iter().filter(|(_, faults)| faults.contains(&name)).count();
            assert!(count >= 10, "{name}: {count}");
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
