//! Tap of the diagnosis on a running line, which does not hold up the cycle.
//!
//! Frames are kept in a log that was laid out beforehand, which has room for one more at any time: a
//! frame that is sent is built there, one that comes back is received there, and neither is copied. A
//! full or old log is handed over as a whole to the thread that judges, and an empty one taken in
//! return. When that thread does not keep up, frames are left out and counted: the cycle never waits.

use std::sync::atomic::{Ordering, fence};
use std::sync::mpsc::{self, Receiver, SyncSender, TryRecvError, TrySendError};
use std::sync::{Arc, OnceLock};
use std::thread::{self, Thread};

use linesman_diagnosis::{Direction, FrameSeen, HostObservation};
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_session::frame::{FRAME_ROOM, FrameSummary};

/// Bytes of a log.
const ROOM: usize = 256 * 1024;
/// What is noted of a frame lies before it: its time, its number, and a word of all else.
const HEAD: usize = 24;
/// What a frame takes at most.
const ENTRY: usize = HEAD + FRAME_ROOM;
/// A log with more bytes than this is full: one of the longest has no room any more.
const FULL: usize = ROOM - ENTRY;
/// Logs on their way: so far may the judging thread fall behind.
const LOGS: usize = 8;
/// A log that is older than this is handed over although it is not full.
const OLD: Span = Span::ms(50);

/// After no empty log was there, none is asked for this long.
const PAUSE: Span = Span::ms(5);

/// Frames and what the host noticed, in order of time.
pub struct TapLog {
    /// The entries one behind the other, and how many bytes they take.
    bytes: Box<[u8; ROOM]>,
    len: usize,
    host: Vec<HostObservation>,
    /// Frames that passed behind these and were left out.
    missed: u64,
}

impl TapLog {
    fn new() -> Self {
        // Not on the stack.
        let bytes = vec![0; ROOM].into_boxed_slice().try_into();
        Self {
            bytes: bytes.unwrap_or_else(|_| Box::new([0; ROOM])),
            len: 0,
            host: Vec::new(),
            missed: 0,
        }
    }

    fn clear(&mut self) {
        self.len = 0;
        self.host.clear();
        self.missed = 0;
    }

    /// Whether there is no room for another entry.
    #[inline]
    const fn is_full(&self) -> bool {
        self.len > FULL
    }

    /// Where the next frame goes.
    #[inline]
    fn room(&mut self) -> Option<&mut [u8; FRAME_ROOM]> {
        self.bytes.get_mut(self.len + HEAD..)?.first_chunk_mut()
    }

    /// The frame there, so many bytes, is one more entry.
    #[inline]
    fn keep(&mut self, passed: &FrameSummary, len: usize) {
        let Some(head) = self.bytes.get_mut(self.len..).and_then(<[u8]>::first_chunk_mut) else {
            return;
        };
        write_head(passed, len, head);
        self.len += HEAD + len;
    }

    /// The frames, oldest first.
    pub fn frames(&self) -> impl Iterator<Item = FrameSeen<'_>> {
        let mut rest = &self.bytes[..self.len];
        std::iter::from_fn(move || {
            let (head, behind) = rest.split_first_chunk()?;
            let (passed, len) = read_head(head);
            rest = behind.get(len..)?;
            Some(passed.seen(behind.get(..len)?))
        })
    }

    /// Frames that passed behind these and were left out, because the other side did not keep up.
    #[must_use]
    pub const fn missed(&self) -> u64 {
        self.missed
    }

    /// What the host noticed meanwhile.
    #[must_use]
    pub fn host(&self) -> &[HostObservation] {
        &self.host
    }
}

/// The word of an entry: the frame's length in its lower half, above it these.
const SENT: u64 = 1 << 32;
const RECEIVED: u64 = 1 << 33;
const BY_A: u64 = 1 << 34;
const BY_B: u64 = 1 << 35;
const TRUNCATED: u64 = 1 << 36;

/// Notes a frame before its bytes, which are so many.
#[inline]
fn write_head(passed: &FrameSummary, len: usize, head: &mut [u8; HEAD]) {
    let direction = match passed.direction {
        Direction::Sent => SENT,
        Direction::Received => RECEIVED,
        Direction::Unknown => 0,
    };
    let path = match passed.path {
        Some(Path::A) => BY_A,
        Some(Path::B) => BY_B,
        None => 0,
    };
    let truncated = if passed.truncated { TRUNCATED } else { 0 };
    let words = [passed.time.as_nanos(), passed.number, len as u64 | direction | path | truncated];
    for (to, word) in head.as_chunks_mut().0.iter_mut().zip(words) {
        *to = word.to_le_bytes();
    }
}

