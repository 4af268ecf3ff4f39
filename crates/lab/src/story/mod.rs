//! Stories: what happens on a line and what the diagnosis must say, as Markdown that people read.
//!
//! ````markdown
//! ---
//! title: A cut cable silences all behind it
//! proves: HW-10 partial
//! ---
//! A machine with a coupler and a box.
//!
//! ```toml
//! name = "small"
//! [[device]]
//! name = "K1"
//! type = "EK1100"
//! on = "maindevice"
//! ```
//!
//! - at 1 s inject link-open at K1.C-B3.A
//! - expect finding link-open at K1.C-B3.A within 500 ms
//! - at 3 s heal
//! - expect line up within 3 s
//! - expect all closed within 1 s
//! - expect exit 1
//! ````
//!
//! A second block, ```` ```toml project ````, holds what the MainDevice is told beyond who is where: tables of a
//! project file.
//!
//! List items are steps ([`step`]), everything else is told to the reader. Time 0 is when all
//! SubDevices have reached the target state; `at` waits for a time, the other steps happen where
//! they stand.

pub mod assertion;
pub mod object;
pub mod parse;
mod place;
pub mod run;
mod segment_probe;
pub mod step;

pub use assertion::Assertion;
pub use parse::{Asserts, FrontMatter, SegmentText, Story, StoryError};
pub use run::{StepReport, StoryReport, exit_status, play};
pub use step::{Expectation, Heal, Step, StepAt, What};
