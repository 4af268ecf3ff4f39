//! Playing a story.

use std::fmt;

use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{Diagnosis, FindingReport, FindingState, Severity, Verdict};
use linesman_proto::address::RegisterAddress;
use linesman_proto::register::SYSTEM_TIME;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment_file::{DescriptionFiles, FaultEntry, SegmentFile};
use linesman_sim::truth::{FaultId, FaultRecord};

use super::parse::{SegmentText, Story};
use super::place;
use super::segment_probe::SegmentProbe;
use super::step::{Expectation, Heal, Step, StepAt, What, Written};
use crate::lab::Lab;
use crate::options::LabOptions;
use crate::verdict::judge::{JudgedFault, best_finding};
use crate::verdict::{Claim, Scene, Site};

/// How long a line may take to be brought up.
const BRING_UP: Span = Span::s(20);
/// A line on which nobody comes nearer to the target for this long is as far up as it gets.
const NO_PROGRESS: Span = Span::s(4);
/// How often an expectation that may take time is looked at.
const LOOK: Span = Span::ms(1);

/// What came of a story.
#[derive(Clone, Debug)]
pub struct StoryReport {
    /// Its title.
    pub title: String,
    /// Each step that was played.
    pub steps: Vec<StepReport>,
    /// Why it could not be played to its end, apart from steps.
    pub trouble: Option<String>,
    /// How long the line took to be up.
    pub up_in: Span,
    /// The last word of the diagnosis.
    pub diagnosis: Option<Diagnosis>,
}

/// What came of a step.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct StepReport {
    /// Line in the story.
    pub line: usize,
    /// As it was written.
    pub text: String,
    /// When it was over, since the line was up.
    pub at: Span,
    /// What was found instead; `None` when it held.
    pub failure: Option<String>,
}

impl StoryReport {
    /// Whether all expectations held.
    #[must_use]
    pub fn held(&self) -> bool {
        self.trouble.is_none() && self.steps.iter().all(|step| step.failure.is_none())
    }
}

impl fmt::Display for StoryReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.title)?;
        for step in &self.steps {
            let mark = if step.failure.is_none() { "ok  " } else { "FAIL" };
            writeln!(
                f,
                "  {mark} line {:>3} at {:>10}  {}",
                step.line,
                step.at.to_string(),
                step.text
            )?;
            for line in step.failure.iter().flat_map(|failure| failure.lines()) {
                writeln!(f, "         {line}")?;
            }
        }
        match &self.trouble {
            Some(trouble) => writeln!(f, "  FAIL {trouble}"),
            None => Ok(()),
        }
    }
}

/// Plays a story; `files` reads the segment file that it names, and those that its segment names,
/// relative to where the story is.
pub fn play(story: &Story, files: &dyn DescriptionFiles) -> StoryReport {
    let mut report = StoryReport {
        title: story.front.title.clone(),
        steps: Vec::new(),
        trouble: None,
        up_in: Span::ZERO,
        diagnosis: None,
    };
    if let Err(trouble) = try_play(story, files, &mut report) {
        report.trouble = Some(trouble);
    }
    report
}

