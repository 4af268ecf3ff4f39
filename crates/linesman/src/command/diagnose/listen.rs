//! Beside another MainDevice: listening without sending.

use linesman_diagnosis::{Engine, InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::listen::{Ears, Heard};
use linesman_runtime::record::Recorder;

use super::Session;
use crate::command::driven;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Progress};
use crate::text::quantity::{count, time};

/// How long is listened when nobody says.
const LASTS: Span = Span::s(10);
/// Longest wait, so that a wish to stop is noticed.
const NAP: Span = Span::ms(100);

/// Judges what is heard.
pub(super) fn run(
    names: &[String],
    session: Session,
    output: &mut Output,
) -> Result<Status, Failure> {
    let stop = driven::stop()?;
    let clock = HostClock::start();
    let until = session.until(LASTS);
    let mut ears = Ears::open(names, clock)?;
    let recorder = session.recorder(clock.started_at(), names)?;
    let mut listening = Listening { session, clock, recorder, engine: None, frames: 0 };
    let mut progress = Progress::new();
    let mut lost = None;
    while !stop.is_set() && clock.now() < until && !output.is_closed() {
        let deadline = until.min(clock.now() + NAP);
        if let Err(error) = listening.hear(&mut ears, deadline, output) {
            lost = Some(error);
            break;
        }
        let frames = listening.frames;
        progress.show(|| format!("{}, {}", count(frames, "frame"), time(clock.now().as_nanos())));
    }
    progress.clear();
    let heard_for = clock.now();
    let Listening { mut session, engine, recorder, .. } = listening;
    session.end_recording(recorder, output);
    let Some(engine) = engine else {
        return Err(lost.map_or_else(|| silence(names, heard_for), Failure::from));
    };
    let complete = lost.is_none();
    if let Some(error) = lost {
        let failure = Failure::from(error);
        output.warn(&format!("{}; judged as far as it went", failure.reason));
    }
    Ok(session.conclude(engine, heard_for, complete, output))
}

/// A diagnosis that begins with the first frame.
struct Listening {
    session: Session,
    clock: HostClock,
    recorder: Option<Recorder>,
    engine: Option<Engine>,
    frames: u64,
}

impl Listening {
    fn hear(
        &mut self,
        ears: &mut Ears,
        deadline: Instant,
        output: &mut Output,
    ) -> Result<(), linesman_link::error::LinkError> {
        let Self { session, clock, recorder, engine, frames } = self;
        ears.hear(deadline, |heard| {
            match heard {
                Heard::Frame(frame) => {
                    *frames += 1;
                    if let Some(recorder) = recorder {
                        recorder.frame(&frame);
                    }
                    // Only beside a MainDevice of this host are the card's counters about the line.
                    let is_local = frame.direction == linesman_diagnosis::Direction::Sent;
                    let engine = engine.get_or_insert_with(|| begin(session, *clock, is_local));
                    engine.handle_frame(&frame);
                }
                Heard::Host(observation) => {
                    if let Some(engine) = engine {
                        engine.handle_host(&observation);
                    }
                }
            }
            if let Some(engine) = engine {
                session.follow(engine, output);
            }
        })?;
        session.look_at_recording(recorder.as_ref(), output);
        if let Some(engine) = engine {
            engine.handle_timeout(clock.now());
            session.follow(engine, output);
        }
        Ok(())
    }
}

fn begin(session: &Session, clock: HostClock, host_counters: bool) -> Engine {
    let start = clock.started_at().rfc3339();
    let clock = "host, monotonic".to_owned();
    Engine::new(Setup {
        input: InputKind::Listened,
        host_counters,
        start,
        clock,
        ..session.setup.clone()
    })
}

fn silence(names: &[String], heard_for: Instant) -> Failure {
    let name = names.join("+");
    let reason =
        format!("listen:{name}: no EtherCAT frame was heard in {}", time(heard_for.as_nanos()));
    let advice = format!(
        "check that the MainDevice runs, and that its line passes this card; when nobody else \
         drives the line, `linesman diagnose {name}` does"
    );
    Failure::new(reason, advice)
}
