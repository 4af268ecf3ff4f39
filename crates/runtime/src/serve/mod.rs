//! A virtual segment on real interfaces: any MainDevice at the other end of the cable sees a line.
//!
//! The host clock feeds the segment; delays, port times and clocks stay computed, so that the
//! MainDevice sees one consistent world. A frame crosses the segment at the time that the kernel
//! stamped on it, and goes back when it is due, or as soon as the host can: a late host makes the
//! line look longer, it does not change what is in the frames. How late it was is told
//! ([`report::Status`]).
//!
//! The thread sleeps until a frame comes, an answer is due, somebody asks for something, or the
//! wish to stop; it looks at nothing by the clock but once a second, so that what happens in the
//! segment by itself is not made up for all at once.

pub mod ethernet_ports;
pub mod lateness;
pub mod report;

use linesman_link::clock::{HostClock, tighten_timers};
use linesman_link::error::LinkError;
use linesman_link::interface::CardLock;
use linesman_link::real_time::sched_fifo;
use linesman_link::socket::{
    Batch, RawSocket, Ready, Reception, SocketOptions, Waitable, WakeHandle, Waker, wait_among,
    wait_any,
};
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;

use self::ethernet_ports::EthernetPorts;
use self::lateness::Lateness;
use self::report::{Frames, Host, SCHEMA, Status};
use crate::control::{Control, apply};
use crate::stop::Stop;
use crate::truth_writer::TruthWriter;
use crate::wiring::Wiring;

/// Frames fetched in one call.
const BATCH: usize = 64;
/// Below this the thread looks again and again instead of sleeping: waking may take 50 µs.
const SPIN: Span = Span::us(80);
/// Below the priority of interrupt threads, above programs without a cycle.
const PRIORITY: u8 = 10;
/// Longest sleep: clocks and faults of the segment go on without frames.
const NAP: Span = Span::s(1);
/// Sleep after a request: what it began, begins behind all that was worked out already.
const SOON: Span = Span::ms(1);

/// A segment that answers on one card, or on two at the ends of a ring.
pub struct Server {
    clock: HostClock,
    segment: Segment,
    wiring: Wiring,
    cards: Vec<RawSocket>,
    ethernet_ports: EthernetPorts,
    waker: Waker,
    batch: Batch,
    answer: Vec<u8>,
    tally: ServeCounts,
    /// Nobody else answers on the cards meanwhile.
    _locks: Vec<CardLock>,
}

/// Who has a say in a segment that runs, and who writes down what happens.
#[derive(Default)]
pub struct ServeControls {
    /// Faults and inputs from outside.
    pub control: Option<Control>,
    /// What really happened.
    pub truth_writer: Option<TruthWriter>,
}

/// What was counted so far.
#[derive(Default)]
struct ServeCounts {
    frames: Frames,
    real_time: bool,
    /// Time asleep.
    asleep: Span,
    spinning: Span,
    pickup: Lateness,
    late: Lateness,
    shifted: u64,
    downs: u64,
    /// The latest time that the segment was told.
    told: Instant,
}

impl Server {
    /// Opens the interfaces, and locks them: the first is card A's cable, the second card B's. What
    /// the segment puts out comes back to its inputs by `wiring`.
    ///
    /// # Errors
    /// When an interface cannot be used, or is used by another process.
    pub fn open(segment: Segment, wiring: Wiring, names: &[String]) -> Result<Self, LinkError> {
        // Controllers process EtherCAT in UDP and behind VLAN tags, too.
        let options = SocketOptions { reception: Reception::EveryForm, ..SocketOptions::default() };
        let locks = names.iter().map(|name| CardLock::take(name)).collect::<Result<_, _>>()?;
        let cards: Result<Vec<_>, _> =
            names.iter().take(2).map(|name| RawSocket::open(name, &options)).collect();
        let waker = Waker::new().map_err(|source| LinkError::System {
            interface: names.join("+"),
            doing: "making a way to be woken",
            source,
        })?;
        Ok(Self {
            cards: cards?,
            ethernet_ports: EthernetPorts::default(),
            waker,
            clock: HostClock::start(),
            segment,
            wiring,
            batch: Batch::new(BATCH),
            answer: Vec::new(),
            tally: ServeCounts::default(),
            _locks: locks,
        })
    }

    /// Ethernet ports of the segment carry what comes by interfaces of this computer from now on.
    #[must_use]
    pub fn with_ethernet_ports(mut self, ports: EthernetPorts) -> Self {
        self.ethernet_ports = ports;
        self
    }

    /// What wakes it: to look at the wish to stop, or at what is asked for.
    #[must_use]
    pub fn wake_handle(&self) -> WakeHandle {
        self.waker.wake_handle()
    }