/// What [`write_head`] has noted, and the length of the frame.
fn read_head(head: &[u8; HEAD]) -> (FrameSummary, usize) {
    let mut words = head.as_chunks().0.iter().map(|word| u64::from_le_bytes(*word));
    let mut word = || words.next().unwrap_or(0);
    let (time, number, rest) = (word(), word(), word());
    let is = |bit: u64| rest & bit != 0;
    let path = [(BY_A, Path::A), (BY_B, Path::B)].into_iter().find(|(bit, _)| is(*bit));
    let direction = match (is(SENT), is(RECEIVED)) {
        (true, _) => Direction::Sent,
        (false, true) => Direction::Received,
        (false, false) => Direction::Unknown,
    };
    let passed = FrameSummary {
        time: Instant::from_nanos(time),
        number,
        path: path.map(|(_, path)| path),
        direction,
        truncated: is(TRUNCATED),
    };
    (passed, (rest & 0xFFFF_FFFF) as usize)
}

/// The end in the cycle.
pub struct Tap {
    log: TapLog,
    /// When the log is handed over although it is not full, if there is anything in it.
    due: Instant,
    full: SyncSender<TapLog>,
    empty: Receiver<TapLog>,
    /// There was no empty log; none is asked for before.
    full_until: Instant,
    /// Frames that were left out.
    left_out: u64,
    /// Where they go.
    nowhere: Box<[u8; FRAME_ROOM]>,
    /// Wait for the other side rather than leave anything out.
    waits: bool,
    /// Behind `full`, so that it rings once more when that is gone.
    waker: ThreadWaker,
}

/// Wakes the thread that judges when there is a log for it. A channel would do that, too, but under a
/// lock, for which the cycle would have to wait.
struct ThreadWaker(Arc<OnceLock<Thread>>);

impl ThreadWaker {
    fn wake(&self) {
        // Either it finds what was sent before this, or its name is found behind it.
        fence(Ordering::SeqCst);
        if let Some(thread) = self.0.get() {
            thread.unpark();
        }
    }
}

impl Drop for ThreadWaker {
    fn drop(&mut self) {
        self.wake();
    }
}

/// The end of the thread that judges. Two threads cannot ask at once (it cannot be shared), and it must not be
/// handed on once it was asked: see [`Listener::next`].
pub struct Listener {
    full: Receiver<TapLog>,
    empty: SyncSender<TapLog>,
    /// Its thread, from when it first asks.
    thread: Arc<OnceLock<Thread>>,
}

/// Both ends. In virtual time a tap may wait; on a real line it must not.
#[must_use]
pub fn tap(waits: bool) -> (Tap, Listener) {
    // One more than there are: the last one is handed over without another to go on with.
    let (full, from_cycle) = mpsc::sync_channel(LOGS + 1);
    let (to_cycle, empty) = mpsc::sync_channel(LOGS + 1);
    for _ in 0..LOGS {
        // There is room for all of them.
        let _ = to_cycle.try_send(TapLog::new());
    }
    let thread = Arc::default();
    let tap = Tap {
        log: TapLog::new(),
        due: Instant::ZERO,
        full_until: Instant::ZERO,
        full,
        empty,
        left_out: 0,
        nowhere: Box::new([0; FRAME_ROOM]),
        waits,
        waker: ThreadWaker(Arc::clone(&thread)),
    };
    (tap, Listener { full: from_cycle, empty: to_cycle, thread })
}

impl Tap {
    /// A frame left a card or came back: it is copied.
    #[inline]
    pub fn frame(&mut self, frame: &FrameSeen<'_>) {
        let len = frame.bytes.len().min(FRAME_ROOM);
        self.room(frame.time)[..len].copy_from_slice(&frame.bytes[..len]);
        let FrameSeen { time, number, path, direction, .. } = *frame;
        let truncated = frame.truncated || len < frame.bytes.len();
        self.keep(&FrameSummary { time, number, path, direction, truncated }, len);
    }

    /// Room for a frame that passes about `now`. [`Tap::keep`] says that it did, else it is as if
    /// nothing had been written.
    #[inline]
    pub fn room(&mut self, now: Instant) -> &mut [u8; FRAME_ROOM] {
        if self.log.is_full() {
            return self.other_room(now);
        }
        self.log.room().unwrap_or(&mut self.nowhere)
    }

