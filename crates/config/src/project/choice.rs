//! Choices of a user in a project: tasks, the network as a whole, clocks, watchdogs, PDOs, start-up
//! commands.

use linesman_proto::time::Span;
use serde::{Deserialize, Serialize};

use crate::plan::layout::{Grouping, PlanOptions, TaskOptions};
use crate::plan::{ClockSettings, IoAt, OnWrongCounter, ProcessAccess, WatchdogSettings};
use crate::profile::ClockMode;
use crate::project::time::TimeChoice;

/// The network as a whole: table `[network]`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Network {
    /// Which SubDevices share datagrams.
    pub layout: Grouping,
    /// SubDevices with a few bits each share bytes.
    pub pack_bits: bool,
    /// Commands for process data of all SubDevices that do not say otherwise.
    pub access: ProcessAccess,
    /// What becomes of inputs when a working counter is wrong, for all SubDevices that do not say
    /// otherwise.
    pub on_wrong_counter: OnWrongCounter,
    /// Read in every cycle which mailboxes hold something, instead of asking each now and then.
    pub mailbox_states: bool,
    /// The unit of `pre_ticks`, and the base tick that programs are told the time of, in µs.
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub base_time_us: u32,
    /// A SubDevice that left its state is brought back, unless it says otherwise; else it stays there until somebody asks for
    /// a state.
    pub restore_state: bool,
    /// A SubDevice that was lost and answers again is set up anew, unless it says otherwise; else it stays in INIT until
    /// somebody asks for a state.
    pub reinitialise: bool,
    /// Error counters are cleared before they stop at 255, unless a SubDevice says otherwise; else they are only read.
    pub clear_counters: bool,
    /// Ethernet frames of SubDevices that speak EoE are passed on by the virtual switch of a run, unless a SubDevice says
    /// otherwise.
    pub eoe: bool,
    /// From the frames to SYNC0, in µs; 30 % of the cycle unless said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outputs_shift_us: Option<u32>,
    /// From the frames to SYNC0 of SubDevices with inputs only, in µs; negative: before the next frames.
    /// -10 % of the cycle unless said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inputs_shift_us: Option<i32>,
    /// How far a clock may be off the reference clock before that is told and the network counts as out of
    /// step, in ns; 1000 unless said.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub sync_window_ns: Option<u32>,
    /// Whose time the network has. Unless said that of its reference clock, or that of another network of the same
    /// process that leads; with a terminal for IEEE 1588 the one that it tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_source: Option<TimeChoice>,
    /// With `time_source = "device"`: the device that tells the time. Unless said the only one that can.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_device: Option<String>,
    /// A port whose link was lost stays closed when the link is back, until the MainDevice has prepared the
    /// section behind it and orders it to open; else it opens by itself, at once.
    pub ports_open_by_order: bool,
    /// Outputs are withheld and SubDevices kept below OP, once no card of the line has a link any more, until the network is
    /// reset (`linesman online SOCKET --reset`); else they go on as soon as SubDevices answer again.
    pub lock_after_link_error: bool,
}

impl Default for Network {
    fn default() -> Self {
        Self {
            layout: Grouping::ByKind,
            pack_bits: true,
            access: ProcessAccess::Auto,
            on_wrong_counter: OnWrongCounter::Keep,
            mailbox_states: true,
            base_time_us: 1_000,
            restore_state: true,
            reinitialise: true,
            clear_counters: true,
            eoe: true,
            outputs_shift_us: None,
            inputs_shift_us: None,
            sync_window_ns: None,
            time_source: None,
            time_device: None,
            ports_open_by_order: false,
            lock_after_link_error: false,
        }
    }
}

/// What a task is for.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TaskPurpose {
    /// Axes: its frames leave in the beat, when its cycle begins.
    Motion,
    /// Logic and I/O: its frames leave when the application has finished, with what that has just set.
    Logic,
}

/// A task: `[[task]]`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProjectTask {
    /// Unique name.
    pub name: String,
    /// Cycle time in µs.
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub cycle_us: u32,
    /// What it is for, which decides when its frames leave where `io_at` is not said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub purpose: Option<TaskPurpose>,
    /// When its frames leave: when its cycle begins, or when the application has finished. Unless said as its purpose
    /// has it, and when the cycle begins where that is not said either.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub io_at: Option<IoAt>,
    /// Inputs are fetched in frames of their own, earlier than the others.
    #[serde(default)]
    pub separate_inputs: bool,
    /// How much earlier, in units of the base time.
    #[serde(default)]
    pub pre_ticks: u32,
    /// How often a frame is sent again at once, if all SubDevices in it allow that (`frame_repeat`).
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(max = 3)))]
    pub repeats: u8,
}

