//! A MainDevice on a line: the thread that sends, receives and waits.

use linesman_diagnosis::{Direction, FrameSeen, HostObservation};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_maindevice::{Event, MainDevice, Options, Transmit};
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};

use crate::run::tap::{FRAME_ROOM, FrameSummary};
use crate::stop::Stop;
use crate::transport::{Cards, FrameSink, RxFrame, Transport};

/// Most frames handed out in one go; a MainDevice has far fewer out at once.
const MOST_FRAMES: usize = 1024;
/// Longest sleep, so that a wish to stop is noticed.
const MAX_SLEEP: Span = Span::ms(50);

/// Hooks of a driver: they see a MainDevice at work, and give it its commands.
pub trait DriverHooks {
    /// A frame left a card or came back.
    fn frame(&mut self, frame: &FrameSeen<'_>);
    /// Room for the longest frame that may be sent, or come back, at `now`, where the hooks keep
    /// frames: it is built, or received, there. When it was, [`keep`](Self::keep) follows in place
    /// of [`frame`](Self::frame).
    fn room(&mut self, _now: Instant) -> Option<&mut [u8]> {
        None
    }
    /// The frame in [`room`](Self::room), so many bytes, has been sent or has come back.
    fn keep(&mut self, _passed: &FrameSummary, _len: usize) {}
    /// The host noticed something.
    fn host(&mut self, observation: &HostObservation);
    /// The MainDevice tells something.
    fn event(&mut self, now: Instant, event: Event, main: &mut MainDevice);
    /// Everything up to `now` is done: time for commands. Says whether to go on.
    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool;
    /// Whether the last [`turn`](Self::turn) waits for somebody outside of the driver. Nothing is sent until it is
    /// taken again.
    fn is_paused(&self) -> bool {
        false
    }
    /// When [`turn`](Self::turn) has something to do.
    fn poll_timeout(&self) -> Option<Instant>;
    /// The thread came so late for the begin of a cycle.
    fn late(&mut self, _late: Span) {}
}

/// A MainDevice and its line.
pub struct Driver<L = Cards> {
    main: MainDevice,
    line: L,
    buffer: Vec<u8>,
    frames: u64,
}

impl Driver<Cards> {
    /// Opens the cards; nothing is sent until the hooks give a command.
    ///
    /// # Errors
    /// When an interface cannot be used.
    pub fn open(names: &[String], clock: HostClock) -> Result<Self, LinkError> {
        let options = Options { ring: names.len() > 1, ..Options::default() };
        Ok(Self::new(Cards::open(names, clock)?, options))
    }

    /// The clock of the run.
    #[must_use]
    pub const fn clock(&self) -> &HostClock {
        self.line.clock()
    }
}

impl<L: Transport> Driver<L> {
    /// A MainDevice with these options on a line.
    pub fn new(line: L, options: Options) -> Self {
        Self {
            main: MainDevice::new(Network::default(), options),
            line,
            buffer: vec![0; FRAME_ROOM],
            frames: 0,
        }
    }

    /// The line.
    pub fn line_mut(&mut self) -> &mut L {
        &mut self.line
    }

    /// The MainDevice.
    pub fn main_mut(&mut self) -> &mut MainDevice {
        &mut self.main
    }

    /// Now, by the clock of the line.
    pub fn now(&self) -> Instant {
        self.line.now()
    }

    /// Drives the line until `until`, `stop`, or the hooks have enough or pause; after a pause it goes on where it was.
    ///
    /// # Errors
    /// When an interface vanished, was switched off, or the kernel refuses something else.
    pub fn run(
        &mut self,
        until: Instant,
        stop: &Stop,
        hooks: &mut impl DriverHooks,
    ) -> Result<(), LinkError> {
        loop {
            let now = self.line.now();
            self.receive(now, hooks)?;
            if let Some(due) = self.main.poll_cycle_timeout()
                && due <= now
                && !hooks.is_paused()
            {
                let late = now.since(due);
                self.line.note_late(late);
                hooks.late(late);
            }
            self.main.handle_timeout(now);
            while let Some(event) = self.main.poll_event() {
                hooks.event(now, event, &mut self.main);
            }
            let goes_on = hooks.turn(now, &mut self.main);
            if hooks.is_paused() {
                return Ok(());
            }
            self.send(now, hooks)?;
            if !goes_on || stop.is_set() || now >= until {
                return Ok(());
            }
            let due = [self.main.poll_timeout(), hooks.poll_timeout()];
            let due = due.into_iter().flatten().min().unwrap_or(Instant::MAX);
            self.line.wait(due.min(until).min(now + MAX_SLEEP))?;
        }
    }

