//! The truth log: what was injected, and every effect that it had.
//!
//! It is written by the physics, never read by them, and shown to nobody who diagnoses: it is what
//! a verdict is held against.

mod audit;

use std::collections::BTreeMap;

use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::register::WatchdogTime;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use crate::controller::WatchdogKind;
use crate::device::SoftwareFault;

pub use audit::{AuditedCounter, Unexplained};
pub(crate) use audit::{Cause, Ledger};

/// How many entries are kept; what comes later is counted in the [`FaultRecord`]s only, so that a
/// segment may run for days.
pub const MAX_ENTRIES: usize = 200_000;

/// Which fault of the run: its index in the order of injection.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct FaultId(pub u32);

/// Where something happened.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Place {
    /// One direction of a link: from the first end to the second.
    Direction(End<DeviceId>, End<DeviceId>),
    /// A link, both directions; the first end is the one nearer the MainDevice.
    Link(End<DeviceId>, End<DeviceId>),
    /// A controller.
    Device(DeviceId),
    /// A card of the MainDevice.
    Host(Path),
}

/// What a cause made happen.
///
/// Each has a stable name for programs, [`Effect::name`]: `frame-lost`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Effect {
    /// A symbol was destroyed, in or outside of a frame: the receiver's physical-layer error.
    SymbolError,
    /// A frame was spoiled on the wire or in a device.
    FrameSpoiled {
        /// Number of the frame in the segment.
        frame: u64,
    },
    /// A frame, or the rest of one, vanished.
    FrameLost {
        /// Number of the frame in the segment.
        frame: u64,
    },
    /// Somebody else than the MainDevice sent a frame.
    StrangerSent {
        /// Number of the frame in the segment.
        frame: u64,
    },
    /// A processing unit counted an undamaged frame for what is in it: foreign, too short,
    /// circulating.
    ContentRefused {
        /// Number of the frame in the segment.
        frame: u64,
    },
    /// An end of a link found its signal gone.
    SignalLost,
    /// Both ends of a link have it again.
    SignalBack,
    /// A controller lost its supply.
    PowerLost,
    /// A controller has its supply again and starts.
    PowerBack,
    /// A change of state is refused with this AL status code from now on.
    StateRefused {
        /// The code in 0x0134.
        code: u16,
    },
    /// The software of a device misbehaves from now on.
    Misbehaves(SoftwareFault),
    /// The processor of a device stopped.
    ProcessorStopped,
    /// It runs again.
    ProcessorRuns,
    /// It started anew by itself, without its controller.
    ProcessorRestarted,
    /// A card sends nothing for a while.
    CardSilent,
    /// A watchdog was set to another time than the MainDevice set, or back.
    WatchdogSet {
        /// As in 0x0420; `None` for the former one.
        time: Option<WatchdogTime>,
    },
    /// A watchdog ran out and counted it. Entered when the log is audited.
    WatchdogExpired {
        /// Which.
        kind: WatchdogKind,
        /// How long what it waits for had not come.
        silence: Span,
    },
    /// A device was made to send an emergency.
    EmergencySent {
        /// Its code; 0 takes the one before back.
        code: u16,
    },
    /// The quartz of a device has another speed from now on.
    ClockDrifts {
        /// Parts per thousand million too fast.
        ppb: i64,
    },
    /// The quartz of a device stands.
    ClockStopped,
    /// The clock of a device started anew.
    ClockRestarted,
    /// The quartz of a device has its own speed again.
    ClockRestored,
    /// The SYNC signals of a device do not reach its processor any more.
    SyncCut,
    /// Each SYNC signal of a device reaches its processor twice.
    SyncBounces,
    /// They reach it again as they are.
    SyncBack,
    /// The work of a device takes so long in each cycle from now on.
    WorkTakes {
        /// How long.
        takes: Span,
    },
    /// It takes as long as it needs again.
    WorkRestored,
    /// A card kept a frame back.
    FrameHeldBack {
        /// How long.
        by: Span,
    },
    /// Counters were not 0 at the start: noise at power-on or plugging, old errors.
    OldCounters,
    /// Another type of device than planned sits here.
    WrongDevice,
    /// A device that was planned is not here.
    MissingDevice,
    /// A device that was not planned is here.
    ExtraDevice,
    /// A device sits in the place of another one, and that one in its.
    SwappedDevice,
    /// A device answers to this address, as another one does.
    SharedAddress {
        /// The station address or alias.
        address: u16,
    },
    /// A cable is plugged into another port than planned.
    WrongPort,
}

