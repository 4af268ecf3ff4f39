//! Input of the diagnosis of a run: behind a queue, or inline in virtual time.

use std::sync::mpsc::Receiver;

use linesman_diagnosis::{Diagnosis, Event, FrameSeen, HostObservation, Probe};
use linesman_proto::time::Instant;
use linesman_session::DiagnosisInput;
use linesman_session::frame::FrameSummary;

use super::diagnosis_thread::{DiagnosisObserver, EFFECT, PART};
use super::tap::Tap;
use crate::part::{PartFailure, guard};

/// Input of the diagnosis of a run, by where frames are judged.
pub enum RunDiagnosis {
    /// Nowhere.
    Nowhere,
    /// In a thread of its own, so that the cycle never waits for it.
    Queued {
        /// The queue of frames for it.
        tap: Tap,
        /// Questions: what it would like to have read.
        probes: Receiver<Probe>,
    },
    /// At once, in virtual time: the same run gives the same findings.
    Inline(InlineDiagnosis),
}

impl RunDiagnosis {
    /// Frames that were not judged because the diagnosis did not keep up, or has failed.
    #[must_use]
    pub const fn left_out(&self) -> u64 {
        match self {
            Self::Nowhere => 0,
            Self::Queued { tap, .. } => tap.left_out(),
            Self::Inline(inline) => inline.left_out,
        }
    }
}

/// A diagnosis in the same thread. Where it fails, the line is driven on.
pub struct InlineDiagnosis {
    observer: Option<Box<dyn DiagnosisObserver>>,
    failure: Option<PartFailure>,
    is_news: bool,
    left_out: u64,
}

impl InlineDiagnosis {
    /// This one.
    #[must_use]
    pub fn new(observer: Box<dyn DiagnosisObserver>) -> Self {
        Self { observer: Some(observer), failure: None, is_news: false, left_out: 0 }
    }

    /// That it has failed; told once.
    pub fn poll_failure(&mut self) -> Option<PartFailure> {
        if std::mem::take(&mut self.is_news) { self.failure.clone() } else { None }
    }

    /// The whole answer at the end of the run.
    ///
    /// # Errors
    /// That it has failed, now or before.
    pub fn finish(mut self, at: Instant) -> Result<(Diagnosis, Vec<Event>), PartFailure> {
        let ended = self.work(|observer| {
            observer.finish(at);
            let events = std::iter::from_fn(|| observer.poll_event()).collect();
            (observer.diagnosis(), events)
        });
        match (ended, self.failure) {
            (Some(ended), _) => Ok(ended),
            (None, Some(failure)) => Err(failure),
            // It is there until it fails.
            (None, None) => Err(PartFailure::of_panic(PART, EFFECT, &"it was gone")),
        }
    }

    fn work<T>(&mut self, work: impl FnOnce(&mut dyn DiagnosisObserver) -> T) -> Option<T> {
        let observer = self.observer.as_deref_mut()?;
        match guard(PART, EFFECT, || work(observer)) {
            Ok(done) => Some(done),
            Err(failure) => {
                self.observer = None;
                self.failure = Some(failure);
                self.is_news = true;
                None
            }
        }
    }
}

impl DiagnosisInput for RunDiagnosis {
    #[inline]
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        match self {
            Self::Nowhere => {}
            Self::Queued { tap, .. } => tap.frame(frame),
            Self::Inline(inline) => {
                if inline.work(|observer| observer.frame(frame)).is_none() {
                    inline.left_out += 1;
                }
            }
        }
    }

    #[inline]
    fn room(&mut self, now: Instant) -> Option<&mut [u8]> {
        match self {
            Self::Queued { tap, .. } => Some(&mut tap.room(now)[..]),
            Self::Nowhere | Self::Inline(_) => None,
        }
    }

    #[inline]
    fn keep(&mut self, passed: &FrameSummary, len: usize) {
        if let Self::Queued { tap, .. } = self {
            tap.keep(passed, len);
        }
    }

    fn host(&mut self, observation: &HostObservation) {
        match self {
            Self::Nowhere => {}
            Self::Queued { tap, .. } => tap.host(observation),
            Self::Inline(inline) => {
                inline.work(|observer| observer.host(observation));
            }
        }
    }

    fn turn(&mut self, now: Instant) {
        match self {
            Self::Nowhere => {}
            Self::Queued { tap, .. } => tap.turn(now),
            Self::Inline(inline) => {
                inline.work(|observer| observer.turn(now));
            }
        }
    }

    fn poll_timeout(&self) -> Option<Instant> {
        match self {
            // The cycle comes round often enough to hand over what is old.
            Self::Nowhere | Self::Queued { .. } => None,
            Self::Inline(inline) => inline.observer.as_ref()?.poll_timeout(),
        }
    }

    fn poll_probe(&mut self) -> Option<Probe> {
        match self {
            Self::Nowhere => None,
            Self::Queued { probes, .. } => probes.try_recv().ok(),
            Self::Inline(inline) => inline.work(|observer| observer.poll_probe()).flatten(),
        }
    }

    fn poll_event(&mut self) -> Option<Event> {
        match self {
            // It tells by itself.
            Self::Nowhere | Self::Queued { .. } => None,
            Self::Inline(inline) => inline.work(|observer| observer.poll_event()).flatten(),
        }
    }
}
