//! Excerpts of recordings: lines that break, recorded, and the recording cut at random, as those are that
//! people bring along. The verdict on an excerpt is held against the truth log: nobody may call a line healthy
//! whose fault acted inside the excerpt and left a trace there, or whose kind of fault could not be judged.

mod cut;

use std::sync::PoisonError;

use linesman_config::fault::FaultName;
use linesman_config::project::Project;
use linesman_diagnosis::coverage::{Extent, InputKind};
use linesman_diagnosis::observe::{Direction, FrameSeen};
use linesman_diagnosis::report::{Diagnosis, Verdict};
use linesman_diagnosis::{Coverage, Engine, Setup};
use linesman_proto::time::Instant;
use linesman_sim::truth::{Effect, Entry, FaultId, TruthLog};

use super::case::{Case, CaseKind, ScoreOptions};
use super::judge::Accusations;
use super::listen::leaves_a_state;
use super::play::play_taped;
use super::recorder::{RecordedFrame, SharedRecording};
use super::trace;

pub use super::trace::Trace;
pub use cut::Cut;

/// Choices for excerpts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ExcerptOptions {
    /// Nothing is wrong in any case.
    pub healthy: bool,
    /// Only this fault.
    pub fault: Option<FaultName>,
}

/// A fault of the run, as far as the excerpt could show it.
#[derive(Clone, PartialEq, Debug)]
pub struct ActedFault {
    /// Which.
    pub name: FaultName,
    /// Whether it acted between the first and the last frame of the excerpt.
    pub acted: bool,
    /// How far faults of its kind were judged.
    pub extent: Extent,
}

/// What came of one excerpt.
#[derive(Clone, PartialEq, Debug)]
pub struct ExcerptReport {
    /// The seed.
    pub seed: u64,
    /// What was cut off.
    pub cut: Cut,
    /// Frames that were left.
    pub frames: u64,
    /// The faults of the run.
    pub faults: Vec<ActedFault>,
    /// What was said of the excerpt.
    pub verdict: Verdict,
    /// Findings of the excerpt, notes left out.
    pub findings: Vec<String>,
    /// What kept the excerpt from being called healthy.
    pub missing: Vec<String>,
    /// Signs of trouble that the frames hold, found without the diagnosis.
    pub traces: Vec<Trace>,
}

/// A judgement of a verdict.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Fairness {
    /// The fault was found, or the verdict left open.
    Right,
    /// Called healthy; the kind of fault was judged, everywhere or in part, and the frames hold no trace of it.
    NoTrace,
    /// Called healthy; the kind of fault was not judged, as the coverage says, and the frames hold no trace of it.
    NotJudged,
    /// Called healthy though the frames hold a trace of trouble.
    Wrong,
}

impl ExcerptReport {
    /// Whether a fault acted inside the excerpt.
    #[must_use]
    pub fn has_acted(&self) -> bool {
        self.faults.iter().any(|fault| fault.acted)
    }

    /// Whether the verdict may stand.
    #[must_use]
    pub fn fairness(&self) -> Fairness {
        if self.verdict != Verdict::Healthy || !self.has_acted() {
            return Fairness::Right;
        }
        if !self.traces.is_empty() {
            return Fairness::Wrong;
        }
        let acted = self.faults.iter().filter(|fault| fault.acted);
        let least = acted.map(|fault| fault.extent).min();
        if least == Some(Extent::NotJudged) { Fairness::NotJudged } else { Fairness::NoTrace }
    }
}

/// Plays the case of a seed, records it, cuts the recording and judges what is left; `None` where the case cannot
/// be played.
#[must_use]
pub fn run_excerpt(seed: u64, options: &ExcerptOptions) -> Option<ExcerptReport> {
    let taped = taped(seed, options)?;
    let mut stream = taped.case.seed.stream("excerpt");
    let cut = Cut::draw(&taped.frames, &mut stream);
    let frames = cut.apply(&taped.frames, &mut stream);
    Some(judge(&taped, cut, &frames))
}

/// The frames of an excerpt, or of the recording that it is taken from, as a recorder keeps them: the time, the bytes
/// that are left, the length on the line.
#[must_use]
pub fn excerpt_frames(
    seed: u64,
    options: &ExcerptOptions,
    whole: bool,
) -> Vec<(Instant, Vec<u8>, usize)> {
    let Some(taped) = taped(seed, options) else { return Vec::new() };
    let mut stream = taped.case.seed.stream("excerpt");
    let cut = Cut::draw(&taped.frames, &mut stream);
    let cut = if whole { Cut::none(&taped.frames) } else { cut };
    let frames = cut.apply(&taped.frames, &mut stream).into_iter().map(|mut frame| {
        let len = frame.bytes.len();
        frame.bytes.truncate(cut.snap.unwrap_or(len));
        (frame.time, frame.bytes, len)
    });
    frames.collect()
}

