//! A window over a stream of bytes: what a reader is looking at, in one piece.
//!
//! It copies only when a piece lies across the end of the buffer, and it grows only while the
//! stream really delivers, so that a length field that lies costs nothing. The readers of
//! `pcap-parser` have a window too, but it cannot be written to, forgets why a stream failed, and
//! their first read must bring the whole first block, which a pipe need not.

use std::io::{self, Read};

/// Size of the buffer to begin with, in bytes.
const INITIAL: usize = 256 * 1024;

/// A moving window over a stream.
pub(super) struct Window {
    source: Box<dyn Read + Send>,
    buffer: Vec<u8>,
    /// What is looked at: `buffer[start..end]`.
    start: usize,
    end: usize,
    /// Where in the stream `buffer[start]` stands.
    offset: u64,
    ended: bool,
    fault: Option<io::Error>,
}

impl Window {
    pub(super) fn new(source: Box<dyn Read + Send>) -> Self {
        let buffer = vec![0; INITIAL];
        Self { source, buffer, start: 0, end: 0, offset: 0, ended: false, fault: None }
    }

    /// Where in the stream the window begins.
    pub(super) fn offset(&self) -> u64 {
        self.offset
    }

    /// What the stream failed with, if it ended by a failure.
    pub(super) fn take_fault(&mut self) -> Option<io::Error> {
        self.fault.take()
    }

    /// What is in the window now.
    #[inline]
    pub(super) fn view(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    /// What is in the window now, to be put right in place.
    #[inline]
    pub(super) fn view_mut(&mut self) -> &mut [u8] {
        &mut self.buffer[self.start..self.end]
    }

    /// Widens the window to at least `len` bytes; `false` when the stream ends before.
    #[inline]
    pub(super) fn fill(&mut self, len: usize) -> bool {
        self.end - self.start >= len || self.read_more(len)
    }

    #[cold]
    fn read_more(&mut self, len: usize) -> bool {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        while self.end < len && !self.ended {
            if self.end == self.buffer.len() {
                self.buffer.resize(self.buffer.len() * 2, 0);
            }
            match self.source.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.ended = true,
                Ok(count) => self.end += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => {
                    self.ended = true;
                    self.fault = Some(error);
                }
            }
        }
        self.end >= len
    }

    /// Moves the window past its first `len` bytes and gives where in the buffer they are. They
    /// stay there until the next [`fill`](Self::fill) or [`skip`](Self::skip).
    ///
    /// # Panics
    /// When the window is shorter: callers `fill` first.
    #[inline]
    pub(super) fn pass(&mut self, len: usize) -> usize {
        assert!(len <= self.end - self.start, "a window is passed only as far as it was filled");
        let at = self.start;
        self.start += len;
        self.offset += len as u64;
        at
    }

    /// Bytes of the buffer that [`pass`](Self::pass) told the place of.
    #[inline]
    pub(super) fn passed(&mut self, at: usize, len: usize) -> &mut [u8] {
        &mut self.buffer[at..at + len]
    }

    /// The same bytes, to be looked at.
    #[inline]
    pub(super) fn kept(&self, at: usize, len: usize) -> &[u8] {
        &self.buffer[at..at + len]
    }

    /// Moves the window past `len` bytes without keeping them; gives how many there were.
    pub(super) fn skip(&mut self, len: u64) -> u64 {
        let mut left = len;
        while left > 0 {
            if self.start == self.end && !self.fill(1) {
                break;
            }
            let step = left.min((self.end - self.start) as u64);
            self.pass(step as usize);
            left -= step;
        }
        len - left
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives one byte at a time, then fails.
    struct Dribble(u8);

    impl Read for Dribble {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            if self.0 == 10 {
                return Err(io::Error::other("the disk is gone"));
            }
            buffer[0] = self.0;
            self.0 += 1;
            Ok(1)
        }
    }

    #[test]
    fn pieces_come_whole_from_a_dribbling_source() {
        let mut window = Window::new(Box::new(Dribble(0)));
        assert!(window.fill(4));
        let at = window.pass(3);
        assert_eq!(window.passed(at, 3), [0, 1, 2]);
        assert!(window.fill(2));
        assert_eq!(window.view(), [3, 4]);
        assert_eq!(window.offset(), 3);
        assert!(!window.fill(100), "the source fails before");
        assert_eq!(window.view().len(), 7);
        assert_eq!(window.take_fault().map(|fault| fault.to_string()).unwrap(), "the disk is gone");
    }

    #[test]
    fn a_lying_length_costs_no_memory() {
        let mut window = Window::new(Box::new(io::repeat(7).take(1000)));
        assert!(!window.fill(usize::MAX));
        assert_eq!(window.buffer.len(), INITIAL);
    }

    #[test]
    fn a_long_piece_makes_the_buffer_grow() {
        let mut window = Window::new(Box::new(io::repeat(7).take(3_000_000)));
        assert!(window.fill(1_000_000));
        assert!(window.buffer.len() < 3_000_000);
        assert_eq!(window.skip(5_000_000), 3_000_000);
        assert_eq!(window.offset(), 3_000_000);
    }
}
