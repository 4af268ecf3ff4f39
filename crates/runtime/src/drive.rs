//! A MainDevice on a line: the thread that sends, receives and waits.

use linesman_diagnosis::{Direction, FrameSeen, HostObservation};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_maindevice::{Event, MainDevice, Options, Transmit};
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};

use crate::line::{Arrived, Cards, Intake, Line};
use crate::run::tap::{FRAME_ROOM, Passed};
use crate::stop::Stop;

/// Most frames handed out in one go; a MainDevice has far fewer out at once.
const MOST_FRAMES: usize = 1024;
/// Longest sleep, so that a wish to stop is noticed.
const NAP: Span = Span::ms(50);

/// Who watches a MainDevice at work, and gives it its commands.
pub trait Audience {
    /// A frame left a card or came back.
    fn frame(&mut self, frame: &FrameSeen<'_>);
    /// Room for the longest frame that may be sent, or come back, at `now`, where the audience keeps
    /// frames: it is built, or received, there. When it was, [`keep`](Self::keep) follows in place
    /// of [`frame`](Self::frame).
    fn room(&mut self, _now: Instant) -> Option<&mut [u8]> {
        None
    }
    /// The frame in [`room`](Self::room), so many bytes, has been sent or has come back.
    fn keep(&mut self, _passed: &Passed, _len: usize) {}
    /// The host noticed something.
    fn host(&mut self, observation: &HostObservation);
    /// The MainDevice tells something.
    fn event(&mut self, now: Instant, event: Event, main: &mut MainDevice);
    /// Everything up to `now` is done: time for commands. Says whether to go on.
    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool;
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
    /// Opens the cards; nothing is sent until the audience gives a command.
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

impl<L: Line> Driver<L> {
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

    /// Drives the line until `until`, `stop`, or the audience has enough.
    ///
    /// # Errors
    /// When an interface vanished, was switched off, or the kernel refuses something else.
    pub fn run(
        &mut self,
        until: Instant,
        stop: &Stop,
        audience: &mut impl Audience,
    ) -> Result<(), LinkError> {
        loop {
            let now = self.line.now();
            self.receive(now, audience)?;
            if let Some(due) = self.main.poll_cycle_timeout()
                && due <= now
            {
                let late = now.since(due);
                self.line.note_late(late);
                audience.late(late);
            }
            self.main.handle_timeout(now);
            while let Some(event) = self.main.poll_event() {
                audience.event(now, event, &mut self.main);
            }
            let goes_on = audience.turn(now, &mut self.main);
            self.send(now, audience)?;
            if !goes_on || stop.is_set() || now >= until {
                return Ok(());
            }
            let due = [self.main.poll_timeout(), audience.poll_timeout()];
            let due = due.into_iter().flatten().min().unwrap_or(Instant::MAX);
            self.line.wait(due.min(until).min(now + NAP))?;
        }
    }

    /// Takes in what has come back, and what the host noticed.
    fn receive(&mut self, now: Instant, audience: &mut impl Audience) -> Result<(), LinkError> {
        let Self { main, line, buffer, frames } = self;
        // Frames are judged at the time at which they are taken in, not at that of their stamp.
        let taking = &mut Taking { audience: &mut *audience, main, buffer, frames, now };
        line.receive(now, taking)?;
        line.look_at_host(now, &mut |observation| audience.host(observation))
    }

    /// Sends what the MainDevice has to send at `now`, which is a little ago.
    fn send(&mut self, now: Instant, audience: &mut impl Audience) -> Result<(), LinkError> {
        let Self { main, line, buffer, frames } = self;
        for _ in 0..MOST_FRAMES {
            if !main.may_transmit(now) {
                break;
            }
            let now = line.now();
            if let Some(room) = audience.room(now) {
                let Some(Transmit { path, len, .. }) = main.poll_transmit(now, room) else { break };
                line.send(path, room.get(..len).unwrap_or_default())?;
                *frames += 1;
                let (path, direction) = (Some(path), Direction::Sent);
                let sent = Passed { time: now, number: *frames, path, direction, truncated: false };
                audience.keep(&sent, len);
            } else {
                let Some(Transmit { path, len, .. }) = main.poll_transmit(now, buffer) else {
                    break;
                };
                let bytes = &buffer[..len];
                line.send(path, bytes)?;
                *frames += 1;
                audience.frame(&seen(*frames, path, Direction::Sent, now, bytes));
            }
        }
        Ok(())
    }
}

/// Takes in frames: the MainDevice judges them, the audience keeps them.
struct Taking<'a, A> {
    audience: &'a mut A,
    main: &'a mut MainDevice,
    /// Where frames are received that the audience does not keep.
    buffer: &'a mut [u8],
    frames: &'a mut u64,
    now: Instant,
}

impl<A: Audience> Intake for Taking<'_, A> {
    fn room(&mut self) -> &mut [u8] {
        match self.audience.room(self.now) {
            Some(room) => room,
            None => self.buffer,
        }
    }

    fn arrived(&mut self, arrived: Arrived) {
        let Arrived { at, path, len, truncated } = arrived;
        *self.frames += 1;
        let (number, direction) = (*self.frames, Direction::Received);
        let at_once = at.max(self.now);
        match self.audience.room(self.now) {
            Some(room) => {
                if !truncated && let Some(bytes) = room.get(..len) {
                    self.main.handle_frame(at_once, path, bytes);
                }
                let passed = Passed { time: at, number, path: Some(path), direction, truncated };
                self.audience.keep(&passed, len);
            }
            None => {
                let Some(bytes) = self.buffer.get(..len) else { return };
                let seen = seen(number, path, direction, at, bytes);
                self.audience.frame(&FrameSeen { truncated, ..seen });
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
