//! Set-up of the engine, and its output beside the report.

use linesman_config::plan::PlannedExchange;
use linesman_config::project::Project;
use linesman_proto::address::{DeviceId, Network, RegisterAddress, StationAddress};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::time::Instant;

use super::Engine;
use crate::coverage::InputKind;
use crate::finding::Change;
use crate::model::reported::PartExchange;
use crate::report::FindingReport;

/// What the engine is told before it begins.
#[derive(Clone, Default, Debug)]
pub struct Setup {
    /// What was planned, for network 0.
    pub project: Option<Project>,
    /// The process data that were planned, where that is known, for network 0.
    pub exchange: PlannedExchange,
    /// The way by which evidence comes in.
    pub input: InputKind,
    /// Whether the counters of the host's cards will be reported, so that silence means zero.
    pub host_counters: bool,
    /// Whether probes can be sent.
    pub probes: bool,
    /// Whether probes may write what restores itself, to find where frames vanish.
    pub active: bool,
    /// What is looked at: a selector, or a file.
    pub source: String,
    /// When the run began, RFC 3339.
    pub start: Option<String>,
    /// The clock behind the times.
    pub clock: String,
    /// SubDevices before each channel of a tap that recorded network 0 inside the line, channel 0 first; empty where the
    /// recording has none, or records of a probe that tell.
    pub tap_places: Vec<u16>,
    /// Parts that were exchanged before, on account of an earlier diagnosis, of network 0.
    pub exchanges: Vec<PartExchange>,
}

impl Engine {
    /// Set-up of the diagnosis, with what it was told of the host since.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }
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
    /// The finding that explains it, by its id, as far as that is known by now.
    pub follows_from: Option<String>,
}

/// What happened to a finding.
pub type EventKind = Change;

/// A wish to have a register or an object read, or a register written where the user allowed it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Probe {
    /// The network.
    pub network: Network,
    /// The controller.
    pub device: DeviceId,
    /// Its station address.
    pub station: StationAddress,
    /// What is to be read.
    pub what: Asked,
    /// Later than this the answer is of no use.
    pub deadline: Instant,
    /// What the probe does to the line.
    pub effect: ProbeEffect,
}

/// What a probe asks for. Who probes need not hand the answer in: its frames are seen.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Asked {
    /// A register.
    Register {
        /// Where to begin.
        address: RegisterAddress,
        /// How many bytes.
        len: u16,
    },
    /// Nothing: a register is to be written, which restores itself.
    Written {
        /// Where to begin.
        address: RegisterAddress,
        /// What.
        data: [u8; 2],
    },
    /// An object of the dictionary, where the SubDevice has a mailbox.
    Object(ObjectAddress),
}

/// What a probe does to the line.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ProbeEffect {
    /// It reads, and changes nothing.
    Reads,
    /// It writes: only where the user allowed it.
    Writes,
}
