//! Cases with a capture probe: its recording alone is judged, no error counter is read.
//!
//! Plant and fault are drawn as for the score, and plugs of the plant for the channels of the probe. What the
//! recording is said to show is held against the truth by places along the way of the frames: the true place must be
//! in the range that a finding names, and the range may be no wider than the ports of the probe allow.

mod way;

use std::sync::PoisonError;

use linesman_config::fault::FaultName;
use linesman_diagnosis::FrameSeen;
use linesman_diagnosis::observe::Direction;
use linesman_diagnosis::observe::capture_probe::tap::TapWays;
use linesman_diagnosis::report::{Diagnosis, FindingReport, Severity};
use linesman_proto::address::{DeviceId, Network};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet;
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, WKC_LEN};
use linesman_proto::register::ErrorCounters;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Route};
use linesman_sim::seed::{Seed, Stream};

use self::way::{ProbedWay, Spot};
use super::built_in::EarlyEnd;
use super::case::{Case, ScoreOptions};
use super::play::{Active, BRING_UP, CALM, Play};
use crate::verdict::Truth;
use crate::verdict::claim::Claim;

/// Faults of the signal, and of what carries it.
pub const FAULTS: [FaultName; 10] = [
    FaultName::CableDegraded,
    FaultName::EmcNoise,
    FaultName::TransmitterDamaged,
    FaultName::ReceiverDamaged,
    FaultName::DeviceInternal,
    FaultName::NicDamaged,
    FaultName::LinkOpen,
    FaultName::FalseLink,
    FaultName::LinkFlapping,
    FaultName::DeviceOff,
];
/// How often plants are drawn until one has a place for fault and probe.
const ATTEMPTS: u32 = 40;
/// Most channels that are drawn.
const MOST_CHANNELS: u64 = 4;
/// One case in so many has no fault.
const HEALTHY_EVERY: u64 = 8;

/// Result of one seed.
#[derive(Clone, Debug)]
pub struct ProbeCaseReport {
    /// The seed.
    pub seed: u64,
    /// The fault; `None` in a healthy line.
    pub fault: Option<FaultName>,
    /// Place and manner of its action.
    pub entry: String,
    /// SubDevices.
    pub devices: usize,
    /// The plugs at which the probe sat.
    pub places: Vec<String>,
    /// Copies that the probe has recorded, and the damaged ones of them; of a tap, which drops those, the frames that came
    /// damaged to some port, and undamaged to the first one.
    pub copies: [u64; 2],
    /// Judgement of the diagnosis.
    pub outcome: ProbeOutcome,
    /// All that was found.
    pub said: Vec<String>,
}

/// Judgement of the diagnosis of a case.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ProbeOutcome {
    /// It could not be played.
    NotPlayed(String),
    /// Nothing was wrong, and nothing was said.
    Quiet,
    /// Nothing was wrong where something was said.
    FalseAlarm,
    /// The fault left no trace in what the probe saw.
    NotSeen,
    /// The true place is in the range, and the range as narrow as it can be: so many places.
    Right(usize),
    /// The range is too wide, or the place not in it.
    Wrong(String),
}

/// Device that records the frames.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ProbeKind {
    /// A probe that adds a record to each frame, and keeps damaged ones.
    Recording,
    /// The cards of a tap of which the links are told: no records, and damaged frames are dropped.
    Tap,
}

/// Plays the case of a seed with a capture probe.
#[must_use]
pub fn run_probe_case(seed: u64, kind: ProbeKind) -> ProbeCaseReport {
    let mut stream = Seed(seed).stream("capture probe case");
    let is_healthy = stream.below(HEALTHY_EVERY) == 0;
    let fault = stream.pick(&FAULTS).copied().filter(|_| !is_healthy);
    let options =
        ScoreOptions { fault, healthy: is_healthy, capture_only: true, ..ScoreOptions::default() };
    let mut report = ProbeCaseReport {
        seed,
        fault,
        entry: String::new(),
        devices: 0,
        places: Vec::new(),
        copies: [0; 2],
        outcome: ProbeOutcome::NotPlayed("no plant has a place for it".to_owned()),
        said: Vec::new(),
    };
    for attempt in 0..ATTEMPTS {
        let mut case = Case::draw(seed, attempt, &options);
        // In a ring frames do not come back by the link by which they went.
        if case.file.ring.is_some() {
            continue;
        }
        case.background = None;
        let Ok(play) = Play::new(&case, &options) else { continue };
        match (ProbePlay { play, kind, probes: Vec::new() }).run(&mut report, &mut stream) {
            Ok(outcome) => {
                report.outcome = outcome;
                break;
            }
            Err(EarlyEnd::NoPlace) => {}
            Err(EarlyEnd::Failed(why)) => {
                report.outcome = ProbeOutcome::NotPlayed(why);
                break;
            }
        }
    }
    report
}

/// A case that is being played with a probe.
struct ProbePlay<'a> {
    play: Play<'a>,
    kind: ProbeKind,
    /// The plugs of the channels.
    probes: Vec<End>,
}

