//! One case, played: brought up, watched while all is well, broken, judged.

use std::sync::{Arc, Mutex, PoisonError};

use linesman_config::fault::FaultName;
use linesman_config::plan::ClockSettings;
use linesman_config::project::Project;
use linesman_diagnosis::model::reported::PartExchange;
use linesman_diagnosis::observe::{Direction, FrameSeen};
use linesman_diagnosis::report::Diagnosis;
use linesman_diagnosis::{Engine, Setup};
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::Stream;
use linesman_sim::segment_file::{FaultEntry, Value};
use linesman_sim::truth::{FaultId, TruthLog};

use super::baseline::{self, CourseMethod};
use super::built_in::{EarlyEnd, around_extra, with_built_in};
use super::case::{Case, CaseKind, ScoreOptions};
use super::disturb::disturb;
use super::draw::{Drawn, Ends, Offer, When, draw};
use super::effect::{effects, is_bearable, is_harmless};
use super::judge::{Accusations, Candidates, Judged, claim, judge};
use super::outcome::{CaseReport, FaultOutcome};
use super::plant_extras::add_group;
use super::recorder::{SharedRecording, take_down, take_down_host};
use super::repair_trial::{RepairTrial, try_repairs};
use super::set_trial::{put_in_instead, set_trial};
use super::unplayable::Unplayable;
use crate::choice::{LineOutline, are_apart, is_behind, text};
use crate::habit::Habit;
use crate::lab::{Lab, LabError};
use crate::options::LabOptions;
use crate::swarm::run::cabled;
use crate::verdict::judge::JudgedFault;
use crate::verdict::{Grade, Scene, Truth, TruthPlace, matches};

/// How long the bring-up may take.
pub(super) const BRING_UP: Span = Span::s(30);
/// How long the line is watched while nothing is wrong.
pub(super) const CALM: Span = Span::ms(1_500);
/// How long a diagnosis may take after a fault is over, or has lasted its time.
const VERDICT: Span = Span::ms(2_500);
/// How long a line may take to come back.
const RECOVERY: Span = Span::s(8);
/// How long it may take where nobody brings anything back.
const SETTLING: Span = Span::s(1);
/// How much longer a run is listened to, so that who joins late hears enough.
const LISTENED: Span = Span::ms(2_500);
/// From the end of one pause of the MainDevice to the next, in ms.
const BETWEEN_PAUSES_MS: (f64, f64) = (300.0, 1_500.0);
/// How often plants are drawn for a fault that needs a place of its own.
const ATTEMPTS: u32 = 40;

/// Plays the case of a seed.
#[must_use]
pub fn run_case(seed: u64, options: &ScoreOptions) -> CaseReport {
    let mut why = Unplayable::NoPlace(String::new());
    for attempt in 0..ATTEMPTS {
        let case = Case::draw(seed, attempt, options);
        match Play::new(&case, options).and_then(Play::play) {
            Ok(report) => return report,
            Err(EarlyEnd::NoPlace) => {
                let names: Vec<&str> = case.faults.iter().map(|name| name.name()).collect();
                let names = names.join(" and ");
                why = Unplayable::NoPlace(format!("no place for {names} in any plant"));
            }
            Err(EarlyEnd::Failed(error)) => {
                why = Unplayable::NotUp(error);
                break;
            }
        }
    }
    let case = Case::draw(seed, 0, options);
    CaseReport { unplayable: Some(why), ..empty(&case, 0) }
}

/// Plays a case and takes its recording down. Gives the truth, and the project where the recording is judged with
/// one.
pub(super) fn play_taped(
    case: &Case,
    options: &ScoreOptions,
    shared_recording: &SharedRecording,
) -> Result<(CaseReport, TruthLog, Option<Project>), EarlyEnd> {
    let mut play = Play::new(case, options)?;
    let reader = Arc::clone(shared_recording);
    play.lab.set_recorder(Box::new(move |seen| take_down(&reader, seen)));
    let report = play.run_all()?;
    let project = play.has_project.then(|| play.lab.project().clone());
    Ok((report, play.lab.truth().clone(), project))
}

