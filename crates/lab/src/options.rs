//! Options of a lab.

use linesman_diagnosis::model::reported::PartExchange;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use crate::habit::Habit;

/// What a lab does with its line from the start.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Begin {
    /// Nothing is sent until told.
    Idle,
    /// The line is scanned, which changes no state.
    Scan,
    /// The line is scanned, driven to the target state and kept there.
    #[default]
    Run,
}

/// Choices for a lab.
#[derive(Clone, Debug)]
pub struct LabOptions {
    /// How the MainDevice drives the line. Beside another habit than ours the diagnosis listens: it is shown what the
    /// cards have sent and received, and asks for nothing.
    pub habit: Habit,
    /// State the line is driven to.
    pub target: AlState,
    /// Cycle of the process data.
    pub cycle: Span,
    /// Whether the counters of the card are shown to the diagnosis. Without them nobody counts what
    /// is spoiled on the last hop.
    pub host_counters: bool,
    /// Whether the diagnosis is given the project, as planned.
    pub project: bool,
    /// Whether the project knows serial numbers, where the segment file gives them.
    pub serials: bool,
    /// Whether the diagnosis may ask for registers by itself.
    pub probes: bool,
    /// Whether it may write what restores itself, to find where frames vanish.
    pub active: bool,
    /// Whether SubDevices with distributed clocks are brought into step with SYNC0, one event a cycle.
    pub clocks: bool,
    /// Whether the MainDevice's log is kept: what happened, in words.
    pub log: bool,
    /// What is done with the line from the start.
    pub begin: Begin,
    /// What the report says was looked at; empty for the segment's name.
    pub source: String,
    /// Parts that were exchanged before, on account of an earlier diagnosis.
    pub exchanges: Vec<PartExchange>,
}

impl Default for LabOptions {
    fn default() -> Self {
        Self {
            habit: Habit::Own,
            target: AlState::Op,
            cycle: Span::ms(2),
            host_counters: true,
            project: true,
            serials: true,
            probes: true,
            active: false,
            clocks: false,
            log: false,
            begin: Begin::Run,
            source: String::new(),
            exchanges: Vec::new(),
        }
    }
}
