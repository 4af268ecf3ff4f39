//! Host observations: what the card, the kernel and the clocks of this host have counted.
//!
//! The last hop, first SubDevice to card, is counted by no EtherCAT controller; only these counters
//! tell a damaged frame there from a lost one. Everything is given by difference, from sample to
//! sample: old counts are history. The counters are those of `ip -s -s link`
//! (`Documentation/networking/statistics.rst` of Linux), read in one request to rtnetlink, so that
//! they belong together.

use std::io;

use linesman_proto::time::{Instant, Span};

use crate::clock::{ClockReading, HostClock, suspended};
use crate::error::LinkError;
use crate::interface::netlink::{LinkNews, LinkRecord, LinkStatistics, Netlink};
use crate::interface::{self, OperationalState};
use crate::socket::SocketCounters;

/// The wall clock was set when it moved by more than this against the monotonic clock …
const STEP: Span = Span::ms(1);
/// … and by more than one part in so many of the time between samples: what slewing may do.
const SLEW: u64 = 1_000;
/// A host that slept less has not been suspended.
const SUSPENSION: Span = Span::ms(1);

/// Samples what a host has to say about one of its cards.
///
/// A sample costs one request to the kernel, some ten microseconds, but may wait while another
/// program configures the network: take samples in a thread that may be late.
pub struct HostSampler {
    interface: String,
    index: u32,
    netlink: Netlink,
    news: LinkNews,
    clock: HostClock,
    last: Reading,
    wakes: Wakes,
}

/// What happened on the host since the sample before.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct HostSample {
    /// When it was taken.
    pub at: Instant,
    /// The time since the sample before.
    pub over: Span,
    /// Whether the card has a link now.
    pub carrier: bool,
    /// The card's state now.
    pub operational: OperationalState,
    /// How often the link came or went; two changes may have left it as it was.
    pub carrier_changes: u64,
    /// What the card and its driver counted.
    pub card: CardCounters,
    /// Whether the card's counters began anew (its driver was loaded again); then they count from
    /// there.
    pub card_restarted: bool,
    /// What the socket counted.
    pub socket: SocketCounters,
    /// How late the cycle's thread woke.
    pub wakes: Wakes,
    /// How far the wall clock was set, in ns, backward if negative; `None` when it was not.
    pub clock_step_ns: Option<i64>,
    /// How long the host was suspended; zero when it was not.
    pub suspended: Span,
}

/// Counters of a card, by difference.
///
/// Few drivers fill all of them; none counts a damaged frame as received.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct CardCounters {
    /// Frames received.
    pub rx_frames: u64,
    /// Frames sent.
    pub tx_frames: u64,
    /// All damaged or lost received frames that the driver counts as errors.
    pub rx_errors: u64,
    /// Frames with a wrong check sequence.
    pub rx_crc_errors: u64,
    /// Frames that did not end on a whole byte.
    pub rx_alignment_errors: u64,
    /// Frames of a wrong length.
    pub rx_length_errors: u64,
    /// Frames that overran the card's memory.
    pub rx_fifo_errors: u64,
    /// Frames for which the card had no buffer: the host was too slow.
    pub rx_missed: u64,
    /// Sound frames that the kernel dropped. Among them are frames that no program wanted: a card
    /// nobody listens on "drops" all EtherCAT frames.
    pub rx_dropped: u64,
    /// Frames that could not be sent.
    pub tx_errors: u64,
    /// Frames that were dropped before sending.
    pub tx_dropped: u64,
}

/// How often a thread woke for its deadlines, and how late at most.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Wakes {
    /// How often it woke.
    pub count: u64,
    /// How late it was at most.
    pub latest: Span,
}

impl Wakes {
    /// Counts one more.
    pub fn add(&mut self, late: Span) {
        self.count += 1;
        self.latest = self.latest.max(late);
    }
}

/// What is compared from sample to sample.
#[derive(Clone, Copy)]
struct Reading {
    clocks: ClockReading,
    suspended: Span,
    link: Link,
    socket: SocketCounters,
}

#[derive(Clone, Copy)]
struct Link {
    carrier: bool,
    operational: OperationalState,
    carrier_changes: u32,
    statistics: LinkStatistics,
}

