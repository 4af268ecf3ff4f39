//! What the diagnosis sees of a running line, without holding up the cycle.
//!
//! Frames are kept in a log that was laid out beforehand, which has room for one more at any time: a
//! frame that is sent is written there in the first place, one that was received is copied. A full or
//! old log is handed over as a whole to the thread that judges, and an empty one taken in return. When that thread does not keep
//! up, frames are left out and counted: the cycle never waits.

use std::sync::mpsc::{self, Receiver, SyncSender, TrySendError};

use linesman_diagnosis::{Direction, FrameSeen, HostObservation};
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};

/// Bytes of frames in one log.
const ROOM: usize = 256 * 1024;
/// Room for one frame, in bytes: the longest has 1,514, and what is longer than any may be has its
/// end cut off.
const FRAME_ROOM: usize = 1_536;
/// Frames in one log.
const FRAMES: usize = 2_048;
/// Logs on their way: so far may the judging thread fall behind.
const LOGS: usize = 8;
/// A log that is older than this is handed over although it is not full.
const OLD: Span = Span::ms(50);

/// After no empty log was there, none is asked for this long.
const PAUSE: Span = Span::ms(5);

/// One frame of a log.
#[derive(Clone, Copy)]
struct Record {
    time: Instant,
    number: u64,
    end: usize,
    path: Option<Path>,
    direction: Direction,
    truncated: bool,
}

impl Record {
    const NONE: Self = Self {
        time: Instant::ZERO,
        number: 0,
        end: 0,
        path: None,
        direction: Direction::Unknown,
        truncated: false,
    };
}

/// Frames and what the host noticed, in order of time.
pub struct Log {
    /// The frames one behind the other, and how many bytes they take.
    bytes: Box<[u8]>,
    len: usize,
    records: Box<[Record]>,
    count: usize,
    /// There is no room for another frame.
    full: bool,
    host: Vec<HostObservation>,
}

impl Log {
    fn new(bytes: usize, frames: usize) -> Self {
        Self {
            bytes: vec![0; bytes].into(),
            len: 0,
            records: vec![Record::NONE; frames].into(),
            count: 0,
            full: false,
            host: Vec::new(),
        }
    }

    fn clear(&mut self) {
        (self.len, self.count, self.full) = (0, 0, false);
        self.host.clear();
    }

    /// Room for the next frame; `None`: the log is full.
    #[inline]
    fn room(&mut self) -> Option<&mut [u8; FRAME_ROOM]> {
        if self.full {
            return None;
        }
        self.bytes.get_mut(self.len..)?.first_chunk_mut()
    }

    /// The frame in [`Log::room`] is there.
    #[inline]
    fn keep(&mut self, passed: &Passed, len: usize) {
        self.len += len;
        if let Some(record) = self.records.get_mut(self.count) {
            *record = Record {
                time: passed.time,
                number: passed.number,
                end: self.len,
                path: passed.path,
                direction: passed.direction,
                truncated: passed.truncated,
            };
            self.count += 1;
        }
        self.full = self.count >= self.records.len() || self.len + FRAME_ROOM > self.bytes.len();
    }

    /// The frames, oldest first.
    pub fn frames(&self) -> impl Iterator<Item = FrameSeen<'_>> {
        let mut begin = 0;
        self.records[..self.count].iter().map(move |record| {
            let bytes = &self.bytes[begin..record.end];
            begin = record.end;
            FrameSeen {
                network: Network::default(),
                path: record.path,
                direction: record.direction,
                time: record.time,
                number: record.number,
                fcs: None,
                truncated: record.truncated,
                bytes,
            }
        })
    }

    /// What the host noticed meanwhile.
    #[must_use]
    pub fn host(&self) -> &[HostObservation] {
        &self.host
    }
}

/// What is known of a frame that passed, without its bytes.
#[derive(Clone, Copy, Debug)]
pub struct Passed {
    /// When, as [`FrameSeen::time`].
    pub time: Instant,
    /// Its number, as [`FrameSeen::number`].
    pub number: u64,
    /// The card.
    pub path: Option<Path>,
    /// Which way it went.
    pub direction: Direction,
    /// Its end is missing.
    pub truncated: bool,
}

/// The end in the cycle.
pub struct Tap {
    log: Log,
    /// When the log is handed over although it is not full.
    due: Instant,
    full: SyncSender<Log>,
    empty: Receiver<Log>,
    /// There was no empty log; none is asked for before.
    full_until: Instant,
    /// Frames that were left out.
    left_out: u64,
    /// Where they go.
    nowhere: Box<[u8; FRAME_ROOM]>,
    /// Wait for the other side rather than leave anything out.
    waits: bool,
}

/// The end of the thread that judges.
pub struct Listener {
    full: Receiver<Log>,
    empty: SyncSender<Log>,
}

