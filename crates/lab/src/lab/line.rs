//! Line of a lab: the segment with its cards, and a capture tool beside the MainDevice.

use std::convert::Infallible;

use linesman_diagnosis::{Direction, Engine, HostObservation};
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_session::frame::FrameSummary;
use linesman_session::segment_line::SegmentLine;
use linesman_session::transport::{FrameSink, RxFrame, Transport};
use linesman_sim::segment::{Outgoing, Segment};

use super::Tap;
use super::capture_loss::CaptureLoss;

/// The segment, and who listens on the computer of the MainDevice.
pub(super) struct LabLine {
    pub(super) line: SegmentLine,
    /// True if the counters of the cards are shown to the diagnosis.
    counters: bool,
    pub(super) capture: CaptureTool,
    outgoing: Vec<u8>,
}

/// Capture tool: sees what was handed to a card, when it was, and what came back.
#[derive(Default)]
pub(super) struct CaptureTool {
    pub(super) recorder: Option<Tap>,
    /// A diagnosis that listens, and asks for nothing.
    pub(super) listener: Option<Engine>,
    pub(super) loss: Option<CaptureLoss>,
    count: u64,
}

impl CaptureTool {
    const fn is_shown(&self) -> bool {
        self.recorder.is_some() || self.listener.is_some()
    }

    fn frame(&mut self, direction: Direction, path: Path, time: Instant, bytes: &[u8]) {
        if !self.is_shown() || self.loss.as_mut().is_some_and(|loss| loss.hides(direction, bytes)) {
            return;
        }
        self.count += 1;
        let (number, path) = (self.count, Some(path));
        let seen = FrameSummary { time, number, path, direction, truncated: false }.seen(bytes);
        if let Some(listener) = &mut self.listener {
            listener.handle_frame(&seen);
        }
        if let Some(recorder) = &mut self.recorder {
            recorder(&seen);
        }
    }
}

impl LabLine {
    pub(super) fn new(segment: Segment, ring: bool, counters: bool) -> Self {
        Self {
            line: SegmentLine::new(segment, ring),
            counters,
            capture: CaptureTool::default(),
            outgoing: Vec::new(),
        }
    }

    pub(super) const fn segment(&self) -> &Segment {
        self.line.segment()
    }

    pub(super) const fn segment_mut(&mut self) -> &mut Segment {
        self.line.segment_mut()
    }

    /// Gives the capture what was handed to the cards.
    fn capture_outgoing(&mut self) {
        if !self.capture.is_shown() {
            return;
        }
        while let Some(Outgoing { at, path }) =
            self.line.segment_mut().poll_outgoing(&mut self.outgoing)
        {
            self.capture.frame(Direction::Sent, path, at, &self.outgoing);
        }
    }
}

impl Transport for LabLine {
    type Error = Infallible;

    fn options(&self) -> Options {
        self.line.options(Options::default())
    }

    fn now(&self) -> Instant {
        self.line.now()
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, Infallible> {
        self.line.advance(now);
        self.capture_outgoing();
        let capture = &mut self.capture;
        Ok(self.line.receive(&mut CapturedIntake { capture, intake }))
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), Infallible> {
        self.line.send(path, frame);
        self.capture_outgoing();
        Ok(())
    }

    fn look_at_host(
        &mut self,
        now: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), Infallible> {
        let Self { line, capture, counters, .. } = self;
        if let Some(listener) = &mut capture.listener {
            listener.handle_timeout(now);
        }
        line.look_at_host(*counters, &mut |observation| {
            if let Some(listener) = &mut capture.listener {
                listener.handle_host(observation);
            }
            tell(observation);
        });
        Ok(())
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), Infallible> {
        self.line.set_now(deadline);
        Ok(())
    }

    fn note_late(&mut self, _: Span) {}
}

/// Frames that come back, shown to a capture tool on their way to the MainDevice.
struct CapturedIntake<'a> {
    capture: &'a mut CaptureTool,
    intake: &'a mut dyn FrameSink,
}

impl FrameSink for CapturedIntake<'_> {
    fn room(&mut self) -> &mut [u8] {
        self.intake.room()
    }

    fn frame_received(&mut self, received: RxFrame) {
        if self.capture.is_shown()
            && let Some(bytes) = self.intake.room().get(..received.len)
        {
            self.capture.frame(Direction::Received, received.path, received.at, bytes);
        }
        self.intake.frame_received(received);
    }
}