impl ProbePlay<'_> {
    fn run(
        mut self,
        report: &mut ProbeCaseReport,
        stream: &mut Stream,
    ) -> Result<ProbeOutcome, EarlyEnd> {
        self.choose(stream);
        report.devices = self.play.lab.tree().len();
        report.places = self.probes.iter().map(|end| self.name(*end)).collect();
        self.play.lab.loop_in_probe(&report.places).map_err(|_| EarlyEnd::NoPlace)?;
        self.play.lab.wait_up(BRING_UP)?;
        self.play.up = self.play.lab.now();
        self.play.run(CALM)?;
        let mut active: Vec<Active> = Vec::new();
        if report.fault.is_some() {
            self.play.break_line(&mut active)?;
            self.play.wait(&mut active)?;
        }
        // The last frames come in.
        self.play.run(Span::ms(30))?;
        let diagnosis = self.judge(&mut report.copies);
        let said = with_consequences(&diagnosis.findings).map(|one| self.told(one));
        report.said = said.collect();
        let Some(active) = active.first() else {
            let is_alarm = |finding: &FindingReport| finding.severity != Severity::Info;
            let is_quiet = !diagnosis.findings.iter().any(is_alarm);
            return Ok(if is_quiet { ProbeOutcome::Quiet } else { ProbeOutcome::FalseAlarm });
        };
        report.entry = crate::choice::text(&active.drawn.choice.entry);
        let truth = self.play.truth(active).ok_or(EarlyEnd::NoPlace)?;
        Ok(self.outcome(&truth, &diagnosis, report.copies[1]))
    }

    /// Plugs of the plant, each on a link of its own.
    fn choose(&mut self, stream: &mut Stream) {
        let tree = self.play.lab.segment().tree();
        let mut links: Vec<usize> = (0..tree.links().len()).collect();
        let channels = stream.between(1, MOST_CHANNELS).min(links.len() as u64);
        for _ in 0..channels {
            let link = links.remove(stream.below(links.len() as u64) as usize);
            let link = tree.links()[link];
            self.probes.push(if stream.chance(0.5) { link.upstream } else { link.downstream });
        }
    }

    fn name(&self, end: End) -> String {
        let segment = self.play.lab.segment();
        match end {
            End::MainDevice(_) => "maindevice".to_owned(),
            End::Controller(node, port) => {
                let id = segment.devices().nth(node).unwrap_or(DeviceId(0));
                format!("{}.{port}", segment.name(id))
            }
        }
    }

    /// What is said of the recording of the probe, as of a file.
    fn judge(&mut self, copies: &mut [u64; 2]) -> Diagnosis {
        let recording = std::sync::Arc::clone(&self.play.recording);
        let mut engine = recording.lock().unwrap_or_else(PoisonError::into_inner);
        let tap_places = match self.kind {
            ProbeKind::Recording => Vec::new(),
            ProbeKind::Tap => self.probes.iter().filter_map(|end| self.before(*end)).collect(),
        };
        *engine = linesman_diagnosis::Engine::new(linesman_diagnosis::Setup {
            clock: "virtual".to_owned(),
            tap_places,
            ..Default::default()
        });
        let mut ways = TapWays::default();
        let mut damaged = [0_u64; linesman_proto::esl::PORTS as usize];
        let mut bytes = Vec::new();
        while let Some(seen) = self.play.lab.poll_probe_frame(&mut bytes) {
            copies[0] += 1;
            hide_counters(&mut bytes);
            if let Some(port) = seen.record.port.filter(|_| seen.record.is_damaged()) {
                damaged[usize::from(port)] += 1;
            }
            let seen_as_recorded = FrameSeen {
                network: Network::default(),
                path: None,
                direction: Direction::Unknown,
                time: Instant::from_nanos(seen.record.time_ns),
                number: copies[0],
                fcs: seen.record.is_damaged().then_some(false),
                truncated: false,
                probe: Some(seen.record),
                bytes: &bytes,
            };
            match self.kind {
                ProbeKind::Recording => engine.handle_frame(&seen_as_recorded),
                ProbeKind::Tap if seen.record.is_damaged() => {}
                ProbeKind::Tap => {
                    let mut frame = FrameSeen { probe: None, ..seen_as_recorded };
                    let port = seen.record.port.unwrap_or(0);
                    frame.probe = Some(ways.record(port / 2, u32::from(port), &frame));
                    engine.handle_frame(&frame);
                }
            }
        }
        copies[1] = match self.kind {
            ProbeKind::Recording => damaged.iter().sum(),
            // What comes damaged to the first port was never whole at a tap, and shows nowhere.
            ProbeKind::Tap => {
                let most = damaged.iter().max().copied().unwrap_or(0);
                most.saturating_sub(damaged[self.first_port()])
            }
        };
        engine.finish(Instant::ZERO, true);
        engine.diagnosis()
    }

    /// The port of the probe to which frames come first.
    fn first_port(&self) -> usize {
        let route = Route::intact(self.play.lab.tree());
        let hop =
            |end: &End| route.hops().iter().position(|hop| hop.from == *end || hop.to == *end);
        let channels = self.probes.iter().map(hop).enumerate();
        channels.min_by_key(|(_, hop)| hop.unwrap_or(usize::MAX)).map_or(0, |(at, _)| 2 * at)
    }

    /// SubDevices that frames have passed when they come to the link at an end.
    fn before(&self, end: End) -> Option<u16> {
        let tree = self.play.lab.tree();
        let link = tree.links().get(tree.link_at(end)?)?;
        let position = tree.position(link.downstream.node()?)?;
        u16::try_from(position).ok()
    }

    fn told(&self, finding: &FindingReport) -> String {
        let evidence = finding.evidence.last().map_or("", |evidence| evidence.text.as_str());
        let others = finding.alternatives.len();
        let others = if others == 0 { String::new() } else { format!(" or {others} others") };
        let FindingReport { id, code, cause, place, .. } = finding;
        format!("{code} {cause:?} {place:?}{others} ({id}): {evidence}")
    }

    fn outcome(&self, truth: &Truth, diagnosis: &Diagnosis, damaged: u64) -> ProbeOutcome {
        let way = ProbedWay::of(self.play.lab.tree(), &self.probes);
        let all = || with_consequences(&diagnosis.findings);
        let is_damage = |finding: &&FindingReport| {
            matches!(finding.code.as_str(), "H110" | "H111" | "H112" | "H116")
        };
        let set = |finding: &FindingReport| self.places(finding, &way);
        let of_signal = is_of_signal(truth.name);
        let spots = way.spots(truth);
        if of_signal && damaged == 0 && !all().any(|one| is_damage(&one)) {
            return ProbeOutcome::NotSeen;
        }
        let is_true = |places: &[Spot]| spots.iter().any(|spot| places.contains(&spot.place()));
        if !of_signal {
            return match all().map(set).filter(|places| is_true(places)).map(|all| all.len()).min()
            {
                Some(len) => ProbeOutcome::Right(len),
                None if diagnosis.findings.is_empty() => ProbeOutcome::NotSeen,
                None => ProbeOutcome::Wrong("no finding has the place in its range".to_owned()),
            };
        }
        let mut least = None;
        for finding in all().filter(is_damage) {
            let places = set(finding);
            if !is_true(&places) {
                return ProbeOutcome::Wrong(format!("{} names a range without it", finding.id));
            }
            let mut ideals = spots.iter().filter_map(|spot| way.ideal(*spot));
            let is_narrow = |ideal: Vec<Spot>| places.iter().all(|place| ideal.contains(place));
            if !ideals.any(is_narrow) {
                return ProbeOutcome::Wrong(format!("{} names more than it need", finding.id));
            }
            least = Some(least.map_or(places.len(), |least: usize| least.min(places.len())));
        }
        least.map_or_else(
            || ProbeOutcome::Wrong("damage was seen, and nothing is said".to_owned()),
            ProbeOutcome::Right,
        )
    }

    /// Places that a finding names, first and besides.
    fn places(&self, finding: &FindingReport, way: &ProbedWay) -> Vec<Spot> {
        let naming = |id: DeviceId| self.play.lab.of_plan(id);
        let claims = std::iter::once(Claim::of(finding)).chain(Claim::alternatives(finding));
        claims.flat_map(|claim| way.places(claim.renamed(&naming).site)).collect()
    }
}

