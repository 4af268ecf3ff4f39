//! Sets on drawn cases: where a set made an answer right, the line of that case is played again, once with the fault that
//! was drawn and once with the cause that was named, and every frame and every observation of the host must be the same.
//!
//! Both act in the same form. Faults that destroy symbols, or drop frames, hit the next frame at each moment at which the
//! drawn one acted, on the same directions of links as far as the cause reaches them: a damaged output has one direction,
//! a worn cable two, interference all that were hit. Links and supplies are taken away at the moment of the drawn one.
//! Chance has no part in that but what the seed of the line gives both alike.

#![expect(
    clippy::wildcard_enum_match_arm,
    reason = "each form is for a few causes of the catalogue"
)]

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Arc, Mutex, PoisonError};

use linesman_config::fault::FaultName::{self, *};
use linesman_diagnosis::report::Diagnosis;
use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};
use linesman_sim::segment_file::{FaultEntry, Schedule, Times, Value};
use linesman_sim::truth::{Effect, Entry, FaultId, FaultRecord, Place, TruthLog};
use serde::{Deserialize, Serialize};

use super::built_in::EarlyEnd;
use super::case::{Case, ScoreOptions};
use super::judge::claim;
use super::outcome::FaultOutcome;
use super::play::{Active, Play};
use super::repair_trial::finding_named;
use crate::choice::LineOutline;
use crate::lab::{Lab, LabError};
use crate::verdict::sets::{self, AdmittedSet};
use crate::verdict::{Claim, Hop, Site, Truth};

/// Moments of a fault that are played again: the first ones.
const MOST_MOMENTS: usize = 300;
/// Hits closer than this are one.
const APART: Span = Span::us(5);
/// A hit waits for its frame so long, in ms.
const HIT_MS: f64 = 0.001;

/// Outcome of the plays of one case with the drawn cause and with the one that was named.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct SetTrial {
    /// The set's name.
    pub set: String,
    /// The cause that was named.
    pub cause: FaultName,
    /// Difference between the two plays.
    pub outcome: SetOutcome,
}

/// First difference between the two plays, if there is one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SetOutcome {
    /// None: so many frames and observations were the same.
    Same(u64),
    /// The first one, in words.
    Parted(String),
    /// They were not played, for this reason.
    NotTried(String),
}

/// A case with a fault that has been judged.
#[derive(Clone, Copy)]
struct JudgedCase<'a> {
    case: &'a Case,
    options: &'a ScoreOptions,
    outline: &'a LineOutline<'a>,
    log: &'a TruthLog,
    record: &'a FaultRecord,
    truth: &'a Truth,
    /// The entry as it was drawn.
    drawn: &'a FaultEntry,
}

/// Plays the case with the cause that was named, where a set made the answer right.
pub(super) fn set_trial(
    play: &Play<'_>,
    active: &Active,
    fault: &FaultOutcome,
    diagnosis: &Diagnosis,
) -> Option<SetTrial> {
    let live = fault.live.as_ref().filter(|_| fault.effects > 0 && !fault.is_unseen)?;
    let set = live.fits.cause.set()?;
    let finding = finding_named(diagnosis, &live.finding)?;
    with_other_cause(play, active, set, claim(finding, &|id| id))
}

/// Plays a case with a cause of a set instead of the drawn one.
fn with_other_cause(
    play: &Play<'_>,
    active: &Active,
    set: &'static AdmittedSet,
    claim: Claim,
) -> Option<SetTrial> {
    let (names, cabled) = play.names_and_cables();
    let tree = play.lab.segment().tree();
    let outline = LineOutline { tree, names: &names, cabled: &cabled };
    let judged = JudgedCase {
        case: play.case,
        options: play.options,
        outline: &outline,
        log: play.lab.truth(),
        record: play.lab.truth().fault(active.id)?,
        truth: &play.truth(active)?,
        drawn: &active.drawn.choice.entry,
    };
    Some(try_set(&judged, set, claim))
}

/// Plays the case with both causes.
fn try_set(judged: &JudgedCase<'_>, set: &'static AdmittedSet, claim: Claim) -> SetTrial {
    let outcome = match form(judged, set, claim) {
        Err(why) => SetOutcome::NotTried(why),
        Ok(form) => compare(judged, &form, claim.cause),
    };
    SetTrial { set: set.name.to_owned(), cause: claim.cause, outcome }
}

