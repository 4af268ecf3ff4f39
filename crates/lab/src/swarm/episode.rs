//! One time something goes wrong: faults are put on the line, looked at, healed, and the line comes
//! back.

use std::sync::{Arc, Mutex, PoisonError};

use linesman_config::fault::FaultName;
use linesman_diagnosis::observe::{Direction, FrameSeen};
use linesman_diagnosis::report::{FindingReport, FindingState, Severity};
use linesman_proto::frame::view::FrameView;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;
use linesman_sim::seed::Stream;
use linesman_sim::truth::{Effect, Entry, FaultId, FaultRecord, Place};

use super::counter::{Kind, Returned, expected};
use super::reach::Reach;
use super::run::{SwarmOptions, cabled};
use crate::choice::{AT_RUN_TIME, Choice, LineOutline, are_apart};
use crate::habit::Habit;
use crate::lab::{Lab, LabError};
use crate::verdict::judge::{JudgedFault, best_finding, explains, is_left_open};
use crate::verdict::{Claim, Match, Naming, Scene, Site, Truth};

/// Slices of time between two checks.
const SLICE: Span = Span::ms(25);
/// How long the line is left alone between two episodes.
const QUIET: Span = Span::ms(3_500);
/// How long a diagnosis may take to see what goes on.
const VERDICT: Span = Span::s(2);

/// What came of an episode.
#[derive(Clone, Debug)]
pub struct EpisodeReport {
    /// The faults, in order of injection.
    pub faults: Vec<FaultOutcome>,
    /// How long the line took to be up again after healing.
    pub recovered_in: Option<Span>,
}

/// What came of one fault.
#[derive(Clone, Debug)]
pub struct FaultOutcome {
    /// What it was.
    pub name: FaultName,
    /// Where, with its parameters.
    pub entry: String,
    /// Whether it had an effect that can be seen from the MainDevice.
    pub had_effect: bool,
    /// What was found, in words, with how well it fits.
    pub found: Option<(String, Match)>,
}

/// Frames as the tap notes them.
type Notes = Arc<Mutex<Vec<Returned>>>;

pub(super) struct Episode<'a> {
    lab: &'a mut Lab,
    options: &'a SwarmOptions,
    host_counters: bool,
    notes: Notes,
    reach: Reach,
    checked: u64,
    violations: Vec<String>,
}

impl<'a> Episode<'a> {
    pub(super) fn new(lab: &'a mut Lab, options: &'a SwarmOptions, host_counters: bool) -> Self {
        let notes = Notes::default();
        lab.set_tap(Box::new(note_into(Arc::clone(&notes))));
        Self {
            lab,
            options,
            host_counters,
            notes,
            reach: Reach::default(),
            checked: 0,
            violations: Vec::new(),
        }
    }

    pub(super) fn counters_checked(&self) -> u64 {
        self.checked
    }

    pub(super) fn play(
        &mut self,
        stream: &mut Stream,
    ) -> Result<(EpisodeReport, Vec<String>), LabError> {
        let choices = self.choose(stream);
        let mut faults = Vec::new();
        for choice in choices {
            match self.lab.inject(&choice.entry) {
                Ok(id) => faults.push((id, choice)),
                Err(error) => self.violation(format!("{}: {error}", choice.text())),
            }
        }
        let lasts = faults.iter().map(|(_, choice)| choice.lasts).max().unwrap_or(Span::ms(100));
        self.run(lasts)?;
        let outcomes = self.judge(&faults)?;
        for (id, _) in &faults {
            self.lab.heal(*id);
        }
        let healed = self.lab.now();
        let recovered_in = self.recover(healed)?;
        self.explain_findings();
        self.audit();
        let report = EpisodeReport { faults: outcomes, recovered_in };
        Ok((report, std::mem::take(&mut self.violations)))
    }

    /// One fault, or two that do not hide each other.
    fn choose(&self, stream: &mut Stream) -> Vec<Choice> {
        let segment = self.lab.segment();
        let tree = segment.tree();
        let names: Vec<String> = (0..tree.len() as u32)
            .map(|n| segment.name(linesman_proto::address::DeviceId(n)).to_owned())
            .collect();
        let cabled = cabled(segment);
        let outline = LineOutline { tree, names: &names, cabled: &cabled };
        let mut draw = || {
            let name = *stream.pick(&AT_RUN_TIME)?;
            outline.choose(name, stream)
        };
        let mut choices: Vec<Choice> = draw().into_iter().collect();
        if let (Some(first), Some(second)) = (choices.first(), draw())
            && stream.chance(0.2)
            && are_apart(tree, first, &second)
        {
            choices.push(second);
        }
        choices
    }