fn empty(case: &Case, devices: usize) -> CaseReport {
    CaseReport {
        seed: case.seed.0,
        kind: case.kind,
        devices,
        is_ring: case.file.ring.is_some(),
        forwarded: case.forwarded,
        host_counters: case.host_counters,
        healthy: None,
        healthy_for: Span::ZERO,
        healthy_listened: None,
        heard: Vec::new(),
        reports: None,
        plant: None,
        project: None,
        cycle: case.cycle,
        drawn: case.faults.clone(),
        pair: case.pair,
        has_background: case.background.is_some(),
        has_group: false,
        faults: Vec::new(),
        unplayable: None,
    }
}

/// A fault that was put in.
pub(super) struct Active {
    pub(super) id: FaultId,
    pub(super) drawn: Drawn,
    until: Instant,
}

/// When something was first said rightly, after the first effect.
#[derive(Clone, Copy, Default)]
pub(super) struct First {
    place: Option<Span>,
    cause: Option<Span>,
}

pub(super) struct Play<'a> {
    pub(super) case: &'a Case,
    pub(super) options: &'a ScoreOptions,
    stream: Stream,
    pub(super) lab: Lab,
    /// What listeners hear, beside a MainDevice with the habits of others.
    pub(super) shared_recording: Option<SharedRecording>,
    /// Since when the line has been up, or broken from the start.
    pub(super) up: Instant,
    /// What reads the recording.
    pub(super) recording: Arc<Mutex<Engine>>,
    /// Faults that are in the line from its making on.
    built_in: Vec<Drawn>,
    /// Whether the recording is judged with the project beside it.
    has_project: bool,
    /// How much goes on beside the faults of the case.
    beside: usize,
    /// The method of a course.
    course: CourseMethod,
    /// What is put in instead of the drawn fault.
    pub(super) instead: Option<Vec<FaultEntry>>,
}

impl<'a> Play<'a> {
    pub(super) fn new(case: &'a Case, options: &'a ScoreOptions) -> Result<Self, EarlyEnd> {
        Self::told(case, options, Vec::new())
    }

    /// The same, with parts that were exchanged before.
    pub(super) fn told(
        case: &'a Case,
        options: &'a ScoreOptions,
        exchanges: Vec<PartExchange>,
    ) -> Result<Self, EarlyEnd> {
        let mut stream = case.seed.stream("score faults");
        let (mut file, built_in) = with_built_in(case, &mut stream)?;
        let mut project = file.project().map_err(|_| EarlyEnd::NoPlace)?;
        if built_in.is_empty() {
            add_group(&mut file, &mut project, &mut case.seed.stream("score group"));
        }
        let lab_options = LabOptions {
            habit: options.habit,
            cycle: case.cycle,
            host_counters: case.host_counters,
            clocks: case.clocks,
            probes: options.judges_live(),
            active: options.judges_live(),
            exchanges,
            ..LabOptions::default()
        };
        // What cannot be built so is no case.
        let lab = Lab::with_project(&file, project, lab_options);
        let mut lab = lab.map_err(|_| EarlyEnd::NoPlace)?;
        let has_project = !built_in.is_empty();
        let setup = Setup {
            project: has_project.then(|| lab.project().clone()),
            clock: "virtual".to_owned(),
            ..Setup::default()
        };
        if let Some(perturb) = options.perturb {
            lab.hide_counters(perturb.unseen(), case.seed.stream("score unseen"));
        }
        let recording = Arc::new(Mutex::new(Engine::new(setup)));
        let reader = Arc::clone(&recording);
        let shared_recording = (options.habit != Habit::Own).then(SharedRecording::default);
        if let Some(shared_recording) = shared_recording.clone() {
            lab.set_host_tap(Box::new(move |seen| take_down_host(&shared_recording, seen)));
        }
        let heard = shared_recording.clone();
        lab.set_recorder(Box::new(move |seen| {
            if let Some(heard) = &heard {
                take_down(heard, seen);
            }
            // As most recordings are: neither cards nor directions are told apart.
            let frame = FrameSeen { path: None, direction: Direction::Unknown, ..*seen };
            reader.lock().unwrap_or_else(PoisonError::into_inner).handle_frame(&frame);
        }));
        let up = Instant::ZERO;
        Ok(Self {
            case,
            options,
            stream,
            lab,
            shared_recording,
            up,
            recording,
            built_in,
            has_project,
            beside: 0,
            course: CourseMethod::default(),
            instead: None,
        })
    }

