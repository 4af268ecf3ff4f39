//! Waiting for frames on one socket or several, until a deadline.
//!
//! Reference: ppoll(2).

use linesman_proto::time::{Instant, Span};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;

use crate::clock::{HostClock, timespec};
use crate::error::LinkError;

/// Why a wait ended.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Ready {
    /// There is something to fetch, or an error that fetching reports.
    Readable,
    /// The deadline passed.
    Deadline,
    /// A signal came: look whether to stop, and wait again.
    Interrupted,
}

pub(super) mod sealed {
    use std::os::fd::BorrowedFd;

    /// What to wait for. Its content is known to this module only: sockets are never handed out.
    pub struct Polled<'a> {
        pub(in super::super) socket: BorrowedFd<'a>,
        pub(in super::super) name: &'a str,
    }

    impl<'a> Polled<'a> {
        pub(in super::super) const fn new(socket: BorrowedFd<'a>, name: &'a str) -> Self {
            Self { socket, name }
        }
    }

    /// Gives what to wait for.
    pub trait Pollable {
        #[doc(hidden)]
        fn polled(&self) -> Polled<'_>;
    }
}

/// A socket that can be waited for.
pub trait Waitable: sealed::Pollable {}

/// Waits until one of `sockets` has something to fetch, at most until `deadline`;
/// [`Instant::MAX`] waits without end.
///
/// A thread without real-time scheduling may wake up to 50 µs late, see
/// [`tighten_timers`](crate::clock::tighten_timers).
///
/// # Errors
/// When the kernel refuses to wait.
pub fn wait_any<const N: usize>(
    sockets: [&dyn Waitable; N],
    clock: &HostClock,
    deadline: Instant,
) -> Result<Ready, LinkError> {
    let left = (deadline != Instant::MAX).then(|| deadline.since(clock.now()));
    wait_for(sockets, left)
}

/// The same for as many sockets as there are, which takes memory each time.
///
/// # Errors
/// When the kernel refuses to wait.
pub fn wait_among(
    sockets: &[&dyn Waitable],
    clock: &HostClock,
    deadline: Instant,
) -> Result<Ready, LinkError> {
    let waited: Vec<_> = sockets.iter().map(|socket| socket.polled()).collect();
    let mut polled: Vec<_> =
        waited.iter().map(|one| PollFd::from_borrowed_fd(one.socket, PollFlags::IN)).collect();
    let left = (deadline != Instant::MAX).then(|| timespec(deadline.since(clock.now()).as_nanos()));
    ended(poll(&mut polled, left.as_ref()), || {
        waited.iter().map(|one| one.name).collect::<Vec<_>>().join("+")
    })
}

/// The same for who has just read the clock: waits so long at most; `None` waits without end.
///
/// # Errors
/// When the kernel refuses to wait.
pub fn wait_for<const N: usize>(
    sockets: [&dyn Waitable; N],
    left: Option<Span>,
) -> Result<Ready, LinkError> {
    let waited = sockets.map(|socket| socket.polled());
    let mut polled = std::array::from_fn::<_, N, _>(|index| {
        PollFd::from_borrowed_fd(waited[index].socket, PollFlags::IN)
    });
    let left = left.map(|left| timespec(left.as_nanos()));
    ended(poll(&mut polled, left.as_ref()), || waited.map(|one| one.name).join("+"))
}

/// Outcome of a wait for the interfaces of these names.
fn ended(
    polled: rustix::io::Result<usize>,
    names: impl FnOnce() -> String,
) -> Result<Ready, LinkError> {
    match polled {
        Ok(0) => Ok(Ready::Deadline),
        Ok(_) => Ok(Ready::Readable),
        Err(Errno::INTR) => Ok(Ready::Interrupted),
        Err(error) => Err(LinkError::system(&names(), "waiting for frames", error)),
    }
}
