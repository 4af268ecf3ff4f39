//! MainDevice, segment and diagnosis in virtual time.
//!
//! [`lab`] joins the three; [`story`] plays what Markdown tells, [`swarm`] what chance draws,
//! [`demo`] what people want to see, [`score`] measures the diagnosis. [`verdict`] holds what was said against what was done,
//! [`habit`] names how other MainDevices drive a line, `soem` drives it as programs with SOEM do, [`choice`] draws faults, [`drawing`] shows the line; [`replay`] plays real traffic against a segment.

pub mod choice;
pub mod demo;
pub mod drawing;
pub mod habit;
pub mod lab;
pub mod options;
pub mod part;
pub mod replay;
pub mod score;
mod soem;
pub mod story;
pub mod swarm;
pub mod verdict;
