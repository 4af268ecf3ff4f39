//! The demo: a plant drawn by chance, brought up, broken and healed again and again, with the
//! injected truth beside the verdict.
//!
//! It goes step by step so that a front end can show what happens as it happens: [`Demo::new`],
//! [`Demo::bring_up`], then [`Demo::next_episode`] until there are no more.

use linesman_config::fault::FaultName;
use linesman_config::project::Project;
use linesman_diagnosis::report::FindingReport;
use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;
use linesman_sim::seed::Seed;
use linesman_sim::segment_file::SegmentFile;
use linesman_sim::segment_file::{PlantOptions, plant};
use linesman_sim::truth::{FaultId, Place};

use crate::choice::{Choice, LineOutline};
use crate::drawing::{Label, Row, draw};
use crate::lab::{Lab, LabError};
use crate::options::LabOptions;
use crate::swarm::run::cabled;
use crate::verdict::judge::{JudgedFault, best_finding};
use crate::verdict::{Claim, Match, Scene, Site};

/// SubDevices of a demo plant, at least.
pub const MIN_DEVICES: usize = 25;
/// SubDevices of a demo plant, at most.
pub const MAX_DEVICES: usize = 36;
/// Cycle of the process data.
const CYCLE: Span = Span::ms(2);
/// How long the bring-up may take.
const BRING_UP: Span = Span::s(20);
/// How long the line runs between two faults.
const QUIET: Span = Span::ms(3_500);
/// How long the diagnosis may take.
const VERDICT: Span = Span::s(3);
/// How long the line may take to recover, and all findings to close.
const RECOVERY: Span = Span::s(15);

/// What a demo suffers, in an order drawn by chance.
const MENU: [FaultName; 5] = [
    FaultName::LinkOpen,
    FaultName::EmcNoise,
    FaultName::DeviceInternal,
    FaultName::DeviceOff,
    FaultName::TransmitterDamaged,
];

/// A demo as it goes.
pub struct Demo {
    seed: Seed,
    file: SegmentFile,
    lab: Lab,
    menu: Vec<FaultName>,
    next: usize,
}

/// A fault, what was said about it, and how the line came back.
#[derive(Clone, Debug)]
pub struct DemoEpisode {
    /// What was injected.
    pub fault: FaultName,
    /// Where, with names.
    pub place: String,
    /// The devices at the place, to be marked in a drawing.
    pub marked: Vec<DeviceId>,
    /// Kind, place and parameters in one line.
    pub entry: String,
    /// What was said about it.
    pub verdict: Option<DemoVerdict>,
    /// How long the line took to be up again, with all findings closed, after healing; `None` if it
    /// did not.
    pub healed_in: Option<Span>,
}

/// What was said about a fault.
#[derive(Clone, Debug)]
pub struct DemoVerdict {
    /// The finding.
    pub finding: FindingReport,
    /// Its place, with names.
    pub place: String,
    /// How well it fits the truth.
    pub fits: Match,
    /// Cycles from the first effect of the fault to the finding.
    pub cycles: u64,
    /// Findings beside this one that are not its consequences.
    pub others: usize,
}

impl DemoEpisode {
    /// Whether the verdict is right and the line came back.
    #[must_use]
    pub fn held(&self) -> bool {
        let right = self.verdict.as_ref().is_some_and(|verdict| verdict.fits.is_right());
        right && self.healed_in.is_some()
    }
}

impl Demo {
    /// Draws the plant of a seed.
    ///
    /// # Errors
    /// [`LabError::Segment`].
    pub fn new(seed: u64) -> Result<Self, LabError> {
        let seed = Seed(seed);
        let options = PlantOptions {
            min_devices: MIN_DEVICES,
            max_devices: MAX_DEVICES,
            junction: true,
            ..PlantOptions::default()
        };
        let file = plant(seed, &options);
        let lab = Lab::new(&file, LabOptions { cycle: CYCLE, ..LabOptions::default() })?;
        let mut menu = MENU.to_vec();
        let mut stream = seed.stream("demo menu");
        for at in (1..menu.len()).rev() {
            menu.swap(at, stream.below(at as u64 + 1) as usize);
        }
        Ok(Self { seed, file, lab, menu, next: 0 })
    }

    /// The plant as a file, for `linesman sim` and `diagnose sim:`.
    #[must_use]
    pub fn file(&self) -> &SegmentFile {
        &self.file
    }

    /// The lab behind it.
    #[must_use]
    pub fn lab(&self) -> &Lab {
        &self.lab
    }

    /// The cycle of the process data.
    #[must_use]
    pub fn cycle(&self) -> Span {
        CYCLE
    }

    /// How many faults are to come in all.
    #[must_use]
    pub fn episodes(&self) -> usize {
        self.menu.len()
    }

    /// The plant as text.
    #[must_use]
    pub fn drawing(&self) -> Vec<Row> {
        let labels: Vec<Label> = self
            .lab
            .project()
            .devices
            .iter()
            .map(|device| Label { name: device.name.clone(), type_name: device.type_name.clone() })
            .collect();
        draw(self.lab.tree(), &labels)
    }

