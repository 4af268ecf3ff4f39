//! Cases that could not be played.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Why a case could not be played.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Unplayable {
    /// None of the plants that were drawn has a place for the faults.
    NoPlace(String),
    /// The line did not come up, or stopped for good, though nothing was wrong yet.
    NotUp(String),
}

impl fmt::Display for Unplayable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoPlace(why) | Self::NotUp(why) => f.write_str(why),
        }
    }
}