impl ProjectTask {
    /// A task with this cycle time, in whole µs, and nothing special.
    #[must_use]
    pub fn new(name: &str, cycle: Span) -> Self {
        Self {
            name: name.to_owned(),
            cycle_us: u32::try_from(cycle.as_nanos() / 1_000).unwrap_or(u32::MAX),
            purpose: None,
            io_at: None,
            separate_inputs: false,
            pre_ticks: 0,
            repeats: 0,
        }
    }

    /// When its frames leave: as is said, else as its purpose has it, else when its cycle begins (SYN-13).
    #[must_use]
    pub fn io_at(&self) -> IoAt {
        self.io_at.unwrap_or(match self.purpose {
            None | Some(TaskPurpose::Motion) => IoAt::TaskBegin,
            Some(TaskPurpose::Logic) => IoAt::TaskEnd,
        })
    }

    /// The same for the planner.
    #[must_use]
    pub fn options(&self, network: &Network) -> TaskOptions {
        let ahead = u64::from(self.pre_ticks) * u64::from(network.base_time_us);
        TaskOptions {
            name: self.name.clone(),
            cycle: Span::us(u64::from(self.cycle_us)),
            io_at: self.io_at(),
            separate_inputs: self.separate_inputs.then(|| Span::us(ahead)),
            repeats: self.repeats,
        }
    }
}

impl Network {
    /// What the planner is told; without tasks there is one of 1 ms.
    #[must_use]
    pub fn options(&self, tasks: &[ProjectTask]) -> PlanOptions {
        PlanOptions {
            separate_directions: false,
            tasks: tasks.iter().map(|task| task.options(self)).collect(),
            grouping: self.layout,
            pack_bits: self.pack_bits,
            clock_datagrams: true,
            mailbox_states: self.mailbox_states,
            outputs_shift: self.outputs_shift_us.map(|us| Span::us(u64::from(us))),
            inputs_shift_ns: self.inputs_shift_us.map(|us| i64::from(us) * 1_000),
            base_tick: Span::us(u64::from(self.base_time_us)),
            sync_window: self.sync_window_ns.map(|ns| Span::ns(u64::from(ns))),
            ports_open_by_order: self.ports_open_by_order,
            lock_after_link_error: self.lock_after_link_error,
            ..PlanOptions::default()
        }
    }
}

/// The distributed clock of a device: `clock = { … }`. What is not said is that of the mode.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ClockChoice {
    /// An operation mode of its description, by name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<String>,
    /// What is written to 0x0980: 0x0300 is SYNC0, 0x0700 SYNC0 and SYNC1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assign_activate: Option<u16>,
    /// Cycle of SYNC0 in µs; that of its task unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sync0_cycle_us: Option<u32>,
    /// Shift of SYNC0 in ns, on top of the shift of the network.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sync0_shift_ns: Option<i64>,
    /// SYNC0 refers to the shift of the inputs (`true`) or of the outputs (`false`). Unless said: as the mode of
    /// its description has it, else that of the inputs for a device with inputs only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input_reference: Option<bool>,
    /// Cycle of SYNC1 in µs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sync1_cycle_us: Option<u32>,
    /// It is the reference clock.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reference: bool,
}

impl ClockChoice {
    /// The settings, with what the modes of its description say and the cycle of its task.
    ///
    /// # Errors
    /// A mode that its description does not have.
    pub fn settings(&self, modes: &[ClockMode], cycle: Span) -> Result<ClockSettings, String> {
        let mode = match &self.mode {
            None => ClockMode::default(),
            Some(name) => {
                modes.iter().find(|mode| mode.name == *name).cloned().ok_or_else(|| {
                    let names: Vec<_> =
                        modes.iter().map(|mode| format!("`{}`", mode.name)).collect();
                    let has = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                    format!("clock: its description has no mode `{name}`; it has {has}")
                })?
            }
        };
        let us = |us: u32| Span::us(u64::from(us));
        let sync0_cycle = self.sync0_cycle_us.map_or_else(|| mode.sync0_cycle(cycle), us);
        let sync1_cycle = Span::ns(
            sync0_cycle.as_nanos() * u64::try_from(mode.sync1_cycle_factor).unwrap_or(0)
                + u64::try_from(mode.sync1_shift_ns).unwrap_or(0),
        );
        let assign_activate = match (self.assign_activate, &self.mode) {
            (Some(activate), _) => activate,
            (None, Some(_)) => mode.assign_activate,
            // A clock that is asked for without further words gives SYNC0.
            (None, None) => 0x0300,
        };
        Ok(ClockSettings {
            assign_activate,
            sync0_cycle,
            sync0_shift_ns: self.sync0_shift_ns.unwrap_or(i64::from(mode.sync0_shift_ns)),
            input_reference: self.input_reference.or(mode.input_reference),
            sync1_cycle: self.sync1_cycle_us.map_or(sync1_cycle, us),
            reference: self.reference,
        })
    }

