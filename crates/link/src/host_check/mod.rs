//! Checks of this host's real-time set-up: what makes frames late, lost or impossible, with the
//! commands that fix it.
//!
//! Everything is read from `/sys` and `/proc`, below a folder that is `/` unless said, so that a copy of
//! another computer's files can be judged, too; what only a driver knows comes in as [`DriverSettings`].
//! Nothing is changed: each check names the commands that would mend what it found.
//!
//! Reference: `Documentation/admin-guide/pm/{cpuidle,cpufreq}.rst`, `scheduler/sched-rt-group.rst` and
//! `networking/statistics.rst` of Linux, proc(5), capabilities(7), ethtool(8).

mod card;
mod files;
mod firewall;
mod kernel;
mod machine;
mod network;
mod privilege;
mod processor;

use std::fmt;

pub use card::DriverSettings;
pub use files::Files;
pub use firewall::FirewallRules;

/// What a check is about.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Area {
    /// What this process may do.
    Rights,
    /// What runs beneath the kernel: a virtual machine, a container.
    Machine,
    /// The kernel and its scheduler.
    Kernel,
    /// The processors and their power saving.
    Processor,
    /// The network card.
    Card,
    /// Network settings that Ethernet over EtherCAT needs.
    Network,
}

impl fmt::Display for Area {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rights => "rights",
            Self::Machine => "machine",
            Self::Kernel => "kernel",
            Self::Processor => "processor",
            Self::Card => "card",
            Self::Network => "network",
        })
    }
}

/// What a check came to.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Outcome {
    /// Nothing to do.
    Good,
    /// It could not be told.
    Unknown,
    /// It makes frames late or loses some.
    Doubtful,
    /// Cyclic work cannot be relied on, or is not possible at all.
    Bad,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Good => "good",
            Self::Unknown => "unknown",
            Self::Doubtful => "doubtful",
            Self::Bad => "bad",
        })
    }
}

/// One thing that was looked at.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Check {
    /// What it is about.
    pub area: Area,
    /// Its name, lower case with hyphens.
    pub name: &'static str,
    /// What came of it.
    pub outcome: Outcome,
    /// What was found.
    pub found: String,
    /// What that does to EtherCAT; empty where all is well.
    pub effect: String,
    /// What mends it, command by command, or in words where no command does; most promising first.
    pub mend: Vec<String>,
}

impl Check {
    fn new(area: Area, name: &'static str, outcome: Outcome, found: impl Into<String>) -> Self {
        let (found, effect, mend) = (found.into(), String::new(), Vec::new());
        Self { area, name, outcome, found, effect, mend }
    }

    fn good(area: Area, name: &'static str, found: impl Into<String>) -> Self {
        Self::new(area, name, Outcome::Good, found)
    }

    fn unknown(area: Area, name: &'static str, found: impl Into<String>) -> Self {
        Self::new(area, name, Outcome::Unknown, found)
    }

    fn effect(mut self, effect: &str) -> Self {
        effect.clone_into(&mut self.effect);
        self
    }

    fn mend(mut self, command: impl Into<String>) -> Self {
        self.mend.push(command.into());
        self
    }
}

/// All checks, of the whole computer and of the cards in `cards`, each with what its driver says.
#[must_use]
pub fn inspect(files: &Files, cards: &[(String, DriverSettings)]) -> Vec<Check> {
    let mut checks = privilege::checks(files);
    checks.extend(machine::checks(files));
    checks.extend(kernel::checks(files));
    checks.extend(processor::checks(files));
    for (name, settings) in cards {
        checks.extend(card::checks(files, name, settings));
    }
    checks
}

/// Checks of the network settings that Ethernet over EtherCAT needs (EOE-13); `interface` is the one of `run --eoe`, if there is
/// one to look at, and `rules` those of a firewall, if they were asked for.
#[must_use]
pub fn inspect_network(
    files: &Files,
    interface: Option<&str>,
    rules: Option<&FirewallRules>,
) -> Vec<Check> {
    network::checks(files, interface, rules)
}
