//! Virtual segment of a line, shared by the run and by those who break it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use linesman_diagnosis::HostObservation;
use linesman_link::error::LinkError;
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::time::Instant;
use linesman_runtime::transport::{FrameSink, SegmentTransport, Transport};
use linesman_sim::segment_file::FaultEntry;
use linesman_sim::truth::FaultId;

use crate::Error;

/// Breaks and heals the virtual segment of a line, also while it runs, from the application or from another
/// thread: [`Segment::simulation`](crate::Segment::simulation). Copies mean the same segment.
#[derive(Clone)]
pub struct Simulation {
    line: Arc<Mutex<SegmentTransport>>,
}

impl Simulation {
    pub(crate) fn new(line: SegmentTransport) -> Self {
        Self { line: Arc::new(Mutex::new(line)) }
    }

    /// Injects a fault. Its times count from now on.
    ///
    /// # Errors
    /// When the segment has no such place.
    pub fn inject(&self, fault: &FaultEntry) -> Result<FaultId, Error> {
        let mut line = self.lock();
        let now = line.now();
        line.segment_mut().inject(now, fault).map_err(|error| Error::Segment(error.to_string()))
    }

    /// Ends a fault.
    pub fn heal(&self, fault: FaultId) {
        let mut line = self.lock();
        let now = line.now();
        line.segment_mut().heal(now, fault);
    }

    /// The virtual time.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.lock().now()
    }

    /// The line belongs to one thread at a time; one that panicked has left it whole.
    fn lock(&self) -> MutexGuard<'_, SegmentTransport> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Transport for Simulation {
    type Error = LinkError;

    fn options(&self) -> Options {
        self.lock().options()
    }

    fn now(&self) -> Instant {
        self.lock().now()
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, LinkError> {
        self.lock().receive(now, intake)
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), LinkError> {
        self.lock().send(path, frame)
    }

    fn look_at_host(
        &mut self,
        now: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), LinkError> {
        self.lock().look_at_host(now, tell)
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), LinkError> {
        self.lock().wait(deadline)
    }

    fn note_late(&mut self, late: linesman_proto::time::Span) {
        self.lock().note_late(late);
    }
}
