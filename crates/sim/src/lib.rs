//! A virtual EtherCAT segment: full controllers, real wires, and the ways in which both break.
//!
//! It models causes, never counters: a noise burst hits symbols on one direction of one link, and
//! what any controller counts, drops or forwards follows from the path of the frame. [`wire`]
//! carries a frame port by port, [`controller`] is the EtherCAT controller, [`device`] what is
//! behind it, [`fault`] the catalogue of what can go wrong, [`truth`] the log of what did.
//!
//! Read first: "The physical model" in `ARCHITECTURE.md`.

pub mod controller;
pub mod device;
mod event_queue;
pub mod fault;
pub mod frame;
pub mod hardware;
pub mod seed;
pub mod segment;
pub mod segment_file;
pub mod truth;
pub mod wire;