    /// The frame that was written into [`Tap::room`] has passed; it has so many bytes.
    #[inline]
    pub fn keep(&mut self, passed: &FrameSummary, len: usize) {
        if self.log.is_full() {
            return self.leave_out();
        }
        self.log.keep(passed, len.min(FRAME_ROOM));
    }

    #[cold]
    fn leave_out(&mut self) {
        self.left_out += 1;
        self.log.missed += 1;
    }

    /// The log is full: the next one takes the frame, if there is one.
    #[cold]
    fn other_room(&mut self, now: Instant) -> &mut [u8; FRAME_ROOM] {
        // Asking again and again costs more than the frames are worth.
        if now >= self.full_until && !self.hand_over() {
            self.full_until = now + PAUSE;
        }
        self.log.room().unwrap_or(&mut self.nowhere)
    }

    /// The host noticed something.
    pub fn host(&mut self, observation: &HostObservation) {
        self.log.host.push(*observation);
    }

    /// Hands over what is old.
    #[inline]
    pub fn turn(&mut self, now: Instant) {
        if now >= self.due {
            self.hand_over_old(now);
        }
    }

    #[cold]
    fn hand_over_old(&mut self, now: Instant) {
        // Should nobody take it now, there is room left, and asking costs something.
        self.due = now + OLD;
        if self.log.len > 0 || !self.log.host.is_empty() {
            self.hand_over();
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
        match self.full.try_send(log) {
            Ok(()) => self.waker.wake(),
            // As many logs as there is room for: it cannot be full, so nobody judges any more.
            Err(TrySendError::Full(log) | TrySendError::Disconnected(log)) => {
                self.left_out += log.frames().count() as u64;
                self.log = log;
                self.log.clear();
            }
        }
        true
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        // Nobody may listen any more.
        let _ = self.full.try_send(std::mem::replace(&mut self.log, TapLog::new()));
    }
}

impl Listener {
    /// The next log; `None` when the run has ended. `done` is given back.
    ///
    /// It must always be the same thread that asks: the first one is noted as the one to be woken, and another
    /// would sleep for ever.
    pub fn next(&self, done: Option<TapLog>) -> Option<TapLog> {
        if let Some(done) = done {
            // The run may have ended.
            let _ = self.empty.try_send(done);
        }
        match self.thread.get() {
            Some(noted) => debug_assert_eq!(noted.id(), thread::current().id(), "nobody else asks"),
            None => {
                let _ = self.thread.set(thread::current());
                fence(Ordering::SeqCst);
            }
        }
        loop {
            match self.full.try_recv() {
                Ok(log) => return Some(log),
                Err(TryRecvError::Disconnected) => return None,
                Err(TryRecvError::Empty) => thread::park(),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::address::Network;

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
            probe: None,
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
        let (mut seen, mut missed, mut last, mut done) = (0, 0, None, None);
        while let Some(log) = listener.next(done.take()) {
            missed += log.missed();
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
        assert_eq!(missed, left_out, "who judges is told of each");
    }

    #[test]
    fn who_judges_is_woken_for_each_log_and_at_the_end() {
        let (mut tap, listener) = tap(true);
        let judge = std::thread::spawn(move || {
            let (mut seen, mut done) = (0, None);
            while let Some(log) = listener.next(done.take()) {
                seen += log.frames().count() as u64;
                done = Some(log);
            }
            seen
        });
        // Every third frame finds the log old, so that it is handed over with hardly anything in it.
        let sent = 3_000;
        for number in 0..sent {
            let time = Instant::ZERO + Span::ms(20) * number;
            tap.frame(&FrameSeen { time, ..frame(number, &[0; 60]) });
            tap.turn(time);
        }
        assert_eq!(tap.left_out(), 0);
        drop(tap);
        assert_eq!(judge.join().unwrap(), sent);
    }

    #[test]
    fn frames_that_nobody_takes_any_more_are_counted() {
        let (mut tap, listener) = tap(true);
        drop(listener);
        for number in 0..2_000 {
            let time = Instant::ZERO + Span::ms(20) * number;
            tap.frame(&FrameSeen { time, ..frame(number, &[0; 1_000]) });
            tap.turn(time);
        }
        // The last log is not full yet.
        assert!(tap.left_out() > 1_000, "{}", tap.left_out());
    }
}
