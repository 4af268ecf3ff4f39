//! Times of bringing up: for the network, and for each SubDevice and step.

use std::fmt;

use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

/// A part of bringing up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Phase {
    /// Counting the SubDevices and taking back old station addresses.
    Count,
    /// Reading who they are, and giving them their station addresses.
    Identify,
    /// Measuring delays, setting clocks, and compensating their drift.
    Clocks,
    /// Waiting for a clock to follow the reference clock.
    ClockSettling,
    /// Writing what a state needs: SyncManagers, FMMUs, SyncSignals.
    SetUp(AlState),
    /// Start-up commands on the way to a state.
    StartUp(AlState),
    /// From the request of a state to the state.
    Step(AlState),
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count => f.write_str("count"),
            Self::Identify => f.write_str("identify and address"),
            Self::Clocks => f.write_str("clocks"),
            Self::ClockSettling => f.write_str("clock settling"),
            Self::SetUp(state) => write!(f, "set up for {state}"),
            Self::StartUp(state) => write!(f, "start-up commands to {state}"),
            Self::Step(state) => write!(f, "change to {state}"),
        }
    }
}

/// What one SubDevice took, since it was last brought up from INIT.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct DeviceTimes {
    /// Its phases in the order in which they ended; a step that was refused and tried again stands
    /// there twice.
    pub phases: Vec<(Phase, Span)>,
}

impl DeviceTimes {
    /// All its phases together. Others were brought up meanwhile.
    #[must_use]
    pub fn total(&self) -> Span {
        self.phases.iter().fold(Span::ZERO, |sum, (_, span)| sum + *span)
    }

    /// What took it longest.
    #[must_use]
    pub fn longest(&self) -> Option<(Phase, Span)> {
        self.phases.iter().copied().max_by_key(|(_, span)| *span)
    }
}

/// What bringing up a network took.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BringUpTimes {
    /// When it began.
    pub began: Instant,
    /// When all SubDevices had reached their targets for the first time; `None` before.
    pub reached: Option<Instant>,
    /// What was done for all at once.
    pub network: Vec<(Phase, Span)>,
    /// What each SubDevice took; they are brought up side by side.
    pub devices: Vec<DeviceTimes>,
}

/// More than this is not kept of a SubDevice that is refused again and again.
const MOST_PHASES: usize = 64;

impl BringUpTimes {
    pub(super) fn new(count: usize) -> Self {
        Self {
            began: Instant::ZERO,
            reached: None,
            network: Vec::new(),
            devices: vec![DeviceTimes::default(); count],
        }
    }

    pub(super) fn note(&mut self, id: DeviceId, phase: Phase, took: Span) {
        if let Some(times) = self.devices.get_mut(id.index())
            && times.phases.len() < MOST_PHASES
        {
            times.phases.push((phase, took));
        }
    }

    /// From the beginning until all had reached their targets; `None` before.
    #[must_use]
    pub fn took(&self) -> Option<Span> {
        self.reached.map(|reached| reached.since(self.began))
    }

    /// The SubDevice that took longest.
    #[must_use]
    pub fn slowest(&self) -> Option<(DeviceId, &DeviceTimes)> {
        let devices = (0..).map(DeviceId).zip(&self.devices);
        devices.max_by_key(|(_, times)| times.total())
    }
}
