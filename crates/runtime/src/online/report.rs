//! The online view as JSON.

use serde::{Deserialize, Serialize};

use crate::ads::AdsReport;
use crate::ethernet::EthernetReport;
use crate::gateway::GatewayReport;
use crate::run::group::GroupTime;

/// Name and version of the format.
pub const SCHEMA: &str = "linesman.online/1";

/// A network as it is now.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlineReport {
    /// `linesman.online/1`.
    pub schema: String,
    /// The line: `eth0`, `sim:plant.toml`, or the socket of a run.
    pub on: String,
    /// Time of the run, in ns.
    pub time_ns: u64,
    /// Whether a MainDevice drives the line; else it was looked at with reads only, and what belongs to
    /// the cycle is `null` or empty.
    pub driven: bool,
    /// The network's state word: 0 when all is well.
    pub state: Word,
    /// How many SubDevices are planned; on a line that nobody drives: were seen first.
    pub planned: u32,
    /// How many of them are there.
    pub present: u32,
    /// How many answered the last broadcast read; `null`: there was none.
    pub responding: Option<u16>,
    /// The same by the card that received it, card A first: while a ring is whole, all are counted by card B. `null`:
    /// there is no ring.
    #[serde(default)]
    pub responding_by_card: Option<[u16; 2]>,
    /// The time of the network; `null`: no clocks are in use.
    #[serde(default)]
    pub clock: Option<OnlineClock>,
    /// The group of networks that it runs in; `null`: it is the only one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<GroupTime>,
    /// The SubDevices, by number.
    pub devices: Vec<OnlineDevice>,
    /// The hot connect groups, in the order of the plan.
    #[serde(default)]
    pub groups: Vec<OnlineGroup>,
    /// Numbers of all SubDevices in the order of a topology list: those of groups come last.
    #[serde(default)]
    pub topology: Vec<u32>,
    /// The cyclic frames, task by task.
    pub frames: Vec<OnlineFrame>,
    /// The sync units, task by task.
    pub sync_units: Vec<OnlineSyncUnit>,
    /// Frames with process data.
    pub cyclic: FrameCounts,
    /// Frames of procedures: state changes, registers, mailboxes.
    pub queued: FrameCounts,
    /// Frames that came back, but otherwise than they should.
    pub odd: OddFrames,
    /// The network cards, that of path A first.
    pub cards: Vec<Card>,
    /// What goes through the virtual switch (EoE); `null`: no SubDevice has a port of it, and there is no interface.
    #[serde(default)]
    pub ethernet: Option<EthernetReport>,
    /// What goes through the mailbox gateway; `null`: none is open.
    #[serde(default)]
    pub gateway: Option<GatewayReport>,
    /// Messages that go through the ADS server; `null`: none is open.
    #[serde(default)]
    pub ads: Option<AdsReport>,
}

/// A hot connect group.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlineGroup {
    /// Its name.
    pub name: String,
    /// Numbers of its SubDevices, that of the first one first.
    pub devices: Vec<u32>,
    /// How many of them are there.
    pub present: u32,
    /// Whether it is plugged in, and all of it have reached their states.
    pub joined: bool,
    /// The port that it hangs at, such as `3.D`: number and port; `null` while it is absent.
    pub place: Option<String>,
}

/// The time of the network: that of the reference clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlineClock {
    /// Whose clock is the reference, by number.
    pub reference: u32,
    /// By how many ns it is ahead of the host's time; negative: it is behind. Read once a second, by a frame
    /// whose way there is not known better than to some µs.
    pub ahead_ns: i64,
}

/// A state word with its text.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Word {
    /// The word.
    pub word: u16,
    /// What it says: `OP`, `OP LNK_MIS B`, `OK`.
    pub text: String,
}