impl Effect {
    /// Its stable name for programs.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::SymbolError => "symbol-error",
            Self::FrameSpoiled { .. } => "frame-spoiled",
            Self::FrameLost { .. } => "frame-lost",
            Self::StrangerSent { .. } => "stranger-sent",
            Self::ContentRefused { .. } => "content-refused",
            Self::SignalLost => "signal-lost",
            Self::SignalBack => "signal-back",
            Self::PowerLost => "power-lost",
            Self::PowerBack => "power-back",
            Self::StateRefused { .. } => "state-refused",
            Self::Misbehaves(_) => "misbehaves",
            Self::ProcessorStopped => "processor-stopped",
            Self::ProcessorRuns => "processor-runs",
            Self::ProcessorRestarted => "processor-restarted",
            Self::CardSilent => "card-silent",
            Self::WatchdogSet { .. } => "watchdog-set",
            Self::WatchdogExpired { .. } => "watchdog-expired",
            Self::EmergencySent { .. } => "emergency-sent",
            Self::ClockDrifts { .. } => "clock-drifts",
            Self::ClockStopped => "clock-stopped",
            Self::ClockRestarted => "clock-restarted",
            Self::ClockRestored => "clock-restored",
            Self::SyncCut => "sync-cut",
            Self::SyncBounces => "sync-bounces",
            Self::SyncBack => "sync-back",
            Self::WorkTakes { .. } => "work-takes",
            Self::WorkRestored => "work-restored",
            Self::FrameHeldBack { .. } => "frame-held-back",
            Self::OldCounters => "old-counters",
            Self::WrongDevice => "wrong-device",
            Self::MissingDevice => "missing-device",
            Self::ExtraDevice => "extra-device",
            Self::SwappedDevice => "swapped-device",
            Self::SharedAddress { .. } => "shared-address",
            Self::WrongPort => "wrong-port",
        }
    }

    /// The number of the frame it was about, if it was about one.
    #[must_use]
    pub const fn frame(&self) -> Option<u64> {
        if let Self::FrameSpoiled { frame }
        | Self::FrameLost { frame }
        | Self::ContentRefused { frame } = self
        {
            Some(*frame)
        } else {
            None
        }
    }
}

/// An entry of the log.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Entry {
    /// A fault begins to act.
    Begin {
        /// When.
        at: Instant,
        /// Which one.
        fault: FaultId,
    },
    /// A fault ends or is healed.
    End {
        /// When.
        at: Instant,
        /// Which one.
        fault: FaultId,
    },
    /// Something happened.
    Effect {
        /// When.
        at: Instant,
        /// The fault that caused it; `None` for what is no fault.
        fault: Option<FaultId>,
        /// Where.
        place: Place,
        /// What.
        effect: Effect,
    },
}

/// A fault of the run and what it has done so far.
#[derive(Clone, PartialEq, Debug)]
pub struct FaultRecord {
    /// Which.
    pub id: FaultId,
    /// What it is.
    pub name: FaultName,
    /// Where it was put: one place, or several that share one cause.
    pub places: Vec<Place>,
    /// When it first began to act.
    pub began: Option<Instant>,
    /// When it ended or was healed, the last time; `None` while it acts.
    pub ended: Option<Instant>,
    /// How often it has come so far.
    pub times: u32,
    /// When it first had an effect.
    pub first_effect: Option<Instant>,
    /// Symbols destroyed.
    pub symbol_errors: u64,
    /// Frames spoiled.
    pub frames_spoiled: u64,
    /// Frames, or rests of frames, that vanished.
    pub frames_lost: u64,
    /// Frames that it sent itself.
    pub frames_sent: u64,
    /// Frames that it kept back.
    pub frames_delayed: u64,
    /// Ends of links that lost their link.
    pub links_lost: u64,
    /// Controllers that lost their supply.
    pub supplies_lost: u64,
}

impl FaultRecord {
    /// Whether it acts at present.
    #[must_use]
    pub fn is_active(&self) -> bool {
        self.began.is_some() && self.ended.is_none()
    }