const fn is_of_signal(name: FaultName) -> bool {
    matches!(
        name,
        FaultName::CableDegraded
            | FaultName::EmcNoise
            | FaultName::TransmitterDamaged
            | FaultName::ReceiverDamaged
            | FaultName::DeviceInternal
            | FaultName::NicDamaged
    )
}

fn with_consequences(findings: &[FindingReport]) -> impl Iterator<Item = &FindingReport> {
    findings.iter().flat_map(|finding| std::iter::once(finding).chain(&finding.consequences))
}

/// Makes what reads error counters a command that nobody answers.
fn hide_counters(bytes: &mut [u8]) {
    let Some((_, header_at)) = ethernet::locate(bytes) else { return };
    let mut at = header_at + ETHERCAT_HEADER_LEN;
    let counters = ErrorCounters::START.0..ErrorCounters::START.0 + ErrorCounters::LEN as u16;
    while let Some(header) = bytes.get_mut(at..at + DATAGRAM_HEADER_LEN) {
        let ado = u16::from_le_bytes([header[4], header[5]]);
        let length = u16::from_le_bytes([header[6], header[7]]);
        let counter_at = at + DATAGRAM_HEADER_LEN + usize::from(length & 0x07FF);
        let is_logical = Command::from_code(header[0])
            .is_none_or(|command| command.addressing() == Addressing::Logical);
        if !is_logical && counters.contains(&ado) {
            header[0] = 0;
            header[2..6].fill(0);
            if let Some(counter) = bytes.get_mut(counter_at..counter_at + WKC_LEN) {
                counter.fill(0);
            }
        }
        if length & 0x8000 == 0 {
            return;
        }
        at = counter_at + WKC_LEN;
    }
}
