//! SubDevices: identity, addresses, ports, set-up, and the words of the SII that were read; links between them.

use linesman_diagnosis::model::{Device, NetworkModel, Seen};
use linesman_diagnosis::report::{DeviceReport as Identity, Number};
use linesman_proto::port::Port;
use linesman_proto::register::{FmmuConfig, SmDirection, SmMode, SyncManagerConfig};
use linesman_proto::topology::End;
use serde::{Deserialize, Serialize};

/// A SubDevice. What the frames do not show is `null`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SurveyedDevice {
    /// Number, names, addresses, identity and state.
    #[serde(flatten)]
    pub about: Identity,
    /// Its type by a device description of its maker, where its identity was read and a description was found.
    pub described_as: Option<String>,
    /// Its position from 1, as it was last.
    pub position_no: Option<u32>,
    /// Its ports, where DL status was read.
    pub ports: Vec<PortStatusReport>,
    /// SyncManagers.
    pub sync_managers: Vec<SyncManagerSetUpReport>,
    /// FMMUs.
    pub fmmus: Vec<FmmuSetUpReport>,
    /// Distributed clock, where any register of it was written or read.
    pub clock: Option<ClockSetUpReport>,
    /// Words of the SII that were read.
    pub sii: Vec<SiiWordsReport>,
}

/// A port, by DL status (0x0110) as it was last read.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PortStatusReport {
    /// `A` to `D`.
    pub port: String,
    /// True if it has a link.
    pub link: bool,
    /// True if it is open and communicates.
    pub open: bool,
}

/// A SyncManager (0x0800 and up).
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SyncManagerSetUpReport {
    /// Its number, from 0.
    pub sync_manager: u8,
    /// The first address of its memory.
    pub start: u16,
    /// Length in bytes.
    pub length: u16,
    /// `mailbox`, `buffered`, or `reserved`.
    pub mode: String,
    /// `out` (the MainDevice writes), `in` (it reads), or `reserved`.
    pub direction: String,
    /// True if it is switched on.
    pub active: bool,
}

/// An FMMU (0x0600 and up).
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FmmuSetUpReport {
    /// Its number, from 0.
    pub fmmu: u8,
    /// The first logical address.
    pub logical_start: u32,
    /// Length in bytes.
    pub length: u16,
    /// The first bit of the first byte.
    pub start_bit: u8,
    /// The last bit of the last byte.
    pub stop_bit: u8,
    /// The first physical address.
    pub physical_start: u16,
    /// The first bit there.
    pub physical_bit: u8,
    /// `in` (it is read), `out` (it is written), `both`, or `none`.
    pub direction: String,
    /// True if it is switched on.
    pub active: bool,
}

/// A distributed clock. Times in ns.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ClockSetUpReport {
    /// System time minus local time (0x0920), as text: it may not fit a JSON number.
    pub offset_ns: Option<String>,
    /// Propagation delay from the reference clock (0x0928).
    pub delay_ns: Option<u32>,
    /// SYNC signals that are switched on (0x0981).
    pub activation: Option<u8>,
    /// System time of the first SYNC pulse (0x0990).
    pub start_ns: Option<Number>,
    /// Cycle of SYNC0 (0x09A0).
    pub sync0_ns: Option<u32>,
    /// Time from SYNC0 to SYNC1 (0x09A4).
    pub sync1_ns: Option<u32>,
    /// How far it is ahead of (positive) or behind the reference clock (0x092C), as last read.
    pub ahead_ns: Option<i64>,
}

/// A stretch of the SII.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SiiWordsReport {
    /// Address of the first word.
    pub word: u32,
    /// The words.
    pub words: Vec<u16>,
}

/// A link of the tree.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WiredLinkReport {
    /// The end nearer the MainDevice.
    pub a: LinkEndReport,
    /// The other end.
    pub b: LinkEndReport,
}

/// An end of a link.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LinkEndReport {
    /// Number of the SubDevice; 0 for the MainDevice.
    pub no: u32,
    /// Port, `A` to `D`; of the MainDevice its card, `A` or `B`.
    pub port: String,
}

