//! Diagnosis thread: the diagnosis of a line while it runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;
use std::thread::{self, JoinHandle};

use linesman_diagnosis::{Diagnosis, Engine, Probe};
use linesman_proto::address::Network;
use linesman_proto::time::Instant;
use linesman_session::DiagnosisInput;

use super::note::Note;
use super::tap::{Listener, TapLog};
use crate::part::{PartFailure, guard};

/// The diagnosis in messages.
pub(super) const PART: &str = "the diagnosis";
/// The consequence of its failure.
pub(super) const EFFECT: &str = "the line is driven on, and not judged any more";

/// A diagnosis of a run: an [`Engine`], but in tests.
pub trait DiagnosisObserver: DiagnosisInput + Send {
    /// Notes that `count` frames passed up to this time and were not shown.
    fn missed(&mut self, count: u64, at: Instant);
    /// The run has ended.
    fn finish(&mut self, at: Instant);
    /// The whole answer.
    fn diagnosis(&self) -> Diagnosis;
}

impl DiagnosisObserver for Engine {
    fn missed(&mut self, count: u64, at: Instant) {
        self.handle_missed(Network::default(), count, at);
    }

    fn finish(&mut self, at: Instant) {
        Engine::finish(self, at, true);
    }

    fn diagnosis(&self) -> Diagnosis {
        Engine::diagnosis(self)
    }
}

/// Shows frames and what the host noticed, in order of time; gives the time of the last frame.
fn take(observer: &mut dyn DiagnosisObserver, log: &TapLog) -> Instant {
    let mut last = Instant::ZERO;
    let mut host = log.host().iter().peekable();
    for frame in log.frames() {
        while let Some(observation) = host.next_if(|one| one.time <= frame.time) {
            observer.host(observation);
        }
        if observer.poll_timeout().is_some_and(|due| due <= frame.time) {
            observer.turn(frame.time);
        }
        observer.frame(&frame);
        last = last.max(frame.time);
    }
    host.for_each(|observation| observer.host(observation));
    observer.missed(log.missed(), last);
    last
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
        last = last.max(take(&mut *observer, &log));
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
