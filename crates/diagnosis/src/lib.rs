//! Frames in, findings out: where, why and what to do.
//!
//! [`observe`] pairs what went out with what came back, [`mod@line`] is what is known of the network,
//! [`main_device`] recognises who drives it, each [`rule`] looks at the line for one kind of trouble, [`finding`] gives conditions a life,
//! [`coverage`] says what could be judged at all, and [`report`] is the answer as people and programs read it. [`Engine`] drives them all.

pub mod ask;
pub mod coverage;
pub mod engine;
pub mod finding;
pub mod line;
pub mod locate;
pub mod main_device;
pub mod observation_file;
pub mod observe;
pub mod pasted;
pub mod report;
pub mod rule;

pub use coverage::{Coverage, InputKind};
pub use engine::{Asked, Engine, Event, EventKind, Probe, ProbeEffect, Setup};
pub use observe::{Direction, FrameSeen, HostEvent, HostObservation};
pub use report::Diagnosis;