    fn play(mut self) -> Result<CaseReport, EarlyEnd> {
        self.run_all()
    }

    /// A line that has been up for a while, and on which all is well.
    #[cfg(test)]
    pub(super) fn calm(case: &'a Case, options: &'a ScoreOptions) -> Result<Self, EarlyEnd> {
        let mut play = Self::new(case, options)?;
        play.lab.wait_up(BRING_UP)?;
        play.up = play.lab.now();
        play.run(CALM)?;
        Ok(play)
    }

    pub(super) fn run_all(&mut self) -> Result<CaseReport, EarlyEnd> {
        let mut report = empty(self.case, self.lab.tree().len());
        report.has_group = !self.lab.project().groups.is_empty();
        report.project = self.options.keeps_heard.then(|| self.lab.project().to_toml());
        let mut active: Vec<Active> = Vec::new();
        if self.built_in.is_empty() {
            self.lab.wait_up(BRING_UP)?;
            self.up = self.lab.now();
            self.run(CALM)?;
            if self.case.kind == CaseKind::Healthy {
                let until = self.lab.now() + self.options.healthy_for;
                disturb(&mut self.lab, self.case.cycle, &mut self.stream)?;
                while self.lab.now() < until {
                    let calm = Span::us(self.stream.between(1_000_000, 120_000_000));
                    self.lab.run_until((self.lab.now() + calm).min(until))?;
                    disturb(&mut self.lab, self.case.cycle, &mut self.stream)?;
                }
                self.run(VERDICT)?;
            }
            self.course.clear(&self.lab);
            report.healthy =
                Some([self.lab.diagnosis(), self.recorded()].map(|one| Accusations::of(&one)));
            report.healthy_for = self.lab.now().since(Instant::ZERO);
            report.healthy_listened = self.healthy_listened();
            if self.case.kind == CaseKind::Healthy {
                if self.options.keeps_heard {
                    report.heard = self.heard(None);
                }
                self.keep_reports(&mut report, self.lab.diagnosis(), self.recorded());
                return Ok(report);
            }
            self.break_line(&mut active)?;
        } else {
            self.course.clear(&self.lab);
            for (drawn, id) in std::mem::take(&mut self.built_in).into_iter().zip(0..) {
                let until = self.lab.now() + drawn.choice.lasts;
                // Who joins late finds the line brought up, as far as it comes.
                self.up = self.lab.now() + Span::ns(drawn.choice.lasts.as_nanos() / 2);
                active.push(Active { id: FaultId(id), until, drawn });
            }
        }
        self.wait(&mut active)?;
        let recorded = self.recorded();
        let diagnosis = self.lab.diagnosis();
        let firsts = self.firsts(&active);
        for (at, first) in active.iter().zip(firsts) {
            report.faults.extend(self.outcome(at, &diagnosis, &recorded, first, [None, None]));
        }
        if let ([one, other], [first, second]) = (active.as_slice(), report.faults.as_mut_slice()) {
            let pair = [(one, first), (other, second)];
            self.each_its_own(pair, &diagnosis, &recorded);
        }
        if let ([one], [fault]) = (active.as_slice(), report.faults.as_mut_slice())
            && self.options.tries_repairs
        {
            fault.repair = self.trial(one, fault, &diagnosis);
        }
        if let ([one], [fault]) = (active.as_slice(), report.faults.as_mut_slice())
            && self.options.proves_sets
        {
            fault.set_trial = set_trial(self, one, fault, &diagnosis);
        }
        self.keep_reports(&mut report, diagnosis, recorded);
        if let (true, Some(first)) = (self.options.keeps_heard, active.first()) {
            report.heard = self.heard(self.lab.truth().fault(first.id));
        }
        Ok(report)
    }