/// A case with its recording and its truth.
struct RecordedCase {
    case: Case,
    frames: Vec<RecordedFrame>,
    truth: TruthLog,
    project: Option<Project>,
}

fn taped(seed: u64, options: &ExcerptOptions) -> Option<RecordedCase> {
    let score =
        ScoreOptions { healthy: options.healthy, fault: options.fault, ..ScoreOptions::default() };
    for attempt in 0..8 {
        let case = Case::draw(seed, attempt, &score);
        if case.kind == CaseKind::Healthy && !options.healthy {
            return None;
        }
        let shared_recording = SharedRecording::default();
        let Ok((_, truth, project)) = play_taped(&case, &score, &shared_recording) else {
            continue;
        };
        let recording =
            std::mem::take(&mut *shared_recording.lock().unwrap_or_else(PoisonError::into_inner));
        let frames = recording.frames;
        return Some(RecordedCase { case, frames, truth, project });
    }
    None
}

fn judge(taped: &RecordedCase, cut: Cut, frames: &[RecordedFrame]) -> ExcerptReport {
    let setup = Setup {
        project: taped.project.clone(),
        input: InputKind::Recorded,
        clock: "virtual".to_owned(),
        ..Setup::default()
    };
    let mut engine = Engine::new(setup);
    for (frame, number) in frames.iter().zip(1..) {
        let kept = cut.snap.map_or(frame.bytes.len(), |snap| snap.min(frame.bytes.len()));
        engine.handle_frame(&FrameSeen {
            network: linesman_proto::address::Network(0),
            path: None,
            direction: Direction::Unknown,
            time: frame.time,
            number,
            fcs: frame.fcs,
            truncated: kept < frame.bytes.len(),
            probe: None,
            bytes: &frame.bytes[..kept],
        });
    }
    engine.finish(Instant::ZERO, true);
    let diagnosis: Diagnosis = engine.diagnosis();
    let coverage = engine.coverage();
    let within = frames.first().zip(frames.last()).map(|(first, last)| (first.time, last.time));
    // What is done to a healthy line is no fault.
    let is_fault = taped.case.kind != CaseKind::Healthy;
    let faults = taped.truth.faults().iter().filter(|fault| is_fault && fault.began.is_some());
    let faults = faults.map(|fault| acted(&taped.truth, fault.id, within, &coverage)).collect();
    ExcerptReport {
        seed: taped.case.seed.0,
        cut,
        frames: frames.len() as u64,
        faults,
        verdict: diagnosis.verdict,
        findings: Accusations::of(&diagnosis).alarms,
        missing: diagnosis.coverage.essential_gaps().map(|gap| gap.text.clone()).collect(),
        traces: trace::find(&taped.frames, frames, cut.snap),
    }
}

fn acted(
    truth: &TruthLog,
    id: FaultId,
    within: Option<(Instant, Instant)>,
    coverage: &Coverage,
) -> ActedFault {
    let name = truth.fault(id).map_or(FaultName::LinkOpen, |fault| fault.name);
    let is_in = |at: Instant| within.is_some_and(|(from, to)| from <= at && at <= to);
    let effects = truth.entries().iter().filter_map(|entry| match entry {
        Entry::Effect { at, fault: Some(fault), effect, .. } if *fault == id => {
            Some((*at, *effect))
        }
        Entry::Effect { .. } | Entry::Begin { .. } | Entry::End { .. } => None,
    });
    let acted = effects.clone().any(|(at, _)| is_in(at)) || lasts(truth, id, effects, within);
    ActedFault { name, acted, extent: coverage.extent_of(name) }
}

/// Whether something that the fault did before the excerpt began still held in it.
fn lasts(
    truth: &TruthLog,
    id: FaultId,
    effects: impl Iterator<Item = (Instant, Effect)>,
    within: Option<(Instant, Instant)>,
) -> bool {
    let Some((from, to)) = within else { return false };
    let ended = truth.fault(id).and_then(|fault| fault.ended);
    effects.into_iter().any(|(at, effect)| {
        leaves_a_state(effect) && at <= to && ended.is_none_or(|ended| ended >= from)
    })
}
