//! Bundles: one file for each finding, with what came before and after it and all that the diagnosis needs to give the
//! same result again.
//!
//! [`BundleRecorder`] keeps the inputs of a diagnosis in memory ([`history`]) and hands them to a thread that writes them
//! ([`writer`]). [`Bundle`] reads such a file, and [`replay`] shows its inputs to an engine in their order.
//!
//! A bundle is a zip archive: `manifest.json` says what it is and what is missing, `frames.pcapng` has the frames,
//! `observations.jsonl` what the host noticed between them, `project.toml` what was planned, `diagnosis.json` and
//! `report.txt` what was said when it was written.

mod archive;
mod error;
mod history;
mod manifest;
mod observation;
mod recorder;
mod replay;
mod writer;

pub use archive::{Bundle, MEMBERS};
pub use error::BundleError;
pub use manifest::{
    Anonymised, BundleFinding, FrameStretch, Manifest, SCHEMA, Trigger, differences, findings,
};
pub use observation::{Noticed, ObservationLine};
pub use recorder::{BundleRecorder, BundleSettings, RecordedEngine};
pub use writer::{BundleNews, BundleReceiver, BundleRework};
