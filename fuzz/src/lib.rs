//! What each fuzz target does with its bytes.
//!
//! A target panics when a promise is broken: not only by a crash of the code under test, but also
//! by an assertion here, such as "what was built reads as what was meant".

mod bundle;
mod capture;
mod capture_filter;
mod device;
mod device_builder;
mod diagnosis;
mod eni;
mod esi;
mod ethernet;
mod frame;
mod gateway;
mod mailbox;
mod mailbox_client;
mod observation_file;
mod pasted;
mod project;
mod segment;
mod segment_file;
mod series;
mod sii;

pub use bundle::{BETWEEN_MEMBERS, bundle, packed};
pub use capture::capture;
pub use capture_filter::capture_filter;
pub use device_builder::device_builder;
pub use diagnosis::diagnosis;
pub use eni::eni;
pub use esi::esi;
pub use ethernet::ethernet;
pub use frame::frame;
pub use gateway::gateway;
pub use mailbox::mailbox;
pub use mailbox_client::mailbox_client;
pub use observation_file::observation_file;
pub use pasted::pasted;
pub use project::project;
pub use segment::segment;
pub use segment_file::segment_file;
pub use sii::sii;

/// A target: its name, which is that of its corpus's folder, and what it does.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: &[Target] = &[
    ("bundle", bundle),
    ("capture", capture),
    ("capture_filter", capture_filter),
    ("device_builder", device_builder),
    ("diagnosis", diagnosis),
    ("eni", eni),
    ("esi", esi),
    ("ethernet", ethernet),
    ("frame", frame),
    ("gateway", gateway),
    ("mailbox", mailbox),
    ("mailbox_client", mailbox_client),
    ("observation_file", observation_file),
    ("pasted", pasted),
    ("project", project),
    ("segment", segment),
    ("segment_file", segment_file),
    ("sii", sii),
];
