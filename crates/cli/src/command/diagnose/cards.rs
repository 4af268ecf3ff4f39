//! Diagnosis of a line that nobody drives: reads again and again, and sees what changes.

use linesman_diagnosis::{Engine, FrameSeen, HostObservation, InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_maindevice::{Event, MainDevice};
use linesman_proto::time::{Instant, Span};
use linesman_runtime::drive::Driver;
use linesman_runtime::record::Recorder;
use linesman_session::{SessionHooks, probe};

use super::DiagnosisRun;
use crate::command::line_access;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Progress};
use crate::text::quantity::{count, time};

/// How long the line is looked at when nobody says.
const LASTS: Span = Span::s(5);
/// Between two looks. Each is a few frames long, so that damage has something to hit.
const LOOK_EVERY: Span = Span::ms(10);

/// Judges the line on these cards. With `active` station addresses are written and SIIs read, so
/// that the SubDevices have names; else nothing is sent that writes.
pub(super) fn run(
    names: &[String],
    active: bool,
    mut session: DiagnosisRun,
    output: &mut Output,
) -> Result<Status, Failure> {
    line_access::refuse(names)?;
    let stop = line_access::stop()?;
    let clock = HostClock::start();
    let until = session.until(LASTS);
    let setup = Setup {
        input: InputKind::Driven,
        host_counters: true,
        start: clock.started_at().rfc3339(),
        clock: "host, monotonic".to_owned(),
        probes: active,
        active,
        ..session.setup.clone()
    };
    let recorder = session.recorder(clock.started_at(), names)?;
    session.begin_bundles(clock.started_at(), names)?;
    let looking = CardPoll {
        engine: Engine::new(setup),
        session,
        recorder,
        output,
        progress: Progress::new(),
        next: if active { Next::Scan } else { Next::LookAt(Instant::ZERO) },
        frames: 0,
    };
    let mut driver = Driver::open(names, clock, looking)?;
    let result = driver.run(until, &stop);
    let CardPoll { engine, mut session, recorder, frames, mut progress, output, .. } =
        driver.into_hooks();
    progress.clear();
    session.end_recording(recorder, clock.now(), output);
    let complete = match result {
        Ok(()) => true,
        Err(error) if frames == 0 => return Err(error.into()),
        Err(error) => {
            let failure = Failure::from(error);
            output.warn(&format!("{}; judged as far as it went", failure.reason));
            false
        }
    };
    Ok(session.conclude(engine, clock.now(), complete, output))
}

/// Looks again and again.
struct CardPoll<'a> {
    engine: Engine,
    session: DiagnosisRun,
    recorder: Option<Recorder>,
    output: &'a mut Output,
    progress: Progress,
    next: Next,
    frames: u64,
}

/// What the MainDevice does next.
#[derive(Clone, Copy)]
enum Next {
    /// Address and read all.
    Scan,
    /// Look, at this time.
    LookAt(Instant),
    /// It is at work.
    Wait,
}

impl SessionHooks for CardPoll<'_> {
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.frames += 1;
        if let Some(recorder) = &mut self.recorder {
            recorder.frame(frame);
        }
        self.engine.handle_frame(frame);
        if let Some(recording) = &mut self.session.recording {
            recording.frame(frame);
        }
    }

    fn host(&mut self, observation: &HostObservation) {
        self.engine.handle_host(observation);
        if let Some(recording) = &mut self.session.recording {
            recording.host(observation);
        }
    }

    fn event(&mut self, now: Instant, event: Event, _: &mut MainDevice) {
        let is_done = matches!(
            event,
            Event::ReadOnlyScanned(_)
                | Event::ReadOnlyScanFailed(_)
                | Event::Scanned(_)
                | Event::ScanFailed(_)
        );
        if is_done {
            self.next = Next::LookAt(now + LOOK_EVERY);
        }
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        self.engine.handle_timeout(now);
        self.session.follow(&mut self.engine, self.output);
        self.session.turn_bundles(now, &self.engine, self.output);
        self.session.look_at_recording(self.recorder.as_ref(), self.output);
        while let Some(wish) = self.engine.poll_probe() {
            // Mailboxes of SubDevices that nobody drives are not asked: they are of no plan.
            probe::ask(&wish, now, main);
        }
        match self.next {
            Next::Scan => {
                self.next = Next::Wait;
                main.scan(now);
            }
            Next::LookAt(at) if at <= now => {
                self.next = Next::Wait;
                main.read_only_scan(now);
            }
            Next::LookAt(_) | Next::Wait => {}
        }
        let frames = self.frames;
        self.progress.show(|| format!("{}, {}", count(frames, "frame"), time(now.as_nanos())));
        !self.output.is_closed()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let look = match self.next {
            Next::LookAt(at) => Some(at),
            Next::Scan | Next::Wait => None,
        };
        [look, self.engine.poll_timeout()].into_iter().flatten().min()
    }
}
