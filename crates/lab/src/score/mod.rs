//! The score: how often the diagnosis is right, on a corpus that anyone can draw again.
//!
//! A seed gives a [`case`]: a plant, its features, and faults of the whole catalogue with wide
//! parameters ([`draw`]). [`play`] runs it, live and as a recording, [`judge`] holds what was said
//! against the truth log, [`repair_trial`] exchanges what was blamed, [`set_trial`] plays the cause that was
//! named where no evidence could tell it from the drawn one, [`report`] adds up. [`disturb`] does to a healthy line what is no fault,
//! [`perturb`] makes a plant other than the diagnosis expects, [`listen`] judges by what is heard beside a MainDevice
//! with other habits. A case counts when the truth log shows an effect,
//! whether or not the diagnosis saw it.

pub mod baseline;
pub mod built_in;
pub mod capture_probe;
pub mod case;
pub mod disturb;
pub mod draw;
mod effect;
pub mod excerpt;
pub mod judge;
pub mod listen;
pub mod outcome;
pub mod parts;
pub mod perturb;
mod plant_extras;
pub mod play;
pub mod rate;
mod recorder;
pub mod repair_trial;
pub mod report;
pub mod set_trial;
mod sharing;
pub mod tally;
mod trace;
mod unplayable;

pub use case::{CaseKind, ScoreOptions};
pub use outcome::{CaseReport, FaultOutcome};
pub use perturb::Perturbation;
pub use play::run_case;
pub use rate::Rate;
pub use recorder::RecordedFrame;
pub use report::ScoreReport;
pub use tally::Tally;
pub use unplayable::Unplayable;
