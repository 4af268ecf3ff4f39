//! A virtual segment on real interfaces: any MainDevice at the other end of the cable sees a line.
//!
//! The host clock feeds the segment; delays, port times and clocks stay computed, so that the
//! MainDevice sees one consistent world. Frames go back when they are due, or as soon as the host
//! can: a late host makes the line look longer, it does not change what is in the frames.

use linesman_link::clock::{HostClock, tighten_timers};
use linesman_link::error::LinkError;
use linesman_link::real_time::sched_fifo;
use linesman_link::socket::{Batch, RawSocket, Ready, SocketOptions, Waitable, wait_any};
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;

use crate::control::Control;
use crate::stop::Stop;
use crate::wiring::Wiring;

/// Frames fetched in one call.
const BATCH: usize = 64;
/// Below this the thread looks again and again instead of sleeping: waking may take 50 µs.
const SPIN: Span = Span::us(80);
/// Below the priority of interrupt threads, above programs without a cycle.
const PRIORITY: u8 = 10;
/// Longest sleep, so that a wish to stop is noticed.
const NAP: Span = Span::ms(50);

/// A segment that answers on one card, or on two at the ends of a ring.
pub struct Server {
    clock: HostClock,
    segment: Segment,
    wiring: Wiring,
    cards: Vec<RawSocket>,
    batch: Batch,
    answer: Vec<u8>,
    served: Served,
}

/// What was done so far.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Served {
    /// Frames that came in.
    pub received: u64,
    /// Frames that went back.
    pub sent: u64,
    /// Frames that came back damaged: a card would drop them, so they were not sent.
    pub damaged: u64,
    /// Frames that the kernel did not take.
    pub refused: u64,
    /// How late a frame went back at most.
    pub latest: Span,
    /// How often an interface was found switched off.
    pub downs: u64,
}

impl Server {
    /// Opens the interfaces: the first is card A's cable, the second card B's. What the segment
    /// puts out comes back to its inputs by `wiring`.
    ///
    /// # Errors
    /// When an interface cannot be used.
    pub fn open(segment: Segment, wiring: Wiring, names: &[String]) -> Result<Self, LinkError> {
        let options = SocketOptions::default();
        let cards: Result<Vec<_>, _> =
            names.iter().take(2).map(|name| RawSocket::open(name, &options)).collect();
        Ok(Self {
            cards: cards?,
            clock: HostClock::start(),
            segment,
            wiring,
            batch: Batch::new(BATCH),
            answer: Vec::new(),
            served: Served::default(),
        })
    }

    /// Answers until `until` or `stop`, and suffers what `control` is asked for.
    ///
    /// # Errors
    /// When an interface vanished, or the kernel refuses something else. What was served so far
    /// stays to be asked for.
    pub fn run(
        &mut self,
        until: Instant,
        stop: &Stop,
        control: Option<&Control>,
    ) -> Result<(), LinkError> {
        tighten_timers();
        // A line never waits for other programs. Without the right it is late at times, as
        // `Served::latest` tells.
        let _ = sched_fifo(PRIORITY);
        loop {
            self.receive()?;
            let now = self.clock.now();
            self.segment.advance(now);
            if let Some(control) = control {
                control.serve(now, &mut self.segment);
            }
            self.wiring.carry(self.segment.signals_mut());
            self.send(now)?;
            if stop.is_set() || now >= until {
                return Ok(());
            }
            let due = self.segment.poll_timeout().unwrap_or(Instant::MAX);
            if due.since(now) > SPIN {
                let deadline = (due.before(SPIN)).min(until).min(now + NAP);
                self.wait(deadline)?;
            }
        }
    }

    /// Takes in what has come.
    fn receive(&mut self) -> Result<(), LinkError> {
        for (path, card) in Path::ALL.into_iter().zip(&mut self.cards) {
            match card.recv_batch(&mut self.batch, &self.clock) {
                Ok(_) => {}
                // It may come up again, and until then there is nothing to answer.
                Err(LinkError::Down { .. }) => {
                    self.served.downs += 1;
                    continue;
                }
                Err(error) => return Err(error),
            }
            for frame in self.batch.iter() {
                self.served.received += 1;
                self.segment.handle_frame(frame.at, path, frame.bytes);
            }
        }
        Ok(())
    }

    /// Sends back what is due.
    fn send(&mut self, now: Instant) -> Result<(), LinkError> {
        while let Some(arrival) = self.segment.poll_arrival(&mut self.answer) {
            if !arrival.intact {
                self.served.damaged += 1;
                continue;
            }
            let Some(card) = self.cards.get_mut(arrival.path.index()) else { continue };
            match card.send_batch([self.answer.as_slice()]) {
                Ok(sent) if sent.frames == 1 => self.served.sent += 1,
                Ok(_) | Err(LinkError::Down { .. }) => self.served.refused += 1,
                Err(error) => return Err(error),
            }
            self.served.latest = self.served.latest.max(now.since(arrival.at));
        }
        Ok(())
    }

    fn wait(&self, deadline: Instant) -> Result<Ready, LinkError> {
        match self.cards.as_slice() {
            [a, b, ..] => wait_any([a as &dyn Waitable, b], &self.clock, deadline),
            [a] => a.wait(&self.clock, deadline),
            [] => Ok(Ready::Deadline),
        }
    }

    /// What was done so far.
    #[must_use]
    pub fn served(&self) -> Served {
        self.served
    }

    /// The clock of the run.
    #[must_use]
    pub fn clock(&self) -> &HostClock {
        &self.clock
    }

    /// The segment.
    #[must_use]
    pub fn segment(&self) -> &Segment {
        &self.segment
    }
}
