//! Judging a diagnosis: which finding belongs to which fault, and what is left over.

use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{Diagnosis, FindingReport, FindingState};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::Tree;
use linesman_sim::truth::{Effect, Entry, FaultRecord, Place, TruthLog};

use super::sets::{self, AdmittedSet};
use super::{Claim, Match, Naming, Scene, Site, Truth, TruthPlace, matches};

/// The fault of a truth log as it is held against a verdict.
#[must_use]
pub fn truth_of(log: &TruthLog, fault: &FaultRecord) -> Truth {
    let place = |place: &Place| match *place {
        Place::Direction(from, to) => TruthPlace::Hop(from, to),
        Place::Link(one, other) => TruthPlace::Link(one, other),
        Place::Device(id) => TruthPlace::Device(id),
        Place::Host(path) => TruthPlace::Host(path),
    };
    let mut truth = Truth::new(fault.name, fault.places.iter().map(place).collect());
    truth.signals_lost = fault.links_lost;
    for entry in log.entries() {
        let Entry::Effect { fault: Some(id), place, effect, .. } = entry else { continue };
        if *id != fault.id {
            continue;
        }
        match (effect, place) {
            (Effect::SymbolError | Effect::FrameSpoiled { .. }, Place::Direction(from, to)) => {
                if !truth.hops.contains(&(*from, *to)) {
                    truth.hops.push((*from, *to));
                }
            }
            (Effect::PowerLost, Place::Device(id)) => {
                if !truth.dark.contains(id) {
                    truth.dark.push(*id);
                }
            }
            (_, _) => {}
        }
    }
    truth
}

/// When and in what company a fault acted.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct JudgedFault {
    /// When it began.
    pub began: Option<Instant>,
    /// Whether another began with it.
    pub is_shared: bool,
}

impl JudgedFault {
    /// Of a fault of the log.
    #[must_use]
    pub fn of(log: &TruthLog, fault: &FaultRecord) -> Self {
        let together = |other: &&FaultRecord| match (other.began, fault.began) {
            (Some(one), Some(other)) => one.since(other).max(other.since(one)) < TOGETHER,
            (Some(_) | None, _) => false,
        };
        let is_shared = log.faults().iter().filter(together).count() > 1;
        Self { began: fault.began, is_shared }
    }
}

/// Faults that began so close together are one event to whoever reads counters and states in turn.
const TOGETHER: Span = Span::ms(500);

/// The finding that fits a fault best, at its place at least, with how well; open ones are preferred to closed ones. What
/// was over before the fault began is about something else.
///
/// Two faults that begin together may look like one source: interference on several links, a supply
/// that several devices share. Then one of them hangs beneath the other, and has been found there.
#[must_use]
pub fn best_finding<'a>(
    diagnosis: &'a Diagnosis,
    truth: &Truth,
    scene: &Scene<'_>,
    context: JudgedFault,
) -> Option<(&'a FindingReport, Match)> {
    let began = context.began.unwrap_or(Instant::ZERO).as_nanos();
    let of_its_time =
        |finding: &&FindingReport| finding.closed_ns.is_none_or(|closed| closed.0 >= began);
    let is_common = |finding: &&FindingReport| context.is_shared && may_be_common(finding.cause);
    let beneath = diagnosis.findings.iter().filter(is_common).flat_map(|f| &f.consequences);
    let all = diagnosis.findings.iter().chain(beneath);
    let graded = all.filter(of_its_time).map(|finding| {
        let graded = matches(truth, scene, Claim::of(finding));
        (finding, graded)
    });
    graded.filter(|(_, graded)| graded.place.is_right()).max_by_key(|(finding, graded)| {
        (graded.is_right(), finding.state != FindingState::Closed, graded.cause, graded.place)
    })
}

/// Whether a cause may act at several places at once, so that faults which begin together look like it.
#[must_use]
pub fn may_be_common(cause: FaultName) -> bool {
    use FaultName::{BrownOut, DeviceOff, EmcNoise, SupplyOff};
    matches!(cause, EmcNoise | BrownOut | SupplyOff | DeviceOff)
}

/// Causes that a finding names: the first, and the others that it may be.
pub fn may_be(finding: &FindingReport) -> impl Iterator<Item = FaultName> + Clone {
    let others = finding.alternatives.iter().map(|other| other.cause);
    std::iter::once(finding.cause).chain(others)
}

/// Another place leaves the first one open where it is at least half as sure.
const AS_SURE: f64 = 2.0;

/// Whether a finding leaves its place open, and what it leaves holds the right one: another place about as sure as the
/// first, or the network as a whole, for a cause that may be taken for the right one.
#[must_use]
pub fn is_left_open(
    finding: &FindingReport,
    truth: &Truth,
    scene: &Scene<'_>,
    naming: Naming<'_>,
) -> bool {
    let others = Claim::alternatives(finding).zip(&finding.alternatives);
    let has_place = others
        .filter(|(_, other)| other.confidence * AS_SURE >= finding.confidence)
        .any(|(claim, _)| matches(truth, scene, claim.renamed(naming)).place.is_right());
    let is_whole = Claim::of(finding).site == Site::Network;
    let is_kin = |cause: FaultName| {
        let share = |set: &&AdmittedSet| set.has(cause) && set.has(truth.name);
        cause == truth.name || sets::ALL.iter().any(share)
    };
    has_place || (is_whole && may_be(finding).any(is_kin))
}

/// How well a claim fits any of the faults of the run, now or in the past.
#[must_use]
pub fn explains(truths: &[Truth], tree: &Tree, host_counters: bool, claim: Claim) -> Match {
    let mut best = Match::NONE;
    for truth in truths {
        // A finding may have been made while the line was silent, or since.
        for answered_again in [false, true] {
            let scene = Scene { tree, host_counters, answered_again };
            let graded = matches(truth, &scene, claim);
            if (graded.cause, graded.place) > (best.cause, best.place) {
                best = graded;
            }
        }
    }
    best
}
