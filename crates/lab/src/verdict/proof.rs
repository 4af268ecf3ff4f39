//! Proofs of admitted sets: one line, played once with each cause of a set.
//!
//! What the MainDevice sends and gets, and what its computer notices, is written down with its times; of
//! a set all that must be the same. Two controls keep the proof from being empty: each fault must have
//! acted by the truth log, and what it leaves must differ from a line on which nothing is wrong. What
//! parts the causes ([`Separation`]) must part them here, too.

use std::sync::{Arc, Mutex, PoisonError};

use linesman_diagnosis::observe::{Direction, HostObservation};
use linesman_diagnosis::report::Diagnosis;
use linesman_proto::address::Path;
use linesman_proto::time::Instant;
use linesman_sim::segment_file::SegmentFile;

use super::sets::{AdmittedSet, Play, Separation, Visibility};
use crate::lab::Lab;
use crate::options::{Begin, LabOptions};

/// The line on which all sets are played: two couplers, terminals of two types, two of them twins.
pub const LINE: &str = r#"
name = "proof"
seed = 3

[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
cable_m = 5.0

[[device]]
name = "T1"
type = "EL1008"
on = "K1.B"

[[device]]
name = "T2"
type = "EL2008"
on = "T1.B"

[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
cable_m = 20.0

[[device]]
name = "T4"
type = "EL2004"
on = "K2.B"
serial = 104

[[device]]
name = "T5"
type = "EL2004"
on = "T4.B"
serial = 105
"#;

/// How a play begins of which the equal devices have been built in at each other's place.
pub const EXCHANGED: &str = "# exchanged";

/// How a play begins for which another device was planned in the place of one of the proof's line, with its serial
/// number: `# other T4 X 7`.
pub const OTHER: &str = "# other ";

/// How a play begins on whose line there is nothing behind the first SubDevice that would take its place: the
/// first coupler with its terminals alone.
pub const ALONE: &str = "# alone";

/// Where the second coupler begins, with all that hangs on it.
const SECOND: &str = "\n[[device]]\nname = \"K2\"";

/// When the fault of a play begins, in ms, unless it says so.
const BEGIN_MS: u64 = 3_000;
/// When a line is first looked at on which a fault is there from the start, in ms.
const LOOKED_AT_MS: u64 = 1_000;
/// How long is watched what parts the causes, in ms.
const PARTED_MS: u64 = 3_000;

/// What was seen from the MainDevice's side.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Observed {
    /// A frame, sent or received.
    Frame {
        /// When.
        at: Instant,
        /// Which way.
        direction: Direction,
        /// Through which card.
        path: Path,
        /// Its bytes.
        bytes: Vec<u8>,
    },
    /// Something the host noticed.
    Host(HostObservation),
}

/// What came of a play.
#[derive(Clone, Debug)]
pub struct Played {
    /// All that was seen, in order.
    pub seen: Vec<Observed>,
    /// What is said of it.
    pub diagnosis: Diagnosis,
    /// Whether a fault has acted.
    pub acted: bool,
}

/// How a play is made other than the proof has it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ProofVariation {
    /// By this, if anything.
    pub by: Option<Separation>,
}

