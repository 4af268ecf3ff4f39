//! Report, `linesman.diagnosis/1`: the JSON that the command line prints with `--json`.
//!
//! Times are ns since the start of the run; numbers above 2^53 are written as strings, since not
//! every reader of JSON keeps them.

pub mod build;
mod calibration;
pub mod coverage;
pub mod device;
pub mod main_device;
pub mod number;
mod place_text;
pub(crate) mod reading;
pub mod second_look;

use linesman_config::fault::{Class, FaultName};
use serde::{Deserialize, Serialize};

pub use crate::ask::AskingReport;
pub use crate::finding::{EvidenceKind, Severity};
pub use crate::pasted::Understood;
pub use coverage::CoverageReport;
pub use device::DeviceReport;
pub use main_device::MainDeviceReport;
pub use number::Number;
pub use second_look::SecondLook;

/// Name and version of the format.
pub const SCHEMA: &str = "linesman.diagnosis/1";

/// A whole diagnosis.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Diagnosis {
    /// `linesman.diagnosis/1`.
    pub schema: String,
    /// Name and version of the program.
    pub tool: String,
    /// When the run began, RFC 3339; `null` when no clock says.
    pub start: Option<String>,
    /// The clock behind all times.
    pub clock: String,
    /// What was looked at.
    pub source: String,
    /// Whether the input could be read to its end.
    pub complete: bool,
    /// The verdict.
    pub verdict: Verdict,
    /// The network as a whole.
    pub network: NetworkReport,
    /// The MainDevice that drives the line, as far as its requests tell; `null` where this program drives it, or where
    /// there are no frames.
    #[serde(default)]
    pub main_device: Option<MainDeviceReport>,
    /// The SubDevices, as far as the input says who they are.
    #[serde(default)]
    pub devices: Vec<DeviceReport>,
    /// Questions that were asked beside the MainDevice; left out where none were wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asking: Option<AskingReport>,
    /// What could be judged, and what not.
    #[serde(default)]
    pub coverage: CoverageReport,
    /// Of a pasted text: what was understood, and what not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub understood: Option<Understood>,
    /// What became of a finding of an earlier diagnosis after something was exchanged; left out where nobody asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_look: Option<SecondLook>,
    /// What is wrong, worst first.
    pub findings: Vec<FindingReport>,
}

/// What it all comes to.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// No error or warning was found, and enough was judged to have shown one.
    Healthy,
    /// There is, or was, an error or a warning.
    Faulty,
    /// No error or warning was found, and too little was judged to call the line healthy: see `coverage`.
    Inconclusive,
}

/// The network in numbers.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NetworkReport {
    /// Controllers: the largest of answers to a broadcast, stations that answered, positions seen.
    pub devices: Number,
    /// The highest state a SubDevice was in: `INIT`, `BOOT`, `PREOP`, `SAFEOP`, `OP`.
    pub al_state_highest: Option<String>,
    /// Datagrams judged, each request once.
    pub datagrams: Number,
    /// Datagrams whose frame never came back, or came back with working counter 0 from an address
    /// where an answer was expected.
    pub unanswered: Number,
    /// EtherCAT frames seen, both directions.
    pub frames: Number,
    /// Frames that went out and did not come back.
    pub lost: Number,
    /// Frames that were seen with a wrong check sequence.
    pub damaged: Number,
}

/// Something that is, or was, wrong.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FindingReport {
    /// Unique in this run: `F1`, `F2`.
    pub id: String,
    /// The rule's code, for `linesman explain`.
    pub code: String,
    /// The rule's name.
    pub name: String,
    /// How bad.
    pub severity: Severity,
    /// Who is called.
    pub class: Class,
    /// Its life.
    pub state: FindingState,
    /// When it began.
    pub opened_ns: Number,
    /// When it was certain.
    pub confirmed_ns: Option<Number>,
    /// When it was over.
    pub closed_ns: Option<Number>,
    /// Where.
    pub place: PlaceReport,
    /// Why.
    pub cause: FaultName,
    /// How sure, 0 to 1.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 1.0)))]
    pub confidence: f64,
    /// What else it may be.
    pub alternatives: Vec<AlternativeReport>,
    /// What shows it.
    pub evidence: Vec<EvidenceReport>,
    /// What to do.
    pub actions: Vec<String>,
    /// What follows from it.
    pub consequences: Vec<FindingReport>,
}

/// The life of a finding.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum FindingState {
    /// Seen, not certain yet.
    Opened,
    /// Certain.
    Confirmed,
    /// Over.
    Closed,
}

/// A place.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum PlaceReport {
    /// A link between two ports.
    Link {
        /// The network.
        network: u8,
        /// The end nearer the MainDevice.
        a: EndReport,
        /// The far end; `null` when it was never seen.
        b: Option<EndReport>,
        /// The direction in trouble; `null` when not known.
        direction: Option<DirectionReport>,
    },
    /// A controller.
    Device {
        /// The network.
        network: u8,
        /// Its number, from 1.
        no: u32,
    },
    /// The network.
    Network {
        /// Which.
        network: u8,
    },
    /// The computer.
    Host,
}

/// An end of a link.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EndReport {
    /// The controller, from 1; 0 is the MainDevice.
    pub no: u32,
    /// Its port, A to D; of the MainDevice its card, A or B.
    pub port: char,
}

/// A direction of a link.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum DirectionReport {
    /// Away from the MainDevice.
    AToB,
    /// Towards it.
    BToA,
    /// Both.
    Both,
}

/// Another explanation.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AlternativeReport {
    /// Why.
    pub cause: FaultName,
    /// Where, if elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<PlaceReport>,
    /// How sure, 0 to 1.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 1.0)))]
    pub confidence: f64,
    /// What would tell it from the first cause, where something does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub told_apart_by: Option<String>,
}

/// What shows it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EvidenceReport {
    /// Where it comes from.
    pub kind: EvidenceKind,
    /// When.
    pub time_ns: Option<Number>,
    /// The frame's number, from 1.
    pub frame: Option<Number>,
    /// The controller, from 1; 0 is the MainDevice.
    pub no: Option<u32>,
    /// The port, A to D.
    pub port: Option<char>,
    /// The register's address.
    pub register: Option<u16>,
    /// Its value before.
    pub before: Option<Number>,
    /// Its value after.
    pub after: Option<Number>,
    /// In words.
    pub text: String,
}
