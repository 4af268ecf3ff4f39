//! One line of the log.

use std::fmt;

use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;

/// How much an entry matters.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Severity {
    /// Good to know.
    Info,
    /// Something is not as it should be; the network goes on.
    Warning,
    /// Something does not work.
    Error,
}

impl Severity {
    /// From the mildest to the worst.
    pub const ALL: [Self; 3] = [Self::Info, Self::Warning, Self::Error];

    /// The word in files and filters.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }

    /// The severity of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|severity| severity.name() == name)
    }
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What an entry is about: a stable word to filter by.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum EntryKind {
    /// A SubDevice entered a state it was asked to enter, or all have.
    State,
    /// It left its state by itself.
    AbnormalState,
    /// It refused a state, or did not reach it in time.
    StateAborted,
    /// It does not answer any more, or does again.
    Communication,
    /// It is not who it should be, or nobody planned it.
    Identity,
    /// Its ports changed.
    Link,
    /// Its error counters rose.
    Counter,
    /// A working counter was wrong, or is right again.
    WorkingCounter,
    /// Cyclic frames got lost, or come back.
    Frames,
    /// The ring was broken, or is whole again.
    Ring,
    /// A SubDevice sent an emergency message.
    Emergency,
    /// An access to its mailbox failed, or its drive has told something through it.
    Mailbox,
    /// The host: carrier, application.
    Host,
    /// Distributed clocks.
    Clock,
    /// What the diagnosis has found, and what became of it.
    Finding,
}

impl EntryKind {
    /// All of them.
    pub const ALL: [Self; 15] = [
        Self::State,
        Self::AbnormalState,
        Self::StateAborted,
        Self::Communication,
        Self::Identity,
        Self::Link,
        Self::Counter,
        Self::WorkingCounter,
        Self::Frames,
        Self::Ring,
        Self::Emergency,
        Self::Mailbox,
        Self::Host,
        Self::Clock,
        Self::Finding,
    ];

    /// The word in files and filters.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::State => "state",
            Self::AbnormalState => "abnormal-state",
            Self::StateAborted => "state-aborted",
            Self::Communication => "communication",
            Self::Identity => "identity",
            Self::Link => "link",
            Self::Counter => "counter",
            Self::WorkingCounter => "working-counter",
            Self::Frames => "frames",
            Self::Ring => "ring",
            Self::Emergency => "emergency",
            Self::Mailbox => "mailbox",
            Self::Host => "host",
            Self::Clock => "clock",
            Self::Finding => "finding",
        }
    }

    /// The kind of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

impl fmt::Display for EntryKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One line of the log.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LogEntry {
    /// When it happened.
    pub at: Instant,
    /// How much it matters.
    pub severity: Severity,
    /// What it is about.
    pub kind: EntryKind,
    /// Whom it concerns; `None`: the network.
    pub device: Option<DeviceId>,
    /// What happened, in words.
    pub text: String,
}
