//! Parts of a run that fail while it drives a line: each is told, and the SubDevices end in a safe state.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![allow(clippy::panic, reason = "parts are made to fail")]

use std::sync::mpsc::{Receiver, sync_channel};

use linesman_config::plan::Plan;
use linesman_diagnosis::{Diagnosis, Engine, Event, FrameSeen, HostObservation, Probe, Setup};
use linesman_link::error::LinkError;
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::register;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::run::diagnosis_thread::DiagnosisObserver;
use linesman_runtime::run::{
    Application, Idle, Io, NOTES, Next, Note, PlanChoices, RunControls, RunError, RunOutcome,
    SessionOptions, run_observed,
};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::{FrameSink, Pace, SegmentTransport, Transport};
use linesman_runtime::wiring::Wiring;
use linesman_session::DiagnosisInput;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

fn line() -> SegmentTransport {
    let row = [("K1", "EK1100"), ("I1", "EL1008"), ("O1", "EL2008")];
    let file = SegmentFile::in_a_row("plant", 1, &row);
    let segment = Segment::build(&file).unwrap();
    let wiring = Wiring::of(&segment, &file.project().unwrap());
    SegmentTransport::new(segment, wiring, false, Pace::Free).unwrap()
}

/// The AL status of each SubDevice, as it is in its register.
fn states(line: &SegmentTransport) -> Vec<u8> {
    let segment = line.segment();
    let state = |id| segment.controller(id).unwrap().register(register::AL_STATUS.address);
    segment.devices().map(state).collect()
}

const INIT: [u8; 3] = [1; 3];

fn driven<L: Transport<Error = LinkError>>(
    line: L,
    application: impl Application,
    observer: impl FnOnce(Setup) -> Box<dyn DiagnosisObserver>,
) -> (Result<RunOutcome, RunError>, Receiver<Note>) {
    let options = SessionOptions {
        on: "plant".to_owned(),
        leave: AlState::Init,
        lasts: Some(Span::s(3)),
        real_time: None,
        allowed_misses: None,
        hold: false,
        diagnose: Some(Setup::default()),
        group: None,
    };
    let (notes, told) = sync_channel(NOTES);
    let stop = Stop::default();
    let beside = RunControls::new(&stop, notes);
    let wanted = PlanChoices::default().as_found();
    (run_observed(line, wanted, application, &options, beside, observer), told)
}

fn engine(setup: Setup) -> Box<dyn DiagnosisObserver> {
    Box::new(Engine::new(setup))
}

/// A diagnosis that panics over the frames of a line that is up.
struct Panics;

impl DiagnosisInput for Panics {
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        assert!(frame.time < Instant::ZERO + Span::s(1), "the judge stumbles");
    }

    fn host(&mut self, _: &HostObservation) {}

    fn turn(&mut self, _: Instant) {}

    fn poll_timeout(&self) -> Option<Instant> {
        None
    }

    fn poll_event(&mut self) -> Option<Event> {
        None
    }

    fn poll_probe(&mut self) -> Option<Probe> {
        None
    }
}

impl DiagnosisObserver for Panics {
    fn missed(&mut self, _: u64, _: Instant) {}

    fn finish(&mut self, _: Instant) {}

    fn diagnosis(&self) -> Diagnosis {
        unreachable!("it has failed")
    }
}

#[test]
fn a_diagnosis_that_panics_is_told_at_once_and_the_line_is_driven_on_to_its_end() {
    let mut line = line();
    let (ended, told) = driven(&mut line, Idle, |_| Box::new(Panics));
    let RunOutcome { report, error, failed } = ended.unwrap();
    assert!(error.is_none(), "{error:?}");
    let failed = failed.unwrap();
    assert_eq!(failed.why.split(": ").last(), Some("the judge stumbles"));
    assert_eq!(report.failed, [failed.to_string()]);
    assert!(report.diagnosis.is_none());
    assert!(report.reached_ns.is_some() && report.time_ns >= 3_000_000_000, "driven on");
    assert!(report.counts.undiagnosed > 0, "frames that nobody judges are counted");
    let notes: Vec<Note> = told.try_iter().collect();
    let at = |is: fn(&Note) -> bool| notes.iter().position(is);
    let (failed, leaving) =
        (at(|note| matches!(note, Note::Failed(_))), at(|note| matches!(note, Note::Leaving(_))));
    assert!(failed.unwrap() < leaving.unwrap(), "while the line still runs");
    assert_eq!(states(&line), INIT);
}

/// An application that panics once the line is up.
struct Stumbles;

impl Application for Stumbles {
    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        io.outputs_mut().fill(0xFF);
        assert!(!io.is_settled(), "the application stumbles");
        Next::Continue
    }
}

#[test]
fn an_application_that_panics_leaves_the_subdevices_as_after_any_other_end() {
    let mut line = line();
    let (ended, told) = driven(&mut line, Stumbles, engine);
    let RunOutcome { report, error, .. } = ended.unwrap();
    let error = error.unwrap().to_string();
    assert!(error.contains("the application stumbles; the line is stopped"), "{error}");
    assert_eq!(report.error, Some(error));
    assert!(report.reached_ns.is_some());
    let failed = told.try_iter().position(|note| matches!(note, Note::Failed(_)));
    assert!(failed.is_some());
    assert_eq!(states(&line), INIT);
}

/// A line on which nothing can be received any more without a panic once the application has stumbled.
struct Broken(SegmentTransport, u64);

impl Transport for Broken {
    type Error = LinkError;

    fn options(&self) -> Options {
        self.0.options()
    }

    fn now(&self) -> Instant {
        self.0.now()
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, LinkError> {
        assert!(now < Instant::ZERO + Span::ms(self.1), "the line stumbles");
        self.0.receive(now, intake)
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), LinkError> {
        self.0.send(path, frame)
    }

    fn look_at_host(
        &mut self,
        now: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), LinkError> {
        self.0.look_at_host(now, tell)
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), LinkError> {
        self.0.wait(deadline)
    }

    fn note_late(&mut self, late: Span) {
        self.0.note_late(late);
    }
}

#[test]
fn subdevices_are_ordered_to_init_even_where_the_main_device_cannot_take_them_there() {
    let mut line = Broken(line(), 2_000);
    let (ended, told) = driven(&mut line, Idle, engine);
    let error = ended.unwrap().error.unwrap().to_string();
    assert!(error.contains("the line stumbles; all SubDevices were ordered to INIT"), "{error}");
    let failures = told.try_iter().filter(|note| matches!(note, Note::Failed(_))).count();
    assert_eq!(failures, 2, "on the way, and at the end");
    let end = line.0.now() + Span::s(1);
    line.0.segment_mut().advance(end);
    // The low half is the state; an error may be shown beside it.
    let states: Vec<u8> = states(&line.0).iter().map(|status| status & 0x0F).collect();
    assert_eq!(states, INIT);
}

/// A plan that stumbles.
struct NeverBegins;

impl Application for NeverBegins {
    fn begin(&mut self, _: &Plan) -> Result<(), String> {
        panic!("the application does not begin")
    }

    fn cycle(&mut self, _: &mut Io<'_>) -> Next {
        Next::Stop
    }
}

#[test]
fn a_panic_before_anything_is_started_is_a_refusal_with_a_reason() {
    let (ended, _told) = driven(line(), NeverBegins, engine);
    let error = ended.err().unwrap().to_string();
    assert!(error.contains("the application does not begin"), "{error}");
}
