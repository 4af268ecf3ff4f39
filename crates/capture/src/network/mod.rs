//! The network, from frames alone: SubDevices, wiring, states, set-up, process image, clocks, counters.

pub mod commands;
pub mod counters;
pub mod cyclic;
pub mod devices;
pub mod image;
pub mod pdos;
pub mod report;
pub mod ring;
pub mod states;
pub mod unknown;