impl HostSampler {
    /// Begins to observe the interface with this name; differences count from now.
    ///
    /// # Errors
    /// When the interface is missing or the kernel does not answer.
    pub fn open(interface: &str, clock: &HostClock) -> Result<Self, LinkError> {
        let index = interface::find(interface)?.index;
        let mut netlink = Netlink::open()
            .map_err(|error| LinkError::system(interface, "asking for its counters", error))?;
        let news = LinkNews::listen()
            .map_err(|error| LinkError::system(interface, "listening for its link", error))?;
        let link = ask(&mut netlink, index, interface)?;
        let socket = SocketCounters::default();
        let last = Reading { clocks: clock.read(), suspended: suspended(), link, socket };
        let interface = interface.to_owned();
        let wakes = Wakes::default();
        Ok(Self { interface, index, netlink, news, clock: *clock, last, wakes })
    }

    /// Notes that the cycle's thread woke for a deadline, `late` after it.
    pub fn note_wake(&mut self, late: Span) {
        self.wakes.add(late);
    }

    /// Notes what another thread has noted of its own.
    pub fn note_wakes(&mut self, wakes: Wakes) {
        self.wakes.count += wakes.count;
        self.wakes.latest = self.wakes.latest.max(wakes.latest);
    }

    /// Whether the kernel has spoken of the interface since it was asked last, such as of a link that came or
    /// went: then it is worth taking a sample. It costs less than a microsecond, and does not wait.
    ///
    /// # Errors
    /// When the kernel refuses it.
    pub fn has_news(&mut self) -> Result<bool, LinkError> {
        let listening = |error| LinkError::system(&self.interface, "listening for its link", error);
        self.news.about(self.index).map_err(listening)
    }

    /// What happened since the sample before, or since [`open`](Self::open). `socket` is what the
    /// socket on this card has counted up to now.
    ///
    /// # Errors
    /// [`LinkError::Vanished`] when the interface was removed; or when the kernel does not answer.
    pub fn sample(&mut self, socket: SocketCounters) -> Result<HostSample, LinkError> {
        let link = ask(&mut self.netlink, self.index, &self.interface)?;
        let now = Reading { clocks: self.clock.read(), suspended: suspended(), link, socket };
        let before = std::mem::replace(&mut self.last, now);
        let wakes = std::mem::take(&mut self.wakes);
        Ok(difference(&before, &now, wakes))
    }
}

fn difference(before: &Reading, now: &Reading, wakes: Wakes) -> HostSample {
    let over = now.clocks.at.since(before.clocks.at);
    let (card, card_restarted) = card_difference(&before.link.statistics, &now.link.statistics);
    let slept = now.suspended.saturating_sub(before.suspended);
    HostSample {
        at: now.clocks.at,
        over,
        carrier: now.link.carrier,
        operational: now.link.operational,
        // A 32-bit counter of the kernel, which may wrap.
        carrier_changes: now.link.carrier_changes.wrapping_sub(before.link.carrier_changes).into(),
        card,
        card_restarted,
        socket: SocketCounters {
            received: now.socket.received.saturating_sub(before.socket.received),
            sent: now.socket.sent.saturating_sub(before.socket.sent),
            send_failures: now.socket.send_failures.saturating_sub(before.socket.send_failures),
            drops: now.socket.drops.saturating_sub(before.socket.drops),
        },
        wakes,
        clock_step_ns: clock_step(before.clocks, now.clocks, slept),
        suspended: if slept > SUSPENSION { slept } else { Span::ZERO },
    }
}

/// How far the wall clock was set between two readings, in ns. The monotonic clock stands still
/// while the host is suspended, the wall clock does not.
fn clock_step(before: ClockReading, now: ClockReading, slept: Span) -> Option<i64> {
    let passed = now.at.since(before.at) + slept;
    let expected = before.wall + passed;
    let step = now.wall.as_nanos() - expected.as_nanos();
    let allowed = STEP + Span::ns(passed.as_nanos() / SLEW);
    let stepped = step.unsigned_abs() > u128::from(allowed.as_nanos());
    stepped.then(|| i64::try_from(step).unwrap_or(if step > 0 { i64::MAX } else { i64::MIN }))
}

/// The difference of all counters, and whether they began anew.
fn card_difference(before: &LinkStatistics, now: &LinkStatistics) -> (CardCounters, bool) {
    let fields = |statistics: &LinkStatistics| CardCounters::from_statistics(statistics);
    let restarted = now.rx_packets < before.rx_packets || now.tx_packets < before.tx_packets;
    let base = if restarted { CardCounters::default() } else { fields(before) };
    (fields(now).minus(&base), restarted)
}