/// A SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlineDevice {
    /// Its number, from 1.
    pub no: u32,
    /// Its name.
    pub name: String,
    /// Its order designation; may be empty.
    pub r#type: String,
    /// Its station address; 0: none.
    pub station: u16,
    /// Its place as auto-increment addresses count it: 0, 65535, 65534.
    pub auto_increment: u16,
    /// Whether it answers; `null` before it was looked for.
    pub present: Option<bool>,
    /// The state word: software in the low byte, wiring in the high byte.
    pub state: Word,
    /// Its state: `INIT`, `PREOP`, `SAFEOP`, `OP`, `BOOT`; `null` before it was read.
    pub al_state: Option<String>,
    /// Whether it signals an error.
    pub al_error: bool,
    /// Why; 0: no reason.
    pub al_code: u16,
    /// What the reason means; `null` without one.
    pub al_code_text: Option<String>,
    /// The state it is driven to; `null` when nobody drives the line.
    pub target: Option<String>,
    /// Whether a working counter that it has a share in was wrong in the last cycle; `null`: it has no
    /// process data. It may be the fault of another one: its state tells.
    pub wc_state: Option<bool>,
    /// How old its inputs are, in ns; `null`: it has none, or never gave any.
    pub age_ns: Option<u64>,
    /// Who it should be; `null` when nobody says.
    pub planned: Option<OnlineIdentity>,
    /// Who it is; `null` before it was asked.
    pub found: Option<OnlineIdentity>,
    /// Its DL status register (0x0110); `null` before it was read, and while it does not answer.
    pub dl_status: Option<u16>,
    /// How far its clock is off the reference clock, in ns (0x092C); `null`: none is in use, or it is that
    /// itself.
    #[serde(default)]
    pub clock_difference_ns: Option<u64>,
    /// Whether that is further than the sync window allows.
    #[serde(default)]
    pub clock_apart: bool,
    /// Its ports, A to D.
    pub ports: Vec<OnlinePort>,
    /// Frames that its processing unit refused (0x030C).
    pub processing_unit: Option<Count>,
    /// Errors between controller and processor (0x030D).
    pub pdi: Option<Count>,
    /// Frame and symbol errors of all its ports since the start or the last clear.
    pub errors: u64,
    /// Whether more may have happened: a register stood at 255, or somebody else cleared it.
    pub errors_lower_bound: bool,
    /// How often it left a state by itself. 0 is healthy.
    pub abnormal_changes: u64,
    /// 1 from the start, and one more each time it stopped answering.
    pub presence_changes: u64,
    /// The last abnormal changes, the oldest first.
    pub history: Vec<OnlineChange>,
    /// Its mailbox; `null`: it has none, or nobody drives the line.
    pub mailbox: Option<OnlineMailbox>,
    /// Its NetId, by which ADS reaches it (AoE); `null`: its configuration names none.
    #[serde(default)]
    pub net_id: Option<String>,
    /// Addresses, drive channels and times for programs; `null`: nobody drives the line.
    #[serde(default)]
    pub info: Option<OnlineInfo>,
}

/// Information of a SubDevice for programs, beside its state.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlineInfo {
    /// Its address by ADS, NetId and port: `192.168.1.5.2.1:4098`; `null`: no ADS server is open.
    pub ads_address: Option<String>,
    /// NetId for AoE: the one of its configuration (`net_id`), else that of the network with the station address in place
    /// of the last two bytes; `null`: it does not speak AoE, or no ADS server is open.
    pub aoe_net_id: Option<String>,
    /// Numbers of its drive channels, from 0; empty for all but drives.
    pub channels: Vec<u8>,
    /// Planned shift of SYNC0 against the begin of the cycle, in ns; `null`: it has no SYNC0.
    pub sync0_shift_ns: Option<i64>,
    /// From the begin of the cycle, when its outputs leave, to the SYNC0 that makes them effective, in ns; `null`: it
    /// has no SYNC0, or no outputs.
    pub output_shift_ns: Option<u64>,
    /// From the SYNC0 that takes its inputs to the begin of the cycle that fetches them, in ns; `null`: it has no SYNC0,
    /// or no inputs.
    pub input_shift_ns: Option<u64>,
    /// Index of its object in the dictionary of the MainDevice (ETG.1510), from 32768 (0x8000) on; `null`: it has none.
    pub object: Option<u16>,
}

/// Who a SubDevice is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the names are those of the EEPROM")]
pub struct OnlineIdentity {
    pub vendor_id: u32,
    pub product_code: u32,
    pub revision: u32,
    pub serial: u32,
}

