//! Diagnosis thread: the diagnosis of a line while it runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;
use std::thread::{self, JoinHandle};

use linesman_diagnosis::{Diagnosis, Engine, Event, Probe};
use linesman_proto::address::Network;
use linesman_proto::time::Instant;

use super::note::Note;
use super::tap::{Listener, TapLog};
use crate::part::{PartFailure, guard};

/// The diagnosis in messages.
const PART: &str = "the diagnosis";
/// The consequence of its failure.
const EFFECT: &str = "the line is driven on, and not judged any more";

/// A diagnosis that is fed with the frames of a run: an [`Engine`], but in tests.
pub trait DiagnosisObserver: Send {
    /// Takes frames and what the host noticed, in order of time; gives the time of the last frame.
    fn take(&mut self, log: &TapLog) -> Instant;
    /// Time has passed.
    fn turn(&mut self, now: Instant);
    /// The run has ended.
    fn finish(&mut self, at: Instant);
    /// What happened to findings.
    fn poll_event(&mut self) -> Option<Event>;
    /// What it would like to have read.
    fn poll_probe(&mut self) -> Option<Probe>;
    /// The whole answer.
    fn diagnosis(&self) -> Diagnosis;
}

impl DiagnosisObserver for Engine {
    fn take(&mut self, log: &TapLog) -> Instant {
        let mut last = Instant::ZERO;
        let mut host = log.host().iter().peekable();
        for frame in log.frames() {
            while let Some(observation) = host.next_if(|one| one.time <= frame.time) {
                self.handle_host(observation);
            }
            if Engine::poll_timeout(self).is_some_and(|due| due <= frame.time) {
                self.handle_timeout(frame.time);
            }
            self.handle_frame(&frame);
            last = last.max(frame.time);
        }
        host.for_each(|observation| self.handle_host(observation));
        self.handle_missed(Network::default(), log.missed(), last);
        last
    }

    fn turn(&mut self, now: Instant) {
        self.handle_timeout(now);
    }

    fn finish(&mut self, at: Instant) {
        Engine::finish(self, at, true);
    }

    fn poll_event(&mut self) -> Option<Event> {
        Engine::poll_event(self)
    }

    fn poll_probe(&mut self) -> Option<Probe> {
        Engine::poll_probe(self)
    }

    fn diagnosis(&self) -> Diagnosis {
        Engine::diagnosis(self)
    }
}

/// Where a diagnosis tells what it finds.
pub struct DiagnosisOutput {
    /// Findings, and that it has failed.
    pub notes: SyncSender<Note>,
    /// Notes for which there was no room.
    pub untold: Arc<AtomicU64>,
    /// What it would like to have read, as far as there is room.
    pub probes: SyncSender<Probe>,
}

impl DiagnosisOutput {
    fn events(&self, observer: &mut dyn DiagnosisObserver) {
        while let Some(event) = observer.poll_event() {
            self.note(Note::Finding(Box::new(event)));
        }
    }

    fn note(&self, note: Note) {
        if self.notes.try_send(note).is_err() {
            self.untold.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Begins to judge what comes by the tap. Where the diagnosis fails, that is told at once, and again by the thread
/// when it is waited for.
///
/// # Errors
/// When the system has no more threads.
pub fn judge(
    observer: Box<dyn DiagnosisObserver>,
    listener: Listener,
    told: DiagnosisOutput,
) -> std::io::Result<JoinHandle<Result<Diagnosis, PartFailure>>> {
    thread::Builder::new().name("judge".to_owned()).spawn(move || {
        let reporting = &told;
        let judged = guard(PART, EFFECT, move || work(observer, &listener, reporting));
        if let Err(failure) = &judged {
            told.note(Note::Failed(failure.clone()));
        }
        judged
    })
}

fn work(
    mut observer: Box<dyn DiagnosisObserver>,
    listener: &Listener,
    told: &DiagnosisOutput,
) -> Diagnosis {
    let (mut done, mut last) = (None, Instant::ZERO);
    while let Some(log) = listener.next(done.take()) {
        last = last.max(observer.take(&log));
        observer.turn(last);
        while let Some(probe) = observer.poll_probe() {
            // What is not read now is asked for again.
            let _ = told.probes.try_send(probe);
        }
        told.events(&mut *observer);
        done = Some(log);
    }
    observer.finish(last);
    told.events(&mut *observer);
    observer.diagnosis()
}
