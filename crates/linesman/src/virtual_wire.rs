//! Wire of a virtual segment for a MainDevice of one's own.

use linesman_diagnosis::{Diagnosis, Direction, Engine, Event, HostObservation, InputKind, Setup};
use linesman_link::error::LinkError;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::transport::{FrameSink, RxFrame, Transport};
use linesman_session::frame::{FRAME_ROOM, FrameSummary};
use linesman_sim::segment_file::SegmentFile;

use crate::segment::build;
use crate::{Error, Simulation};

/// A virtual segment that another MainDevice drives with its own frames, and the diagnosis that watches them.
///
/// Time is virtual: it passes in [`exchange`](Self::exchange) and [`wait`](Self::wait), and the same calls give the
/// same bytes.
pub struct VirtualWire {
    segment: Simulation,
    engine: Engine,
    frames: u64,
}

impl VirtualWire {
    /// Builds a segment.
    ///
    /// # Errors
    /// When it cannot be built: an unknown type, a port that is used twice.
    pub fn new(file: &SegmentFile) -> Result<Self, Error> {
        let segment = build(file, &Error::Segment)?;
        let source = format!("sim:{}", file.name);
        // The frames are those of another MainDevice: its orders are not known.
        let setup =
            Setup { input: InputKind::Listened, host_counters: true, source, ..Setup::default() };
        Ok(Self { segment, engine: Engine::new(setup), frames: 0 })
    }

    /// The segment, to break and heal it.
    #[must_use]
    pub const fn simulation(&self) -> &Simulation {
        &self.segment
    }

    /// The virtual time.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.segment.now()
    }

    /// Sends an Ethernet frame, without check sequence, and waits until it comes back, `timeout` at most. `None`:
    /// it was lost.
    ///
    /// # Errors
    /// When the system fails.
    pub fn exchange(&mut self, frame: &[u8], timeout: Span) -> Result<Option<Vec<u8>>, Error> {
        let sent = self.now();
        self.see(sent, Direction::Sent, frame);
        self.segment.send(Path::A, frame)?;
        let until = sent + timeout;
        loop {
            if let Some((at, back)) = self.receive()?.pop() {
                self.engine.handle_timeout(self.now().max(at));
                return Ok(Some(back));
            }
            if self.now() >= until {
                self.engine.handle_timeout(until);
                return Ok(None);
            }
            self.segment.wait(until)?;
        }
    }

    /// Lets time pass. A frame that comes back meanwhile is late: the diagnosis sees it, nobody else does.
    ///
    /// # Errors
    /// When the system fails.
    pub fn wait(&mut self, span: Span) -> Result<(), Error> {
        let until = self.now() + span;
        while self.now() < until {
            self.segment.wait(until)?;
            self.receive()?;
        }
        self.engine.handle_timeout(until);
        Ok(())
    }

    /// Next change of a finding: it has opened, was confirmed, or closed.
    pub fn poll_finding(&mut self) -> Option<Event> {
        self.engine.poll_event()
    }

    /// Ends the observation and gives the whole answer.
    #[must_use]
    pub fn diagnosis(mut self) -> Diagnosis {
        let now = self.now();
        self.engine.finish(now, true);
        self.engine.diagnosis()
    }

    /// Takes in what has come back.
    fn receive(&mut self) -> Result<Vec<(Instant, Vec<u8>)>, LinkError> {
        let mut arrived = Arrived { room: vec![0; FRAME_ROOM], frames: Vec::new() };
        let now = self.segment.now();
        self.segment.receive(now, &mut arrived)?;
        for (at, frame) in &arrived.frames {
            self.see(*at, Direction::Received, frame);
        }
        let mut host: Vec<HostObservation> = Vec::new();
        self.segment.look_at_host(now, &mut |observation| host.push(*observation))?;
        host.iter().for_each(|observation| self.engine.handle_host(observation));
        Ok(arrived.frames)
    }

    fn see(&mut self, time: Instant, direction: Direction, bytes: &[u8]) {
        self.frames += 1;
        let (number, path) = (self.frames, Some(Path::A));
        let passed = FrameSummary { time, number, path, direction, truncated: false };
        self.engine.handle_frame(&passed.seen(bytes));
    }
}

/// Frames that have come back.
struct Arrived {
    room: Vec<u8>,
    frames: Vec<(Instant, Vec<u8>)>,
}

impl FrameSink for Arrived {
    fn room(&mut self) -> &mut [u8] {
        &mut self.room
    }

    fn frame_received(&mut self, frame: RxFrame) {
        let bytes = self.room.get(..frame.len).unwrap_or_default();
        self.frames.push((frame.at, bytes.to_vec()));
    }
}