    /// Takes in what has come back, and what the host noticed.
    fn receive(&mut self, now: Instant, hooks: &mut impl DriverHooks) -> Result<(), LinkError> {
        let Self { main, line, buffer, frames } = self;
        // Frames are judged at the time at which they are taken in, not at that of their stamp.
        let taking = &mut HookSink { hooks: &mut *hooks, main, buffer, frames, now };
        line.receive(now, taking)?;
        line.look_at_host(now, &mut |observation| hooks.host(observation))
    }

    /// Sends what the MainDevice has to send at `now`, which is a little ago.
    fn send(&mut self, now: Instant, hooks: &mut impl DriverHooks) -> Result<(), LinkError> {
        let Self { main, line, buffer, frames } = self;
        for _ in 0..MOST_FRAMES {
            if !main.may_transmit(now) {
                break;
            }
            let now = line.now();
            if let Some(room) = hooks.room(now) {
                let Some(Transmit { path, len, .. }) = main.poll_transmit(now, room) else { break };
                line.send(path, room.get(..len).unwrap_or_default())?;
                *frames += 1;
                let (path, direction) = (Some(path), Direction::Sent);
                let sent =
                    FrameSummary { time: now, number: *frames, path, direction, truncated: false };
                hooks.keep(&sent, len);
            } else {
                let Some(Transmit { path, len, .. }) = main.poll_transmit(now, buffer) else {
                    break;
                };
                let bytes = &buffer[..len];
                line.send(path, bytes)?;
                *frames += 1;
                hooks.frame(&seen(*frames, path, Direction::Sent, now, bytes));
            }
        }
        Ok(())
    }
}

/// Takes in frames: the MainDevice judges them, the hooks keep them.
struct HookSink<'a, A> {
    hooks: &'a mut A,
    main: &'a mut MainDevice,
    /// Where frames are received that the hooks do not keep.
    buffer: &'a mut [u8],
    frames: &'a mut u64,
    now: Instant,
}

impl<A: DriverHooks> FrameSink for HookSink<'_, A> {
    fn room(&mut self) -> &mut [u8] {
        match self.hooks.room(self.now) {
            Some(room) => room,
            None => self.buffer,
        }
    }

    fn frame_received(&mut self, frame_received: RxFrame) {
        let RxFrame { at, path, len, truncated } = frame_received;
        *self.frames += 1;
        let (number, direction) = (*self.frames, Direction::Received);
        let at_once = at.max(self.now);
        match self.hooks.room(self.now) {
            Some(room) => {
                if !truncated && let Some(bytes) = room.get(..len) {
                    self.main.handle_frame(at_once, path, bytes);
                }
                let passed =
                    FrameSummary { time: at, number, path: Some(path), direction, truncated };
                self.hooks.keep(&passed, len);
            }
            None => {
                let Some(bytes) = self.buffer.get(..len) else { return };
                let seen = seen(number, path, direction, at, bytes);
                self.hooks.frame(&FrameSeen { truncated, ..seen });
                if !truncated {
                    self.main.handle_frame(at_once, path, bytes);
                }
            }
        }
    }
}

fn seen(
    number: u64,
    path: Path,
    direction: Direction,
    time: Instant,
    bytes: &[u8],
) -> FrameSeen<'_> {
    let network = Network::default();
    FrameSeen {
        network,
        path: Some(path),
        direction,
        time,
        number,
        fcs: None,
        truncated: false,
        bytes,
    }
}