impl CardCounters {
    fn from_statistics(statistics: &LinkStatistics) -> Self {
        Self {
            rx_frames: statistics.rx_packets,
            tx_frames: statistics.tx_packets,
            rx_errors: statistics.rx_errors,
            rx_crc_errors: statistics.rx_crc_errors,
            rx_alignment_errors: statistics.rx_frame_errors,
            rx_length_errors: statistics.rx_length_errors,
            rx_fifo_errors: statistics.rx_fifo_errors,
            rx_missed: statistics.rx_missed_errors,
            rx_dropped: statistics.rx_dropped,
            tx_errors: statistics.tx_errors,
            tx_dropped: statistics.tx_dropped,
        }
    }

    /// Saturating: a single counter that a driver sets back counts as unchanged.
    fn minus(&self, base: &Self) -> Self {
        Self {
            rx_frames: self.rx_frames.saturating_sub(base.rx_frames),
            tx_frames: self.tx_frames.saturating_sub(base.tx_frames),
            rx_errors: self.rx_errors.saturating_sub(base.rx_errors),
            rx_crc_errors: self.rx_crc_errors.saturating_sub(base.rx_crc_errors),
            rx_alignment_errors: self.rx_alignment_errors.saturating_sub(base.rx_alignment_errors),
            rx_length_errors: self.rx_length_errors.saturating_sub(base.rx_length_errors),
            rx_fifo_errors: self.rx_fifo_errors.saturating_sub(base.rx_fifo_errors),
            rx_missed: self.rx_missed.saturating_sub(base.rx_missed),
            rx_dropped: self.rx_dropped.saturating_sub(base.rx_dropped),
            tx_errors: self.tx_errors.saturating_sub(base.tx_errors),
            tx_dropped: self.tx_dropped.saturating_sub(base.tx_dropped),
        }
    }
}

fn ask(netlink: &mut Netlink, index: u32, interface: &str) -> Result<Link, LinkError> {
    netlink.link(index, Link::of).map_err(|error: io::Error| match error.raw_os_error() {
        Some(libc::ENODEV) => LinkError::Vanished { interface: interface.to_owned() },
        _ => LinkError::system(interface, "asking for its counters", error),
    })
}

impl Link {
    fn of(record: &LinkRecord<'_>) -> Self {
        Self {
            carrier: record.is_up() && record.carrier,
            operational: OperationalState::from_number(record.operational),
            carrier_changes: record.carrier_changes,
            statistics: record.statistics,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unix_time::UnixTime;

    fn reading(at_ms: u64, wall_ms: i128) -> ClockReading {
        let wall = UnixTime::from_nanos(1_700_000_000_000_000_000 + wall_ms * 1_000_000);
        ClockReading { at: Instant::ZERO + Span::ms(at_ms), wall }
    }

    #[test]
    fn a_wall_clock_that_is_set_is_told_from_one_that_drifts_or_sleeps() {
        let start = reading(0, 0);
        let rows = [
            (reading(100, 100), Span::ZERO, None),
            (reading(100, 101), Span::ZERO, None),
            (reading(100, 102), Span::ZERO, Some(2_000_000)),
            (reading(100, -3_600_000), Span::ZERO, Some(-3_600_100_000_000)),
            // Slewing at 500 parts per million for 100 s moves it by 50 ms.
            (reading(100_000, 100_050), Span::ZERO, None),
            (reading(100, 60_100), Span::s(60), None),
        ];
        for (now, slept, step) in rows {
            assert_eq!(clock_step(start, now, slept), step, "{now:?}");
        }
    }

    #[test]
    fn counters_are_differences_and_begin_anew_with_the_driver() {
        let before = LinkStatistics {
            rx_packets: 1000,
            tx_packets: 1000,
            rx_crc_errors: 40,
            rx_missed_errors: 7,
            ..LinkStatistics::default()
        };
        let mut now = before;
        now.rx_packets += 10;
        now.rx_crc_errors += 3;
        let expected = CardCounters { rx_frames: 10, rx_crc_errors: 3, ..CardCounters::default() };
        assert_eq!(card_difference(&before, &now), (expected, false));
        let fresh = LinkStatistics { rx_packets: 5, rx_crc_errors: 1, ..Default::default() };
        let expected = CardCounters { rx_frames: 5, rx_crc_errors: 1, ..CardCounters::default() };
        assert_eq!(card_difference(&before, &fresh), (expected, true));
    }

    #[test]
    fn wakes_keep_the_worst() {
        let mut wakes = Wakes::default();
        for late in [3, 50, 2] {
            wakes.add(Span::us(late));
        }
        assert_eq!(wakes, Wakes { count: 3, latest: Span::us(50) });
    }
}
