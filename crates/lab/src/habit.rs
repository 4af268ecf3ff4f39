//! Habits of MainDevices that the MainDevice of the lab plays: what it reads beside process data, how often, and
//! what it does about SubDevices that have left their state.
//!
//! The diagnosis beside another MainDevice sees nothing but what that one asks. All habits but SOEM's are ours with
//! other polls ([`Polling`]): what they send is nothing that we do not send, but less of it. SOEM's start-up, numbering
//! of frames and recovery are its own (`docs/decisions/08-habits-of-others.md`).

use std::fmt;
use std::str::FromStr;

use linesman_config::plan::PlanOptions;
use linesman_maindevice::{CounterPoll, Options, Polling, Rounds};
use linesman_proto::time::Span;

/// A habit.
#[derive(
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Debug,
    Default,
    serde::Serialize,
    serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Habit {
    /// Ours: AL status, DL status and error counters of each SubDevice every 100 ms, AL status of all in each cycle.
    #[default]
    Own,
    /// Process data and nothing else once all are up; nothing is brought back.
    ProcessData,
    /// AL status of all once a second, of each when that is not as it should be; what has left its state is
    /// brought back.
    States,
    /// The same, with DL status of each when something is wrong.
    Links,
    /// As states, with all error counters of each SubDevice once a second.
    Counters,
    /// As states, with the error counters of all ports once a second, cleared each time, as `TwinCAT` does.
    Clearing,
    /// As a program with SOEM: its own start-up, frames and recovery.
    Soem,
}

/// How often a habit other than ours looks.
const ROUND: Span = Span::s(1);
/// Mailboxes are not looked into unless something is asked.
const NEVER: Span = Span::s(86_400);

impl Habit {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Own,
        Self::ProcessData,
        Self::States,
        Self::Links,
        Self::Counters,
        Self::Clearing,
        Self::Soem,
    ];

    /// The name on the command line and in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::ProcessData => "process-data",
            Self::States => "states",
            Self::Links => "links",
            Self::Counters => "counters",
            Self::Clearing => "clearing",
            Self::Soem => "soem",
        }
    }

    /// What it does, in a few words.
    #[must_use]
    pub const fn what(self) -> &'static str {
        match self {
            Self::Own => "all registers of each SubDevice every 100 ms",
            Self::ProcessData => "process data alone; nothing is brought back",
            Self::States => "states of all each second, of each when these differ",
            Self::Links => "as states, and DL status of each when something is wrong",
            Self::Counters => "as states, and all error counters each second",
            Self::Clearing => "as states, and error counters read and cleared each second",
            Self::Soem => "SOEM: its start-up, states of all every 50 ms, its recovery",
        }
    }

    /// What our MainDevice reads beside process data.
    fn polling(self) -> Polling {
        let rounds = |links, counters| Polling::Rounds(Rounds { links, counters });
        match self {
            Self::Own => Polling::EachDevice,
            Self::ProcessData => Polling::Nothing,
            Self::States | Self::Soem => rounds(false, CounterPoll::None),
            Self::Links => rounds(true, CounterPoll::None),
            Self::Counters => rounds(false, CounterPoll::Read),
            Self::Clearing => rounds(false, CounterPoll::ReadAndCleared),
        }
    }

    /// Whether SubDevices that were lost or have left their state are brought back.
    #[must_use]
    pub const fn brings_back(self) -> bool {
        !matches!(self, Self::ProcessData)
    }

    /// Our MainDevice with this habit.
    pub(crate) fn main_device(self, options: Options) -> Options {
        if self == Self::Own {
            return options;
        }
        Options {
            polling: self.polling(),
            watch_interval: ROUND,
            mailbox_interval: NEVER,
            restore_states: self.brings_back(),
            reinitialise: self.brings_back(),
            ..options
        }
    }

    /// Its cyclic frames: others do not read AL status of all in each cycle.
    pub(crate) fn plan(self, options: PlanOptions) -> PlanOptions {
        PlanOptions { presence: options.presence && self == Self::Own, ..options }
    }
}

impl fmt::Display for Habit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Habit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|one| one.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("`{text}` is no habit of a MainDevice; these are: {names}")
        })
    }
}