/// A port.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlinePort {
    /// `A` to `D`.
    pub port: String,
    /// Whether there is a signal; `null` before it was read.
    pub link: Option<bool>,
    /// Whether frames go out there and come back; `null` before it was read.
    pub communication: Option<bool>,
    /// Who is planned at the other end; `null`: nobody, or the MainDevice.
    pub to: Option<Neighbour>,
    /// Damaged frames that came in there (0x0300 and so on).
    pub invalid_frames: Option<Count>,
    /// Symbols that could not be decoded (0x0301 and so on).
    pub physical_layer: Option<Count>,
    /// Damaged frames that others before had found (0x0308 and so on); `null`: not supported, or not
    /// read.
    pub forwarded: Option<Count>,
    /// How often the link was lost (0x0310 and so on).
    pub lost_links: Option<Count>,
}

/// A neighbour.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Neighbour {
    /// Its number.
    pub no: u32,
    /// Its station address.
    pub station: u16,
    /// Its place as auto-increment addresses count it.
    pub auto_increment: u16,
    /// Its port that this one is wired to.
    pub port: String,
}

/// An error counter.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Count {
    /// What the register holds: up to 255, history included.
    pub register: u8,
    /// How many since the start or the last clear.
    pub total: u64,
}

/// A state left by itself.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlineChange {
    /// When it was seen, in ns.
    pub at_ns: u64,
    /// Where it was.
    pub from: String,
    /// Where it went.
    pub to: String,
    /// The reason that it gave; 0: none.
    pub al_code: u16,
    /// What the reason means; `null` without one.
    pub al_code_text: Option<String>,
}

/// A mailbox.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlineMailbox {
    /// Bytes of a message to it.
    pub out_size: u16,
    /// Bytes of a message from it.
    pub in_size: u16,
    /// Whether the cycle reads if it holds something; else it is polled.
    pub mapped: bool,
    /// How many accesses failed so far.
    pub errors: u64,
    /// The failures that the next clean access of their protocol erases.
    pub standing: Vec<MailboxTrouble>,
}

/// An access to a mailbox that failed.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MailboxTrouble {
    /// The protocol: `CoE`, `FoE`.
    pub protocol: String,
    /// When it ended, in ns.
    pub at_ns: u64,
    /// What went wrong.
    pub text: String,
}

/// A cyclic frame.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlineFrame {
    /// Its task.
    pub task: String,
    /// Its number within the task, from 0.
    pub frame: u32,
    /// Datagrams that were sent without their outputs, a bit each; 0x8000: the frame was not sent.
    pub state: u16,
    /// Datagrams with a wrong working counter, a bit each; 0x8000: the frame did not come back.
    pub wc_state: u16,
    /// A bit for each datagram, turned over with each good answer.
    pub input_toggle: u16,
}

/// A sync unit.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OnlineSyncUnit {
    /// Its task.
    pub task: String,
    /// Its name.
    pub name: String,
    /// Whether one of its working counters was wrong in the last cycle.
    pub wc_state: bool,
    /// Numbers of the SubDevices that share it.
    pub devices: Vec<u32>,
}

/// Frames that were sent.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FrameCounts {
    /// How many, since the start or the last clear.
    pub sent: u64,
    /// How many of them did not come back in time.
    pub lost: u64,
    /// How many a second, over the last one; `null` before a second has passed.
    pub per_second: Option<f64>,
}

/// Frames that came back otherwise than they should.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OddFrames {
    /// After they had been given up.
    pub late: u64,
    /// Once more.
    pub duplicate: u64,
    /// Without their end.
    pub truncated: u64,
    /// Of ours, but nothing that is out.
    pub stray: u64,
    /// From others.
    pub foreign: u64,
}

/// A network card.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// `A` or `B`.
    pub path: String,
    /// Whether it has a link; `null`: not known.
    pub carrier: Option<bool>,
    /// Damaged frames that it dropped, and other errors of receiving.
    pub rx_errors: u64,
    /// Frames that it dropped for want of room.
    pub rx_drops: u64,
    /// Frames that it did not take.
    pub tx_errors: u64,
}

impl OnlineReport {
    /// Whether something is not as it should be: the network's word, a SubDevice's word, a working
    /// counter.
    #[must_use]
    pub fn has_trouble(&self) -> bool {
        let device = |one: &OnlineDevice| {
            one.al_error || one.present == Some(false) || one.wc_state == Some(true)
        };
        self.devices.iter().any(device) || (self.driven && self.state.word != 0)
    }
}