    /// Tries repairs of a fault that had an effect and that can be seen.
    fn trial(
        &self,
        active: &Active,
        fault: &FaultOutcome,
        diagnosis: &Diagnosis,
    ) -> Option<RepairTrial> {
        let live = fault.live.as_ref().filter(|_| fault.effects > 0 && !fault.is_unseen)?;
        let truth = self.truth(active)?;
        let first_look = (diagnosis, live.finding.as_str());
        Some(try_repairs(self.case, self.options, &truth, self.lab.tree(), first_look))
    }

    /// Names of the SubDevices, and which links are cables.
    pub(super) fn names_and_cables(&self) -> (Vec<String>, Vec<bool>) {
        let segment = self.lab.segment();
        let names = segment.devices().map(|id| segment.name(id).to_owned()).collect();
        (names, cabled(segment))
    }

    /// The live diagnosis at the end.
    pub(super) fn live_diagnosis(&mut self) -> Result<Diagnosis, EarlyEnd> {
        self.run_all()?;
        Ok(self.lab.diagnosis())
    }

    fn keep_reports(&self, report: &mut CaseReport, live: Diagnosis, recorded: Diagnosis) {
        if self.options.keeps_reports {
            report.plant = Some(Box::new(self.case.file.clone()));
            report.reports = Some(Box::new([live, recorded]));
        }
    }

    pub(super) fn run(&mut self, span: Span) -> Result<(), LabError> {
        self.lab.run_until(self.lab.now() + span)
    }

    /// Puts the faults in, one a while after the other, or at one moment.
    pub(super) fn break_line(&mut self, active: &mut Vec<Active>) -> Result<(), EarlyEnd> {
        let beside = self.options.perturb.and_then(|perturb| perturb.beside(&mut self.stream));
        if let Some(entry) = beside {
            self.lab.inject(&entry).map_err(|_| EarlyEnd::NoPlace)?;
            self.beside = 1;
        }
        let pause = Span::us(self.stream.between(0, 200_000));
        self.run(pause)?;
        let mut drawn: Vec<Drawn> = Vec::new();
        for name in self.case.faults.clone() {
            let mut one = self.draw(name, &drawn)?;
            if self.options.habit != Habit::Own {
                repeat_pauses(&mut one.choice.entry, &mut self.case.seed.stream("score pauses"));
            }
            if let Some(perturb) = self.options.perturb {
                perturb.fault(&mut one.choice.entry, &mut self.stream);
            }
            drawn.push(one);
        }
        let hidden_until = self.part(&mut drawn);
        self.add_background(&drawn)?;
        for (one, hidden) in drawn.into_iter().zip(hidden_until) {
            if !active.is_empty() {
                self.run(self.case.pair.apart)?;
            }
            self.burst(&one)?;
            let mut entry = one.choice.entry.clone();
            let until = self.lab.now() + hidden + one.choice.lasts;
            if entry.parameters.contains_key("hits") {
                // So many in just this time.
                let from = self.lab.now() + hidden + Span::ms(1);
                let ms = |at: Instant| at.as_nanos() as f64 / 1e6;
                entry = entry.from_to(ms(from), Some(ms(until)));
            }
            let id = match self.instead.take() {
                None => self.lab.inject(&entry),
                Some(entries) => put_in_instead(&mut self.lab, &entries),
            };
            // What chance has put together wrongly is no case.
            let id = id.map_err(|_| EarlyEnd::NoPlace)?;
            active.push(Active { id, drawn: one, until });
        }
        Ok(())
    }

