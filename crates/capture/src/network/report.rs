//! Report, `linesman.capture/1`: the JSON of `capture info`.
//!
//! Times are ns since the first frame. What the frames do not show is `null`, and named in `unknown` with the reason.

use linesman_diagnosis::report::{MainDeviceReport, Number};
use serde::{Deserialize, Serialize};

use super::commands::CommandReport;
use super::counters::CountersReport;
use super::cyclic::{CycleTaskReport, CyclicFrameReport};
use super::devices::{SurveyedDevice, WiredLinkReport};
use super::image::ProcessImageReport;
use super::ring::RingReport;
use super::states::StateEventReport;
use super::unknown::UnknownReport;
use crate::dialogue::TransferReport;
use crate::timing::report::TimingReport;

/// Name and version of the format.
pub const SCHEMA: &str = "linesman.capture/1";

/// A port of a capture probe.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProbePortReport {
    /// Its number, from 0.
    pub port: u8,
    /// Its channel, from 0: two ports each.
    pub channel: u8,
    /// True if frames come by on their way back.
    pub is_way_back: bool,
    /// SubDevices that frames have passed when they come, as the addresses of broadcasts tell; `null` where none was
    /// seen.
    pub subdevices_before: Option<u16>,
    /// Place of it in words.
    pub place: String,
    /// Frames that came.
    pub frames: Number,
    /// Those of them with a wrong check sequence.
    pub damaged: Number,
    /// Those of the damaged ones that a SubDevice had found bad before.
    pub marked: Number,
}

/// Everything that a capture shows of a network.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CaptureReport {
    /// `linesman.capture/1`.
    pub schema: String,
    /// Name and version of the program.
    pub tool: String,
    /// The file.
    pub source: String,
    /// When the first frame was recorded, RFC 3339; `null` when no clock says.
    pub start: Option<String>,
    /// True if all of the file could be read.
    pub complete: bool,
    /// The frames.
    pub recording: RecordingReport,
    /// The MainDevice, recognised by its habits.
    pub main_device: Option<MainDeviceReport>,
    /// The network as a whole.
    pub network: NetworkSummary,
    /// SubDevices, in order of their numbers.
    pub devices: Vec<SurveyedDevice>,
    /// Links, as DL status tells them; empty where the wiring is not known.
    pub links: Vec<WiredLinkReport>,
    /// The ring; `null` where the frames do not show two cards.
    pub ring: Option<RingReport>,
    /// Datagrams by command.
    pub commands: Vec<CommandReport>,
    /// Frames that carry process data or the system time, in order of their first appearance.
    pub cyclic: Vec<CyclicFrameReport>,
    /// When process data came for the first time.
    pub first_process_data_ns: Option<Number>,
    /// Cycles at which these frames come.
    pub tasks: Vec<CycleTaskReport>,
    /// Logical addresses and who owns which of their bits.
    pub image: Vec<ProcessImageReport>,
    /// States that were asked for and read, in order of time.
    pub states: Vec<StateEventReport>,
    /// State requests and changes beyond those that are listed.
    pub states_left_out: Number,
    /// Error counters that were read.
    pub counters: Vec<CountersReport>,
    /// Mailbox messages put together, in order of time.
    pub transfers: Vec<TransferReport>,
    /// Transfers beyond those that are listed.
    pub transfers_left_out: Number,
    /// Times.
    pub timing: TimingReport,
    /// Ports of the capture probe that recorded it, in the order in which frames pass them; empty where none did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub probe_ports: Vec<ProbePortReport>,
    /// Facts that the frames do not show, with the reason.
    pub unknown: Vec<UnknownReport>,
}

/// The frames of a capture.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RecordingReport {
    /// EtherCAT frames.
    pub frames: Number,
    /// From the first to the last.
    pub lasts_ns: Number,
    /// Interfaces that recorded them, by name or number.
    pub interfaces: Vec<String>,
    /// Which of requests and returns were recorded: `both`, `requests`, `returns`; `null` without EtherCAT frames.
    pub ways: Option<String>,
    /// Requests.
    pub requests: Number,
    /// Returns.
    pub returns: Number,
    /// Returns whose request was not recorded.
    pub returns_alone: Number,
    /// Requests that did not come back.
    pub lost: Number,
    /// Frames with a wrong check sequence.
    pub damaged: Number,
    /// Frames that were not recorded to their end.
    pub cut: Number,
    /// Frames that carry no EtherCAT datagrams.
    pub foreign: Number,
    /// Addresses of those who sent requests.
    pub senders: Vec<String>,
    /// True if process data came already when the capture began.
    pub began_in_run: bool,
}

/// The network as a whole.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NetworkSummary {
    /// Least number of SubDevices.
    pub devices: Number,
    /// The highest state that any SubDevice was seen in.
    pub al_state_highest: Option<String>,
    /// Distribution of the system time, where frames carry it.
    pub reference_clock: Option<ReferenceClockReport>,
    /// SubDevices with a mailbox, where frames tell.
    pub mailboxes: Option<MailboxesReport>,
}

/// Distribution of the system time by ARMW or FRMW to 0x0910.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ReferenceClockReport {
    /// Number of the SubDevice that is asked for its time, the reference clock.
    pub no: Option<u32>,
    /// Its station address, where the datagram names it.
    pub station: Option<u16>,
    /// Its position from 1, where the datagram names it.
    pub position_no: Option<u32>,
    /// `ARMW` or `FRMW`.
    pub command: String,
    /// Datagrams that came back.
    pub datagrams: Number,
    /// SubDevices that took part, by the latest working counter: the reference clock and those that took its time; 0 when
    /// nobody answers.
    pub takes_part: u16,
    /// By how much it is fast (positive) or slow against the clock of the capture, in parts per million.
    pub ppm: Option<i64>,
}

/// SubDevices with a mailbox.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MailboxesReport {
    /// Number of them.
    pub count: u16,
    /// How that is known: `status-bits` (the working counter of a datagram in which each SubDevice has a bit),
    /// `sync-managers` (their set-up was seen), or `messages`.
    pub by: String,
}