/// All SubDevices of a network.
pub(crate) fn reports(model: &NetworkModel) -> Vec<SurveyedDevice> {
    model.devices.iter().map(report).collect()
}

/// The links, as far as the tree is known.
pub(crate) fn links(model: &NetworkModel) -> Vec<WiredLinkReport> {
    let end = |end: End<linesman_proto::address::DeviceId>| match end {
        End::MainDevice(card) => LinkEndReport { no: 0, port: card.to_string() },
        End::Controller(id, port) => LinkEndReport { no: id.no(), port: port.to_string() },
    };
    let links = model.links();
    links.map(|link| WiredLinkReport { a: end(link.upstream), b: end(link.downstream) }).collect()
}

fn report(device: &Device) -> SurveyedDevice {
    let ports = device.dl.last.map(|last| last.value);
    let ports = ports.into_iter().flat_map(|status| {
        Port::ALL.into_iter().map(move |port| {
            let state = status.port_state(port);
            PortStatusReport { port: port.to_string(), link: state.link, open: state.is_active() }
        })
    });
    let sync_managers = device.set_up.sync_managers.iter();
    let sii = device.sii.stretches().into_iter();
    SurveyedDevice {
        about: Identity::of(device),
        described_as: None,
        position_no: device.position.map(|position| u32::from(position.value()) + 1),
        ports: ports.collect(),
        sync_managers: sync_managers.map(|(no, config)| sync_manager(*no, config)).collect(),
        fmmus: device.fmmus.iter().map(|(no, config)| fmmu(*no, config)).collect(),
        clock: clock(device),
        sii: sii.map(|(word, words)| SiiWordsReport { word, words }).collect(),
    }
}

fn sync_manager(number: u8, config: &SyncManagerConfig) -> SyncManagerSetUpReport {
    let mode = match config.control.mode() {
        SmMode::Mailbox => "mailbox",
        SmMode::Buffered => "buffered",
        SmMode::Reserved(_) => "reserved",
    };
    let direction = match config.control.direction() {
        SmDirection::MainDeviceReads => "in",
        SmDirection::MainDeviceWrites => "out",
        SmDirection::Reserved(_) => "reserved",
    };
    SyncManagerSetUpReport {
        sync_manager: number,
        start: config.start.0,
        length: config.length,
        mode: mode.to_owned(),
        direction: direction.to_owned(),
        active: config.activate.enable(),
    }
}

fn fmmu(number: u8, config: &FmmuConfig) -> FmmuSetUpReport {
    FmmuSetUpReport {
        fmmu: number,
        logical_start: config.logical_start.0,
        length: config.length,
        start_bit: config.logical_start_bit,
        stop_bit: config.logical_stop_bit,
        physical_start: config.physical_start.0,
        physical_bit: config.physical_start_bit,
        direction: direction(config.reads, config.writes).to_owned(),
        active: config.active,
    }
}

/// `in`, `out`, `both`, `none`.
pub(crate) const fn direction(reads: bool, writes: bool) -> &'static str {
    match (reads, writes) {
        (true, false) => "in",
        (false, true) => "out",
        (true, true) => "both",
        (false, false) => "none",
    }
}

fn clock(device: &Device) -> Option<ClockSetUpReport> {
    fn value<T: Copy>(seen: Option<Seen<T>>) -> Option<T> {
        seen.map(|seen| seen.value)
    }
    let set_up = &device.set_up.clock;
    let ahead_ns = device.clock.differences.back().map(|seen| seen.value);
    (!set_up.is_unknown() || ahead_ns.is_some()).then(|| ClockSetUpReport {
        offset_ns: value(set_up.offset_ns).map(|ns| ns.to_string()),
        delay_ns: value(set_up.delay_ns),
        activation: value(set_up.activation),
        start_ns: value(set_up.start_ns).map(Number),
        sync0_ns: value(set_up.sync0_ns),
        sync1_ns: value(set_up.sync1_ns),
        ahead_ns,
    })
}
