//! A session on a line: the thread that sends, receives and waits.

use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_maindevice::{MainDevice, Options};
use linesman_proto::address::Network;
use linesman_proto::time::{Instant, Span};
use linesman_session::{Session, SessionHooks};

use crate::stop::Stop;
use crate::transport::{Cards, Transport};

/// Longest sleep, so that a wish to stop is noticed.
const MAX_SLEEP: Span = Span::ms(50);

/// A session and its line.
pub struct Driver<L, H> {
    session: Session<H>,
    line: L,
}

impl<H: SessionHooks> Driver<Cards, H> {
    /// Opens the cards; nothing is sent until the hooks give a command.
    ///
    /// # Errors
    /// When an interface cannot be used.
    pub fn open(names: &[String], clock: HostClock, hooks: H) -> Result<Self, LinkError> {
        let options = Options { ring: names.len() > 1, ..Options::default() };
        Ok(Self::new(Cards::open(names, clock)?, options, hooks))
    }

    /// The clock of the run.
    #[must_use]
    pub const fn clock(&self) -> &HostClock {
        self.line.clock()
    }
}

impl<L: Transport, H: SessionHooks> Driver<L, H> {
    /// A MainDevice with these options on a line.
    pub fn new(line: L, options: Options, hooks: H) -> Self {
        let main = MainDevice::new(Network::default(), options);
        Self { session: Session::new(main, hooks), line }
    }

    /// The line.
    pub const fn line_mut(&mut self) -> &mut L {
        &mut self.line
    }

    /// The session.
    pub const fn session(&self) -> &Session<H> {
        &self.session
    }

    /// The session.
    pub const fn session_mut(&mut self) -> &mut Session<H> {
        &mut self.session
    }

    /// The hooks, at the end.
    pub fn into_hooks(self) -> H {
        self.session.into_hooks()
    }

    /// Now, by the clock of the line.
    pub fn now(&self) -> Instant {
        self.line.now()
    }

    /// Drives the line until `until`, `stop`, or the hooks have enough or pause; after a pause it goes on where it was.
    ///
    /// # Errors
    /// When an interface vanished, was switched off, or the kernel refuses something else.
    pub fn run(&mut self, until: Instant, stop: &Stop) -> Result<(), L::Error> {
        let Self { session, line } = self;
        loop {
            let now = line.now();
            let goes_on = session.take_in(now, line)?;
            if session.hooks().is_paused() {
                return Ok(());
            }
            session.send(now, line)?;
            if !goes_on || stop.is_set() || now >= until {
                return Ok(());
            }
            let due = session.poll_timeout().unwrap_or(Instant::MAX);
            line.wait(due.min(until).min(now + MAX_SLEEP))?;
        }
    }
}
