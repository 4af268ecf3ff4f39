//! Diagnosis of a lab beside its session, and who looks over its shoulder.

use linesman_diagnosis::{Engine, Event, FrameSeen, HostObservation, Probe};
use linesman_proto::time::Instant;
use linesman_session::DiagnosisInput;

use super::capture_loss::CaptureLoss;
use super::{HostTap, Tap};

/// The diagnosis inline, unless it listens on the line as one beside the MainDevice of others does; with taps that see
/// what it sees.
#[derive(Default)]
pub(super) struct LabDiagnosis {
    pub(super) engine: Option<Engine>,
    pub(super) tap: Option<Tap>,
    pub(super) host_tap: Option<HostTap>,
    pub(super) loss: Option<CaptureLoss>,
    /// Frames that passed, both ways.
    pub(super) frames: u64,
}

impl DiagnosisInput for LabDiagnosis {
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.frames += 1;
        let loss = self.loss.as_mut();
        if loss.is_some_and(|loss| loss.hides(frame.direction, frame.bytes)) {
            return;
        }
        if let Some(engine) = &mut self.engine {
            engine.handle_frame(frame);
        }
        if let Some(tap) = &mut self.tap {
            tap(frame);
        }
    }

    fn host(&mut self, observation: &HostObservation) {
        if let Some(engine) = &mut self.engine {
            engine.handle_host(observation);
        }
        if let Some(tap) = &mut self.host_tap {
            tap(observation);
        }
    }

    fn turn(&mut self, now: Instant) {
        if let Some(engine) = &mut self.engine {
            engine.handle_timeout(now);
        }
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.engine.as_ref()?.poll_timeout()
    }

    fn poll_probe(&mut self) -> Option<Probe> {
        self.engine.as_mut()?.poll_probe()
    }

    fn poll_event(&mut self) -> Option<Event> {
        self.engine.as_mut()?.poll_event()
    }
}