    /// Brings the line up, and says how long that took on its own clock.
    ///
    /// # Errors
    /// [`LabError`] when it does not come up.
    pub fn bring_up(&mut self) -> Result<Span, LabError> {
        let start = self.lab.now();
        self.lab.wait_up(BRING_UP)?;
        let took = self.lab.now().since(start);
        self.lab.run_until(self.lab.now() + QUIET)?;
        Ok(took)
    }

    /// The next fault: injected, judged, healed. `None` when all have been.
    ///
    /// # Errors
    /// [`LabError`] when virtual time stands still.
    pub fn next_episode(&mut self) -> Result<Option<DemoEpisode>, LabError> {
        let Some(name) = self.menu.get(self.next).copied() else { return Ok(None) };
        self.next += 1;
        let choice = self.choose(name);
        let Some(choice) = choice else { return self.next_episode() };
        let mut episode = DemoEpisode {
            fault: name,
            place: String::new(),
            marked: Vec::new(),
            entry: choice.text(),
            verdict: None,
            healed_in: None,
        };
        let id = self.lab.inject(&choice.entry)?;
        self.mark(id, &mut episode);
        episode.verdict = self.judge(id)?;
        self.lab.run_until(self.lab.now() + QUIET)?;
        // With more to go by it may have come to know the cause better; the first word stands.
        if let (Some(verdict), Some((finding, fits))) =
            (&mut episode.verdict, verdict_on(&self.lab, id))
        {
            verdict.place = describe(self.lab.project(), Claim::of(&finding).site);
            (verdict.finding, verdict.fits) = (finding, fits);
        }
        self.lab.heal(id);
        let healed = self.lab.now();
        let back = self
            .lab
            .run_while(RECOVERY, Span::ms(5), |lab| lab.is_up() && lab.open_findings() == 0)?;
        episode.healed_in = back.then(|| self.lab.now().since(healed));
        self.lab.run_until(self.lab.now() + QUIET)?;
        Ok(Some(episode))
    }

    fn choose(&self, name: FaultName) -> Option<Choice> {
        let tree = self.lab.tree();
        let names: Vec<String> =
            self.lab.project().devices.iter().map(|device| device.name.clone()).collect();
        let cabled = cabled(self.lab.segment());
        let outline = LineOutline { tree, names: &names, cabled: &cabled };
        let mut stream = self.seed.stream(&format!("demo {name}"));
        // Faults at the very first device leave little to tell apart: they come when nothing else
        // was drawn.
        let mut drawn = None;
        for _ in 0..20 {
            drawn = outline.choose(name, &mut stream);
            let Some(choice) = &drawn else { break };
            if choice.link != Some(0) && choice.device != Some(DeviceId(0)) {
                break;
            }
        }
        drawn
    }

    fn mark(&self, id: FaultId, episode: &mut DemoEpisode) {
        let Some(fault) = self.lab.truth().fault(id) else { return };
        let mut places = Vec::new();
        for place in &fault.places {
            let tree = self.lab.tree();
            let site = match *place {
                Place::Direction(from, to) => Site::hop(tree, from, to),
                Place::Link(one, other) => Site::link(tree, one, other),
                Place::Device(id) => Site::Device(id),
                Place::Host(_) => Site::Host,
            };
            places.push(describe(self.lab.project(), site));
            episode.marked.extend(match site {
                Site::Device(id) => vec![id],
                Site::Link { a, b, .. } => {
                    [Some(a), b].into_iter().flatten().filter_map(|end| end.node()).collect()
                }
                Site::Host | Site::Network => Vec::new(),
            });
        }
        episode.place = places.join(", ");
    }

    /// Lets the line run until the diagnosis has said what fits, or its time is up.
    fn judge(&mut self, id: FaultId) -> Result<Option<DemoVerdict>, LabError> {
        self.lab.run_while(VERDICT, CYCLE, |lab| verdict_on(lab, id).is_some())?;
        let Some((finding, fits)) = verdict_on(&self.lab, id) else { return Ok(None) };
        let effect = self.lab.truth().fault(id).and_then(|fault| fault.first_effect);
        let cycles = match effect {
            Some(at) => self.lab.now().since(at).as_nanos().div_ceil(CYCLE.as_nanos()),
            None => 0,
        };
        let place = describe(self.lab.project(), Claim::of(&finding).site);
        let others = self.lab.open_findings().saturating_sub(1);
        Ok(Some(DemoVerdict { finding, place, fits, cycles, others }))
    }
}

fn verdict_on(lab: &Lab, id: FaultId) -> Option<(FindingReport, Match)> {
    let log = lab.truth();
    let truth = lab.truth_of(id)?;
    let scene = Scene { tree: lab.tree(), host_counters: true, answered_again: false };
    let context = JudgedFault::of(log, log.fault(id)?);
    let diagnosis = lab.diagnosis();
    let (finding, fits) = best_finding(&diagnosis, &truth, &scene, context)?;
    Some((finding.clone(), fits))
}

fn describe(project: &Project, site: Site) -> String {
    let device = |id: DeviceId| project.devices.get(id.index());
    site.describe(|id| device(id).map_or_else(|| id.no().to_string(), |known| known.name.clone()))
}