    /// Answers until `until` or `stop`, and suffers what it is asked for. Whoever sets `stop` or
    /// asks rings [`Server::wake_handle`].
    ///
    /// # Errors
    /// When an interface vanished, or the kernel refuses something else. What was served so far
    /// stays to be asked for.
    pub fn run(
        &mut self,
        until: Instant,
        stop: &Stop,
        beside: &mut ServeControls,
    ) -> Result<(), LinkError> {
        tighten_timers();
        // A line never waits for other programs. Without the right it is late at times, as the
        // status tells.
        self.tally.real_time = sched_fifo(PRIORITY).is_ok();
        loop {
            // Taken before the frames, so that none comes after a time that was told already.
            let now = self.clock.now();
            let received = self.receive()?;
            self.segment.advance(now);
            self.tally.told = self.tally.told.max(now);
            let mut nap = NAP;
            if self.waker.take()
                && let Some(control) = &beside.control
            {
                nap = SOON;
                while let Some(asked) = control.poll() {
                    let answer = apply(now, &asked.order, self);
                    self.tell(&mut beside.truth_writer);
                    asked.requester.give(answer);
                }
            }
            self.wiring.carry(self.segment.signals_mut());
            let carried = self.ethernet_ports.carry(now, &mut self.segment)?;
            if carried > 0 {
                nap = nap.min(SOON);
            }
            let sent = self.send(now)?;
            self.tell(&mut beside.truth_writer);
            if stop.is_set() || now >= until {
                return Ok(());
            }
            let due = self.segment.poll_timeout().unwrap_or(Instant::MAX);
            if due.since(now) > SPIN {
                self.sleep(due.before(SPIN).min(until).min(now + nap))?;
            } else if received + sent == 0 {
                self.tally.spinning += self.clock.now().since(now);
            }
        }
    }

    /// Takes in what has come; gives how many frames that were.
    fn receive(&mut self) -> Result<usize, LinkError> {
        let mut total = 0;
        for (path, card) in Path::ALL.into_iter().zip(&mut self.cards) {
            match card.recv_batch(&mut self.batch, &self.clock) {
                Ok(0) => continue,
                Ok(count) => total += count,
                // It may come up again, and until then there is nothing to answer.
                Err(LinkError::Down { .. }) => {
                    self.tally.downs += 1;
                    continue;
                }
                Err(error) => return Err(error),
            }
            let picked = self.clock.now();
            for frame in self.batch.iter() {
                self.tally.frames.received += 1;
                self.tally.pickup.note(picked.since(frame.at));
                self.tally.shifted += u64::from(frame.at < self.tally.told);
                self.tally.told = self.tally.told.max(frame.at);
                self.segment.handle_frame(frame.at, path, frame.bytes);
            }
        }
        Ok(total)
    }

    /// Sends back what is due; gives how many frames that were.
    fn send(&mut self, now: Instant) -> Result<usize, LinkError> {
        let mut count = 0;
        while let Some(arrival) = self.segment.poll_arrival(&mut self.answer) {
            count += 1;
            if !arrival.intact {
                self.tally.frames.damaged += 1;
                continue;
            }
            let Some(card) = self.cards.get_mut(arrival.path.index()) else { continue };
            match card.send_batch([self.answer.as_slice()]) {
                Ok(sent) if sent.frames == 1 => self.tally.frames.answered += 1,
                Ok(_) | Err(LinkError::Down { .. }) => self.tally.frames.refused += 1,
                Err(error) => return Err(error),
            }
            self.tally.late.note(self.clock.now().max(now).since(arrival.at));
        }
        Ok(count)
    }

    /// Hands on what happened.
    fn tell(&mut self, truth_writer: &mut Option<TruthWriter>) {
        if let Some(truth_writer) = truth_writer {
            truth_writer.take(&mut self.segment);
        }
    }

    /// Sleeps until there is something to do.
    fn sleep(&mut self, deadline: Instant) -> Result<(), LinkError> {
        let before = self.clock.now();
        let waker = &self.waker;
        let _: Ready = match self.cards.as_slice() {
            _ if !self.ethernet_ports.is_empty() => {
                let cards = self.cards.iter().map(|card| card as &dyn Waitable);
                let all =
                    cards.chain(self.ethernet_ports.waitable()).chain([waker as &dyn Waitable]);
                wait_among(&all.collect::<Vec<_>>(), &self.clock, deadline)?
            }
            [a, b, ..] => wait_any([a as &dyn Waitable, b, waker], &self.clock, deadline)?,
            [a] => wait_any([a as &dyn Waitable, waker], &self.clock, deadline)?,
            [] => wait_any([waker as &dyn Waitable], &self.clock, deadline)?,
        };
        self.tally.asleep += self.clock.now().since(before);
        Ok(())
    }

    /// What was done so far, and whether the host kept up.
    #[must_use]
    pub fn status(&mut self) -> Status {
        // A kernel that does not tell has dropped nothing that we know of.
        let drops = |card: &mut RawSocket| card.counters().map_or(0, |counters| counters.drops);
        let dropped = self.cards.iter_mut().map(drops).sum();
        let tally = &self.tally;
        let frames = tally.frames;
        let done = frames.answered + frames.damaged + frames.refused;
        let ran = self.clock.now().since(Instant::ZERO);
        let busy = ran.saturating_sub(tally.asleep).saturating_sub(tally.spinning);
        Status {
            schema: SCHEMA.to_owned(),
            error: None,
            name: self.segment.title().to_owned(),
            interfaces: self.cards.iter().map(|card| card.interface().name.clone()).collect(),
            devices: self.segment.devices().count() as u64,
            time_ns: ran.as_nanos(),
            frames: Frames { outstanding: frames.received.saturating_sub(done), ..frames },
            host: Host {
                real_time: tally.real_time,
                busy_ns: busy.as_nanos(),
                busy_share: busy.as_nanos() as f64 / ran.as_nanos().max(1) as f64,
                spinning_ns: tally.spinning.as_nanos(),
                pickup: tally.pickup.report(),
                answer: tally.late.report(),
                dropped,
                shifted: tally.shifted,
                downs: tally.downs,
            },
        }
    }

    /// The segment.
    #[must_use]
    pub fn segment(&self) -> &Segment {
        &self.segment
    }

    /// The segment and its wires, to do what is asked for.
    pub(crate) fn parts(&mut self) -> (&mut Segment, &mut Wiring) {
        (&mut self.segment, &mut self.wiring)
    }
}