fn compare(judged: &JudgedCase<'_>, form: &PlayedForm<'_>, named: FaultName) -> SetOutcome {
    let causes = [judged.truth.name, named];
    let entries = causes.map(|cause| form.entries(cause).filter(|entries| !entries.is_empty()));
    let [Some(drawn), Some(named)] = entries else {
        return SetOutcome::NotTried(format!("{named} cannot be put there alone"));
    };
    let plays = [drawn, named].map(|entries| observed(judged.case, judged.options, entries));
    let [drawn, named] = match plays {
        [Ok(drawn), Ok(named)] => [drawn, named],
        [Err(why), _] | [_, Err(why)] => return SetOutcome::NotTried(why),
    };
    if let Some(at) = drawn.iter().zip(&named).position(|(one, other)| one != other) {
        let after = drawn[at].at.max(named[at].at).since(form.began);
        return SetOutcome::Parted(format!("{:.6} s after its begin", after.as_secs_f64()));
    }
    match drawn.len() == named.len() {
        true => SetOutcome::Same(drawn.len() as u64),
        false => SetOutcome::Parted("one play is longer than the other".to_owned()),
    }
}

/// A frame or an observation of the host, in short.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct SeenDigest {
    at: Instant,
    digest: u64,
}

fn digest(at: Instant, what: impl Hash) -> SeenDigest {
    let mut hasher = DefaultHasher::new();
    what.hash(&mut hasher);
    SeenDigest { at, digest: hasher.finish() }
}

/// All that the MainDevice and its computer see of a case with these faults instead of the drawn one.
fn observed(
    case: &Case,
    options: &ScoreOptions,
    entries: Vec<FaultEntry>,
) -> Result<Vec<SeenDigest>, String> {
    let options = ScoreOptions { tries_repairs: false, proves_sets: false, ..*options };
    let failed = |error: EarlyEnd| match error {
        EarlyEnd::NoPlace => "the cause cannot be put there".to_owned(),
        EarlyEnd::Failed(error) => error,
    };
    let mut play = Play::new(case, &options).map_err(failed)?;
    let count = entries.len();
    play.instead = Some(entries);
    let seen: Arc<Mutex<Vec<SeenDigest>>> = Arc::default();
    let note = |seen: &Mutex<Vec<SeenDigest>>, one| {
        seen.lock().unwrap_or_else(PoisonError::into_inner).push(one);
    };
    let frames = Arc::clone(&seen);
    play.lab.set_tap(Box::new(move |frame| {
        let is_sent = format!("{:?} {:?}", frame.direction, frame.path);
        note(&frames, digest(frame.time, (is_sent, frame.bytes)));
    }));
    let host = Arc::clone(&seen);
    play.lab.set_host_tap(Box::new(move |one| {
        note(&host, digest(one.time, format!("{one:?}")));
    }));
    play.run_all().map_err(failed)?;
    let faults = play.lab.truth().faults();
    let acted = faults.iter().rev().take(count).all(|fault| fault.first_effect.is_some());
    if !acted {
        return Err("a fault in this form does nothing".to_owned());
    }
    Ok(std::mem::take(&mut *seen.lock().unwrap_or_else(PoisonError::into_inner)))
}

/// Puts these faults in, and gives the first. Hits of the one fall as those of another that stands at its place.
pub(super) fn put_in_instead(lab: &mut Lab, entries: &[FaultEntry]) -> Result<FaultId, LabError> {
    let mut first = None;
    for (index, entry) in entries.iter().enumerate() {
        let id = lab.inject_with_hits(entry, &format!("hits {index}"))?;
        first = first.or(Some(id));
    }
    Ok(first.unwrap_or(FaultId(0)))
}

/// The drawn fault in a form in which each cause of its set can act.
struct PlayedForm<'a> {
    outline: &'a LineOutline<'a>,
    drawn: &'a FaultEntry,
    truth: &'a Truth,
    began: Instant,
    what: PlayedEffect,
}

/// Effects of the drawn fault, as they are played again.
enum PlayedEffect {
    /// Hits on directions of links, each with its moments; the claim is about the first.
    Hits(Vec<(Hop, Vec<Instant>)>),
    /// Silence of a SubDevice and all behind it.
    Silence(DeviceId),
    /// A link that one end alone has lost.
    OneEnd,
    /// Terminals that fall and start anew.
    Restarts,
}

