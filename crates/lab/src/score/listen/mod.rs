//! Listeners beside a MainDevice with the habits of others: one from the start, one that joins while the fault acts, one
//! that joins after it, each without and with the project.
//!
//! They are played after the run, from what the cards of the MainDevice were shown to have sent and received, and from
//! what its computer observed: exactly what `diagnose listen:` on that computer is given.

mod case;
mod join;
mod judge;
mod play;
pub mod report;
pub(super) mod tally;

use linesman_diagnosis::report::Verdict;
use serde::{Deserialize, Serialize};

use super::judge::Judged;
use super::recorder::RecordedFrame;

pub(super) use join::leaves_a_state;

/// What became of a listener's answer.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum Outcome {
    /// The first finding is at the right place, or at one that is admitted.
    Found,
    /// Neither healthy nor wrong: inconclusive, or a finding that leaves its place open and holds the right one.
    Open,
    /// Healthy, though frames that were heard show a trace of trouble.
    Missed,
    /// No warning or error, and no frame that was heard shows anything.
    NoTrace,
    /// A finding at a wrong place.
    Wrong,
}

/// What a listener said of a fault.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Listened {
    /// The first finding, held against the truth.
    pub judged: Judged,
    /// What became of it.
    pub outcome: Outcome,
    /// Whether the first finding names the fault, as its cause or as one of the others that it may be.
    pub is_named: bool,
    /// Healthy, faulty or inconclusive; `None` where nothing was heard.
    pub verdict: Option<Verdict>,
}

/// A listener without and with the project.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Pair {
    /// It knows nothing but what it hears.
    pub alone: Listened,
    /// It knows the project, too.
    pub with_project: Listened,
}

/// The listeners of a case.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Listeners {
    /// From the start.
    pub start: Pair,
    /// Joined while the fault acts; `None` where it acts for an instant only.
    pub during: Option<Pair>,
    /// Joined after it is over; `None` where it never ends.
    pub after: Option<Pair>,
}

/// The frames that a listener heard.
#[derive(Clone, Debug)]
pub struct Heard {
    /// When it joined: `start`, `during`, `after`, or `late` on a healthy line.
    pub joined: &'static str,
    /// What passed the cards of the MainDevice from then on.
    pub frames: Vec<RecordedFrame>,
}

/// What listeners said of a healthy line: alarms, and whether it was called healthy.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct HealthyListened {
    /// From the start, without and with the project, then joined late, without and with it.
    pub columns: [HealthySaid; 4],
}

/// What one listener said of a healthy line.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct HealthySaid {
    /// Warnings and errors.
    pub alarms: Vec<String>,
    /// Whether the verdict is healthy.
    pub is_healthy: bool,
}