    /// Lets time pass, and checks working counters on the way.
    fn run(&mut self, span: Span) -> Result<(), LabError> {
        let until = self.lab.now() + span;
        while self.lab.now() < until {
            let from = self.lab.now();
            let up_before = self.all_reached_are_up();
            self.lab.run_until((from + SLICE).min(until))?;
            self.reach.update(self.lab.truth());
            let returned =
                std::mem::take(&mut *self.notes.lock().unwrap_or_else(PoisonError::into_inner));
            if self.reach.is_settled(from) {
                let up = up_before && self.all_reached_are_up();
                self.check_counters(&returned, up);
            }
        }
        Ok(())
    }

    fn all_reached_are_up(&self) -> bool {
        let reached = self.reach.reached(self.lab.tree());
        self.lab.not_up().all(|id| !reached[id.index()])
    }

    fn check_counters(&mut self, returned: &[Returned], up: bool) {
        let Some(plan) = self.lab.plan() else { return };
        // In a ring each card's copy is its own part of the whole; only their merge is complete.
        if self.lab.tree().closes_at().is_some() {
            return;
        }
        let reached = self.reach.reached(self.lab.tree());
        let mut wrong = None;
        for note in returned {
            // What a SubDevice serves while it is being set up is its own affair.
            if matches!(note.kind, Kind::Logical(_)) && !up {
                continue;
            }
            let served = |id| reached.get(self.lab.of_plan(id).index()).copied().unwrap_or(false);
            let Some(expected) = expected(note.kind, plan, &reached, served) else { continue };
            self.checked += 1;
            if expected != note.counter {
                wrong = wrong.or(Some((*note, expected)));
            }
        }
        if let Some((note, expected)) = wrong {
            self.violation(format!(
                "working counter {} of {:?} in frame {} at {}, expected {expected}: {} of {} \
                 SubDevices can be reached",
                note.counter,
                note.kind,
                note.frame,
                note.at,
                reached.iter().filter(|reached| **reached).count(),
                reached.len(),
            ));
        }
    }

    /// Holds the diagnosis against each fault, and gives it time to see what it has not yet seen.
    fn judge(&mut self, faults: &[(FaultId, Choice)]) -> Result<Vec<FaultOutcome>, LabError> {
        let until = self.lab.now() + VERDICT;
        loop {
            let outcomes: Vec<FaultOutcome> =
                faults.iter().map(|(id, choice)| self.outcome(*id, choice)).collect();
            let open: Vec<&FaultOutcome> = outcomes
                .iter()
                .filter(|outcome| outcome.had_effect && outcome.found.is_none())
                .collect();
            if open.is_empty() {
                return Ok(outcomes);
            }
            if self.lab.now() >= until && self.listens() {
                return Ok(outcomes);
            }
            if self.lab.now() >= until {
                let said = self.said();
                let missed: Vec<String> = open.iter().map(|open| open.entry.clone()).collect();
                self.violation(format!("no finding for {}; said: {said}", missed.join(" and ")));
                return Ok(outcomes);
            }
            self.run(Span::ms(100))?;
        }
    }

    fn outcome(&self, id: FaultId, choice: &Choice) -> FaultOutcome {
        let mut outcome = FaultOutcome {
            name: choice.name,
            entry: choice.text(),
            had_effect: false,
            found: None,
        };
        let log = self.lab.truth();
        let Some(fault) = log.fault(id) else { return outcome };
        outcome.had_effect = self.can_be_seen(fault);
        let scene = Scene {
            tree: self.lab.tree(),
            host_counters: self.host_counters,

            answered_again: false,
        };
        let diagnosis = self.lab.diagnosis();
        let Some(truth) = self.lab.truth_of(id) else { return outcome };
        if let Some((finding, graded)) =
            best_finding(&diagnosis, &truth, &scene, JudgedFault::of(log, fault))
        {
            let site = Site::from(&finding.place);
            let text = format!("{} {} at {site}", finding.code, finding.cause);
            outcome.found = Some((text, graded));
        }
        outcome
    }

    /// Whether a fault has left a trace that can be read from the MainDevice.
    fn can_be_seen(&self, fault: &FaultRecord) -> bool {
        if fault.links_lost > 0 || fault.supplies_lost > 0 {
            return true;
        }
        // A card counts no symbols; without its counters only what does not come back is seen, and a few
        // frames may get lost on a good line.
        let seen = |place: &Place, effect: &Effect| match place {
            Place::Direction(_, End::MainDevice(_)) | Place::Host(_) => {
                self.host_counters && matches!(effect, Effect::FrameSpoiled { .. })
            }
            Place::Direction(_, End::Controller(..)) | Place::Link(..) | Place::Device(_) => {
                matches!(effect, Effect::FrameSpoiled { .. } | Effect::SymbolError)
            }
        };
        self.lab.truth().entries().iter().any(|entry| match entry {
            Entry::Effect { fault: by, place, effect, .. } => {
                *by == Some(fault.id) && seen(place, effect)
            }
            Entry::Begin { .. } | Entry::End { .. } => false,
        })
    }