/// Both ends. In virtual time a tap may wait; on a real line it must not.
#[must_use]
pub fn tap(waits: bool) -> (Tap, Listener) {
    // One more than there are: the last one is handed over without another to go on with.
    let (full, from_cycle) = mpsc::sync_channel(LOGS + 1);
    let (to_cycle, empty) = mpsc::sync_channel(LOGS + 1);
    for _ in 0..LOGS {
        // There is room for all of them.
        let _ = to_cycle.try_send(Log::new(ROOM, FRAMES));
    }
    let tap = Tap {
        log: Log::new(ROOM, FRAMES),
        due: Instant::MAX,
        full_until: Instant::ZERO,
        full,
        empty,
        left_out: 0,
        nowhere: Box::new([0; FRAME_ROOM]),
        waits,
    };
    (tap, Listener { full: from_cycle, empty: to_cycle })
}

impl Tap {
    /// A frame left a card or came back.
    #[inline]
    pub fn frame(&mut self, frame: &FrameSeen<'_>) {
        let len = frame.bytes.len().min(FRAME_ROOM);
        self.room(frame.time)[..len].copy_from_slice(&frame.bytes[..len]);
        let FrameSeen { time, number, path, direction, .. } = *frame;
        let truncated = frame.truncated || len < frame.bytes.len();
        self.keep(&Passed { time, number, path, direction, truncated }, len);
    }

    /// Room for a frame that passes about `now`. [`Tap::keep`] says that it did, else it is as if
    /// nothing had been written.
    #[inline]
    pub fn room(&mut self, now: Instant) -> &mut [u8; FRAME_ROOM] {
        if self.log.full {
            self.next_log(now);
        }
        self.log.room().unwrap_or(&mut self.nowhere)
    }

    /// The frame that was written into [`Tap::room`] has passed; it has so many bytes.
    #[inline]
    pub fn keep(&mut self, passed: &Passed, len: usize) {
        if self.log.count == 0 {
            self.due = passed.time + OLD;
        }
        match self.log.full {
            false => self.log.keep(passed, len),
            true => self.left_out += 1,
        }
    }

    /// The log is full: the next one takes the frame, if there is one.
    #[cold]
    fn next_log(&mut self, now: Instant) {
        // Asking again and again costs more than the frames are worth.
        if now >= self.full_until && !self.hand_over() {
            self.full_until = now + PAUSE;
        }
    }

    /// The host noticed something.
    pub fn host(&mut self, observation: &HostObservation) {
        self.log.host.push(*observation);
    }

    /// Hands over what is old.
    #[inline]
    pub fn turn(&mut self, now: Instant) {
        if now >= self.due && !self.hand_over() {
            // Nobody takes it now: there is room left, and asking costs something.
            self.due = now + OLD;
        }
    }

    /// Frames that were left out because the other side does not keep up.
    #[must_use]
    pub const fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Hands the log over; says whether there is an empty one now.
    fn hand_over(&mut self) -> bool {
        let next = match self.waits {
            true => self.empty.recv().ok(),
            false => self.empty.try_recv().ok(),
        };
        let Some(mut next) = next else { return false };
        next.clear();
        let log = std::mem::replace(&mut self.log, next);
        self.due = Instant::MAX;
        match self.full.try_send(log) {
            Ok(()) => true,
            // As many logs as there is room for: it cannot be full.
            Err(TrySendError::Full(log) | TrySendError::Disconnected(log)) => {
                self.log = log;
                self.log.clear();
                true
            }
        }
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        // Nobody may listen any more.
        let _ = self.full.try_send(std::mem::replace(&mut self.log, Log::new(0, 0)));
    }
}

impl Listener {
    /// The next log; `None` when the run has ended. `done` is given back.
    pub fn next(&self, done: Option<Log>) -> Option<Log> {
        if let Some(done) = done {
            // The run may have ended.
            let _ = self.empty.try_send(done);
        }
        self.full.recv().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(number: u64, bytes: &[u8]) -> FrameSeen<'_> {
        FrameSeen {
            network: Network::default(),
            path: Some(Path::A),
            direction: Direction::Sent,
            time: Instant::from_nanos(number * 1_000),
            number,
            fcs: None,
            truncated: false,
            bytes,
        }
    }

    #[test]
    fn all_frames_arrive_in_order_and_nothing_waits() {
        let (mut tap, listener) = tap(false);
        let bytes: Vec<u8> = (0..=255).cycle().take(1_514).collect();
        let sent = 40_000_u64;
        for number in 0..sent {
            tap.frame(&frame(number, &bytes[..60 + (number as usize % 1_400)]));
        }
        let left_out = tap.left_out();
        drop(tap);
        let (mut seen, mut last, mut done) = (0, None, None);
        while let Some(log) = listener.next(done.take()) {
            for frame in log.frames() {
                assert!(last < Some(frame.number));
                assert_eq!(frame.bytes, &bytes[..60 + (frame.number as usize % 1_400)]);
                last = Some(frame.number);
                seen += 1;
            }
            done = Some(log);
        }
        assert!(left_out > 0, "nobody listened");
        assert_eq!(seen + left_out, sent);
    }
}
