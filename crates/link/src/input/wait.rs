//! Pipes that may never say anything.
//!
//! Reference: fifo(7), poll(2).

use std::fs::{File, OpenOptions};
use std::io::{self, Read};
use std::os::fd::AsFd as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::time::Timespec;

/// Between two looks whether it is enough.
const LOOK_NS: i64 = 50_000_000;
/// Who writes into the pipe is often told to end at the same moment, and hands over the rest.
const GRACE: Duration = Duration::from_millis(500);

/// Opens a named pipe without waiting for somebody to write into it: that wait has no end.
pub(super) fn open_pipe(path: &Path) -> io::Result<File> {
    let without_waiting = rustix::fs::OFlags::NONBLOCK.bits() as i32;
    OpenOptions::new().read(true).custom_flags(without_waiting).open(path)
}

/// Standard input, unbuffered.
pub(super) fn standard_input() -> io::Result<File> {
    Ok(File::from(io::stdin().as_fd().try_clone_to_owned()?))
}

/// Reads from a pipe until its end, or until it is enough.
pub(super) struct PipeReader {
    file: File,
    enough: Box<dyn Fn() -> bool + Send>,
    until: Option<Instant>,
}

impl PipeReader {
    pub(super) fn new(file: File, enough: impl Fn() -> bool + Send + 'static) -> Self {
        Self { file, enough: Box::new(enough), until: None }
    }

    /// Whether to end here.
    fn is_over(&mut self) -> bool {
        if !(self.enough)() {
            return false;
        }
        Instant::now() >= *self.until.get_or_insert_with(|| Instant::now() + GRACE)
    }
}

impl Read for PipeReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let look = Timespec { tv_sec: 0, tv_nsec: LOOK_NS };
        loop {
            if self.is_over() {
                return Ok(0);
            }
            match poll(&mut [PollFd::new(&self.file, PollFlags::IN)], Some(&look)) {
                Ok(0) | Err(Errno::INTR) => continue,
                Ok(_) => {}
                Err(error) => return Err(error.into()),
            }
            match self.file.read(buffer) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                result => return result,
            }
        }
    }
}
