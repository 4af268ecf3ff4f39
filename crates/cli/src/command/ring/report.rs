//! Answer of `linesman ring --json`, and what is told on the way.

use linesman_config::plan::{Plan, PlannedCable};
use serde::Serialize;

use crate::output::Output;

/// A ring that was set up, or what is wrong with it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.ring/1`.
    pub(super) schema: String,
    /// Name and version of the program.
    pub(super) tool: String,
    /// Where the ring is: `eth0+eth1`, `sim:plant.toml`.
    pub(super) on: String,
    /// How many SubDevices it has.
    pub(super) devices: u32,
    /// The port that shall close it: `9.B`.
    pub(super) expected_end: String,
    /// The port that closes it; `null`: none does.
    pub(super) end: Option<String>,
    /// What is wrong; `null`: nothing.
    pub(super) wrong: Option<RingTrouble>,
    /// Its cables, and those of branches; none where something is wrong.
    pub(super) cables: Vec<RingCable>,
    /// The project that was written; `null`: none.
    pub(super) saved: Option<String>,
}

/// What is wrong with a ring.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RingTrouble {
    /// What it is.
    pub(super) reason: String,
    /// What to do.
    pub(super) next_step: String,
}

/// A cable.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RingCable {
    /// Whether it may break without loss.
    pub(super) may_break: bool,
    /// Numbers of the SubDevices that are lost without it.
    pub(super) lost: Vec<u32>,
}

/// What is told on the way: as the answer for people, to the side for programs.
pub(super) struct StepTeller<'a> {
    pub(super) json: bool,
    pub(super) output: &'a mut Output,
}

impl StepTeller<'_> {
    pub(super) fn line(&mut self, text: &str) {
        match self.json {
            true => self.output.warn(text.trim_start()),
            false => self.output.line(text),
        }
    }
}

/// The cables of a ring and of its branches.
pub(super) fn cables(plan: &Plan) -> Vec<RingCable> {
    let of = |cable: PlannedCable| RingCable {
        may_break: cable.may_break,
        lost: cable.lost.iter().map(|id| id.no()).collect(),
    };
    plan.cables().into_iter().map(of).collect()
}
