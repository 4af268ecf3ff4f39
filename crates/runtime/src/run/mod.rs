//! A MainDevice that runs a machine: brought up, exchanging process data, watched, stopped.
//!
//! [`session`] runs a [session](linesman_session) on whatever [transport](crate::transport); on cards [`tap`] shows
//! the frames to the diagnosis, which judges in a thread of its own ([`diagnosis_thread`]), in virtual time they are
//! judged at once; [`shared`] lets another program be the application; [`report`] is what is told at the end and in
//! between; [`scan`](mod@scan) is for those who only look.

pub mod bring_up;
pub mod diagnosis_input;
pub mod diagnosis_thread;
pub mod group;
pub mod note;
pub mod plan_choices;
pub mod real_time;
pub mod report;
pub mod scan;
pub mod session;
pub mod shared;
pub mod tap;

pub use group::NetworkPlace;
pub use linesman_session::{Application, Idle, Io, MakePlan, Next, PlanSource, StartTime};
pub use note::{Note, RunError};
pub use plan_choices::PlanChoices;
pub use real_time::RealTime;
pub use scan::scan;
pub use session::{
    NOTES, RunControls, RunOutcome, RunSession, SessionOptions, StartedRun, run, run_observed,
    start, start_observed,
};
pub use shared::Shared;
