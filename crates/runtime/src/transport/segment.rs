//! A virtual segment in this process, in virtual time.
//!
//! Time jumps from one thing that is due to the next, so a run costs only its work, and the same file
//! gives the same bytes. With [`Pace::Host`] time never runs ahead of the host's clock, for a person
//! or a program that looks on.

use linesman_diagnosis::HostObservation;
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_link::socket::{Waitable, WakeHandle, Waker, wait_any};
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_session::segment_line::SegmentLine;
use linesman_sim::segment::Segment;

use super::{FrameSink, TimeShare, Transport};
use crate::wiring::Wiring;

/// How fast virtual time goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Pace {
    /// As fast as the work is done.
    Free,
    /// As the host's clock, or slower.
    Host,
}

/// The segment, and the clock of the host beside it.
pub struct SegmentTransport {
    line: SegmentLine,
    wiring: Wiring,
    pace: Pace,
    clock: HostClock,
    waker: Waker,
    /// Its place among lines that have one time.
    share: Option<TimeShare>,
}

impl SegmentTransport {
    /// A segment with one card, or with two at the ends of a ring. Its outputs come back to its
    /// inputs by `wiring`.
    ///
    /// # Errors
    /// When the system has no more sockets.
    pub fn new(
        segment: Segment,
        wiring: Wiring,
        ring: bool,
        pace: Pace,
    ) -> Result<Self, std::io::Error> {
        Ok(Self {
            line: SegmentLine::new(segment, ring),
            wiring,
            pace,
            clock: HostClock::start(),
            waker: Waker::new()?,
            share: None,
        })
    }

    /// The segment.
    #[must_use]
    pub const fn segment(&self) -> &Segment {
        self.line.segment()
    }

    /// The segment, to break and heal it, or to set what its inputs see.
    pub const fn segment_mut(&mut self) -> &mut Segment {
        self.line.segment_mut()
    }

    /// Goes on in step with the other lines that share a time.
    pub fn share_time(&mut self, share: TimeShare) {
        self.share = Some(share);
    }

    /// What wakes the thread that waits.
    #[must_use]
    pub fn wake_handle(&self) -> WakeHandle {
        self.waker.wake_handle()
    }
}

impl Transport for SegmentTransport {
    type Error = LinkError;

    fn options(&self) -> Options {
        self.line.options(Options::default())
    }

    fn now(&self) -> Instant {
        self.line.now()
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, LinkError> {
        if let Some(share) = &mut self.share {
            share.begin();
        }
        self.line.advance(now);
        self.wiring.carry(self.line.segment_mut().signals_mut());
        Ok(self.line.receive(intake))
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), LinkError> {
        self.line.send(path, frame);
        Ok(())
    }

    fn look_at_host(
        &mut self,
        _: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), LinkError> {
        self.line.look_at_host(true, tell);
        Ok(())
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), LinkError> {
        let until = self.line.poll_timeout().min(deadline);
        if let Some(share) = &self.share {
            share.wait(until.max(self.line.now()));
        }
        if self.pace == Pace::Host && until > self.clock.now() {
            let waker: &dyn Waitable = &self.waker;
            wait_any([waker], &self.clock, until)?;
            self.waker.take();
            self.line.set_now(until.min(self.clock.now()));
            return Ok(());
        }
        self.line.set_now(until);
        Ok(())
    }

    fn note_late(&mut self, _: Span) {}
}
