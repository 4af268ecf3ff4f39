//! What goes into the engine before it begins, and what comes out beside the report.

use linesman_config::project::Project;
use linesman_proto::address::{DeviceId, Network, RegisterAddress};
use linesman_proto::time::Instant;

use crate::finding::Change;
use crate::report::FindingReport;

/// What the engine is told before it begins.
#[derive(Clone, Default, Debug)]
pub struct Setup {
    /// What was planned, for network 0.
    pub project: Option<Project>,
    /// Whether the counters of the host's cards will be reported, so that silence means zero.
    pub host_counters: bool,
    /// Whether probes can be sent.
    pub probes: bool,
    /// What is looked at: a selector, or a file.
    pub source: String,
    /// When the run began, RFC 3339.
    pub start: Option<String>,
    /// The clock behind the times.
    pub clock: String,
}

/// Something happened to a finding.
#[derive(Clone, PartialEq, Debug)]
pub struct Event {
    /// When the engine noticed.
    pub at: Instant,
    /// What happened.
    pub kind: EventKind,
    /// The finding, without what follows from it.
    pub finding: FindingReport,
}

/// What happened to a finding.
pub type EventKind = Change;

/// A wish to have a register read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Probe {
    /// The network.
    pub network: Network,
    /// The controller.
    pub device: DeviceId,
    /// Where to begin.
    pub register: RegisterAddress,
    /// How many bytes.
    pub len: u16,
    /// Later than this the answer is of no use.
    pub deadline: Instant,
    /// What the probe does to the line.
    pub effect: ProbeEffect,
}

/// What a probe does to the line.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ProbeEffect {
    /// It reads, and changes nothing.
    Reads,
    /// It writes: only where the user allowed it.
    Writes,
}
