//! State word of the network in shared memory when the interface of the line is gone.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::sync::mpsc::sync_channel;

use linesman_diagnosis::HostObservation;
use linesman_link::error::LinkError;
use linesman_link::shared_image::SharedImage;
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::state::{AlState, NetworkState};
use linesman_proto::time::{Instant, Span};
use linesman_runtime::run::{
    NOTES, PlanChoices, RunControls, RunError, SessionOptions, Shared, start,
};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::{FrameSink, Pace, SegmentTransport, Transport};
use linesman_runtime::wiring::Wiring;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;
use tempfile::TempDir;

/// A line whose interface is unplugged at this time.
struct Unplugged {
    line: SegmentTransport,
    at: Instant,
}

impl Transport for Unplugged {
    type Error = LinkError;

    fn options(&self) -> Options {
        self.line.options()
    }

    fn now(&self) -> Instant {
        self.line.now()
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, LinkError> {
        if now >= self.at {
            return Err(LinkError::Vanished { interface: "eth0".to_owned() });
        }
        self.line.receive(now, intake)
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), LinkError> {
        self.line.send(path, frame)
    }

    fn look_at_host(
        &mut self,
        now: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), LinkError> {
        self.line.look_at_host(now, tell)
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), LinkError> {
        self.line.wait(deadline)
    }

    fn note_late(&mut self, late: Span) {
        self.line.note_late(late);
    }
}

// proves: PLC-07 partial: the interface that is gone, in shared memory
#[test]
fn word_in_shared_memory_says_that_the_interface_is_gone_when_the_run_has_ended() {
    let file = SegmentFile::in_a_row("line", 1, &[("K1", "EK1100"), ("I1", "EL1008")]);
    let segment = Segment::build(&file).unwrap();
    let wiring = Wiring::of(&segment, &file.project().unwrap());
    let line = SegmentTransport::new(segment, wiring, false, Pace::Free).unwrap();
    let line = Unplugged { line, at: Instant::ZERO + Span::s(3) };
    let options = SessionOptions {
        on: "eth0".to_owned(),
        leave: AlState::Init,
        lasts: Some(Span::s(60)),
        real_time: None,
        allowed_misses: None,
        hold: false,
        diagnose: None,
        group: None,
    };
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("image");
    let (stop, (notes, _told)) = (Stop::default(), sync_channel(NOTES));
    let beside = RunControls::new(&stop, notes);
    let wanted = PlanChoices::default().as_found();
    let mut started = start(line, wanted, Shared::at(path.clone()), &options, beside).unwrap();
    // The image is there from the first cycle on.
    let mut cycles = 0;
    while started.cycle(true) {
        cycles += 1;
        if cycles == 1_000 {
            break;
        }
    }
    let image = SharedImage::open(&path).unwrap();
    let mut inputs = vec![0; image.inputs_len()];
    let before = image.read_inputs(&mut inputs).unwrap();
    assert!(before.settled && !before.ended && before.network == 0, "{before:?}");
    while started.cycle(true) {}
    let ended = started.end().unwrap();
    assert!(matches!(ended.error, Some(RunError::Link(LinkError::Vanished { .. }))));
    let after = image.read_inputs(&mut inputs).unwrap();
    assert!(after.ended && after.network & NetworkState::DRIVER != 0, "{after:?}");
}
