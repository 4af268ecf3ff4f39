//! Waking a thread that waits for frames: because somebody asks for something, or wants it to stop.
//!
//! Reference: unix(7), signal-safety(7). A waiting thread that looked every few milliseconds
//! whether there is something to do would keep the CPU from sleeping and would still be late.

use std::io::{self, Read as _, Write as _};
use std::os::fd::AsFd as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;

use super::wait::{Waitable, sealed};

/// Wake-up of a waiting thread: another thing to wait for beside sockets.
#[derive(Debug)]
pub struct Waker {
    receiver: UnixStream,
    wake_handle: WakeHandle,
}

/// Handle that wakes the thread of a [`Waker`]. Copies wake the same thread.
#[derive(Clone, Debug)]
pub struct WakeHandle(Arc<UnixStream>);

impl Waker {
    /// A waker that nothing has woken yet.
    ///
    /// # Errors
    /// When the system has no more sockets.
    pub fn new() -> io::Result<Self> {
        let (receiver, wake_handle) = UnixStream::pair()?;
        receiver.set_nonblocking(true)?;
        wake_handle.set_nonblocking(true)?;
        Ok(Self { receiver, wake_handle: WakeHandle(Arc::new(wake_handle)) })
    }

    /// The handle that wakes it.
    #[must_use]
    pub fn wake_handle(&self) -> WakeHandle {
        self.wake_handle.clone()
    }

    /// Whether it was woken since it was asked last.
    pub fn take(&self) -> bool {
        let mut bytes = [0; 64];
        let mut woken = false;
        while matches!((&self.receiver).read(&mut bytes), Ok(1..)) {
            woken = true;
        }
        woken
    }
}

impl WakeHandle {
    /// Wakes the thread, or lets its next wait end at once.
    pub fn wake(&self) {
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
        sealed::Polled::new(self.receiver.as_fd(), "waker")
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
            waker.wake_handle().wake();
        }
        assert_eq!(wait(Instant::MAX), Ready::Readable);
        assert!(waker.take() && !waker.take());
        assert_eq!(wait(clock.now() + Span::ms(1)), Ready::Deadline);
    }

    #[test]
    fn another_thread_wakes_a_wait_without_end() {
        let (waker, clock) = (Waker::new().unwrap(), HostClock::start());
        let wake_handle = waker.wake_handle();
        let ringer = std::thread::spawn(move || wake_handle.wake());
        assert_eq!(
            wait_any([&waker as &dyn Waitable], &clock, Instant::MAX).unwrap(),
            Ready::Readable
        );
        ringer.join().unwrap();
    }
}
