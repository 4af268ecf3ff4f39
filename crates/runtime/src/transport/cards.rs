//! A card, or two at the ends of a ring.

use linesman_diagnosis::HostObservation;
use linesman_link::clock::{HostClock, tighten_timers};
use linesman_link::error::LinkError;
use linesman_link::interface::CardLock;
use linesman_link::socket::{
    RawSocket, Ready, SocketOptions, Waitable, WakeHandle, Waker, wait_any, wait_for,
};
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::time::{DcTime, Instant, Span};

use super::{FrameSink, RxFrame, Transport};
use crate::host_watch::HostWatch;

/// Most frames fetched in one go, so that a flood does not keep the cycle from its work.
const MOST: usize = 64;

/// Whoever rings waits no longer than this to be heard.
const SHORT: Span = Span::ms(3);

/// The cards of a MainDevice.
pub struct Cards {
    clock: HostClock,
    cards: Vec<OpenCard>,
    /// Frames that were sent and have not come back: so many are fetched without asking further.
    expected: usize,
    /// There may be something to fetch.
    ready: bool,
    waker: Waker,
    /// So long before a deadline it no longer sleeps but looks again and again.
    spin: Span,
    /// Nobody else sends on the cards meanwhile.
    _locks: Vec<CardLock>,
}

struct OpenCard {
    socket: RawSocket,
    watch: HostWatch,
    path: Path,
}

impl Cards {
    /// Opens the cards, and locks them: nothing is sent.
    ///
    /// # Errors
    /// When an interface cannot be used, or is used by another process.
    pub fn open(names: &[String], clock: HostClock) -> Result<Self, LinkError> {
        tighten_timers();
        let locks = names.iter().map(|name| CardLock::take(name)).collect::<Result<_, _>>()?;
        let open = |(path, name): (Path, &String)| {
            Ok(OpenCard {
                socket: RawSocket::open(name, &SocketOptions::default())?,
                watch: HostWatch::open(name, path, &clock)?,
                path,
            })
        };
        let cards: Result<Vec<OpenCard>, LinkError> =
            Path::ALL.into_iter().zip(names).map(open).collect();
        let waker = Waker::new().map_err(|source| LinkError::System {
            interface: names.join("+"),
            doing: "making a way to be woken",
            source,
        })?;
        Ok(Self {
            clock,
            cards: cards?,
            expected: 0,
            ready: true,
            waker,
            spin: Span::ZERO,
            _locks: locks,
        })
    }

    /// Looks again and again for so long before each deadline, instead of sleeping up to it: the
    /// thread must have a CPU of its own, else it keeps others from working.
    pub fn set_spin(&mut self, spin: Span) {
        self.spin = spin;
    }

    /// What wakes the thread that waits.
    #[must_use]
    pub fn wake_handle(&self) -> WakeHandle {
        self.waker.wake_handle()
    }

    /// How many cards there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.cards.len()
    }

    /// The clock of the run.
    #[must_use]
    pub const fn clock(&self) -> &HostClock {
        &self.clock
    }
}

impl Transport for Cards {
    type Error = LinkError;

    fn options(&self) -> Options {
        // The network's time begins as the host's, so that times of both can be compared.
        let unix = self.clock.started_at().as_nanos();
        let epoch = unix - i128::from(DcTime::UNIX_EPOCH_OFFSET_S) * 1_000_000_000;
        let clock_epoch = DcTime(u64::try_from(epoch).unwrap_or(0));
        Options { ring: self.cards.len() > 1, clock_epoch, ..Options::default() }
    }

    #[inline]
    fn now(&self) -> Instant {
        self.clock.now()
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, LinkError> {
        if !std::mem::replace(&mut self.ready, false) {
            return Ok(0);
        }
        let Self { clock, cards, expected, .. } = self;
        let mut count = 0;
        for card in cards {
            for _ in 0..MOST {
                let room = intake.room();
                let most = room.len();
                let Some(len) = card.socket.recv_one(room)? else {
                    *expected = 0;
                    break;
                };
                count += 1;
                // The first one was there when we came to look.
                let at = if count == 1 { now } else { clock.now() };
                let path = card.path;
                intake.frame_received(RxFrame {
                    at,
                    path,
                    len: len.min(most),
                    truncated: len > most,
                });
                *expected = expected.saturating_sub(1);
                // All are back. Should there be more, the next wait tells at once.
                if *expected == 0 {
                    break;
                }
            }
        }
        if count == 0 {
            self.waker.take();
        }
        Ok(count)
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), LinkError> {
        let Some(card) = self.cards.get_mut(path.index()) else { return Ok(()) };
        // The host watch tells of what was refused; the MainDevice sends it again.
        self.expected += card.socket.send_one(frame)?.frames;
        Ok(())
    }

    fn look_at_host(
        &mut self,
        now: Instant,
        tell: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), LinkError> {
        for card in &mut self.cards {
            if !card.watch.is_due(now)? {
                continue;
            }
            let counters = card.socket.counters()?;
            card.watch.poll(now, counters)?.iter().for_each(&mut *tell);
        }
        Ok(())
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), LinkError> {
        let sleep_until = deadline.before(self.spin);
        let now = self.clock.now();
        if sleep_until <= now {
            // No time to sleep, but to look.
            self.ready = true;
            return Ok(());
        }
        if let [card] = self.cards.as_slice()
            && sleep_until.since(now) < SHORT
        {
            // Who rings is heard soon enough, and one thing to wait for costs less than two.
            let ready = wait_for([&card.socket as &dyn Waitable], Some(sleep_until.since(now)))?;
            self.ready = ready != Ready::Deadline;
            return Ok(());
        }
        let waker: &dyn Waitable = &self.waker;
        let ready = match self.cards.as_slice() {
            [a, b, ..] => {
                wait_any([&a.socket as &dyn Waitable, &b.socket, waker], &self.clock, sleep_until)
            }
            [a] => wait_any([&a.socket as &dyn Waitable, waker], &self.clock, sleep_until),
            [] => wait_any([waker], &self.clock, sleep_until),
        }?;
        self.ready = ready != Ready::Deadline;
        Ok(())
    }

    fn note_late(&mut self, late: Span) {
        for card in &mut self.cards {
            card.watch.note_wake(late);
        }
    }
}
