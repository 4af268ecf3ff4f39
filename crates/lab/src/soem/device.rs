//! Knowledge that SOEM has of a SubDevice.

use linesman_config::plan::ClockSettings;
use linesman_config::start_up::StartUpCommand;
use linesman_maindevice::Target;
use linesman_proto::address::{Position, StationAddress};
use linesman_proto::mailbox::Counter;
use linesman_proto::register::{DlStatus, FmmuConfig, SyncManagerConfig};
use linesman_proto::sii::SyncManagerKind;

/// `SyncManager`s that are kept: `EC_MAXSM`.
pub(super) const SYNC_MANAGERS: usize = 8;
/// The bit of AL status and AL control that tells of an error and acknowledges it.
pub(super) const ERROR: u16 = 0x10;
/// Nobody answers.
pub(super) const NONE: u16 = 0;
pub(super) const INIT: u16 = 1;
pub(super) const PRE_OP: u16 = 2;
pub(super) const SAFE_OP: u16 = 4;
pub(super) const OP: u16 = 8;

/// Mailbox as the EEPROM describes it.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Mailbox {
    /// Where it is written, and how many bytes.
    pub(super) out: (u16, u16),
    /// Where it is read.
    pub(super) back: (u16, u16),
    /// Protocols.
    pub(super) protocols: u16,
    /// Number of the last message.
    pub(super) counter: Option<Counter>,
}

/// One SubDevice, by its place in the order of processing.
#[derive(Clone, Default, Debug)]
pub(super) struct Device {
    pub(super) position: u16,
    pub(super) station: u16,
    pub(super) alias: u16,
    /// Vendor, product, revision, serial number.
    pub(super) identity: [u32; 4],
    pub(super) mailbox: Option<Mailbox>,
    /// Details of CoE in the EEPROM.
    pub(super) coe_details: u8,
    pub(super) has_clock: bool,
    pub(super) dl_status: DlStatus,
    /// The EEPROM is with the SubDevice's processor.
    pub(super) eeprom_at_pdi: bool,
    pub(super) sync_managers: [SyncManagerConfig; SYNC_MANAGERS],
    /// What each is for.
    pub(super) kinds: [SyncManagerKind; SYNC_MANAGERS],
    pub(super) fmmus: Vec<FmmuConfig>,
    pub(super) output_bits: u32,
    pub(super) input_bits: u32,
    pub(super) state: u16,
    pub(super) is_lost: bool,
    /// What the program that uses SOEM gives it: the hook from PREOP to SAFEOP.
    pub(super) hook: Hook,
}

/// What a program does to a SubDevice between PREOP and SAFEOP.
#[derive(Clone, Default, Debug)]
pub(crate) struct Hook {
    /// SYNC0.
    pub(crate) clock: Option<ClockSettings>,
    /// Commands of the transition.
    pub(crate) start_up: Vec<StartUpCommand>,
}

impl Device {
    pub(super) fn new(position: u16) -> Self {
        Self { position, station: 0x1001 + position, ..Self::default() }
    }

    /// It, by its station address.
    pub(super) const fn target(&self) -> Target {
        Target::Station(StationAddress(self.station))
    }

    /// It, by its place.
    pub(super) const fn place(&self) -> Target {
        Target::Position(Position(self.position))
    }

    pub(super) fn is_like(&self, other: &Self) -> bool {
        self.identity[..3] == other.identity[..3]
    }

    pub(super) const fn output_bytes(&self) -> usize {
        if self.output_bits > 7 { self.output_bits.div_ceil(8) as usize } else { 0 }
    }

    pub(super) const fn input_bytes(&self) -> usize {
        if self.input_bits > 7 { self.input_bits.div_ceil(8) as usize } else { 0 }
    }
}
