//! A virtual segment in this process, in virtual time.
//!
//! Time jumps from one thing that is due to the next, so a run costs only its work, and the same file
//! gives the same bytes. With [`Pace::Host`] time never runs ahead of the host's clock, for a person
//! or a program that looks on.

use linesman_diagnosis::HostObservation;
use linesman_diagnosis::observe::HostEvent;
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_link::socket::{Waitable, WakeHandle, Waker, wait_any};
use linesman_maindevice::Options;
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::{HostPort, Segment};

use super::{FrameSink, RxFrame, Transport};
use crate::wiring::Wiring;

/// How fast virtual time goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Pace {
    /// As fast as the work is done.
    Free,
    /// As the host's clock, or slower.
    Host,
}

/// How often the virtual cards' counters are looked at, if nothing is told of their links.
const EVERY: Span = Span::ms(100);

/// The segment, its cards and its time.
pub struct SegmentTransport {
    segment: Segment,
    wiring: Wiring,
    paths: usize,
    now: Instant,
    pace: Pace,
    clock: HostClock,
    waker: Waker,
    arrival: Vec<u8>,
    look_at: Instant,
    last: [Option<HostPort>; 2],
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
            segment,
            wiring,
            paths: if ring { 2 } else { 1 },
            now: Instant::ZERO,
            pace,
            clock: HostClock::start(),
            waker: Waker::new()?,
            arrival: Vec::with_capacity(1_514),
            look_at: Instant::ZERO,
            last: [None; 2],
        })
    }

    /// The segment.
    #[must_use]
    pub const fn segment(&self) -> &Segment {
        &self.segment
    }

    /// The segment, to break and heal it, or to set what its inputs see.
    pub fn segment_mut(&mut self) -> &mut Segment {
        &mut self.segment
    }

    /// What wakes the thread that waits.
    #[must_use]
    pub fn wake_handle(&self) -> WakeHandle {
        self.waker.wake_handle()
    }
}

impl Transport for SegmentTransport {
    fn options(&self) -> Options {
        let usual = Options { ring: self.paths > 1, ..Options::default() };
        usual.on_line(self.segment.tree().len(), self.segment.longest_way())
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn receive(&mut self, _: Instant, intake: &mut dyn FrameSink) -> Result<usize, LinkError> {
        self.segment.advance(self.now);
        self.wiring.carry(self.segment.signals_mut());
        let mut count = 0;
        while let Some(came) = self.segment.poll_arrival(&mut self.arrival) {
            count += 1;
            // What is not intact the card drops and counts; nobody behind it sees it.
            if came.intact {
                let room = intake.room();
                let len = self.arrival.len().min(room.len());
                room[..len].copy_from_slice(&self.arrival[..len]);
                let truncated = len < self.arrival.len();
                intake.frame_received(RxFrame { at: came.at, path: came.path, len, truncated });
            }
        }
        Ok(count)
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), LinkError> {
        self.segment.handle_frame(self.now, path, frame);
        Ok(())
    }

    fn look_at_host(
        &mut self,
        _: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), LinkError> {
        let has_news = self.segment.takes_card_news();
        if !has_news && self.now < self.look_at {
            return Ok(());
        }
        self.look_at = self.now + EVERY;
        for path in Path::ALL.into_iter().take(self.paths) {
            let port = self.segment.host(path);
            let before = self.last[path.index()].replace(port);
            let last = before.unwrap_or_default();
            let mut note = |what| {
                let network = Network::default();
                tell(&HostObservation { network, path, time: self.now, what });
            };
            if before.is_none_or(|before| before.carrier != port.carrier) {
                note(HostEvent::Carrier(port.carrier));
            }
            let failures = port.tx_dropped - last.tx_dropped;
            if failures > 0 {
                note(HostEvent::SendFailures(failures));
            }
            let crc = port.rx_crc_errors - last.rx_crc_errors;
            let other = port.rx_length_errors - last.rx_length_errors;
            if crc + other > 0 {
                note(HostEvent::CardErrors { crc, other });
            }
        }
        Ok(())
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), LinkError> {
        let until = self.segment.poll_timeout().map_or(deadline, |at| at.min(deadline));
        if self.pace == Pace::Host && until > self.clock.now() {
            let waker: &dyn Waitable = &self.waker;
            wait_any([waker], &self.clock, until)?;
            self.waker.take();
            self.now = self.now.max(until.min(self.clock.now()));
            return Ok(());
        }
        self.now = self.now.max(until);
        Ok(())
    }

    fn note_late(&mut self, _: Span) {}
}