fn try_play(
    story: &Story,
    files: &dyn DescriptionFiles,
    report: &mut StoryReport,
) -> Result<(), String> {
    let text = match &story.segment {
        SegmentText::Inline(text) => text.clone(),
        SegmentText::File(name) => {
            let bytes = files.read(name).map_err(|error| format!("its segment: {error}"))?;
            String::from_utf8(bytes).map_err(|error| format!("{name}: {error}"))?
        }
    };
    let mut file =
        SegmentFile::parse_with(&text, files).map_err(|error| format!("its segment: {error}"))?;
    file.seed.get_or_insert(story.front.seed);
    let mut project = file.project().map_err(|error| format!("its segment: {error}"))?;
    if let Some(choices) = &story.choices {
        project = project.choose(choices).map_err(|error| format!("its project: {error}"))?;
    }
    let first_task = project.tasks.first();
    let options = LabOptions {
        habit: story.front.habit,
        target: story.front.target,
        cycle: first_task.map_or(story.front.cycle, |task| Span::us(u64::from(task.cycle_us))),
        host_counters: story.front.host_counters,
        project: story.front.project,
        log: true,
        ..LabOptions::default()
    };
    let mut lab = Lab::with_project(&file, project, options).map_err(|error| error.to_string())?;
    let (segment_probe, tap) = SegmentProbe::new();
    lab.set_tap(tap);
    let mut story_run = StoryRun { lab, start: Instant::ZERO, faults: Vec::new(), segment_probe };
    // A line that does not come up is for the steps to judge: it may be what the story is about.
    story_run.bring_up()?;
    story_run.start = story_run.lab.now();
    story_run.segment_probe.mark(&story_run.lab);
    report.up_in = story_run.start.since(Instant::ZERO);
    for step in &story.steps {
        let failure = story_run.step(step).err();
        let failed = failure.is_some();
        let at = story_run.lab.now().since(story_run.start);
        report.steps.push(StepReport { line: step.line, text: step.text.clone(), at, failure });
        if failed {
            break;
        }
    }
    report.diagnosis = Some(story_run.lab.diagnosis());
    let unexplained = story_run.lab.audit();
    if unexplained.is_empty() {
        Ok(())
    } else {
        Err(format!("counters moved without a cause in the truth log: {unexplained:?}"))
    }
}

struct StoryRun {
    lab: Lab,
    start: Instant,
    faults: Vec<FaultId>,
    segment_probe: SegmentProbe,
}

impl StoryRun {
    /// Waits until the line is up, or nothing has come of it for a while.
    fn bring_up(&mut self) -> Result<(), String> {
        let mut best = (usize::MAX, self.lab.now());
        let end = |lab: &Lab| {
            let missing = lab.not_up().count();
            if missing < best.0 {
                best = (missing, lab.now());
            }
            let waits = lab.now().since(best.1) > NO_PROGRESS;
            lab.is_up() || lab.failure().is_some() || waits
        };
        let done = self.lab.run_while(BRING_UP, LOOK, end);
        done.map(|_| ()).map_err(|error| error.to_string())
    }

    fn step(&mut self, step: &StepAt) -> Result<(), String> {
        if let Some(at) = step.at {
            self.lab.run_until(self.start + at).map_err(|error| error.to_string())?;
        }
        match &step.step {
            Step::Wait => Ok(()),
            Step::Inject { entry, lasts } => {
                let mut entry: FaultEntry =
                    toml::from_str(entry).map_err(|error| error.to_string())?;
                if let Some(lasts) = lasts {
                    let end = self.lab.now() + *lasts;
                    entry.to_ms = Some(end.as_nanos() as f64 / 1e6);
                }
                self.segment_probe.mark(&self.lab);
                let id = self.lab.inject(&entry).map_err(|error| error.to_string())?;
                self.faults.push(id);
                Ok(())
            }
            Step::Heal(heal) => self.heal(*heal),
            Step::Unplug(device) => {
                self.segment_probe.mark(&self.lab);
                let faults = self.lab.unplug(device).map_err(|error| error.to_string())?;
                self.faults.extend(faults);
                Ok(())
            }
            Step::Plug { device, on } => {
                self.lab.plug(device, on.as_ref()).map_err(|error| error.to_string())
            }
            Step::Write { device, address, value } => self.write(device, *address, value),
            Step::Expect { what, within } => self.expect(what, *within),
        }
    }

    fn write(
        &mut self,
        name: &str,
        address: RegisterAddress,
        value: &Written,
    ) -> Result<(), String> {
        let known = |story_run: &Self, name: &str| {
            let id = place::device(&story_run.lab, name);
            id.ok_or_else(|| format!("no SubDevice of this line is called `{name}`"))
        };
        let bytes = match value {
            Written::Bytes(bytes) => bytes.clone(),
            Written::Now => self.lab.now().as_nanos().to_le_bytes().to_vec(),
            Written::ClockOf(other) => {
                let id = known(self, other)?;
                self.lab.read_register(id, SYSTEM_TIME.address, 8)?
            }
        };
        let id = known(self, name)?;
        self.lab.write_register(id, address, &bytes)
    }

