//! A MainDevice on real cards: the thread that sends, receives and waits.

use linesman_diagnosis::{Direction, FrameSeen, HostObservation};
use linesman_link::clock::{HostClock, tighten_timers};
use linesman_link::error::LinkError;
use linesman_link::socket::{Batch, RawSocket, Ready, SocketOptions, Waitable, wait_any};
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::{Network, Path};
use linesman_proto::ethernet::MAX_LEN;
use linesman_proto::time::{Instant, Span};

use crate::host_watch::HostWatch;
use crate::stop::Stop;

/// Frames fetched in one call.
const BATCH: usize = 64;
/// Most frames handed out in one go; a MainDevice has far fewer out at once.
const MOST_FRAMES: usize = 1024;
/// Longest sleep, so that a wish to stop is noticed.
const NAP: Span = Span::ms(50);

/// Who watches a MainDevice at work, and gives it its commands.
pub trait Audience {
    /// A frame left a card or came back.
    fn frame(&mut self, frame: &FrameSeen<'_>);
    /// The host noticed something.
    fn host(&mut self, observation: &HostObservation);
    /// The MainDevice tells something.
    fn event(&mut self, now: Instant, event: Event, main: &mut MainDevice);
    /// Everything up to `now` is done: time for commands. Says whether to go on.
    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool;
    /// When [`turn`](Self::turn) has something to do.
    fn poll_timeout(&self) -> Option<Instant>;
}

/// A MainDevice and its card, or its two cards at the ends of a ring.
pub struct Driver {
    clock: HostClock,
    main: MainDevice,
    cards: Vec<Card>,
    batch: Batch,
    buffer: Vec<u8>,
    frames: u64,
}

struct Card {
    socket: RawSocket,
    watch: HostWatch,
    path: Path,
}

impl Driver {
    /// Opens the cards; nothing is sent until the audience gives a command.
    ///
    /// # Errors
    /// When an interface cannot be used.
    pub fn open(names: &[String], clock: HostClock) -> Result<Self, LinkError> {
        let options = Options { ring: names.len() > 1, ..Options::default() };
        let open = |(path, name): (Path, &String)| {
            Ok(Card {
                socket: RawSocket::open(name, &SocketOptions::default())?,
                watch: HostWatch::open(name, path, &clock)?,
                path,
            })
        };
        let cards: Result<Vec<Card>, LinkError> =
            Path::ALL.into_iter().zip(names).map(open).collect();
        Ok(Self {
            clock,
            main: MainDevice::new(Network::default(), options),
            cards: cards?,
            batch: Batch::new(BATCH),
            buffer: vec![0; MAX_LEN],
            frames: 0,
        })
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
        tighten_timers();
        loop {
            self.receive(audience)?;
            let now = self.clock.now();
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
            self.wait(due.min(until).min(now + NAP))?;
        }
    }

    /// Takes in what has come back, and what the host noticed.
    fn receive(&mut self, audience: &mut impl Audience) -> Result<(), LinkError> {
        let Self { clock, main, cards, batch, frames, .. } = self;
        for card in cards {
            card.socket.recv_batch(batch, clock)?;
            for frame in batch.iter() {
                *frames += 1;
                let seen = seen(*frames, card.path, Direction::Received, frame.at, frame.bytes);
                audience.frame(&FrameSeen { truncated: frame.truncated, ..seen });
                if !frame.truncated {
                    main.handle_frame(clock.now(), card.path, frame.bytes);
                }
            }
            let counters = card.socket.counters()?;
            for observation in card.watch.poll(clock.now(), counters)? {
                audience.host(&observation);
            }
        }
        Ok(())
    }

    /// Sends what the MainDevice has to send.
    fn send(&mut self, audience: &mut impl Audience) -> Result<(), LinkError> {
        for _ in 0..MOST_FRAMES {
            let now = self.clock.now();
            let Some(transmit) = self.main.poll_transmit(now, &mut self.buffer) else { break };
            let bytes = &self.buffer[..transmit.len];
            let Some(card) = self.cards.get_mut(transmit.path.index()) else { continue };
            self.frames += 1;
            audience.frame(&seen(self.frames, transmit.path, Direction::Sent, now, bytes));
            // What a full queue refuses is lost; the MainDevice sends it again, the host watch tells.
            let _sent = card.socket.send_batch([bytes])?;
        }
        Ok(())
    }

    fn wait(&self, deadline: Instant) -> Result<Ready, LinkError> {
        match self.cards.as_slice() {
            [a, b, ..] => wait_any([&a.socket as &dyn Waitable, &b.socket], &self.clock, deadline),
            [a] => a.socket.wait(&self.clock, deadline),
            [] => Ok(Ready::Deadline),
        }
    }

    /// The clock of the run.
    #[must_use]
    pub const fn clock(&self) -> &HostClock {
        &self.clock
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