    fn add(&mut self, at: Instant, effect: Effect) {
        self.first_effect = Some(self.first_effect.map_or(at, |first| first.min(at)));
        match effect {
            Effect::SymbolError => self.symbol_errors += 1,
            Effect::FrameSpoiled { .. } => self.frames_spoiled += 1,
            Effect::FrameLost { .. } => self.frames_lost += 1,
            Effect::SignalLost => self.links_lost += 1,
            Effect::PowerLost => self.supplies_lost += 1,
            Effect::StrangerSent { .. } => self.frames_sent += 1,
            Effect::FrameHeldBack { .. } => self.frames_delayed += 1,
            Effect::ContentRefused { .. }
            | Effect::SignalBack
            | Effect::PowerBack
            | Effect::StateRefused { .. }
            | Effect::Misbehaves(_)
            | Effect::ProcessorStopped
            | Effect::ProcessorRuns
            | Effect::ProcessorRestarted
            | Effect::EmergencySent { .. }
            | Effect::CardSilent
            | Effect::WatchdogSet { .. }
            | Effect::WatchdogExpired { .. }
            | Effect::ClockDrifts { .. }
            | Effect::ClockStopped
            | Effect::ClockRestarted
            | Effect::ClockRestored
            | Effect::SyncCut
            | Effect::SyncBounces
            | Effect::SyncBack
            | Effect::WorkTakes { .. }
            | Effect::WorkRestored
            | Effect::OldCounters
            | Effect::WrongDevice
            | Effect::MissingDevice
            | Effect::ExtraDevice
            | Effect::SwappedDevice
            | Effect::SharedAddress { .. }
            | Effect::WrongPort => {}
        }
    }
}

/// The log.
///
/// Entries are in the order in which the physics found them; effects on frames that were in flight
/// at once may be a few microseconds out of order.
#[derive(Clone, Default, Debug)]
pub struct TruthLog {
    entries: Vec<Entry>,
    left_out: u64,
    faults: Vec<FaultRecord>,
    /// What each counter may have counted, and for whom.
    pub(crate) ledger: BTreeMap<(DeviceId, AuditedCounter), Ledger>,
}

impl TruthLog {
    /// What happened, up to [`MAX_ENTRIES`].
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// How many entries more there were.
    #[must_use]
    pub const fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Hands out the entries and forgets them, for whoever keeps them elsewhere. Faults and what
    /// they did stay known.
    pub fn take_entries(&mut self) -> Vec<Entry> {
        std::mem::take(&mut self.entries)
    }

    /// Every fault so far, by [`FaultId`].
    #[must_use]
    pub fn faults(&self) -> &[FaultRecord] {
        &self.faults
    }

    /// One fault.
    #[must_use]
    pub fn fault(&self, id: FaultId) -> Option<&FaultRecord> {
        self.faults.get(id.0 as usize)
    }

    /// Faults that act at present.
    pub fn active(&self) -> impl Iterator<Item = &FaultRecord> {
        self.faults.iter().filter(|fault| fault.is_active())
    }

    pub(crate) fn declare(&mut self, name: FaultName, places: Vec<Place>) -> FaultId {
        let id = FaultId(self.faults.len() as u32);
        self.faults.push(FaultRecord {
            id,
            name,
            places,
            began: None,
            ended: None,
            times: 0,
            first_effect: None,
            symbol_errors: 0,
            frames_spoiled: 0,
            frames_lost: 0,
            frames_sent: 0,
            frames_delayed: 0,
            links_lost: 0,
            supplies_lost: 0,
        });
        id
    }

    pub(crate) fn begin(&mut self, at: Instant, fault: FaultId) {
        if let Some(record) = self.faults.get_mut(fault.0 as usize) {
            record.began.get_or_insert(at);
            record.ended = None;
            record.times += 1;
        }
        self.push(Entry::Begin { at, fault });
    }

    pub(crate) fn end(&mut self, at: Instant, fault: FaultId) {
        if let Some(record) = self.faults.get_mut(fault.0 as usize) {
            record.ended = Some(at);
        }
        self.push(Entry::End { at, fault });
    }

    pub(crate) fn effect(
        &mut self,
        at: Instant,
        fault: Option<FaultId>,
        place: Place,
        effect: Effect,
    ) {
        if let Some(record) = fault.and_then(|id| self.faults.get_mut(id.0 as usize)) {
            record.add(at, effect);
        }
        self.push(Entry::Effect { at, fault, place, effect });
    }

    fn push(&mut self, entry: Entry) {
        if self.entries.len() < MAX_ENTRIES {
            self.entries.push(entry);
        } else {
            self.left_out += 1;
        }
    }
}
