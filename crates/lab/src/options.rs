//! How a lab is set up.

use linesman_proto::state::AlState;
use linesman_proto::time::Span;

/// Choices for a lab.
#[derive(Clone, Debug)]
pub struct LabOptions {
    /// State the line is driven to.
    pub target: AlState,
    /// Cycle of the process data.
    pub cycle: Span,
    /// Whether the counters of the card are shown to the diagnosis. Without them nobody counts what
    /// is spoiled on the last hop.
    pub host_counters: bool,
    /// Whether the diagnosis is given the project, as planned.
    pub project: bool,
    /// Whether the diagnosis may ask for registers by itself.
    pub probes: bool,
    /// Whether the line is brought up at once. Otherwise nothing is sent until told.
    pub bring_up: bool,
}

impl Default for LabOptions {
    fn default() -> Self {
        Self {
            target: AlState::Op,
            cycle: Span::ms(2),
            host_counters: true,
            project: true,
            probes: true,
            bring_up: true,
        }
    }
}
