//! One seed, and many of them.

use std::fmt;

use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Route};
use linesman_sim::hardware::PortKind;
use linesman_sim::seed::Seed;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{PlantOptions, SegmentFile, plant};
use serde::{Deserialize, Serialize};

use super::episode::{Episode, EpisodeReport};
use crate::habit::Habit;
use crate::lab::{Lab, LabError};
use crate::options::LabOptions;
use crate::part::SeedPart;

/// Choices for a swarm.
#[derive(Clone, Debug)]
pub struct SwarmOptions {
    /// How the MainDevice drives the line. Beside another habit than ours the diagnosis listens, and need not find
    /// each fault; it must not name a place where there is none.
    pub habit: Habit,
    /// Cycle of the process data.
    pub cycle: Span,
    /// At least this many SubDevices.
    pub min_devices: usize,
    /// At most this many SubDevices.
    pub max_devices: usize,
    /// How many times something goes wrong in each run.
    pub episodes: u64,
    /// How long the first bring-up may take.
    pub bring_up: Span,
    /// How long the line may take to be up again after healing.
    pub recovery: Span,
}

impl Default for SwarmOptions {
    fn default() -> Self {
        Self {
            habit: Habit::Own,
            cycle: Span::ms(5),
            min_devices: 5,
            max_devices: 24,
            episodes: 2,
            bring_up: Span::s(20),
            recovery: Span::s(15),
        }
    }
}

/// What came of one seed.
#[derive(Clone, Debug)]
pub struct SeedReport {
    /// The seed.
    pub seed: u64,
    /// How the MainDevice drove the line.
    pub habit: Habit,
    /// SubDevices of its plant.
    pub devices: usize,
    /// What went wrong on purpose, in order.
    pub episodes: Vec<EpisodeReport>,
    /// What must hold and did not, in words.
    pub violations: Vec<String>,
    /// How much virtual time passed.
    pub time: Instant,
    /// Frames seen.
    pub frames: u64,
    /// Working counters that were checked.
    pub counters_checked: u64,
}

impl SeedReport {
    /// Whether all held.
    #[must_use]
    pub fn is_green(&self) -> bool {
        self.violations.is_empty()
    }

    /// Whether a fault had an effect.
    #[must_use]
    pub fn had_effect(&self) -> bool {
        self.episodes.iter().flat_map(|episode| &episode.faults).any(|fault| fault.had_effect)
    }

    /// The command that plays this seed again.
    #[must_use]
    pub fn replay(&self) -> String {
        let habit = if self.habit == Habit::Own {
            String::new()
        } else {
            format!(" --habit {}", self.habit)
        };
        format!("linesman lab swarm --seeds {}..{}{habit}", self.seed, self.seed + 1)
    }
}

impl fmt::Display for SeedReport {
    /// One line when all held; else also what did not, and how to play it again.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = if self.is_green() { "ok  " } else { "FAIL" };
        let faults = self.episodes.iter().flat_map(|episode| &episode.faults);
        let faults: Vec<&str> = faults.map(|fault| fault.entry.as_str()).collect();
        let (seed, devices) = (self.seed, self.devices);
        write!(f, "{mark} seed {seed:>4}  {devices:>3} SubDevices  {}", faults.join(" | "))?;
        for violation in &self.violations {
            write!(f, "\n       {violation}")?;
        }
        if !self.is_green() {
            write!(f, "\n       again: {}", self.replay())?;
        }
        Ok(())
    }
}

/// Sum of one seed, as a part of a swarm carries it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeedSum {
    /// The seed.
    pub seed: u64,
    /// The report in words, as shown.
    pub words: String,
    /// True if all held.
    pub is_green: bool,
    /// True if a fault had an effect.
    pub had_effect: bool,
    /// Frames seen.
    pub frames: u64,
    /// Working counters that were checked.
    pub counters_checked: u64,
}

impl From<&SeedReport> for SeedSum {
    fn from(report: &SeedReport) -> Self {
        Self {
            seed: report.seed,
            words: report.to_string(),
            is_green: report.is_green(),
            had_effect: report.had_effect(),
            frames: report.frames,
            counters_checked: report.counters_checked,
        }
    }
}

