//! Settings that a user chooses for one SubDevice: how it is addressed, guarded, clocked, and what
//! becomes of its inputs when a working counter is wrong.
//!
//! The defaults are what the MainDevice does when nothing is said.

use linesman_proto::address::StationAlias;
use linesman_proto::ads::AmsNetId;
use linesman_proto::time::Span;
use serde::{Deserialize, Serialize};

use super::IdentificationCheck;

/// Choices for one SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct DeviceSettings {
    /// The task that exchanges its process data; `None` is the first one.
    pub task: Option<String>,
    /// The sync unit of that task that it belongs to; `None` is the unnamed one.
    pub sync_unit: Option<String>,
    /// Which commands carry its process data.
    pub access: ProcessAccess,
    /// Its frame may be sent twice in a cycle, and either copy is taken (ESI `FrameRepeatSupport`).
    pub frame_repeat: bool,
    /// How it may be addressed.
    pub addressing: AddressingChoice,
    /// Its second address, the station alias of its EEPROM; [`AddressingChoice::Alias`] needs it.
    pub alias: Option<StationAlias>,
    /// The number that it must tell; `None`: it is not told apart from its equals.
    pub identification: Option<IdentificationCheck>,
    /// Its watchdogs.
    pub watchdog: WatchdogSettings,
    /// Its distributed clock; `None` runs free.
    pub clock: Option<ClockSettings>,
    /// What becomes of its inputs when the working counter of their datagram is wrong.
    pub on_wrong_counter: OnWrongCounter,
    /// What the MainDevice does for it by itself.
    pub keeping: AutomaticActions,
    /// Modules that must sit in its slots, as object 0xF050 counts them from 1; 0 is an empty slot.
    /// No entries: not compared.
    pub modules: Vec<u32>,
    /// Its NetId as a network configuration says it, beside the start-up command that gives it.
    pub net_id: Option<AmsNetId>,
}

/// What the MainDevice does for a SubDevice by itself while the network runs (SW-15).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct AutomaticActions {
    /// When it left its state it is brought back; else it stays there until somebody asks for a state.
    pub restore_state: bool,
    /// When it was lost and answers again it is set up anew; else it stays in INIT until somebody asks for a state.
    pub reinitialise: bool,
    /// Its error counters are cleared before they stop at 255; else they are only read, as where another tool clears them.
    pub clear_counters: bool,
    /// Its Ethernet frames are passed on by the virtual switch, where it speaks EoE (EOE-03).
    pub forward_ethernet: bool,
}

impl Default for AutomaticActions {
    fn default() -> Self {
        Self {
            restore_state: true,
            reinitialise: true,
            clear_counters: true,
            forward_ethernet: true,
        }
    }
}

/// Which commands carry the process data of a SubDevice (FRM-26).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ProcessAccess {
    /// LRW where its description does not forbid it.
    #[default]
    Auto,
    /// LRW.
    ReadWrite,
    /// LRD and LWR.
    Separate,
}

/// How a SubDevice may be addressed (FRM-28).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum AddressingChoice {
    /// By its position until it has its station address, by that from then on.
    #[default]
    Auto,
    /// Never by its position: by its second address, the station alias.
    Alias,
    /// By its position only: it gets no station address.
    Position,
}

/// Watchdogs of a SubDevice (registers 0x0400, 0x0410, 0x0420); `None` keeps what it has.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct WatchdogSettings {
    /// Divider, in units of 40 ns, less 2.
    pub divider: Option<u16>,
    /// Time of the PDI watchdog, in steps of the divider; 0 switches it off.
    pub pdi: Option<u16>,
    /// Time of the process data watchdog, in steps of the divider; 0 switches it off.
    pub process_data: Option<u16>,
}

/// The distributed clock of a SubDevice (registers 0x0980..0x09A7; ETG.2000, `OpMode`).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct ClockSettings {
    /// What is written to 0x0980: SYNC0 and SYNC1 on, who controls them.
    pub assign_activate: u16,
    /// Cycle of SYNC0.
    pub sync0_cycle: Span,
    /// How much later SYNC0 falls than the shift of the network says, in ns.
    pub sync0_shift_ns: i64,
    /// The shift of the network that SYNC0 refers to: that of the inputs, or that of the outputs. `None`:
    /// that of the inputs for a SubDevice with inputs only (SYN-07, SYN-08).
    pub input_reference: Option<bool>,
    /// Cycle of SYNC1, register 0x09A4; 0 with a SYNC1 that follows SYNC0.
    pub sync1_cycle: Span,
    /// It is to be the reference clock.
    pub reference: bool,
}

impl ClockSettings {
    /// Whether there is a SYNC0.
    #[must_use]
    pub const fn sync0(&self) -> bool {
        self.assign_activate & 0x0200 != 0
    }

    /// Whether there is a SYNC1.
    #[must_use]
    pub const fn sync1(&self) -> bool {
        self.assign_activate & 0x0400 != 0
    }
}

/// What becomes of inputs when the working counter of their datagram is wrong (FRM-17, FRM-18).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum OnWrongCounter {
    /// The last good ones stay.
    #[default]
    Keep,
    /// They become zero.
    Clear,
}
