//! Report of the listeners beside the MainDevice of a score, as programs read it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::super::rate::Rate;

/// Listeners beside a MainDevice with the habits of others.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ListenedReport {
    /// Single faults.
    pub single: ListenersReport,
    /// Faults whose place frames alone can tell: `link-open`, `device-off`, `supply-off`, `brown-out`, `paused`,
    /// `host-drops`, `late-frames`.
    pub placed: ListenersReport,
    /// Faults that cost frames at a place that frames alone do not tell: `cable-degraded`, `emc-noise`,
    /// `transmitter-damaged`, `receiver-damaged`, `device-internal`, `nic-damaged`.
    pub noise: ListenersReport,
    /// Single faults by name; `paused` is `watchdog-starved` with a MainDevice that stops.
    pub per_fault: BTreeMap<String, ListenersReport>,
    /// Runs in which nothing was wrong.
    pub healthy: HealthyListenedReport,
    /// Cases in which a listener was wrong, or said healthy though frames show a trace; at most 2,000.
    pub wrong: Vec<WrongListened>,
}

/// Listeners by the moment at which they began to listen.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ListenersReport {
    /// From before the start of the MainDevice.
    pub start: ListenerPair,
    /// Joined while the fault acted.
    pub during: ListenerPair,
    /// Joined when it was over.
    pub after: ListenerPair,
}

/// A listener without and with the project.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ListenerPair {
    /// It knows nothing but what it hears.
    pub alone: ListenerReport,
    /// It knows the project, too.
    pub with_project: ListenerReport,
}

/// How a listener did. All rates but the first are of the faults of which frames that it heard show a trace, or of which
/// it said something; of these one is found, open, missed or wrong.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ListenerReport {
    /// Of all faults with an effect: no frame that it heard shows anything, and it reported nothing.
    pub no_trace: Rate,
    /// The place is right.
    pub place_at_1: Rate,
    /// Cause and place are right.
    pub cause_at_1: Rate,
    /// Found: the place is right or admitted.
    pub place_at_1_set: Rate,
    /// Cause and place are right or admitted.
    pub cause_at_1_set: Rate,
    /// The first finding names the fault, as its cause or as one of the others that it may be.
    pub named: Rate,
    /// Inconclusive, or a finding that leaves its place open and holds the right one.
    pub open: Rate,
    /// Healthy, though frames that it heard show a trace of trouble.
    pub missed: Rate,
    /// A finding at a wrong place.
    pub wrong: Rate,
    /// Warnings and errors beside the first that nothing explains.
    pub other_findings: u64,
}

/// Listeners to runs in which nothing was wrong.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HealthyListenedReport {
    /// From before the start of the MainDevice.
    pub start: HealthyPair,
    /// Joined while all was well.
    pub late: HealthyPair,
    /// What they were accused of.
    pub alarms: Vec<String>,
}

/// A listener to healthy runs, without and with the project.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HealthyPair {
    /// It knows nothing but what it hears.
    pub alone: HealthyRates,
    /// It knows the project, too.
    pub with_project: HealthyRates,
}

/// What a listener said of healthy runs.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HealthyRates {
    /// Without warning or error.
    pub silent: Rate,
    /// Called healthy, rather than inconclusive.
    pub healthy: Rate,
}

/// A case in which a listener was wrong.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WrongListened {
    /// Its seed.
    pub seed: u64,
    /// SubDevices.
    pub devices: u64,
    /// What was injected.
    pub fault: String,
    /// `start`, `during` or `after`.
    pub joined: String,
    /// Whether it knew the project.
    pub with_project: bool,
    /// `missed` or `wrong`.
    pub outcome: String,
    /// What it said first.
    pub said: String,
}
