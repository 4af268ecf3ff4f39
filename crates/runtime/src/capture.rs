//! A capture as the diagnosis sees it: frames in the order of the file, in times of the run.

use std::path::Path;

use linesman_diagnosis::observe::{Direction, FrameSeen};
use linesman_link::capture::{
    CaptureEnd, CaptureError, CaptureInterface, CaptureReader, FrameDirection, RunClock,
    SkippedLinkType,
};
use linesman_link::input::Input;
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::Network;
use linesman_proto::time::{Instant, Span};

/// A capture that is being read.
pub struct Capture {
    reader: CaptureReader,
    clock: RunClock,
}

impl Capture {
    /// Opens a capture file.
    ///
    /// # Errors
    /// When it is none, or is damaged in its first block.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, CaptureError> {
        Self::of(Input::open(path)?)
    }

    /// Reads a capture from an input. Of a file the run begins with the earliest frame of any
    /// interface; a pipe cannot be read twice, and the run begins with its first frame.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn of(input: Input) -> Result<Self, CaptureError> {
        let clock = match input.is_file() {
            true => RunClock::for_file(input.name())?,
            false => RunClock::default(),
        };
        Ok(Self { clock, reader: CaptureReader::of(input)? })
    }

    /// The share of the file that has been read, 0 to 1; `None` where nobody knows the whole.
    #[must_use]
    pub fn progress(&self) -> Option<f64> {
        self.reader.progress()
    }

    /// The next frame; `None` at the end. Its bytes are borrowed: nothing is copied.
    #[inline]
    pub fn next_frame(&mut self) -> Option<FrameSeen<'_>> {
        let frame = self.reader.next_frame()?;
        let moment = self.clock.place(frame.interface, frame.time);
        Some(FrameSeen {
            network: Network::default(),
            path: None,
            direction: direction(frame.direction),
            time: moment.at,
            number: frame.number.0,
            fcs: frame.fcs,
            truncated: frame.truncated,
            bytes: frame.bytes,
        })
    }

    /// The start of the run by the capture's clock.
    #[must_use]
    pub fn start(&self) -> Option<UnixTime> {
        self.clock.origin()
    }

    /// The latest time so far.
    #[must_use]
    pub fn latest(&self) -> Instant {
        self.clock.latest()
    }

    /// How many frames were earlier than one before them, and by how much at most.
    #[must_use]
    pub fn backward(&self) -> (u64, Span) {
        self.clock.backward()
    }

    /// How it ended; `None` while there may be more.
    #[must_use]
    pub fn end(&self) -> Option<&CaptureEnd> {
        self.reader.end()
    }

    /// The interfaces that were described so far.
    #[must_use]
    pub fn interfaces(&self) -> &[CaptureInterface] {
        self.reader.interfaces()
    }

    /// Frames that were passed over because of their link type.
    #[must_use]
    pub fn skipped(&self) -> &[SkippedLinkType] {
        self.reader.skipped()
    }
}

/// The same word of the diagnosis.
#[must_use]
pub const fn direction(direction: FrameDirection) -> Direction {
    match direction {
        FrameDirection::Incoming => Direction::Received,
        FrameDirection::Outgoing => Direction::Sent,
        FrameDirection::Unknown => Direction::Unknown,
    }
}