/// Plays a line with one cause of a set.
///
/// # Errors
/// What is wrong with the line or the fault, in words.
pub fn play(set: &AdmittedSet, play: &Play, variation: ProofVariation) -> Result<Played, String> {
    let mut until_ms = set.proof.until_ms;
    let mut text = LINE.to_owned();
    let (head, fault) = match play.file.strip_prefix(ALONE) {
        Some(fault) => (LINE.find(SECOND).and_then(|at| LINE.get(..at)).unwrap_or(LINE), fault),
        None => (LINE, play.file),
    };
    text.truncate(head.len());
    let other = play.file.lines().find_map(other_device);
    if let Some((instead_of, name, _)) = other {
        text = text.replace(instead_of, name);
    }
    if play.cause.is_none() || play.file.starts_with(EXCHANGED) {
        // Of two equal devices the other one was built in at each place.
        for (one, other) in [("T4", "T5"), ("104", "105")] {
            text = text.replace(one, "#").replace(other, one).replace('#', other);
        }
    }
    if !play.file.is_empty() {
        text += "\n[[fault]]\n";
        if !fault.trim_start().starts_with("from_ms") {
            text += &format!("from_ms = {BEGIN_MS}\n");
        }
        if play.file.contains("hits") && !play.file.contains("at_ms") {
            // All at once, one frame after the other: the rhythm is the same for all.
            text += &format!("to_ms = {BEGIN_MS}.001\n");
        } else if variation.by == Some(Separation::ByHealing) {
            text += &format!("to_ms = {until_ms}\n");
        }
        text += play.file;
    }
    if variation.by == Some(Separation::ByHealing) {
        until_ms += PARTED_MS;
    }
    let mut file = SegmentFile::parse(&text).map_err(|error| error.to_string())?;
    if let Some((_, name, serial)) = other {
        let known = file.devices.iter_mut().find(|known| known.name == name);
        known.ok_or_else(|| format!("{name} is not in the line"))?.serial = Some(serial);
    }
    if variation.by == Some(Separation::ByAlias) {
        let twins = file.devices.len() - 2;
        for (device, alias) in file.devices[twins..].iter_mut().zip(11..) {
            device.alias = Some(alias);
        }
    }
    let visibility = if variation.by == Some(Separation::ByHost) {
        Visibility::All
    } else {
        set.proof.visibility
    };
    // Of whom nobody was ever seen the line is looked at when all has happened.
    let from_ms = if play.file.starts_with(ALONE) { LOOKED_AT_MS } else { 0 };
    run(&file, visibility, (from_ms, until_ms))
}

/// What a line says that begins as [`OTHER`] does: who is not planned, who is, and his serial number.
fn other_device(line: &str) -> Option<(&str, &str, u32)> {
    let mut words = line.strip_prefix(OTHER)?.split(' ');
    Some((words.next()?, words.next()?, words.next()?.parse().ok()?))
}

fn run(
    file: &SegmentFile,
    visibility: Visibility,
    (from_ms, until_ms): (u64, u64),
) -> Result<Played, String> {
    let host_counters = visibility == Visibility::All;
    // The sets are about devices that nobody knows by number.
    let begin = if from_ms > 0 { Begin::Idle } else { Begin::Run };
    let options = LabOptions { host_counters, serials: false, begin, ..LabOptions::default() };
    let mut lab = Lab::new(file, options).map_err(|error| error.to_string())?;
    lab.run_until(Instant::from_nanos(from_ms * 1_000_000)).map_err(|error| error.to_string())?;
    if begin == Begin::Idle {
        let now = lab.now();
        lab.main_mut().scan(now);
    }
    let seen = Arc::new(Mutex::new(Vec::new()));
    let note = |seen: &Arc<Mutex<Vec<Observed>>>, observed| {
        seen.lock().unwrap_or_else(PoisonError::into_inner).push(observed);
    };
    let frames = Arc::clone(&seen);
    lab.set_tap(Box::new(move |frame| {
        note(
            &frames,
            Observed::Frame {
                at: frame.time,
                direction: frame.direction,
                path: frame.path.unwrap_or(Path::A),
                bytes: frame.bytes.to_vec(),
            },
        );
    }));
    let host = Arc::clone(&seen);
    lab.set_host_tap(Box::new(move |observation| note(&host, Observed::Host(*observation))));
    lab.run_until(Instant::from_nanos(until_ms * 1_000_000)).map_err(|error| error.to_string())?;
    let acted = lab.truth().faults().iter().any(|fault| fault.first_effect.is_some());
    let diagnosis = lab.diagnosis();
    let seen = std::mem::take(&mut *seen.lock().unwrap_or_else(PoisonError::into_inner));
    Ok(Played { seen, diagnosis, acted })
}

/// The first thing in which two plays differ, in words; `None` if they are the same.
#[must_use]
pub fn difference(one: &Played, other: &Played) -> Option<String> {
    let pairs = one.seen.iter().zip(&other.seen);
    let differs = pairs.enumerate().find(|(_, (one, other))| one != other);
    match differs {
        Some((at, (one, other))) => Some(format!("number {at}: {one:?} and {other:?}")),
        None if one.seen.len() == other.seen.len() => None,
        None => Some(format!("{} things and {}", one.seen.len(), other.seen.len())),
    }
}

#[cfg(test)]
mod tests {
    use linesman_diagnosis::report::{AlternativeReport, Severity};

