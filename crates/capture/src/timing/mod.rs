//! Times: cycles and their jitter, responses, load, gaps; what happened, in order of time.

pub mod durations;
pub mod report;
pub mod timeline;