    /// Noise at the place of a fault shortly before it, where plants are drawn so.
    fn burst(&mut self, drawn: &Drawn) -> Result<(), EarlyEnd> {
        let Some(perturb) = self.options.perturb else { return Ok(()) };
        let Some((entry, lasts)) = perturb.before(&drawn.choice.entry, &mut self.stream) else {
            return Ok(());
        };
        let id = self.lab.inject(&entry).map_err(|_| EarlyEnd::NoPlace)?;
        self.run(lasts)?;
        self.lab.heal(id);
        Ok(())
    }

    /// Lets each of two faults be seen: an outage before the other one is healed, and the one behind it acts on
    /// until the line is back. Gives by fault how long it is hidden.
    fn part(&self, drawn: &mut [Drawn]) -> Vec<Span> {
        let mut hidden = vec![Span::ZERO; drawn.len()];
        let tree = self.lab.tree();
        for (outage, behind) in [(0, 1), (1, 0)] {
            let (Some(before), Some(after)) = (drawn.get(outage), drawn.get(behind)) else {
                continue;
            };
            let breaks = matches!(before.choice.name, FaultName::LinkOpen | FaultName::DeviceOff);
            if breaks && is_behind(tree, &after.choice, &before.choice) {
                hidden[behind] = before.choice.lasts + self.case.pair.apart + RECOVERY;
                drawn[outage].ends = Ends::Healed;
            }
        }
        hidden
    }

    /// Errors that are too rare to matter, on a cable that has none of the faults.
    fn add_background(&mut self, drawn: &[Drawn]) -> Result<(), EarlyEnd> {
        let Some(rate) = self.case.background else { return Ok(()) };
        let (names, cabled) = self.names_and_cables();
        let tree = self.lab.segment().tree();
        let outline = LineOutline { tree, names: &names, cabled: &cabled };
        let choice = outline.choose(FaultName::CableDegraded, &mut self.stream);
        let Some(choice) = choice else { return Ok(()) };
        if drawn.iter().any(|one| one.choice.link == choice.link) {
            return Ok(());
        }
        let entry = choice.entry.with("hits_per_s", (rate * 100.0).round() / 100.0);
        self.lab.inject(&entry).map_err(|_| EarlyEnd::NoPlace)?;
        self.beside += 1;
        Ok(())
    }

    fn draw(&mut self, name: FaultName, others: &[Drawn]) -> Result<Drawn, EarlyEnd> {
        let (names, cabled) = self.names_and_cables();
        let tree = self.lab.segment().tree();
        let outline = LineOutline { tree, names: &names, cabled: &cabled };
        let plan = self.lab.plan();
        let clocked: Vec<DeviceId> = plan
            .into_iter()
            .flat_map(|plan| &plan.devices)
            .filter(|device| device.settings.clock.is_some())
            .map(|device| self.lab.of_plan(device.id))
            .collect();
        let reference = plan.and_then(|plan| plan.reference_clock()).map(|id| self.lab.of_plan(id));
        let offer = Offer {
            outline: &outline,
            file: &self.case.file,
            clocked: &clocked,
            reference,
            when: When::Running,
        };
        for _ in 0..10 {
            let drawn = draw(name, &offer, &mut self.stream);
            let is_in_line = self.case.pair.is_in_line;
            let fits = |drawn: &Drawn| {
                let (tree, new) = (outline.tree, &drawn.choice);
                others.iter().all(|other| {
                    let other = &other.choice;
                    match is_in_line {
                        true => is_behind(tree, new, other) || is_behind(tree, other, new),
                        false => are_apart(tree, other, new),
                    }
                })
            };
            if let Some(drawn) = drawn.filter(fits) {
                return Ok(drawn);
            }
        }
        Err(EarlyEnd::NoPlace)
    }

