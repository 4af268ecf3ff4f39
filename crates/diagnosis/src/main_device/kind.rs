//! Kinds of MainDevices and the marks by which they are recognised.
//!
//! A name needs two marks; by one alone it is a guess. The marks come from the sources of the programs
//! where those are open, and from recordings.

use core::ops::Range;

use linesman_proto::ethernet::MacAddress;
use serde::{Deserialize, Serialize};

use super::habits::SenderHabits;

/// The destination address that Beckhoff registered for EtherCAT.
pub(super) const ETHERCAT_ADDRESS: MacAddress = MacAddress([0x01, 0x01, 0x05, 0x01, 0x00, 0x00]);
/// Logical addresses at which configurators that write an ENI begin the process data of a task, or put the states of
/// the mailboxes.
pub(super) const CONFIGURED_ADDRESSES: Range<u32> = 0x0100_0000..0x0A00_0000;
/// SOEM: every byte 1, see `nicdrv.c`.
const SOEM_SOURCE: MacAddress = MacAddress([0x01; 6]);
/// ethercrab: every byte 0x10, see `lib.rs`.
const ETHERCRAB_SOURCE: MacAddress = MacAddress([0x10; 6]);
/// KickCAT: `PRIMARY_IF_MAC` of its versions, and `SECONDARY_IF_MAC`.
const KICKCAT_SOURCES: [MacAddress; 3] = [
    MacAddress([0xCA, 0xDE, 0xCA, 0xDE, 0xDE, 0xFF]),
    MacAddress([0x02, 0xCA, 0xCA, 0x0F, 0xFF, 0xFF]),
    MacAddress([0x02, 0xC0, 0xFF, 0xEE, 0x00, 0xFF]),
];
/// True if a MainDevice sends from this address on every computer: it tells the program, and nobody's card.
#[must_use]
pub fn is_fixed_source(address: MacAddress) -> bool {
    let fixed = KICKCAT_SOURCES.into_iter().chain([SOEM_SOURCE, ETHERCRAB_SOURCE]);
    fixed.into_iter().any(|one| one.marked() == address.marked())
}

/// So many frames show how indexes are used.
const MANY: u64 = 64;
/// Counters that are read and cleared so often in turn are cleared as a habit.
const CLEARED_AGAIN: u64 = 2;

/// A kind of MainDevice.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Debug, Serialize, Deserialize,
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum MainDeviceKind {
    /// SOEM, the Simple Open EtherCAT Master.
    Soem,
    /// The IgH EtherCAT Master of the `EtherLab`.
    Igh,
    /// ethercrab.
    Ethercrab,
    /// `KickCAT`.
    Kickcat,
    /// `TwinCAT`.
    Twincat,
    /// Another Linesman.
    Linesman,
    /// None of these, or too little was seen.
    #[default]
    Unknown,
}

impl MainDeviceKind {
    /// All that have a name.
    pub const NAMED: [Self; 6] =
        [Self::Soem, Self::Igh, Self::Ethercrab, Self::Kickcat, Self::Twincat, Self::Linesman];

    /// Its name as its makers write it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Soem => "SOEM",
            Self::Igh => "IgH EtherCAT Master",
            Self::Ethercrab => "ethercrab",
            Self::Kickcat => "KickCAT",
            Self::Twincat => "TwinCAT",
            Self::Linesman => "Linesman",
            Self::Unknown => "unknown",
        }
    }
}

/// How sure the kind is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Certainty {
    /// No mark, or as many for another kind.
    None,
    /// One mark.
    Perhaps,
    /// Two marks or more that do not depend on each other.
    Likely,
}

/// A mark by which a kind is recognised.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mark {
    /// The source address that the program writes into each frame.
    Source(MacAddress),
    /// The destination address of the frames.
    Destination,
    /// The station address of the first SubDevice.
    FirstStation(u16),
    /// The same index in all datagrams of a frame, 0 to 15.
    SixteenIndexes,
    /// The first datagram's index counts frames, those of the others its carry.
    IndexesOfTwoBytes,
    /// The alias bit of DL control is cleared by a write of its own.
    AliasBitCleared,
    /// All FMMUs are cleared by one write of 256 bytes.
    FmmusClearedAtOnce,
    /// FMMUs are cleared one by one.
    FmmusClearedSingly,
    /// The EEPROM interface is read with 10 bytes at once.
    EepromByTen,
    /// The system time is distributed with 4 bytes.
    HalfSystemTime,
    /// Time differences of all are read by one broadcast.
    DifferencesOfAll,
    /// Error counters are read and cleared in turn.
    CountersCleared,
    /// Process data at the addresses that configurators give, with AL status of all in the same frame.
    ConfiguredFrames,
}