    fn heal(&mut self, heal: Heal) -> Result<(), String> {
        let log = self.lab.truth();
        let chosen: Vec<FaultId> = log
            .faults()
            .iter()
            .filter(|fault| match heal {
                Heal::All => true,
                Heal::Named(name) => fault.name == name,
            })
            .map(|fault| fault.id)
            .collect();
        if chosen.is_empty() {
            return Err("there is no such fault to heal".to_owned());
        }
        for id in chosen {
            self.lab.heal(id);
        }
        Ok(())
    }

    fn expect(&mut self, what: &Expectation, within: Span) -> Result<(), String> {
        if let Expectation::Assertion(assertion) = what {
            self.segment_probe.names(&self.lab, assertion);
        }
        if let Expectation::Object(reading) = what {
            let id = place::device(&self.lab, &reading.device);
            let name = &reading.device;
            let id = id.ok_or_else(|| format!("no SubDevice of this line is called `{name}`"))?;
            return reading.check(id, &mut self.lab);
        }
        let what = self.resolve(what)?;
        let held = self
            .lab
            .run_while(within, LOOK, |lab| holds(&what, lab, &self.segment_probe).is_ok())
            .map_err(|error| error.to_string())?;
        if held { Ok(()) } else { holds(&what, &self.lab, &self.segment_probe) }
    }

    fn resolve<'a>(&self, what: &'a Expectation) -> Result<Resolved<'a>, String> {
        let site = if let Expectation::Finding { place: Some(place), .. }
        | Expectation::Candidate { place, .. } = what
        {
            Some(place::site(&self.lab, place)?)
        } else {
            None
        };
        Ok(Resolved { what, site })
    }
}

struct Resolved<'a> {
    what: &'a Expectation,
    site: Option<Site>,
}

/// Whether an expectation holds now; what is so instead if not.
fn holds(resolved: &Resolved<'_>, lab: &Lab, segment_probe: &SegmentProbe) -> Result<(), String> {
    let diagnosis = lab.diagnosis();
    let check = |held: bool, expected: &str| {
        if held { Ok(()) } else { Err(format!("expected {expected}\n{}", said(&diagnosis))) }
    };
    let real = || diagnosis.findings.iter().filter(|f| f.severity != Severity::Info);
    match resolved.what {
        Expectation::Finding { what, place } => {
            let fits = |finding: &FindingReport| {
                let site = Claim::of(finding).site;
                is(what, finding) && resolved.site.is_none_or(|wanted| wanted.covers(site))
            };
            let expected = format!("a finding {}{}", named(what), at(place.as_deref()));
            check(diagnosis.findings.iter().any(fits), &expected)
        }
        Expectation::Candidate { cause, place } => {
            let fits = |claim: Claim| {
                claim.cause == *cause
                    && resolved.site.is_some_and(|wanted| wanted.covers(claim.site))
            };
            let claims =
                |finding| std::iter::once(Claim::of(finding)).chain(Claim::alternatives(finding));
            let expected = format!("a finding that may be {cause}{}", at(Some(place)));
            check(diagnosis.findings.iter().flat_map(claims).any(fits), &expected)
        }
        Expectation::Verdict(on) => verdict(*on, lab, &diagnosis),
        Expectation::NoFinding(None) => check(real().next().is_none(), "no finding"),
        Expectation::NoFinding(Some(what)) => {
            let expected = format!("no finding {}", named(what));
            check(!diagnosis.findings.iter().any(|finding| is(what, finding)), &expected)
        }
        Expectation::Findings(count) => {
            check(real().count() == *count, &format!("{count} findings, found {}", real().count()))
        }
        Expectation::Healthy => check(diagnosis.verdict == Verdict::Healthy, "a healthy line"),
        Expectation::Inconclusive => {
            check(diagnosis.verdict == Verdict::Inconclusive, "no conclusion")
        }
        Expectation::AllClosed => {
            let all = real().all(|finding| finding.state == FindingState::Closed);
            check(all, "all findings closed")
        }
        Expectation::LineUp => {
            let missing: Vec<String> = lab.not_up().map(|id| lab.state_of(id)).collect();
            let expected =
                format!("all SubDevices in the target state; not there: {}", missing.join(", "));
            check(lab.is_up(), &expected)
        }
        Expectation::Exit(status) => {
            let found = exit_status(&diagnosis);
            check(found == *status, &format!("exit status {status}, found {found}"))
        }
        Expectation::Log { words, told } => segment_probe.logged(words, *told, lab),
        Expectation::Assertion(assertion) => segment_probe.holds(assertion, lab),
        // Reading takes time of its own and is done before.
        Expectation::Object(_) => Ok(()),
    }
}