    /// Lets the faults act, end, and be seen.
    pub(super) fn wait(&mut self, active: &mut [Active]) -> Result<(), EarlyEnd> {
        let mut order: Vec<usize> = (0..active.len()).collect();
        order.sort_by_key(|index| active[*index].until);
        for index in order {
            let Active { id, drawn, until } = &active[index];
            if let Some(asked) = drawn.asks {
                self.ask(asked, *until)?;
            }
            self.lab.run_until(self.lab.now().max(*until))?;
            if drawn.ends == Ends::Healed {
                self.lab.heal(*id);
            }
        }
        let is_for_ever = |active: &Active| active.drawn.ends == Ends::Never;
        if !active.iter().any(is_for_ever) {
            let within = if self.options.habit.brings_back() { RECOVERY } else { SETTLING };
            self.lab.run_while(within, Span::ms(20), Lab::is_up)?;
        }
        self.run(VERDICT)?;
        if self.options.habit != Habit::Own {
            self.run(LISTENED)?;
        }
        Ok(())
    }

    /// The application asks a mailbox now and then.
    fn ask(&mut self, asked: DeviceId, until: Instant) -> Result<(), LabError> {
        for _ in 0..3 {
            if self.lab.now() >= until {
                break;
            }
            self.lab.read_object(asked, ObjectAddress::new(0x1018, 1))?;
            self.run(Span::ms(50))?;
        }
        Ok(())
    }

    /// What is said of the recording, if it ended here.
    fn recorded(&self) -> Diagnosis {
        let mut engine = self.recording.lock().unwrap_or_else(PoisonError::into_inner).clone();
        // Its recorder notes when it ended, as `--record`, `capture record` and dumpcap do.
        engine.finish(self.lab.now(), true);
        engine.diagnosis()
    }

    /// By fault: when the live diagnosis first named its place, and its cause, after the first effect.
    fn firsts(&mut self, active: &[Active]) -> Vec<First> {
        let events: Vec<_> = std::iter::from_fn(|| self.lab.poll_finding_event()).collect();
        let of = |active: &Active| {
            let mut first = First::default();
            let Some(began) =
                self.lab.truth().fault(active.id).and_then(|fault| fault.first_effect)
            else {
                return first;
            };
            let Some(truth) = self.truth(active) else { return first };
            let mut truths = vec![(truth.clone(), true), (truth.clone(), false)];
            if matches!(truth.name, FaultName::BrownOut | FaultName::EbusOverload) {
                // While it lasts, a dip is a device without power.
                let dark = truth.dark.iter().map(|id| TruthPlace::Device(*id)).collect();
                truths.push((Truth::new(FaultName::DeviceOff, dark), false));
            }
            for event in events.iter().filter(|event| event.at >= began) {
                let claim = claim(&event.finding, &|id| id);
                for (truth, answered_again) in &truths {
                    let scene = Scene {
                        tree: self.lab.tree(),
                        host_counters: self.case.host_counters,
                        answered_again: *answered_again,
                    };
                    let fits = matches(truth, &scene, claim);
                    let after = Some(event.at.since(began));
                    first.place = first.place.or(after.filter(|_| fits.place != Grade::Wrong));
                    first.cause = first.cause.or(after.filter(|_| fits.cause != Grade::Wrong));
                }
            }
            first
        };
        active.iter().map(of).collect()
    }

    pub(super) fn truth(&self, active: &Active) -> Option<Truth> {
        let mut truth = self.lab.truth_of(active.id)?;
        // A contact that opened once is an opened link, whatever it would have done next.
        if truth.name == FaultName::LinkFlapping && truth.opened_once() && truth.signals_lost > 0 {
            truth.name =
                if self.is_of_ring(&truth) { FaultName::RingOpen } else { FaultName::LinkOpen };
        }
        // Who was put in between is also told by whom it has pushed on.
        if truth.name == FaultName::DeviceExtra
            && let Some((pushed, equals)) =
                around_extra(self.lab.project(), self.lab.tree(), &active.drawn.choice.entry)
        {
            truth.places.extend(pushed.map(TruthPlace::Device));
            truth.equals = equals;
        }
        Some(truth)
    }

