//! Report of a run, as JSON and for people.

use linesman_config::plan::Plan;
use linesman_diagnosis::Diagnosis;
use linesman_maindevice::watch::{GroupRefusal, NetworkStatus};
use linesman_maindevice::{MainDevice, Statistics};
use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use serde::{Deserialize, Serialize};

use super::bring_up::BringUpReport;
use super::group::GroupTime;
use super::real_time::GrantedRealTime;
use crate::ads::AdsReport;
use crate::ethernet::EthernetReport;
use crate::gateway::GatewayReport;
use crate::serve::lateness::LatenessReport;

/// Name and version of the format.
pub const SCHEMA: &str = "linesman.run/1";

/// How a run went, or goes.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RunReport {
    /// `linesman.run/1`.
    pub schema: String,
    /// Why nothing could be run; `null` when it could.
    pub error: Option<String>,
    /// The line: `eth0`, `sim:plant.toml`.
    pub on: String,
    /// How long it has run, in ns.
    pub time_ns: u64,
    /// When all SubDevices had reached their targets, in ns since the start; `null`: they have not.
    pub reached_ns: Option<u64>,
    /// What bringing up took, step by step; `null`: nothing was brought up, or the
    /// line still runs.
    pub bring_up: Option<BringUpReport>,
    /// Whether every SubDevice is in its target state.
    pub settled: bool,
    /// Whether outputs are withheld because the application is late.
    pub outputs_withheld: bool,
    /// The SubDevices of the plan.
    pub devices: Vec<DeviceReport>,
    /// The cyclic frames, task by task.
    pub frames: Vec<FrameReport>,
    /// How many SubDevices answered the last cyclic broadcast read; `null`: there is none.
    pub responding: Option<u16>,
    /// What was sent and received.
    pub counts: Counts,
    /// How late cycles began.
    pub lateness: LatenessReport,
    /// What the host granted.
    pub host: HostReport,
    /// What went through the mailbox gateway; `null`: there is none.
    #[serde(default)]
    pub gateway: Option<GatewayReport>,
    /// Messages that went through the ADS server; `null`: there is none.
    #[serde(default)]
    pub ads: Option<AdsReport>,
    /// What went through the virtual switch; `null`: no SubDevice speaks EoE, and no interface was wanted.
    #[serde(default)]
    pub ethernet: Option<EthernetReport>,
    /// The group of networks that it ran in; `null`: it is the only one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<GroupTime>,
    /// Hot connect groups that were plugged in and are kept in INIT, each with the reason and the next step.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_taken: Vec<String>,
    /// Parts of this program that failed while the line was driven on, each with the reason and the next step.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failed: Vec<String>,
    /// What was wrong with the line; `null` while it runs, and where it was not judged.
    pub diagnosis: Option<Diagnosis>,
}

/// Groups that are not taken, in words: who, why, what to do.
pub(super) fn not_taken(plan: &Plan, status: &NetworkStatus) -> Vec<String> {
    let name = |id: DeviceId| plan.device(id).map_or_else(|| id.to_string(), |it| it.name.clone());
    let groups = status.groups().iter();
    let refused = groups.filter_map(|group| Some((group, group.refusal()?)));
    refused
        .map(|(group, refusal)| {
            let (why, step) = match refusal {
                GroupRefusal::Number { check, found } => {
                    let found = found.map_or_else(|| "none".to_owned(), |found| found.to_string());
                    (
                        format!(
                            "must tell the number {} ({}), found {found}",
                            check.value, check.source
                        ),
                        "set the number at the device, or plug in the group that has it",
                    )
                }
                GroupRefusal::Shared { check, count } => (
                    format!("{count} tell its number {} ({})", check.value, check.source),
                    "give each a number of its own",
                ),
                GroupRefusal::Place(place) => (
                    match place {
                        Some((id, port)) => {
                            format!("may not be plugged in at port {port} of {}", name(id))
                        }
                        None => "may not be plugged in where it is".to_owned(),
                    },
                    "plug it in at one of its `places`, or add that port to them",
                ),
            };
            format!("hot connect group {}: {why}; it is kept in INIT. Do: {step}", group.name())
        })
        .collect()
}

