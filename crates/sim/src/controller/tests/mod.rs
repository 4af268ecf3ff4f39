//! Tests of the controller through frames.

pub(super) mod rig;