    /// Whether a fault sits on a link of the ring.
    fn is_of_ring(&self, truth: &Truth) -> bool {
        let tree = self.lab.tree();
        truth.places.iter().any(|place| match place {
            TruthPlace::Link(end, _) | TruthPlace::Hop(end, _) => {
                let link = tree.link_at(end.map(DeviceId::index));
                link.is_some_and(|link| tree.is_on_ring(link))
            }
            TruthPlace::Device(_) | TruthPlace::Host(_) => false,
        })
    }

    /// True if a SubDevice is planned to work in step with a SYNC signal; with a hot connect group none is.
    fn keeps_step(&self) -> bool {
        let devices = self.lab.plan().into_iter().flat_map(|plan| &plan.devices);
        devices.filter_map(|device| device.settings.clock.as_ref()).any(ClockSettings::sync0)
    }

    pub(super) fn outcome(
        &self,
        active: &Active,
        live: &Diagnosis,
        recorded: &Diagnosis,
        first: First,
        [taken_live, taken_recorded]: [Option<&str>; 2],
    ) -> Option<FaultOutcome> {
        let record = self.lab.truth().fault(active.id)?;
        let entry = &active.drawn.choice.entry;
        let truth = self.truth(active)?;
        let all: Vec<Truth> = self
            .lab
            .truth()
            .faults()
            .iter()
            .filter_map(|fault| self.lab.truth_of(fault.id))
            .chain([truth.clone()])
            .collect();
        let tree = self.lab.tree();
        let answered_again = self.lab.reached().len() >= tree.len();
        let host_counters = self.case.host_counters;
        let scene = Scene { tree, host_counters, answered_again };
        let context = JudgedFault::of(self.lab.truth(), record);
        let among = self.case.faults.len().max(1) + self.beside;
        let when = |taken| Candidates { context, among, taken };
        let cycle = self.case.cycle.as_nanos().max(1);
        let cycles = first.place.map(|after| after.as_nanos().div_ceil(cycle));
        let live = self.options.judges_live().then(|| Judged {
            cycles,
            named_after: first.cause,
            ..judge(live, &truth, &all, &scene, when(taken_live), &|id| id)
        });
        let by_position = |id: DeviceId| self.lab.of_plan(id);
        let as_planned = |id: DeviceId| id;
        let naming: &dyn Fn(DeviceId) -> DeviceId =
            if self.has_project { &as_planned } else { &by_position };
        let heard_scene = scene;
        let scene = Scene { host_counters: false, ..scene };
        let capture = judge(recorded, &truth, &all, &scene, when(taken_recorded), naming);
        let baseline = self.course.place(&self.lab);
        let is_pause = truth.name == FaultName::WatchdogStarved
            && truth.places.iter().any(|place| matches!(place, TruthPlace::Host(_)));
        let is_single = self.case.faults.len() + self.beside == 1;
        let listened =
            is_single.then(|| self.listened(record, &truth, &all, &heard_scene)).flatten();
        Some(FaultOutcome {
            name: truth.name,
            entry: text(&active.drawn.choice.entry),
            effects: match is_harmless(&self.lab, record, entry, self.case.cycle) {
                true => 0,
                false => effects(&self.lab, record),
            },
            live,
            capture,
            baseline: baseline.is_some_and(|site| baseline::is_right(site, &truth, tree)),
            is_bearable: is_bearable(
                &self.lab,
                record,
                entry,
                self.keeps_step().then_some(self.case.cycle),
            ),
            is_unseen: truth.unseen.is_some(),
            is_pause,
            listened,
            repair: None,
            set_trial: None,
        })
    }
}

/// Lets a MainDevice that stops do so again and again, in half of the cases.
fn repeat_pauses(entry: &mut FaultEntry, stream: &mut Stream) {
    let pause = entry.parameters.get("pause_ms").and_then(Value::as_number);
    if let Some(pause) = pause
        && stream.chance(0.5)
    {
        let (least, most) = BETWEEN_PAUSES_MS;
        let every = (pause + stream.log_uniform(least, most)).round();
        *entry = entry.clone().with("every_ms", every);
    }
}
