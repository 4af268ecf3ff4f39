//! Lines, stories, scores and recordings played as the commands of `linesman lab` play them.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod active;
mod capture_probe;
mod demo;
mod determinism;
mod fast;
mod habit;
mod recording;
mod replay;
mod score;
mod soem;
mod stories;
mod swarm;
mod three_causes;