/// Name and version of the format of a [`SwarmPart`].
pub const PART_SCHEMA: &str = "linesman.swarm-part/1";

/// Seeds of a range, and the habit that all were played with.
pub type SwarmPart = SeedPart<Habit, SeedSum>;

/// What came of a swarm.
#[derive(Clone, Debug, Default)]
pub struct SwarmReport {
    /// Every seed's sum, in order.
    pub seeds: Vec<SeedSum>,
}

impl SwarmReport {
    /// Seeds in which something did not hold.
    pub fn failed(&self) -> impl Iterator<Item = &SeedSum> {
        self.seeds.iter().filter(|seed| !seed.is_green)
    }

    /// How many seeds had a fault with an effect.
    #[must_use]
    pub fn with_effect(&self) -> usize {
        self.seeds.iter().filter(|seed| seed.had_effect).count()
    }

    /// Whether all held in all seeds, and most seeds had a fault with an effect.
    #[must_use]
    pub fn is_green(&self) -> bool {
        self.failed().next().is_none() && self.with_effect() * 2 > self.seeds.len()
    }
}

/// Runs one seed.
#[must_use]
pub fn run_seed(seed: u64, options: &SwarmOptions) -> SeedReport {
    let mut report = SeedReport {
        seed,
        habit: options.habit,
        devices: 0,
        episodes: Vec::new(),
        violations: Vec::new(),
        time: Instant::ZERO,
        frames: 0,
        counters_checked: 0,
    };
    if let Err(error) = play(seed, options, &mut report) {
        report.violations.push(error.to_string());
    }
    report
}

fn play(seed: u64, options: &SwarmOptions, report: &mut SeedReport) -> Result<(), LabError> {
    let seed = Seed(seed);
    let mut stream = seed.stream("swarm");
    let file = draw_plant(seed, options);
    let host_counters = stream.chance(0.5);
    let lab_options = LabOptions {
        habit: options.habit,
        project: options.habit == Habit::Own,
        cycle: options.cycle,
        host_counters,
        ..LabOptions::default()
    };
    let mut lab = Lab::new(&file, lab_options)?;
    report.devices = lab.segment().tree().len();
    let result = (|| {
        lab.wait_up(options.bring_up)?;
        for number in 0..options.episodes {
            let mut stream = seed.stream(&format!("episode {number}"));
            let mut episode = Episode::new(&mut lab, options, host_counters);
            let of_episode = episode.play(&mut stream);
            let checked = episode.counters_checked();
            report.counters_checked += checked;
            let (of_episode, violations) = of_episode?;
            report.violations.extend(violations);
            report.episodes.push(of_episode);
        }
        Ok(())
    })();
    report.time = lab.now();
    report.frames = lab.frames();
    result
}

/// A plant, now and then a ring.
///
/// A ring that leaves a junction by another port than its last is not drawn: what hangs behind the
/// later ports is processed by frames of the second card only, also while the ring is whole.
fn draw_plant(seed: Seed, options: &SwarmOptions) -> SegmentFile {
    let plant_options = PlantOptions {
        min_devices: options.min_devices,
        max_devices: options.max_devices,
        ring: seed.stream("ring").chance(0.15),
        ..PlantOptions::default()
    };
    let file = plant(seed, &plant_options);
    let tree = file.project().ok().and_then(|project| project.tree().ok());
    let is_whole = tree.is_none_or(|tree| Route::intact(&tree).order().count() == tree.len());
    if is_whole { file } else { plant(seed, &PlantOptions { ring: false, ..plant_options }) }
}

/// By link of the tree: whether it is a cable rather than a contact between two terminals.
#[must_use]
pub fn cabled(segment: &Segment) -> Vec<bool> {
    let is_cable = |end: End| match end {
        End::MainDevice(_) => true,
        End::Controller(node, port) => {
            let controller = segment.controller(DeviceId(node as u32));
            controller.is_some_and(|controller| controller.hardware().ports[port] == PortKind::Mii)
        }
    };
    let links = segment.tree().links();
    links.iter().map(|link| is_cable(link.upstream) && is_cable(link.downstream)).collect()
}
