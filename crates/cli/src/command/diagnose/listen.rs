//! Beside another MainDevice: listening without sending, or with questions between its frames.

use linesman_diagnosis::ask::AskSetup;
use linesman_diagnosis::{Direction, Engine, InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_link::interface::find;
use linesman_proto::address::Network;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::listen::{CardListener, ListenEvent, TapCounts};
use linesman_runtime::question_socket::QuestionSocket;
use linesman_runtime::record::Recorder;

use super::{DiagnosisRun, questions};
use crate::command::line_access;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Progress};
use crate::text::quantity::{count, time};

/// How long is listened when nobody says.
const LASTS: Span = Span::s(10);
/// How long, when questions are asked: they begin once the MainDevice is known.
const ASKING_LASTS: Span = Span::s(20);
/// Longest wait, so that a wish to stop is noticed.
const NAP: Span = Span::ms(100);

/// Judges what is heard, and what is asked, where that is wanted.
pub(super) fn run(
    names: &[String],
    questions: Option<AskSetup>,
    mut session: DiagnosisRun,
    output: &mut Output,
) -> Result<Status, Failure> {
    let stop = line_access::stop()?;
    let clock = HostClock::start();
    let until = session.until(if questions.is_some() { ASKING_LASTS } else { LASTS });
    let mut card_listener = CardListener::open(names, clock)?;
    let asking = questions.map(|setup| questions::open(names, clock, setup)).transpose()?;
    let recorder = session.recorder(clock.started_at(), names)?;
    session.begin_bundles(clock.started_at(), names)?;
    let mut listening =
        Listening { session, clock, recorder, engine: None, asking, frames: 0, is_local: false };
    let mut progress = Progress::new();
    let mut lost = None;
    while !stop.is_set() && clock.now() < until && !output.is_closed() {
        let deadline = until.min(clock.now() + NAP).min(listening.deadline());
        let heard = listening.hear(&mut card_listener, deadline, output);
        match heard.and_then(|()| listening.ask(names, output)) {
            Ok(None) => {}
            Ok(Some(refused)) => {
                progress.clear();
                return Err(refused);
            }
            Err(error) => {
                lost = Some(error);
                break;
            }
        }
        let frames = listening.frames;
        progress.show(|| format!("{}, {}", count(frames, "frame"), time(clock.now().as_nanos())));
    }
    progress.clear();
    let heard_for = clock.now();
    let Listening { mut session, engine, recorder, asking, is_local, .. } = listening;
    session.end_recording(recorder, heard_for, output);
    let Some(mut engine) = engine else {
        return Err(
            lost.map_or_else(|| silence(names, heard_for, without_link(names)), Failure::from)
        );
    };
    if let Some(asking) = asking {
        engine.note_asking(asking.report());
    }
    if !is_local && lost.is_none() {
        tell_of_tap(&mut card_listener, names, output);
    }
    let complete = lost.is_none();
    if let Some(error) = lost {
        let failure = Failure::from(error);
        output.warn(&format!("{}; judged as far as it went", failure.reason));
    }
    Ok(session.conclude(engine, heard_for, complete, output))
}

/// A diagnosis that begins with the first frame.
struct Listening {
    session: DiagnosisRun,
    clock: HostClock,
    recorder: Option<Recorder>,
    engine: Option<Engine>,
    asking: Option<QuestionSocket>,
    frames: u64,
    /// Whether this computer drives the line: then the counters of its card are about the line.
    is_local: bool,
}

impl Listening {
    /// When there is something to do though nothing is heard.
    fn deadline(&self) -> Instant {
        // Before the first frame there is nothing to be asked.
        let asking = self.asking.as_ref().filter(|_| self.engine.is_some());
        asking.map_or(Instant::MAX, QuestionSocket::deadline)
    }