fn form<'a>(
    judged: &JudgedCase<'a>,
    set: &'static AdmittedSet,
    claim: Claim,
) -> Result<PlayedForm<'a>, String> {
    let (outline, truth) = (judged.outline, judged.truth);
    let began = judged.record.began.ok_or("it never began")?;
    let is = |other: &'static AdmittedSet| std::ptr::eq(set, other);
    let what = if is(&sets::SILENT) {
        PlayedEffect::Silence(silent(outline.tree, truth).ok_or("nobody falls silent by it")?)
    } else if is(&sets::ONE_END) {
        PlayedEffect::OneEnd
    } else if is(&sets::OVERLOAD) {
        PlayedEffect::Restarts
    } else if [
        &sets::SYMBOLS,
        &sets::BOTH_WAYS,
        &sets::FIRST_HOP,
        &sets::LAST_HOP,
        &sets::UNCOUNTED,
    ]
    .iter()
    .any(|other| is(other))
    {
        PlayedEffect::Hits(
            hits(judged, claim).ok_or("it hits nothing at the place that was named")?,
        )
    } else {
        return Err("its causes are there from the start".to_owned());
    };
    Ok(PlayedForm { outline, drawn: judged.drawn, truth, began, what })
}

/// First SubDevice of those that fall silent.
fn silent(tree: &Tree, truth: &Truth) -> Option<DeviceId> {
    use crate::verdict::TruthPlace::{Device, Hop, Host, Link};
    truth.places.iter().find_map(|place| match *place {
        Link(one, other) | Hop(one, other) => match Site::link(tree, one, other) {
            Site::Link { b: Some(End::Controller(behind, _)), .. } => Some(behind),
            Site::Link { .. } | Site::Device(_) | Site::Host | Site::Network => None,
        },
        Device(id) => {
            let is_behind =
                |other: &DeviceId| *other == id || tree.is_downstream_of(other.index(), id.index());
            let all_behind = truth.places.iter().all(|other| match other {
                Device(other) => is_behind(other),
                Link(..) | Hop(..) | Host(_) => false,
            });
            all_behind.then_some(id)
        }
        Host(_) => None,
    })
}

/// Directions that were hit, each with its moments; first the one that the claim is about.
fn hits(judged: &JudgedCase<'_>, claim: Claim) -> Option<Vec<(Hop, Vec<Instant>)>> {
    let tree = judged.outline.tree;
    let mut hops: Vec<(Hop, Vec<Instant>)> = Vec::new();
    for entry in judged.log.entries() {
        let Entry::Effect { at, fault: Some(id), place, effect } = *entry else { continue };
        if id != judged.record.id {
            continue;
        }
        let hop = match (place, effect) {
            (Place::Direction(from, to), Effect::SymbolError) => (from, to),
            (Place::Host(path), Effect::FrameLost { .. }) => {
                let card = End::MainDevice(path);
                let Some(far) = tree.opposite(End::MainDevice(path)) else { continue };
                (far.map(|node| DeviceId(node as u32)), card)
            }
            (_, _) => continue,
        };
        if !judged.truth.sits_on(hop) {
            continue;
        }
        match hops.iter_mut().find(|(known, _)| *known == hop) {
            Some((_, moments)) => moments.push(at),
            None => hops.push((hop, vec![at])),
        }
    }
    for (_, moments) in &mut hops {
        moments.sort_unstable();
        moments.dedup_by(|later, earlier| later.since(*earlier) < APART);
        moments.truncate(MOST_MOMENTS);
    }
    let is_claimed = |(from, to): Hop| match claim.site {
        Site::Link { .. } => Site::hop(tree, from, to).covers(claim.site),
        Site::Device(id) => [from, to].iter().any(|end| end.node() == Some(id)),
        Site::Host => [from, to].iter().any(|end| end.node().is_none()),
        Site::Network => false,
    };
    let first = hops.iter().position(|(hop, _)| is_claimed(*hop))?;
    hops.swap(0, first);
    Some(hops)
}

