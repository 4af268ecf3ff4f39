//! Conversion of the absolute times of a capture to times of the run.
//!
//! A run begins at 0, its clock is the capture's. Times stay as the file has them: they may repeat,
//! jump, or run backwards between interfaces, and whoever judges them is told when they do.

use std::path::Path;

use linesman_proto::time::{Instant, Span};

use super::error::CaptureError;
use super::frame::CaptureInterfaceId;
use super::reader::CaptureReader;
use crate::unix_time::UnixTime;

/// How many frames are looked at for the first one of each interface.
const SURVEY_FRAMES: usize = 4096;

/// Maps times of a capture to times of the run.
#[derive(Clone, Debug, Default)]
pub struct RunClock {
    origin: Option<UnixTime>,
    latest: Option<UnixTime>,
    /// The last time on each interface.
    last: Vec<Option<UnixTime>>,
    backward_frames: u64,
    backward_most: Span,
}

/// When a frame was seen, in times of the run.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Moment {
    /// The frame's time; [`Instant::ZERO`] also for what lies before the origin.
    pub at: Instant,
    /// Set when the frame is earlier than one before it in the file.
    pub backward: Option<Backward>,
}

/// Time that ran backwards from one frame of the file to the next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Backward {
    /// How far the frame lies behind the latest one before it.
    pub by: Span,
    /// Whether the frame is also earlier than the one before it on its own interface. Then the
    /// recorder's clock was set back, or a card's queues changed the order; otherwise two cards'
    /// clocks or queues merely differ.
    pub same_interface: bool,
}

impl RunClock {
    /// A clock whose run begins at `origin`.
    #[must_use]
    pub fn starting_at(origin: UnixTime) -> Self {
        Self { origin: Some(origin), ..Self::default() }
    }

    /// A clock for a capture file. Its run begins with the earliest of the interfaces' first
    /// frames, found among the first 4,096 frames of the file.
    ///
    /// A [default](Self::default) clock begins with the first frame it is shown; that is for
    /// captures that can be read only once.
    ///
    /// # Errors
    /// When the file cannot be opened as a capture.
    pub fn for_file(path: impl AsRef<Path>) -> Result<Self, CaptureError> {
        let mut reader = CaptureReader::open(path)?;
        let mut seen = Vec::new();
        let mut origin: Option<UnixTime> = None;
        for _ in 0..SURVEY_FRAMES {
            let Some(frame) = reader.next_frame() else { break };
            let Some(time) = frame.time else { continue };
            if !seen.contains(&frame.interface) {
                seen.push(frame.interface);
                origin = Some(origin.map_or(time, |earliest| earliest.min(time)));
            }
        }
        Ok(Self { origin, ..Self::default() })
    }

    /// The start of the run by the capture's clock; `None` before any time was seen.
    #[must_use]
    pub fn origin(&self) -> Option<UnixTime> {
        self.origin
    }

    /// How many frames were earlier than one before them, and by how much at most.
    #[must_use]
    pub fn backward(&self) -> (u64, Span) {
        (self.backward_frames, self.backward_most)
    }

    /// The latest time so far.
    #[must_use]
    pub fn latest(&self) -> Instant {
        self.latest.map_or(Instant::ZERO, |latest| self.at(latest))
    }

    /// Places the next frame of the file. One without a time takes the latest so far.
    #[inline]
    pub fn place(&mut self, interface: CaptureInterfaceId, time: Option<UnixTime>) -> Moment {
        let Some(time) = time else {
            return Moment { at: self.latest(), backward: None };
        };
        self.origin.get_or_insert(time);
        let index = interface.0 as usize;
        if self.last.len() <= index {
            self.last.resize(index + 1, None);
        }
        let backward = self.latest.and_then(|latest| latest.since(time)).and_then(|by| {
            let same_interface = self.last[index].is_some_and(|last| last > time);
            (by > Span::ZERO).then_some(Backward { by, same_interface })
        });
        self.last[index] = Some(time);
        match backward {
            Some(Backward { by, .. }) => {
                self.backward_frames += 1;
                self.backward_most = self.backward_most.max(by);
            }
            None => self.latest = Some(time),
        }
        Moment { at: self.at(time), backward }
    }

    /// The time of the run that a time of the capture is; [`Instant::ZERO`] also for what lies before the origin.
    #[must_use]
    #[inline]
    pub fn at(&self, time: UnixTime) -> Instant {
        let since = self.origin.and_then(|origin| time.since(origin));
        Instant::ZERO + since.unwrap_or(Span::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: CaptureInterfaceId = CaptureInterfaceId(0);
    const B: CaptureInterfaceId = CaptureInterfaceId(1);

    fn unix(nanos: i128) -> Option<UnixTime> {
        Some(UnixTime::from_nanos(1_700_000_000_000_000_000 + nanos))
    }

    #[test]
    fn times_count_from_the_first_frame_and_stay_as_they_are() {
        let mut clock = RunClock::default();
        assert_eq!(clock.latest(), Instant::ZERO);
        let at = |moment: Moment| (moment.at.as_nanos(), moment.backward);
        assert_eq!(at(clock.place(A, unix(0))), (0, None));
        assert_eq!(at(clock.place(A, unix(900))), (900, None));
        let behind = |by, same_interface| Some(Backward { by: Span::ns(by), same_interface });
        assert_eq!(at(clock.place(B, unix(400))), (400, behind(500, false)));
        assert_eq!(at(clock.place(A, unix(880))), (880, behind(20, true)));
        assert_eq!(at(clock.place(A, unix(-7))), (0, behind(907, true)), "before the origin");
        assert_eq!(at(clock.place(A, None)), (900, None), "a block without time");
        assert_eq!(at(clock.place(B, unix(1000))), (1000, None));
        assert_eq!(at(clock.place(B, unix(999))), (999, behind(1, true)));
        assert_eq!(clock.backward(), (4, Span::ns(907)));
        assert_eq!(clock.origin(), unix(0));
    }

    #[test]
    fn absurd_times_do_not_overflow() {
        let mut clock = RunClock::starting_at(UnixTime::from_nanos(i128::MIN));
        assert_eq!(clock.place(A, Some(UnixTime::from_nanos(i128::MAX))).at, Instant::ZERO);
        let mut clock = RunClock::starting_at(UnixTime::EPOCH);
        let far = UnixTime::from_nanos(i128::from(u64::MAX) * 1_000_000_000);
        assert_eq!(clock.place(A, Some(far)).at, Instant::MAX);
        assert_eq!(clock.place(A, unix(0)).backward.unwrap().by, Span::ns(u64::MAX));
    }
}
