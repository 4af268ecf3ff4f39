//! The end of a run: outputs to zero, then the exchange ends, then the states.

use linesman_maindevice::MainDevice;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use super::{PlanRun, RunEvent};
use crate::application::Application;
use crate::diagnosis::DiagnosisInput;

/// Time that SubDevices may take to go down at the end.
const LEAVE_PATIENCE: Span = Span::s(5);
/// Number of cycles that carry zeros before the exchange ends.
const SAFE_CYCLES: u64 = 3;

/// Stage of an end.
#[derive(Clone, Copy, Debug)]
pub(super) enum Ending {
    /// Outputs are zero for some more cycles.
    Zero {
        /// When they have passed.
        until: Instant,
        /// State that SubDevices are brought to then.
        to: AlState,
    },
    /// SubDevices go down.
    Down {
        /// End of the time that this may take.
        until: Instant,
    },
}

impl Ending {
    pub(super) const fn due(&self) -> Instant {
        match self {
            Self::Zero { until, .. } | Self::Down { until } => *until,
        }
    }
}

impl<A: Application, D: DiagnosisInput> PlanRun<A, D> {
    /// Ends the run: outputs to zero, then SubDevices to a state. It goes on until that is done, or was not done in
    /// time; the application is not called any more.
    pub fn leave(&mut self, now: Instant, main: &mut MainDevice, to: AlState) {
        (self.pauses, self.paused) = (false, false);
        let Some(plan) = self.plan.clone() else {
            self.ended = true;
            return;
        };
        self.ended = false;
        self.events.push_back(RunEvent::Leaving(now));
        let cycle = plan.tasks.iter().map(|task| task.cycle).max().unwrap_or_default();
        main.outputs_mut().fill(0);
        self.ending = Some(Ending::Zero { until: now + cycle * SAFE_CYCLES, to });
    }

    pub(super) fn go_on_ending(&mut self, now: Instant, main: &mut MainDevice) {
        match self.ending {
            Some(Ending::Zero { until, to }) if now >= until => {
                main.stop(now, to);
                self.ending = Some(Ending::Down { until: now + LEAVE_PATIENCE });
            }
            Some(Ending::Zero { .. }) => main.outputs_mut().fill(0),
            Some(Ending::Down { until }) if now >= until => self.ended = true,
            Some(Ending::Down { .. }) | None => {}
        }
    }
}
