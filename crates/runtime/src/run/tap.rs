//! What the diagnosis sees of a running line, without holding up the cycle.
//!
//! Frames are copied into a log that was laid out beforehand; a full or old log is handed over as a
//! whole to the thread that judges, and an empty one taken in return. When that thread does not keep
//! up, frames are left out and counted: the cycle never waits.

use std::sync::mpsc::{self, Receiver, SyncSender, TrySendError};

use linesman_diagnosis::{Direction, FrameSeen, HostObservation};
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};

/// Bytes of frames in one log.
const ROOM: usize = 256 * 1024;
/// Frames in one log.
const FRAMES: usize = 2_048;
/// Logs on their way: so far may the judging thread fall behind.
const LOGS: usize = 8;
/// A log that is older than this is handed over although it is not full.
const OLD: Span = Span::ms(20);

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

/// Frames and what the host noticed, in order of time.
pub struct Log {
    bytes: Vec<u8>,
    records: Vec<Record>,
    host: Vec<HostObservation>,
}

impl Log {
    fn new() -> Self {
        Self {
            bytes: Vec::with_capacity(ROOM),
            records: Vec::with_capacity(FRAMES),
            host: Vec::new(),
        }
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.records.clear();
        self.host.clear();
    }

    /// The frames, oldest first.
    pub fn frames(&self) -> impl Iterator<Item = FrameSeen<'_>> {
        let mut begin = 0;
        self.records.iter().map(move |record| {
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

/// The end in the cycle.
pub struct Tap {
    log: Log,
    began: Option<Instant>,
    full: SyncSender<Log>,
    empty: Receiver<Log>,
    /// Frames that were left out.
    left_out: u64,
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
        let _ = to_cycle.try_send(Log::new());
    }
    let tap = Tap { log: Log::new(), began: None, full, empty, left_out: 0, waits };
    (tap, Listener { full: from_cycle, empty: to_cycle })
}

impl Tap {
    /// A frame left a card or came back.
    #[inline]
    pub fn frame(&mut self, frame: &FrameSeen<'_>) {
        let log = &mut self.log;
        let fits = log.bytes.len() + frame.bytes.len() <= ROOM && log.records.len() < FRAMES;
        if !fits && !self.hand_over() {
            self.left_out += 1;
            return;
        }
        let log = &mut self.log;
        log.bytes.extend_from_slice(frame.bytes);
        log.records.push(Record {
            time: frame.time,
            number: frame.number,
            end: log.bytes.len(),
            path: frame.path,
            direction: frame.direction,
            truncated: frame.truncated,
        });
        if self.began.is_none() {
            self.began = Some(frame.time);
        }
    }

    /// The host noticed something.
    pub fn host(&mut self, observation: &HostObservation) {
        self.log.host.push(*observation);
    }

    /// Hands over what is old.
    #[inline]
    pub fn turn(&mut self, now: Instant) {
        if self.began.is_some_and(|began| now.since(began) >= OLD) && !self.hand_over() {
            // Nobody takes it now: there is room left, and asking costs something.
            self.began = Some(now);
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
        self.began = None;
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
        let _ = self.full.try_send(std::mem::replace(
            &mut self.log,
            Log { bytes: Vec::new(), records: Vec::new(), host: Vec::new() },
        ));
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
