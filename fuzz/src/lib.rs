//! What each fuzz target does with its bytes.
//!
//! A target panics when a promise is broken: not only by a crash of the code under test, but also
//! by an assertion here, such as "what was built reads as what was meant".

mod capture;
mod frame;
mod mailbox;
mod sii;

pub use capture::capture;
pub use frame::frame;
pub use mailbox::mailbox;
pub use sii::sii;

/// A target: its name, which is that of its corpus's folder, and what it does.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: &[Target] =
    &[("capture", capture), ("frame", frame), ("mailbox", mailbox), ("sii", sii)];
