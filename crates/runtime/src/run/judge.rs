//! The thread that judges: the diagnosis of a line while it runs.

use std::sync::mpsc::SyncSender;
use std::thread::{self, JoinHandle};

use linesman_diagnosis::{Diagnosis, Engine, Probe, Setup};
use linesman_proto::time::Instant;

use super::operator::Note;
use super::tap::Listener;

/// Begins to judge what comes by the tap; findings are told as notes, and what the diagnosis would like to
/// have read goes to `probes`, as far as there is room.
///
/// # Errors
/// When the system has no more threads.
pub fn judge(
    setup: Setup,
    listener: Listener,
    notes: SyncSender<Note>,
    probes: SyncSender<Probe>,
) -> std::io::Result<JoinHandle<Diagnosis>> {
    thread::Builder::new().name("judge".to_owned()).spawn(move || {
        let mut engine = Engine::new(setup);
        let (mut done, mut last) = (None, Instant::ZERO);
        while let Some(log) = listener.next(done.take()) {
            let mut host = log.host().iter().peekable();
            for frame in log.frames() {
                while let Some(observation) = host.next_if(|one| one.time <= frame.time) {
                    engine.handle_host(observation);
                }
                if engine.poll_timeout().is_some_and(|due| due <= frame.time) {
                    engine.handle_timeout(frame.time);
                }
                engine.handle_frame(&frame);
                last = last.max(frame.time);
            }
            host.for_each(|observation| engine.handle_host(observation));
            engine.handle_timeout(last);
            while let Some(probe) = engine.poll_probe() {
                // What is not read now is asked for again.
                let _ = probes.try_send(probe);
            }
            while let Some(event) = engine.poll_event() {
                let _ = notes.try_send(Note::Finding(Box::new(event)));
            }
            done = Some(log);
        }
        engine.finish(last, true);
        while let Some(event) = engine.poll_event() {
            let _ = notes.try_send(Note::Finding(Box::new(event)));
        }
        engine.diagnosis()
    })
}
