//! Real traffic played against a segment: the requests of a recording go out at their recorded times,
//! in virtual time, and what comes back is compared with what came back on the real line.
//!
//! [`recording`] pairs requests and returns, [`mod@learn`] finds out which devices answered and what
//! they were like, [`mod@model`] makes a segment of such devices, [`mod@play`] sends and [`mod@compare`]
//! compares; [`mod@exception`] says for what reasons answers may differ; [`report`] is the result. What the recording cannot tell is in [`learn::Learned::notes`].
//!
//! Nothing is answered from the recording: registers, SyncManagers, FMMUs, SII and mailbox are those of the
//! model. From the recording come the content of memories (SII words, objects), how long a device took
//! for what, and what the world outside did: the inputs of process data.

pub mod compare;
pub mod exception;
mod firmware;
pub mod learn;
pub mod model;
pub mod play;
pub mod recording;
pub mod report;

pub use learn::{Learned, learn};
pub use model::{Model, ModelError, model, on_segment};
pub use play::play;
pub use recording::{Recorder, Recording};
pub use report::Report;
