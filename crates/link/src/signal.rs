//! Signals and streams by which a program learns that nobody is there any more.
//!
//! Reference: sigaction(2), signal(7), poll(2).

use std::io;
use std::mem;
use std::os::fd::AsFd;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::time::Timespec;

/// Whether this process ignores the signal. Whoever starts a program under `nohup` means it so.
///
/// # Errors
/// When there is no such signal.
#[allow(unsafe_code)]
pub fn is_ignored(signal: i32) -> io::Result<bool> {
    // SAFETY: `sigaction` is made of integers, a mask and an optional pointer, for which zero is valid.
    let mut now: libc::sigaction = unsafe { mem::zeroed() };
    // SAFETY: without a new disposition the kernel only writes to `now`, which is one.
    let result = unsafe { libc::sigaction(signal, std::ptr::null(), &raw mut now) };
    match result {
        0 => Ok(now.sa_sigaction == libc::SIG_IGN),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Whether nobody can read any more what is written to this stream: the reading end of a pipe is
/// closed, the terminal is gone. Files are never without a reader.
#[must_use]
pub fn is_without_reader(stream: impl AsFd) -> bool {
    let mut polled = [PollFd::new(&stream, PollFlags::empty())];
    let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
    // Errors and the end of a connection are told without being asked for.
    poll(&mut polled, Some(&at_once)).is_ok_and(|count| count > 0)
        && polled[0].revents().intersects(PollFlags::ERR | PollFlags::HUP)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pipe_has_a_reader_until_that_is_closed() {
        let (reader, writer) = io::pipe().unwrap();
        assert!(!is_without_reader(&writer));
        drop(reader);
        assert!(is_without_reader(&writer));
        assert!(!is_without_reader(
            std::fs::File::options().write(true).open("/dev/null").unwrap()
        ));
    }

    #[test]
    fn the_pipe_signal_is_ignored_and_the_hangup_is_not() {
        // The standard library ignores SIGPIPE; nothing here touches SIGURG.
        assert!(is_ignored(libc::SIGPIPE).unwrap());
        assert!(!is_ignored(libc::SIGURG).unwrap());
        assert!(is_ignored(4_711).is_err());
    }
}