    use super::super::sets;
    use super::*;

    fn plays(set: &AdmittedSet, variation: ProofVariation) -> Vec<Played> {
        set.proof.plays.iter().map(|one| play(set, one, variation).unwrap()).collect()
    }

    const QUIET: Play =
        Play { cause: Some(linesman_config::fault::FaultName::TwinsSwapped), file: "" };

    #[test]
    fn every_cause_of_every_set_leaves_the_same_frames_and_observations() {
        for set in sets::ALL {
            let all = plays(set, ProofVariation::default());
            for (index, played) in all.iter().enumerate() {
                let at = format!("{} {}", set.name, set.proof.plays[index].file);
                let is_sent = |one: &&Observed| {
                    matches!(one, Observed::Frame { direction: Direction::Sent, .. })
                };
                let (count, sent) = (played.seen.len(), played.seen.iter().filter(is_sent).count());
                if std::ptr::eq(*set, &raw const sets::NOBODY) {
                    let came_back = played.seen.iter().any(|one| {
                        matches!(one, Observed::Frame { direction: Direction::Received, .. })
                    });
                    assert!(sent >= 3 && !came_back, "{at}: {sent} requests of {count} in all");
                } else {
                    assert!(count > 1_000, "{at}: the line ran");
                }
                assert_eq!(played.acted, !set.proof.plays[index].file.is_empty(), "{at}");
                assert_eq!(difference(&all[0], played), None, "{at}");
            }
            for cause in set.causes {
                let has = |play: &&Play| play.cause == Some(*cause);
                let plays = set.proof.plays.iter().filter(has).count();
                // Where it is about the place, one cause is played at each of several.
                let most = if set.causes.len() == 1 { set.proof.plays.len() } else { 1 };
                assert!((1..=most).contains(&plays), "{}: {cause}", set.name);
            }
            if !std::ptr::eq(*set, &raw const sets::TWINS) {
                let quiet = play(set, &QUIET, ProofVariation::default()).unwrap();
                assert!(difference(&all[0], &quiet).is_some(), "{}: nothing is seen", set.name);
            }
        }
    }

    #[test]
    fn what_is_said_to_part_them_parts_them() {
        for set in sets::ALL {
            let by = set.proof.separated;
            let least = match by {
                Separation::ByHealing | Separation::ByAlias => set.proof.plays.len(),
                // What the computer drops is parted from the rest.
                Separation::ByHost => 2,
                Separation::ByExchange => continue,
            };
            let all = plays(set, ProofVariation { by: Some(by) });
            let mut kinds: Vec<&Played> = Vec::new();
            for played in &all {
                if kinds.iter().all(|known| difference(known, played).is_some()) {
                    kinds.push(played);
                }
            }
            assert!(kinds.len() >= least, "{}: {} of {least}", set.name, kinds.len());
        }
    }

    #[test]
    fn a_finding_names_the_others_of_its_set_and_says_what_would_tell_them_apart() {
        for set in sets::ALL {
            for one in set.proof.plays {
                let diagnosis = play(set, one, ProofVariation::default()).unwrap().diagnosis;
                let mut findings = diagnosis.findings.iter();
                // Where there is no warning, a note must do so, too.
                let warned = findings.clone().find(|f| f.severity != Severity::Info);
                let warned = warned.or_else(|| findings.next());
                let at = format!("{} {}", set.name, one.file);
                let Some(finding) = warned else {
                    assert_eq!(set.causes.len(), 1, "{at}: nothing was said");
                    continue;
                };
                assert!(set.has(finding.cause), "{at}: {}", finding.cause);
                for cause in set.causes.iter().filter(|cause| **cause != finding.cause) {
                    let other = finding.alternatives.iter().find(|other| other.cause == *cause);
                    let other = other.unwrap_or_else(|| panic!("{at}: {cause} is not named"));
                    assert!(other.told_apart_by.is_some(), "{at}: {cause}");
                }
                // Where it is about the place, each of them is named.
                let places = set.proof.plays.len() / set.causes.len() - 1;
                let same = |other: &&AlternativeReport| other.cause == finding.cause;
                let elsewhere = finding.alternatives.iter().filter(same).count();
                assert!(elsewhere >= places, "{at}: {elsewhere} of {places} other places");
            }
        }
    }
}
