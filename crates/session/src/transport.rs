//! Transport of the frames of a session: network cards, or a virtual segment.

use linesman_diagnosis::HostObservation;
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

/// A frame that has come back.
#[derive(Clone, Copy, Debug)]
pub struct RxFrame {
    /// When it was seen.
    pub at: Instant,
    /// At which card.
    pub path: Path,
    /// Its length in the room that it was received in, in bytes without check sequence.
    pub len: usize,
    /// Its end is missing because it was longer than any frame may be.
    pub truncated: bool,
}

/// Sink for frames that have come back: it gives the room, so that nothing is copied on the way.
pub trait FrameSink {
    /// Room for the next frame, however long it is.
    fn room(&mut self) -> &mut [u8];
    /// It was.
    fn frame_received(&mut self, frame_received: RxFrame);
}

/// A line, and the clock that it is driven by.
pub trait Transport {
    /// Why the line cannot be used any more.
    type Error;

    /// Options of a MainDevice for this line; all else is as usual.
    fn options(&self) -> Options;

    /// Now.
    fn now(&self) -> Instant;

    /// Takes in what has come back up to `now`; gives how many frames that were.
    ///
    /// # Errors
    /// When an interface vanished, was switched off, or the kernel refuses something else.
    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, Self::Error>;

    /// Sends a frame. What a full queue refuses is lost, and counted by the host.
    ///
    /// # Errors
    /// As [`receive`](Self::receive).
    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), Self::Error>;

    /// Tells what the host noticed since it was asked last, if it is time to look at `now`.
    ///
    /// # Errors
    /// As [`receive`](Self::receive).
    fn look_at_host(
        &mut self,
        now: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), Self::Error>;

    /// Waits until a frame comes, somebody rings, or `deadline`.
    ///
    /// # Errors
    /// When the kernel refuses to wait.
    fn wait(&mut self, deadline: Instant) -> Result<(), Self::Error>;

    /// A deadline of the MainDevice was met so late.
    fn note_late(&mut self, late: Span);
}

impl<L: Transport + ?Sized> Transport for &mut L {
    type Error = L::Error;

    fn options(&self) -> Options {
        (**self).options()
    }

    fn now(&self) -> Instant {
        (**self).now()
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, L::Error> {
        (**self).receive(now, intake)
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), L::Error> {
        (**self).send(path, frame)
    }

    fn look_at_host(
        &mut self,
        now: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), L::Error> {
        (**self).look_at_host(now, tell)
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), L::Error> {
        (**self).wait(deadline)
    }

    fn note_late(&mut self, late: Span) {
        (**self).note_late(late);
    }
}