/// Whether each fault that acts, or the one named, has a finding that fits.
fn verdict(on: Option<FaultName>, lab: &Lab, diagnosis: &Diagnosis) -> Result<(), String> {
    let log = lab.truth();
    let meant = |fault: &&FaultRecord| match on {
        Some(name) => fault.name == name,
        None => fault.is_active(),
    };
    let mut none = true;
    for fault in log.faults().iter().filter(meant) {
        none = false;
        let Some(truth) = lab.truth_of(fault.id) else { continue };
        let host_counters = lab.options().host_counters;
        let fits = [false, true].into_iter().any(|answered_again| {
            // Once it is over and the line is back, memories tell more than silence did.
            let over = !fault.is_active();
            let scene = Scene { tree: lab.tree(), host_counters, answered_again };
            (over || !answered_again)
                && best_finding(diagnosis, &truth, &scene, JudgedFault::of(log, fault))
                    .is_some_and(|(_, fits)| fits.is_right())
        });
        if !fits {
            return Err(format!(
                "expected a finding that fits {} at {:?}\n{}",
                fault.name,
                fault.places,
                said(diagnosis)
            ));
        }
    }
    if none { Err("no fault acts that a verdict could be on".to_owned()) } else { Ok(()) }
}

/// What `diagnose` exits with: 0 healthy, 1 an error or warning even if closed since, 3
/// inconclusive.
#[must_use]
pub fn exit_status(diagnosis: &Diagnosis) -> u8 {
    match diagnosis.verdict {
        Verdict::Healthy => 0,
        Verdict::Faulty => 1,
        Verdict::Inconclusive => 3,
    }
}

fn is(what: &What, finding: &FindingReport) -> bool {
    match what {
        What::Code(code) => finding.code == *code,
        What::Cause(cause) => finding.cause == *cause,
    }
}

fn named(what: &What) -> String {
    match what {
        What::Code(code) => code.clone(),
        What::Cause(cause) => cause.to_string(),
    }
}

fn at(place: Option<&str>) -> String {
    place.map(|place| format!(" at {place}")).unwrap_or_default()
}

/// What the diagnosis says, one line each.
fn said(diagnosis: &Diagnosis) -> String {
    let mut text = format!("verdict: {:?}", diagnosis.verdict).to_lowercase();
    for finding in &diagnosis.findings {
        text += &format!(
            "\n{} {} {} at {}, {:.2}, {}",
            finding.id,
            finding.code,
            finding.cause,
            Claim::of(finding).site,
            finding.confidence,
            life(finding),
        );
        for evidence in finding.evidence.iter().take(3) {
            text += &format!("\n    {}", evidence.text);
        }
        for follows in &finding.consequences {
            let site = Claim::of(follows).site;
            let (id, code, cause) = (&follows.id, &follows.code, follows.cause);
            text += &format!("\n    so: {id} {code} {cause} at {site}, {}", life(follows));
        }
    }
    text
}

/// When a finding was open, in ms of the run.
fn life(finding: &FindingReport) -> String {
    let ms = |ns: u64| format!("{:.1}", ns as f64 / 1e6);
    let closed = finding.closed_ns.map_or_else(|| "now".to_owned(), |closed| ms(closed.0));
    format!("{:?} from {} to {closed} ms", finding.state, ms(finding.opened_ns.0)).to_lowercase()
}