impl PlayedForm<'_> {
    /// The entries by which a cause acts so; `None` where it cannot.
    fn entries(&self, cause: FaultName) -> Option<Vec<FaultEntry>> {
        let entry = FaultEntry::new(cause).from_to(ms(self.began), None);
        let name = |id: DeviceId| self.outline.name(id.index()).to_owned();
        match &self.what {
            PlayedEffect::Hits(hops) => self.hits(cause, hops),
            PlayedEffect::Silence(id) if cause == LinkOpen => {
                let link = self.outline.tree.links()[self.outline.tree.link_above(id.index())?];
                let [up, down] = [link.upstream, link.downstream].map(|end| self.outline.end(end));
                Some(vec![entry.at(format!("{up}-{down}"))])
            }
            PlayedEffect::Silence(id) if cause == DeviceOff => Some(vec![entry.device(name(*id))]),
            PlayedEffect::Silence(id) if cause == SupplyOff => {
                let tree = self.outline.tree;
                let behind = |node: &&usize| tree.is_downstream_of(**node, id.index());
                let next = tree.order().iter().find(behind)?;
                let devices = vec![name(*id), self.outline.name(*next).to_owned()];
                let entry = FaultEntry { devices: Some(devices), ..entry };
                Some(vec![entry.with("spread_us", 0.0)])
            }
            PlayedEffect::OneEnd => {
                let at = self.drawn.at.as_ref()?.as_slice().first()?;
                // Between two ends it is the way from the MainDevice that is open.
                let entry = match (cause, self.truth.name == FalseLink) {
                    (FalseLink, true) => entry.at(at),
                    (_, _) => entry.at(at.replace('-', ">")),
                };
                Some(vec![match cause {
                    FalseLink => entry.with("far", "without-link"),
                    _ => entry,
                }])
            }
            PlayedEffect::Restarts if cause == EbusOverload => {
                Some(vec![self.drawn.clone().from_to(ms(self.began), None)])
            }
            PlayedEffect::Restarts if cause == BrownOut => {
                let number = |key: &str| self.drawn.parameters.get(key).and_then(Value::as_number);
                let (off, on) = (number("off_ms")?, number("on_ms")?);
                let devices = self.truth.dark.iter().copied().map(name).collect();
                let entry = FaultEntry { devices: Some(devices), ..entry };
                Some(vec![entry.with("dip_ms", off).with("every_ms", off + on)])
            }
            PlayedEffect::Silence(_) | PlayedEffect::Restarts => None,
        }
    }

    fn hits(&self, cause: FaultName, hops: &[(Hop, Vec<Instant>)]) -> Option<Vec<FaultEntry>> {
        let (claimed, _) = hops.first()?;
        let is_of_link = |(from, to): Hop| (from, to) == *claimed || (to, from) == *claimed;
        let reached = hops.iter().filter(|(hop, _)| match cause {
            EmcNoise => true,
            CableDegraded => is_of_link(*hop),
            TransmitterDamaged => hop.0 == claimed.0,
            ReceiverDamaged => hop.1 == claimed.1,
            _ => hop == claimed,
        });
        reached
            .map(|((from, to), moments)| {
                let first = *moments.first()?;
                let after = |at: &Instant| at.since(first).as_nanos() as f64 / 1e6;
                let at_ms = Some(Times::Many(moments.iter().map(after).collect()));
                let schedule = Schedule { at_ms, for_ms: Some(HIT_MS), ..Schedule::default() };
                let [sender, receiver] =
                    [*from, *to].map(|end| self.outline.end(end.map(DeviceId::index)));
                let entry = FaultEntry::new(cause).from_to(ms(first), None).with("hits", 1_u32);
                let entry = match cause {
                    NicDamaged if from.node().is_none() => {
                        entry.at(sender).with("part", "transmitter")
                    }
                    NicDamaged => entry.at(receiver).with("part", "receiver"),
                    HostDrops => entry.at(receiver),
                    _ => entry.at(format!("{sender}>{receiver}")),
                };
                Some(FaultEntry { schedule, ..entry })
            })
            .collect()
    }
}

fn ms(at: Instant) -> f64 {
    at.as_nanos() as f64 / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cable that interference has hit beside others, and what is said of it when it is said to be worn.
    fn one_of_several(seed: u64, cause: FaultName) -> Option<SetOutcome> {
        let options = ScoreOptions { fault: Some(EmcNoise), ..ScoreOptions::default() };
        let case = Case::draw(seed, 0, &options);
        let mut play = Play::calm(&case, &options).ok()?;
        let mut active = Vec::new();
        play.break_line(&mut active).ok()?;
        play.wait(&mut active).ok()?;
        let truth = play.truth(&active[0])?;
        let link = |(from, to): &Hop| Site::link(play.lab.tree(), *from, *to);
        let mut hit = truth.hops.iter().filter(|hop| truth.sits_on(**hop));
        let first = link(hit.next()?);
        hit.find(|hop| link(hop) != first)?;
        let claim = Claim { cause, site: first };
        let set = &sets::BOTH_WAYS;
        with_other_cause(&play, &active[0], set, claim).map(|trial| trial.outcome)
    }

    #[test]
    fn a_cause_that_does_not_reach_all_that_was_hit_leaves_other_frames() {
        let found = (1..40).find_map(|seed| Some((seed, one_of_several(seed, CableDegraded)?)));
        let (seed, cable) = found.unwrap();
        assert!(matches!(cable, SetOutcome::Parted(_)), "{seed}: {cable:?}");
        let noise = one_of_several(seed, EmcNoise).unwrap();
        assert!(matches!(noise, SetOutcome::Same(1_000..)), "{seed}: {noise:?}");
    }
}
