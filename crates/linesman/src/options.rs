//! Options of a run: cycle time, clocks, priority, the state at the end.

use linesman_config::plan::IoAt;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_runtime::run::RealTime;

/// Cycle time and all else that a run is asked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RunOptions {
    pub(crate) time: Span,
    pub(crate) misses: u32,
    pub(crate) real_time: RealTime,
    pub(crate) leave: AlState,
    pub(crate) io_at: Option<IoAt>,
    pub(crate) clocks: bool,
    pub(crate) hold: bool,
    pub(crate) diagnosed: bool,
}

impl RunOptions {
    /// A cycle of so many microseconds.
    #[must_use]
    pub fn us(micros: u64) -> Self {
        let time = Span::us(micros.max(1));
        let (real_time, leave) = (RealTime::default(), AlState::Init);
        Self {
            time,
            misses: 2,
            real_time,
            leave,
            io_at: None,
            clocks: false,
            hold: false,
            diagnosed: false,
        }
    }

    /// Number of cycles in a row that the application may be late before its outputs are withheld.
    #[must_use]
    pub const fn allow_misses(mut self, misses: u32) -> Self {
        self.misses = misses;
        self
    }

    /// Distributed clocks: every SubDevice that has one and says in its EEPROM how it is to be used gets
    /// SYNC0 in the beat of this cycle, and the cycle follows the reference clock. A plan of a project that
    /// chooses clocks keeps its choices.
    #[must_use]
    pub const fn dc(mut self) -> Self {
        self.clocks = true;
        self
    }

    /// Frames leave when the cycle begins, with the outputs of the cycle before, and the application runs
    /// after them, on inputs that have just come back: steady, for motion. It is so unless a project says
    /// otherwise.
    #[must_use]
    pub const fn exchange_at_begin(mut self) -> Self {
        self.io_at = Some(IoAt::TaskBegin);
        self
    }

    /// The application runs when the cycle begins, and frames leave as soon as it has returned: outputs are
    /// as fresh as they can be, and jitter with the application. What need not go before them runs in
    /// [`Application::after_outputs`](crate::Application::after_outputs).
    #[must_use]
    pub const fn exchange_at_end(mut self) -> Self {
        self.io_at = Some(IoAt::TaskEnd);
        self
    }

    /// SubDevices stay in PREOP until the application has given outputs for the first time: one that is not
    /// ready calls [`Io::outputs_are_old`](crate::Io::outputs_are_old).
    #[must_use]
    pub const fn wait_for_outputs(mut self) -> Self {
        self.hold = true;
        self
    }

    /// The diagnosis judges the line while it runs, on a thread of its own.
    #[must_use]
    pub const fn diagnosed(mut self) -> Self {
        self.diagnosed = true;
        self
    }

    /// Keeps the cycle on this CPU, counted from 0.
    #[must_use]
    pub const fn on_cpu(mut self, cpu: usize) -> Self {
        self.real_time.cpu = Some(cpu);
        self
    }

    /// Real-time priority, 1 to 99; `None` for none. It is 80 unless said, and where the right is
    /// missing the line runs without: the report says so.
    #[must_use]
    pub const fn priority(mut self, priority: Option<u8>) -> Self {
        self.real_time.priority = priority;
        self
    }

    /// The state in which SubDevices are left at the end, INIT unless said.
    #[must_use]
    pub const fn leave_in(mut self, state: AlState) -> Self {
        self.leave = state;
        self
    }
}
