//! Diagnosis of EtherCAT networks: takes frames, and returns findings with place, cause and advice.
//!
//! [`observe`] pairs requests with returns, [`mod@model`] holds what is known of the network, [`main_device`] recognises the
//! MainDevice that drives it, each [`rule`] tests the model for one kind of trouble, [`finding`] opens and closes findings,
//! [`coverage`] tells what could be judged, and [`report`] is the result for people and programs. [`Engine`] drives them all.

pub mod ask;
pub mod coverage;
pub mod engine;
pub mod finding;
mod found_wiring;
pub mod locate;
pub mod main_device;
pub mod model;
pub mod observation_file;
pub mod observe;
pub mod pasted;
pub mod report;
pub mod rule;

pub use coverage::{Coverage, InputKind};
pub use engine::{Asked, Engine, Event, EventKind, Probe, ProbeEffect, Setup};
pub use observe::{Direction, FrameSeen, HostEvent, HostObservation};
pub use report::Diagnosis;
