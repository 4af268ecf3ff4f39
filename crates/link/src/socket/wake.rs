//! Waking a thread that waits for frames: because somebody asks for something, or wants it to stop.
//!
//! Reference: unix(7), signal-safety(7). A waiting thread that looked every few milliseconds
//! whether there is something to do would keep the CPU from sleeping and would still be late.

use std::io::{self, Read as _, Write as _};
use std::os::fd::AsFd as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;

use super::wait::{Waitable, sealed};

/// The ear of a thread that waits: another thing to wait for beside sockets.
#[derive(Debug)]
pub struct Waker {
    ear: UnixStream,
    bell: Bell,
}

/// What wakes it. Copies ring the same thread.
#[derive(Clone, Debug)]
pub struct Bell(Arc<UnixStream>);

impl Waker {
    /// A waker that nobody has rung yet.
    ///
    /// # Errors
    /// When the system has no more sockets.
    pub fn new() -> io::Result<Self> {
        let (ear, bell) = UnixStream::pair()?;
        ear.set_nonblocking(true)?;
        bell.set_nonblocking(true)?;
        Ok(Self { ear, bell: Bell(Arc::new(bell)) })
    }

    /// What wakes it.
    #[must_use]
    pub fn bell(&self) -> Bell {
        self.bell.clone()
    }

    /// Whether it was rung since it was asked last.
    pub fn take(&self) -> bool {
        let mut bytes = [0; 64];
        let mut rung = false;
        while matches!((&self.ear).read(&mut bytes), Ok(1..)) {
            rung = true;
        }
        rung
    }
}

impl Bell {
    /// Wakes the thread, or lets its next wait end at once.
    pub fn ring(&self) {
        // A full pipe wakes it all the same.
        let _ = (&*self.0).write(&[1]);
    }

    /// A copy of its own for a signal handler, which writes a byte to it.
    ///
    /// # Errors
    /// When the system has no more sockets.
    pub fn for_signals(&self) -> io::Result<UnixStream> {
        self.0.try_clone()
    }
}

impl sealed::Pollable for Waker {
    fn polled(&self) -> sealed::Polled<'_> {
        sealed::Polled::new(self.ear.as_fd(), "waker")
    }
}

impl Waitable for Waker {}

#[cfg(test)]
mod tests {
    use linesman_proto::time::{Instant, Span};

    use super::*;
    use crate::clock::HostClock;
    use crate::socket::{Ready, wait_any};

    #[test]
    fn a_ring_ends_a_wait_once() {
        let (waker, clock) = (Waker::new().unwrap(), HostClock::start());
        let wait = |until| wait_any([&waker as &dyn Waitable], &clock, until).unwrap();
        assert!(!waker.take());
        assert_eq!(wait(clock.now() + Span::ms(1)), Ready::Deadline);
        for _ in 0..100_000 {
            waker.bell().ring();
        }
        assert_eq!(wait(Instant::MAX), Ready::Readable);
        assert!(waker.take() && !waker.take());
        assert_eq!(wait(clock.now() + Span::ms(1)), Ready::Deadline);
    }

    #[test]
    fn another_thread_wakes_a_wait_without_end() {
        let (waker, clock) = (Waker::new().unwrap(), HostClock::start());
        let bell = waker.bell();
        let ringer = std::thread::spawn(move || bell.ring());
        assert_eq!(
            wait_any([&waker as &dyn Waitable], &clock, Instant::MAX).unwrap(),
            Ready::Readable
        );
        ringer.join().unwrap();
    }
}