impl Mark {
    /// The mark in words.
    #[must_use]
    pub fn words(self) -> String {
        match self {
            Self::Source(mac) => format!("source address {mac}"),
            Self::Destination => format!("destination address {ETHERCAT_ADDRESS}"),
            Self::FirstStation(station) => format!("first station address 0x{station:04X}"),
            Self::SixteenIndexes => "one index for each frame, 0 to 15".to_owned(),
            Self::IndexesOfTwoBytes => "frames numbered by two index bytes".to_owned(),
            Self::AliasBitCleared => "BWR 0x0103 of 1 byte at start-up".to_owned(),
            Self::FmmusClearedAtOnce => "BWR 0x0600 of 256 bytes at start-up".to_owned(),
            Self::FmmusClearedSingly => "FMMUs cleared one by one at start-up".to_owned(),
            Self::EepromByTen => "EEPROM interface read by 10 bytes".to_owned(),
            Self::HalfSystemTime => "FRMW 0x0910 of 4 bytes".to_owned(),
            Self::DifferencesOfAll => "BRD 0x092C of 4 bytes".to_owned(),
            Self::CountersCleared => "error counters read and cleared in turn".to_owned(),
            Self::ConfiguredFrames => {
                "process data from 0x01000000 with BRD 0x0130 in the same frame".to_owned()
            }
        }
    }
}

/// A MainDevice as far as it is recognised.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Recognised {
    /// The kind.
    pub kind: MainDeviceKind,
    /// How sure.
    pub certainty: Certainty,
    /// The marks.
    pub marks: Vec<Mark>,
}

/// Weighs the marks of one sender.
pub(super) fn recognise(habits: &SenderHabits) -> Recognised {
    let mut found: Vec<(MainDeviceKind, Vec<Mark>)> =
        MainDeviceKind::NAMED.map(|kind| (kind, marks(kind, habits))).into();
    found.sort_by_key(|(_, marks)| core::cmp::Reverse(marks.len()));
    let second = found.get(1).map_or(0, |(_, marks)| marks.len());
    let (kind, marks) = found.swap_remove(0);
    let certainty = match marks.len() {
        count if count <= second => Certainty::None,
        1 => Certainty::Perhaps,
        _ => Certainty::Likely,
    };
    if certainty == Certainty::None {
        return Recognised { kind: MainDeviceKind::Unknown, certainty, marks: Vec::new() };
    }
    Recognised { kind, certainty, marks }
}

fn marks(kind: MainDeviceKind, habits: &SenderHabits) -> Vec<Mark> {
    let source = |mac: MacAddress| (habits.mac == mac.marked()).then_some(Mark::Source(mac));
    let station = habits.base.or(habits.lowest_station);
    let first = |wanted: u16| (station == Some(wanted)).then_some(Mark::FirstStation(wanted));
    let index = &habits.index;
    let marks = match kind {
        MainDeviceKind::Soem => vec![
            source(SOEM_SOURCE),
            first(0x1001),
            (habits.requests >= MANY && index.highest == 15 && index.same == index.several)
                .then_some(Mark::SixteenIndexes),
            habits.clears_alias_bit.then_some(Mark::AliasBitCleared),
        ],
        MainDeviceKind::Igh => vec![
            first(0x0001),
            habits.reads_eeprom_by_ten.then_some(Mark::EepromByTen),
            habits.distributes_half_time.then_some(Mark::HalfSystemTime),
            habits.reads_differences.then_some(Mark::DifferencesOfAll),
        ],
        MainDeviceKind::Ethercrab => vec![
            source(ETHERCRAB_SOURCE),
            first(0x1000),
            habits.clears_single_fmmus.then_some(Mark::FmmusClearedSingly),
        ],
        MainDeviceKind::Kickcat => vec![
            KICKCAT_SOURCES.into_iter().find_map(source),
            first(1001),
            habits.clears_all_fmmus.then_some(Mark::FmmusClearedAtOnce),
        ],
        MainDeviceKind::Twincat => vec![
            (habits.requests > 0 && habits.to_ethercat_address == habits.requests)
                .then_some(Mark::Destination),
            first(1001),
            (habits.counter_clears >= CLEARED_AGAIN).then_some(Mark::CountersCleared),
            (habits.configured_frames >= MANY).then_some(Mark::ConfiguredFrames),
        ],
        MainDeviceKind::Linesman => vec![
            first(0x1001),
            (index.several >= MANY && index.steady * 10 >= index.several * 9)
                .then_some(Mark::IndexesOfTwoBytes),
        ],
        MainDeviceKind::Unknown => Vec::new(),
    };
    marks.into_iter().flatten().collect()
}
