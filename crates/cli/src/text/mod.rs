//! Answers as people read them: what the JSON says, in words and by names.

pub(crate) mod capture;
pub(crate) mod coverage;
pub(crate) mod devices;
pub(crate) mod diagnosis;
pub(crate) mod drawing;
pub(crate) mod finding;
pub(crate) mod group;
pub(crate) mod main_device;
pub(crate) mod names;
pub(crate) mod quantity;
pub(crate) mod questions;
pub(crate) mod understood;