/// A SubDevice of a running plan.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DeviceReport {
    /// Its number, from 1.
    pub no: u32,
    /// Its name.
    pub name: String,
    /// Its station address.
    pub station: u16,
    /// The state it is driven to.
    pub target: String,
    /// Whether its process data came back right the last time.
    pub valid: bool,
    /// How old its inputs are, in ns; `null`: it has none, or never gave any.
    pub age_ns: Option<u64>,
}

/// A cyclic frame.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FrameReport {
    /// Its task.
    pub task: String,
    /// Its number within the task, from 0.
    pub frame: usize,
    /// Datagrams that were sent without their outputs, a bit each; 0x8000: the frame was not sent.
    pub not_sent: u16,
    /// Datagrams with a wrong working counter, a bit each; 0x8000: the frame did not come back.
    pub wrong_counter: u16,
}

/// Counts since the start.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the names are those of Statistics, which explains them")]
pub struct Counts {
    pub cycles: u64,
    pub cycles_missed: u64,
    pub cycles_withheld: u64,
    pub deadlines_missed: u64,
    pub working_counter_errors: u64,
    pub frames_sent: u64,
    pub frames_received: u64,
    pub cyclic_sent: u64,
    pub cyclic_lost: u64,
    pub cyclic_unsent: u64,
    pub frames_lost: u64,
    pub frames_late: u64,
    pub frames_duplicate: u64,
    pub frames_spare: u64,
    pub frames_stray: u64,
    pub frames_truncated: u64,
    pub frames_foreign: u64,
    pub repeats: u64,
    /// Frames that the diagnosis did not see because it was busy.
    pub undiagnosed: u64,
    /// Events that were not told because whoever listens was busy.
    pub untold: u64,
}

/// What the host granted.
#[derive(Clone, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct HostReport {
    /// Real-time priority; `null`: none.
    pub priority: Option<u8>,
    /// The CPU that the cycle stays on; `null`: any.
    pub cpu: Option<usize>,
    /// Whether memory is kept in RAM.
    pub memory_locked: bool,
    /// What was not granted, each with what to do about it.
    pub refused: Vec<String>,
}

impl From<&GrantedRealTime> for HostReport {
    fn from(granted: &GrantedRealTime) -> Self {
        Self {
            priority: granted.priority,
            cpu: granted.cpu,
            memory_locked: granted.memory,
            refused: granted.refused.clone(),
        }
    }
}

impl Counts {
    pub(super) fn of(statistics: &Statistics, undiagnosed: u64) -> Self {
        Self {
            cycles: statistics.cycles,
            cycles_missed: statistics.cycles_missed,
            cycles_withheld: statistics.cycles_withheld,
            deadlines_missed: statistics.deadlines_missed,
            working_counter_errors: statistics.working_counter_errors,
            frames_sent: statistics.frames_sent,
            frames_received: statistics.frames_received,
            cyclic_sent: statistics.cyclic_sent,
            cyclic_lost: statistics.cyclic_lost,
            cyclic_unsent: statistics.cyclic_unsent,
            frames_lost: statistics.frames_lost,
            frames_late: statistics.frames_late,
            frames_duplicate: statistics.frames_duplicate,
            frames_spare: statistics.frames_spare,
            frames_stray: statistics.frames_stray,
            frames_truncated: statistics.frames_truncated,
            frames_foreign: statistics.frames_foreign,
            repeats: statistics.repeats,
            undiagnosed,
            untold: 0,
        }
    }
}

/// The SubDevices and frames of a running plan.
pub(super) fn of_plan(
    plan: &Plan,
    main: &MainDevice,
    now: Instant,
) -> (Vec<DeviceReport>, Vec<FrameReport>) {
    let device = |device: &linesman_config::plan::DevicePlan| {
        let quality = main.quality(device.id);
        DeviceReport {
            no: device.id.no(),
            name: device.name.clone(),
            station: device.station.0,
            target: device.target.to_string(),
            valid: quality.valid,
            age_ns: quality.age(now).map(Span::as_nanos),
        }
    };
    let mut frames = Vec::new();
    for (at, task) in plan.tasks.iter().enumerate() {
        for frame in 0..task.frames.len() {
            let status = main.frame_status(at, frame).unwrap_or_default();
            let (not_sent, wrong_counter) = (status.not_sent, status.wrong_counter);
            frames.push(FrameReport { task: task.name.clone(), frame, not_sent, wrong_counter });
        }
    }
    (plan.devices.iter().map(device).collect(), frames)
}