    fn hear(
        &mut self,
        card_listener: &mut CardListener,
        deadline: Instant,
        output: &mut Output,
    ) -> Result<(), LinkError> {
        let Self { session, clock, recorder, engine, asking, frames, is_local } = self;
        card_listener.hear(deadline, |heard| {
            match heard {
                ListenEvent::Frame(frame) => {
                    *frames += 1;
                    if let Some(recorder) = recorder {
                        recorder.frame(&frame);
                    }
                    let engine =
                        engine.get_or_insert_with(|| begin(session, *clock, asking.is_some()));
                    if frame.direction == Direction::Sent && !std::mem::replace(is_local, true) {
                        engine.watch_host();
                    }
                    engine.handle_frame(&frame);
                    if let Some(recording) = &mut session.recording {
                        recording.frame(&frame);
                    }
                    if let Some(asking) = asking {
                        asking.frame(&frame);
                    }
                }
                ListenEvent::Host(observation) => {
                    if let Some(engine) = engine {
                        engine.handle_host(&observation);
                        if let Some(recording) = &mut session.recording {
                            recording.host(&observation);
                        }
                    }
                }
                ListenEvent::Missed(count, at) => {
                    if let Some(recorder) = recorder {
                        recorder.missed(count);
                    }
                    if let Some(engine) = engine {
                        engine.handle_missed(Network::default(), count, at);
                        if let Some(recording) = &mut session.recording {
                            recording.missed(count, at);
                        }
                    }
                    if let Some(asking) = asking {
                        asking.missed();
                    }
                }
            }
            if let Some(engine) = engine {
                session.follow(engine, output);
            }
        })?;
        session.look_at_recording(recorder.as_ref(), output);
        if let Some(engine) = engine {
            let now = clock.now();
            engine.handle_timeout(now);
            session.follow(engine, output);
            session.turn_bundles(now, engine, output);
        }
        Ok(())
    }

    /// Sends the question that is due. Gives why nothing is asked at all beside this MainDevice, if that is so.
    fn ask(&mut self, names: &[String], output: &Output) -> Result<Option<Failure>, LinkError> {
        match (&mut self.asking, &mut self.engine) {
            (Some(asking), Some(engine)) => questions::turn(asking, engine, names, output),
            (_, None) | (None, _) => Ok(None),
        }
    }
}

/// Says of a card that only listens that what it dropped is no matter of the MainDevice's card.
fn tell_of_tap(card_listener: &mut CardListener, names: &[String], output: &Output) {
    let Ok(counts) = card_listener.tap_counts() else { return };
    if counts == TapCounts::default() {
        return;
    }
    output.warn(&format!(
        "{} only listens here: {} and {} that it dropped itself are not counted to the MainDevice's card; some of them may \
         be among the frames that seem lost",
        names.join("+"),
        count(counts.damaged, "damaged frame"),
        count(counts.dropped, "other frame"),
    ));
}

fn begin(session: &DiagnosisRun, clock: HostClock, probes: bool) -> Engine {
    let start = clock.started_at().rfc3339();
    let clock = "host, monotonic".to_owned();
    Engine::new(Setup { input: InputKind::Listened, probes, start, clock, ..session.setup.clone() })
}

/// The first of some cards that is switched on and has no link.
fn without_link(names: &[String]) -> Option<&str> {
    let is_dark = |name: &&String| find(name).is_ok_and(|card| card.up && !card.carrier);
    names.iter().find(is_dark).map(String::as_str)
}

fn silence(names: &[String], heard_for: Instant, dark: Option<&str>) -> Failure {
    let name = names.join("+");
    let reason =
        format!("listen:{name}: no EtherCAT frame was heard in {}", time(heard_for.as_nanos()));
    if let Some(card) = dark {
        let advice = format!(
            "look at {card}, its cable and plugs, and at the supply of the first SubDevice: a MainDevice sends \
             nothing by a card without link"
        );
        return Failure::new(format!("{reason}, and card {card} has no link"), advice);
    }
    let advice = format!(
        "check that the MainDevice runs, and that its line passes this card; when nobody else \
         drives the line, `linesman diagnose {name}` does"
    );
    Failure::new(reason, advice)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_on_a_card_without_link_names_the_link() {
        let names = ["eth0".to_owned()];
        let told = silence(&names, Instant::from_nanos(2_000_000_000), Some("eth0"));
        assert!(told.report().reason.contains("card eth0 has no link"), "{:?}", told.report());
        let told = silence(&names, Instant::from_nanos(2_000_000_000), None);
        assert!(!told.report().reason.contains("link"), "{:?}", told.report());
    }
}
