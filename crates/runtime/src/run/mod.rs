//! A MainDevice that runs a machine: brought up, exchanging process data, watched, stopped.
//!
//! [`operator`] is the one who does it, on whatever [line](crate::line); [`io`] is what the application
//! sees in a cycle; [`tap`] shows the frames to the diagnosis, which judges in a thread of its own
//! ([`judge`](mod@judge)); [`shared`] lets another program be the application; [`report`] is what is told at the end and in between;
//! [`scan`](mod@scan) is for those who only look.

pub mod bring_up;
pub mod io;
pub mod judge;
pub mod note;
pub mod operator;
pub mod real_time;
pub mod report;
pub mod scan;
pub mod shared;
pub mod tap;
pub mod wanted;

pub use io::{Application, Idle, Io, Next};
pub use note::{Note, RunError};
pub use operator::{
    Beside, Ended, MakePlan, NOTES, Operator, RunOptions, Wanted, run, run_observed,
};
pub use real_time::RealTime;
pub use scan::scan;
pub use shared::Shared;
pub use wanted::Choices;