    /// Waits until the line is up again.
    fn recover(&mut self, healed: Instant) -> Result<Option<Span>, LabError> {
        let bound = healed + self.options.recovery;
        while !self.lab.is_up() {
            if !self.options.habit.brings_back() {
                self.run(QUIET)?;
                return Ok(None);
            }
            if self.lab.now() >= bound {
                let missing: Vec<String> =
                    self.lab.not_up().map(|id| id.no().to_string()).collect();
                self.violation(format!(
                    "{} after healing these SubDevices are not in the target state: {}",
                    self.options.recovery,
                    missing.join(", ")
                ));
                return Ok(None);
            }
            self.run(SLICE)?;
        }
        let recovered_in = self.lab.now().since(healed);
        self.run(QUIET)?;
        Ok(Some(recovered_in))
    }

    /// Every finding is at a place where something was wrong. How often its cause is right measures the
    /// score.
    fn explain_findings(&mut self) {
        let diagnosis = self.lab.diagnosis();
        let acted = self.lab.truth().faults().iter().filter(|fault| fault.first_effect.is_some());
        let truths: Vec<Truth> = acted.filter_map(|fault| self.lab.truth_of(fault.id)).collect();
        for finding in diagnosis.findings.iter().filter(|f| f.severity != Severity::Info) {
            let by_position = |id| self.lab.of_plan(id);
            let as_planned = |id| id;
            let naming: Naming<'_> = if self.listens() { &by_position } else { &as_planned };
            let claim = Claim::of(finding).renamed(naming);
            let graded = explains(&truths, self.lab.tree(), self.host_counters, claim);
            let is_open = self.listens() && self.is_left_open(finding, &truths, naming);
            if !graded.place.is_right() && !is_open {
                let site = Site::from(&finding.place);
                let faults: Vec<String> =
                    self.lab.truth().faults().iter().map(|fault| fault.name.to_string()).collect();
                self.violation(format!(
                    "{} {} {} at {site} has no fault there (opened at {}: {}); injected so far: {}",
                    finding.id,
                    finding.code,
                    finding.cause,
                    Instant::from_nanos(finding.opened_ns.0),
                    finding.evidence.first().map_or("", |evidence| evidence.text.as_str()),
                    faults.join(", ")
                ));
            }
        }
    }

    /// Whether the diagnosis listens beside a MainDevice with the habits of others.
    fn listens(&self) -> bool {
        self.options.habit != Habit::Own
    }

    /// Whether a finding leaves its place open, and holds that of a fault.
    fn is_left_open(&self, finding: &FindingReport, truths: &[Truth], naming: Naming<'_>) -> bool {
        truths.iter().any(|truth| {
            [false, true].into_iter().any(|answered_again| {
                let host_counters = self.host_counters;
                let scene = Scene { tree: self.lab.tree(), host_counters, answered_again };
                is_left_open(finding, truth, &scene, naming)
            })
        })
    }

    fn audit(&mut self) {
        for hole in self.lab.audit() {
            self.violation(format!(
                "{:?} of {} moved by {}, the log has {} causes",
                hole.counter,
                hole.device.no(),
                hole.moved,
                hole.causes
            ));
        }
    }

    fn said(&self) -> String {
        let diagnosis = self.lab.diagnosis();
        let open = diagnosis.findings.iter().filter(|f| f.state != FindingState::Closed);
        let said: Vec<String> =
            open.map(|f| format!("{} {} at {}", f.code, f.cause, Site::from(&f.place))).collect();
        if said.is_empty() { "nothing".to_owned() } else { said.join("; ") }
    }

    fn violation(&mut self, what: String) {
        // One and the same thing is told once.
        if !self.violations.contains(&what) {
            self.violations.push(format!("at {}: {what}", self.lab.now()));
        }
    }
}

/// A tap that notes the working counters of what comes back.
fn note_into(notes: Notes) -> impl FnMut(&FrameSeen<'_>) + Send {
    move |seen| {
        if seen.direction != Direction::Received {
            return;
        }
        let Ok(view) = FrameView::parse(seen.bytes) else { return };
        let mut notes = notes.lock().unwrap_or_else(PoisonError::into_inner);
        for datagram in view.datagrams().flatten() {
            if let Some(kind) = Kind::of(&datagram) {
                let counter = datagram.wkc().0;
                notes.push(Returned { at: seen.time, frame: seen.number, kind, counter });
            }
        }
    }
}