    /// What is set otherwise than the named mode of the description has it, for a task of this cycle; nothing
    /// where no mode is named, or the description does not have it.
    #[must_use]
    pub fn changes(&self, modes: &[ClockMode], cycle: Span) -> Vec<String> {
        let as_described = Self { mode: self.mode.clone(), ..Self::default() };
        let named = self.mode.is_some();
        let settings = |choice: &Self| choice.settings(modes, cycle).ok().filter(|_| named);
        let (Some(described), Some(chosen)) = (settings(&as_described), settings(self)) else {
            return Vec::new();
        };
        let hex = |value: u16| format!("0x{value:04X}");
        let pairs = [
            ("assign_activate", hex(chosen.assign_activate), hex(described.assign_activate)),
            ("cycle of SYNC0", of(chosen.sync0_cycle), of(described.sync0_cycle)),
            ("shift of SYNC0", ns(chosen.sync0_shift_ns), ns(described.sync0_shift_ns)),
            (
                "shift that SYNC0 refers to",
                referred(chosen.input_reference),
                referred(described.input_reference),
            ),
            ("cycle of SYNC1", of(chosen.sync1_cycle), of(described.sync1_cycle)),
        ];
        let differs = pairs.into_iter().filter(|(_, chosen, described)| chosen != described);
        differs.map(|(what, chosen, own)| format!("{what} {chosen} instead of {own}")).collect()
    }
}

fn of(span: Span) -> String {
    format!("{} ns", span.as_nanos())
}

fn referred(input_reference: Option<bool>) -> String {
    match input_reference {
        Some(true) => "that of the inputs".to_owned(),
        Some(false) => "that of the outputs".to_owned(),
        None => "that of its process data".to_owned(),
    }
}

fn ns(value: i64) -> String {
    format!("{value} ns")
}

/// Watchdogs of a device: `watchdog = { … }`; what is not said stays as the device has it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WatchdogChoice {
    /// Divider (0x0400) in units of 40 ns, less 2; 2498 makes steps of 100 µs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub divider: Option<u16>,
    /// PDI watchdog (0x0410) in steps of the divider; 0 is off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pdi: Option<u16>,
    /// Process data watchdog (0x0420) in steps of the divider; 0 is off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub process_data: Option<u16>,
}

impl WatchdogChoice {
    pub(super) fn settings(self) -> WatchdogSettings {
        let Self { divider, pdi, process_data } = self;
        WatchdogSettings { divider, pdi, process_data }
    }
}

/// Other entries for a PDO: `[[device.mapping]]`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    /// Index of the PDO.
    pub pdo: u16,
    /// What it consists of from now on, in order.
    pub entries: Vec<super::DescribedEntry>,
}

/// A command at start-up: `[[device.start_up]]`, for an object, for registers, for an identification
/// number of a drive, or for the addresses of an Ethernet port.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StartUpEntry {
    /// When: `IP`, `PS`, `SO` and so on.
    #[cfg_attr(feature = "schema", schemars(regex(pattern = "^[IPSOB]{2}$")))]
    pub transition: String,
    /// Index of the object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub index: Option<u16>,
    /// Its subindex.
    #[serde(default)]
    pub subindex: u8,
    /// The whole object in one transfer.
    #[serde(default)]
    pub complete_access: bool,
    /// The first register, instead of an object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub register: Option<u16>,
    /// An identification number of a drive that speaks SoE, such as `S-0-0032`, instead of an object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(regex(pattern = "^[SP]-[0-7]-[0-9]{1,4}$")))]
    pub idn: Option<String>,
    /// With `idn`: which drive of the device.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(max = 7)))]
    pub drive: u8,
    /// Addresses of an Ethernet port, instead of an object and data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eoe: Option<super::EthernetChoice>,
    /// The NetId that a device which speaks AoE is to have, such as `192.168.1.5.3.1`, instead of an object and data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(regex(pattern = "^[0-9]{1,3}([.][0-9]{1,3}){5}$")))]
    pub net_id: Option<String>,
    /// What is written: bytes in the order on the wire, as hexadecimal digits, such as `"08 00"`.
    #[serde(default)]
    pub data: String,
    /// What it is for.
    #[serde(default)]
    pub comment: String,
}
