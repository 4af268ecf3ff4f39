//! Questions on a card that is listened on: the socket that sends them, and the lock of the card.

use linesman_diagnosis::ask::{AskSetup, Asker, AskingReport, News};
use linesman_diagnosis::{Engine, FrameSeen};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_link::interface::CardLock;
use linesman_link::socket::{RawSocket, Reception, SocketOptions};
use linesman_proto::address::Network;
use linesman_proto::time::Instant;

/// Room for a question: headers of UDP, and three datagrams.
const FRAME: usize = 256;

/// Asks on one card.
pub struct QuestionSocket {
    socket: RawSocket,
    asker: Asker,
    clock: HostClock,
    buffer: [u8; FRAME],
    /// No other program of ours sends on the card meanwhile.
    _lock: CardLock,
}

impl QuestionSocket {
    /// Makes ready to ask on the card with this name, on which another program may drive a line. Nothing is sent.
    ///
    /// # Errors
    /// When the interface cannot be used, is used by another process of this project, or the process lacks the right.
    pub fn open(interface: &str, clock: HostClock, setup: AskSetup) -> Result<Self, LinkError> {
        let lock = CardLock::take(interface)?;
        let options = SocketOptions { reception: Reception::Nothing, ..SocketOptions::default() };
        let socket = RawSocket::open(interface, &options)?;
        Ok(Self { socket, asker: Asker::new(setup), clock, buffer: [0; FRAME], _lock: lock })
    }

    /// Takes a frame that was heard.
    pub fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.asker.handle_frame(frame);
    }

    /// Frames passed that were not heard.
    pub fn missed(&mut self) {
        self.asker.handle_missed();
    }

    /// Sends the question that is due, if one is.
    ///
    /// # Errors
    /// When the interface was switched off, or vanished.
    pub fn turn(&mut self, engine: &mut Engine) -> Result<(), LinkError> {
        while let Some(probe) = engine.poll_probe() {
            self.asker.want(&probe);
        }
        let Some(line) = engine.model(Network(0)) else { return Ok(()) };
        let len = self.asker.poll_transmit(self.clock.now(), line, &mut self.buffer);
        if let Some(frame) = len.and_then(|len| self.buffer.get(..len)) {
            // Where the card's queue is full it is lost, as on the line.
            let _ = self.socket.send_one(frame)?;
        }
        Ok(())
    }

    /// When [`QuestionSocket::turn`] has something to do, though nothing is heard.
    #[must_use]
    pub fn deadline(&self) -> Instant {
        self.asker.poll_timeout().unwrap_or(Instant::MAX)
    }

    /// News since this was last asked.
    pub fn poll_news(&mut self) -> Option<News> {
        self.asker.poll_news()
    }

    /// How it stands.
    #[must_use]
    pub fn report(&self) -> AskingReport {
        self.asker.report(self.clock.now())
    }
}
