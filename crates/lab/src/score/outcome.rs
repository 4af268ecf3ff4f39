//! Outcome of one case, and of each of its faults.

use linesman_config::fault::FaultName;
use linesman_diagnosis::report::Diagnosis;
use linesman_proto::time::Span;
use linesman_sim::segment_file::SegmentFile;
use serde::{Deserialize, Serialize};

use super::case::{CaseKind, FaultPair};
use super::judge::{Accusations, Judged};
use super::listen::{HealthyListened, Heard, Listeners};
use super::parts::span_ns;
use super::repair_trial::RepairTrial;
use super::set_trial::SetTrial;
use super::unplayable::Unplayable;

/// Outcome of one seed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CaseReport {
    /// The seed.
    pub seed: u64,
    /// Its kind.
    pub kind: CaseKind,
    /// SubDevices.
    pub devices: usize,
    /// True if it is a ring.
    pub is_ring: bool,
    /// True if forwarded errors are counted, as far as types do.
    pub forwarded: bool,
    /// True if the card's counters were known.
    pub host_counters: bool,
    /// Findings while nothing was wrong, live and in the recording; `None` where the line never was healthy.
    pub healthy: Option<[Accusations; 2]>,
    /// Time in which nothing was wrong, from the start on.
    #[serde(with = "span_ns")]
    pub healthy_for: Span,
    /// What listeners said of it, beside a MainDevice with the habits of others.
    pub healthy_listened: Option<HealthyListened>,
    /// What listeners heard, where that is kept.
    #[serde(skip)]
    pub heard: Vec<Heard>,
    /// Diagnoses at the end, live and of the recording, where they are kept.
    #[serde(skip)]
    pub reports: Option<Box<[Diagnosis; 2]>>,
    /// The plant, where that is kept.
    #[serde(skip)]
    pub plant: Option<Box<SegmentFile>>,
    /// The project of the line as TOML, where that is kept.
    pub project: Option<String>,
    /// Cycle of the process data.
    #[serde(with = "span_ns")]
    pub cycle: Span,
    /// Faults that were drawn for it.
    pub drawn: Vec<FaultName>,
    /// Relation of two faults.
    pub pair: FaultPair,
    /// Its faults.
    pub faults: Vec<FaultOutcome>,
    /// True if another cable had rare errors beside its fault.
    pub has_background: bool,
    /// True if a station of it is a hot connect group.
    pub has_group: bool,
    /// Why it could not be played.
    pub unplayable: Option<Unplayable>,
}

/// Outcome of one fault.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FaultOutcome {
    /// Its name.
    pub name: FaultName,
    /// With place and parameters.
    pub entry: String,
    /// Number of effects in the truth log; without any the case does not count.
    pub effects: u64,
    /// The live diagnosis; `None` when only the recording is judged.
    pub live: Option<Judged>,
    /// The diagnosis of the recording.
    pub capture: Judged,
    /// True if the method of a course finds the place.
    pub baseline: bool,
    /// True if it did so little that a note is the right answer: one frame at most was lost or late, and no link.
    pub is_bearable: bool,
    /// True if nothing that anybody could see tells it from a line as planned.
    pub is_unseen: bool,
    /// True if it is the MainDevice that stops.
    pub is_pause: bool,
    /// What listeners said of it, beside a MainDevice with the habits of others.
    pub listened: Option<Listeners>,
    /// Outcome of the exchanges that were tried; of single faults for which the live diagnosis had an answer.
    pub repair: Option<RepairTrial>,
    /// Whether the cause that was named leaves the same frames, where a set made the answer right and that was tried.
    pub set_trial: Option<SetTrial>,
}

impl CaseReport {
    /// The command that plays it again.
    #[must_use]
    pub fn replay(&self) -> String {
        format!("linesman lab score --seeds {}..{} --list", self.seed, self.seed + 1)
    }
}
