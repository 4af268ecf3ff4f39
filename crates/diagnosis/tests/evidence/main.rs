//! Findings that evidence made by hand brings: one module per subject.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod beside;
mod captures;
mod clocks;
mod conditions;
mod coverage;
mod excerpts;
mod exchanges;
mod host_and_tools;
mod identity;
mod joined_late;
mod late;
mod listened_host;
mod locate;
mod mailbox_bits;
mod main_device;
mod missed;
mod observation;
mod odd_frames;
mod physics;
mod readings;
mod requests;
mod support;
mod weighing;
