//! A MainDevice on a line: the thread that sends, receives and waits.

use linesman_diagnosis::{Direction, FrameSeen, HostObservation};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_maindevice::{Event, MainDevice, Options, Transmit};
use linesman_proto::address::{Network, Path};
use linesman_proto::ethernet::MAX_LEN;
use linesman_proto::time::{Instant, Span};

use crate::line::{Cards, Line};
use crate::run::tap::Passed;
use crate::stop::Stop;

/// Most frames handed out in one go; a MainDevice has far fewer out at once.
const MOST_FRAMES: usize = 1024;
/// Longest sleep, so that a wish to stop is noticed.
const NAP: Span = Span::ms(50);

/// Who watches a MainDevice at work, and gives it its commands.
pub trait Audience {
    /// A frame left a card or came back.
    fn frame(&mut self, frame: &FrameSeen<'_>);
    /// Room for a frame of at most 1,514 bytes that may be sent at `now`, where the audience keeps
    /// frames: it is built there. After it was sent [`keep`](Self::keep) follows in place of
    /// [`frame`](Self::frame).
    fn room(&mut self, _now: Instant) -> Option<&mut [u8]> {
        None
    }
    /// The frame in [`room`](Self::room), so many bytes, has been sent.
    fn keep(&mut self, _sent: &Passed, _len: usize) {}
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
            buffer: vec![0; MAX_LEN],
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
            self.receive(audience)?;
            let now = self.line.now();
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
            self.send(audience)?;
            if !goes_on || stop.is_set() || now >= until {
                return Ok(());
            }
            let due = [self.main.poll_timeout(), audience.poll_timeout()];
            let due = due.into_iter().flatten().min().unwrap_or(Instant::MAX);
            self.line.wait(due.min(until).min(now + NAP))?;
        }
    }

    /// Takes in what has come back, and what the host noticed.
    fn receive(&mut self, audience: &mut impl Audience) -> Result<(), LinkError> {
        let Self { main, line, frames, .. } = self;
        // Frames are judged at the time at which they are taken in, not at that of their stamp.
        let now = line.now();
        line.receive(&mut |frame| {
            *frames += 1;
            let seen = seen(*frames, frame.path, Direction::Received, frame.at, frame.bytes);
            audience.frame(&FrameSeen { truncated: frame.truncated, ..seen });
            if !frame.truncated {
                main.handle_frame(frame.at.max(now), frame.path, frame.bytes);
            }
        })?;
        line.look_at_host(&mut |observation| audience.host(observation))
    }

    /// Sends what the MainDevice has to send.
    fn send(&mut self, audience: &mut impl Audience) -> Result<(), LinkError> {
        let Self { main, line, buffer, frames } = self;
        for _ in 0..MOST_FRAMES {
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
