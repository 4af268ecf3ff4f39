//! MainDevice, segment and diagnosis in virtual time.
//!
//! [`lab`] joins the three; [`story`] plays what Markdown tells, [`swarm`] what chance draws,
//! [`demo`] what people want to see, [`score`] measures the diagnosis. [`verdict`] holds what was said against what was done,
//! [`habit`] names how other MainDevices drive a line, [`choice`] draws faults, [`drawing`] shows the line; [`replay`] plays real traffic against a segment.

pub mod choice;
pub mod demo;
pub mod drawing;
pub mod habit;
pub mod lab;
pub mod options;
pub mod replay;
pub mod score;
pub mod story;
pub mod swarm;
pub mod verdict;
