//! MainDevice, segment and diagnosis in virtual time.
//!
//! [`verdict`] holds what was said against what was done; [`drawing`] shows the line.

pub mod choice;
pub mod drawing;
pub mod story;
pub mod verdict;
