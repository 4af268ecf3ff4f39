//! The swarm: many seeds, each a plant, faults and a schedule, and what must hold after each step.
//!
//! * Working counters are those of the line as the truth log tells it ([`reach`], [`counter`]).
//! * No counter of a controller moves without a logged cause.
//! * Every fault that acts and can be seen has a finding; every finding has a logged cause.
//! * Any fault on any plant leaves the segment itself sound ([`physics`]).
//! * After healing all SubDevices reach the target state within a bound.

pub mod counter;
pub mod episode;
pub mod physics;
pub mod reach;
pub mod run;

pub use episode::{EpisodeReport, FaultOutcome};
pub use physics::{PhysicsReport, run_physics_seed};
pub use run::{SeedReport, SeedSum, SwarmOptions, SwarmPart, SwarmReport, run_seed};
