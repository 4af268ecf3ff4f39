//! What the application sees of a cycle, and does in it.

use linesman_config::plan::Plan;
use linesman_maindevice::{FrameStatus, MainDevice, Quality, Statistics};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;

use crate::image::{Input, Output, Value};

/// Whether the application goes on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// With the next cycle.
    Continue,
    /// The line is stopped: outputs to zero, states back.
    Stop,
}

/// A program that is called once a cycle. It must not wait for anything: while it runs, no frame is
/// sent.
pub trait Application {
    /// One cycle: inputs are those that have just come back, outputs leave with the next frames.
    fn cycle(&mut self, io: &mut Io<'_>) -> Next;

    /// Whether it gives outputs at all. One that does not is not watched for being late.
    fn is_idle(&self) -> bool {
        false
    }
}

/// Nobody: outputs stay zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct Idle;

impl Application for Idle {
    fn cycle(&mut self, _: &mut Io<'_>) -> Next {
        Next::Continue
    }

    fn is_idle(&self) -> bool {
        true
    }
}

impl<F: FnMut(&mut Io<'_>) -> Next> Application for F {
    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        self(io)
    }
}

/// The process data of a cycle.
pub struct Io<'a> {
    pub(crate) main: &'a mut MainDevice,
    pub(crate) now: Instant,
    pub(crate) missed: u64,
}

impl Io<'_> {
    /// The value of an input.
    #[must_use]
    pub fn get<T: Value>(&self, input: Input<T>) -> T {
        input.get(self.main.inputs())
    }

    /// Sets an output.
    pub fn set<T: Value>(&mut self, output: Output<T>, value: T) {
        output.set(self.main.outputs_mut(), value);
    }

    /// All inputs as bytes, laid out as the plan says.
    #[must_use]
    pub fn inputs(&self) -> &[u8] {
        self.main.inputs()
    }

    /// All outputs as bytes, laid out as the plan says.
    pub fn outputs_mut(&mut self) -> &mut [u8] {
        self.main.outputs_mut()
    }

    /// Says that the outputs are to stay as they are on purpose: they count as given anew.
    pub fn keep_outputs(&mut self) {
        self.main.outputs_mut();
    }

    /// How good the process data of a SubDevice are, and how old.
    #[must_use]
    pub fn quality(&self, id: DeviceId) -> Quality {
        self.main.quality(id)
    }

    /// How a frame of a task went the last time.
    #[must_use]
    pub fn frame_status(&self, task: usize, frame: usize) -> Option<FrameStatus> {
        self.main.frame_status(task, frame)
    }

    /// Whether every SubDevice is in its target state.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.main.is_settled()
    }

    /// The time of the run.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// Cycles that were left out so far because the host was late.
    #[must_use]
    pub const fn missed(&self) -> u64 {
        self.missed
    }

    /// What has been sent and received so far.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.main.statistics()
    }

    /// The plan that runs.
    #[must_use]
    pub fn plan(&self) -> Option<&Plan> {
        self.main.plan()
    }
}
