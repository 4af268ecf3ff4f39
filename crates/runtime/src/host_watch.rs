//! Watch over one card by the host, in the words of the diagnosis.

use linesman_diagnosis::observe::{HostEvent, HostObservation};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_link::host::{HostSample, HostSampler};
use linesman_link::socket::SocketCounters;
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};

/// How often the card is asked.
const EVERY: Span = Span::ms(100);
/// How often it is looked whether the kernel tells of the card by itself: a link that came or went is known so
/// exactly.
const NEWS: Span = Span::ms(1);

/// Asks the host about a card from time to time.
pub struct HostWatch {
    sampler: HostSampler,
    path: Path,
    carrier: Option<bool>,
    next: Instant,
    next_news: Instant,
}

impl HostWatch {
    /// Begins to watch the interface with this name.
    ///
    /// # Errors
    /// When it is missing or the kernel does not answer.
    pub fn open(interface: &str, path: Path, clock: &HostClock) -> Result<Self, LinkError> {
        let sampler = HostSampler::open(interface, clock)?;
        let now = clock.now();
        Ok(Self { sampler, path, carrier: None, next: now, next_news: now })
    }

    /// Whether the card is to be asked now: its time has come, or the kernel has told of it.
    ///
    /// # Errors
    /// When the kernel refuses to tell.
    pub fn is_due(&mut self, now: Instant) -> Result<bool, LinkError> {
        if now >= self.next {
            return Ok(true);
        }
        if now < self.next_news {
            return Ok(false);
        }
        self.next_news = now + NEWS;
        self.sampler.has_news()
    }

    /// Notes that the thread woke so late for a deadline.
    pub fn note_wake(&mut self, late: Span) {
        self.sampler.note_wake(late);
    }

    /// Asks, whatever the [time](Self::is_due); `socket` is what the socket on this card has counted up to now.
    ///
    /// # Errors
    /// When the interface vanished or the kernel does not answer.
    pub fn poll(
        &mut self,
        now: Instant,
        socket: SocketCounters,
    ) -> Result<Vec<HostObservation>, LinkError> {
        self.next = now + EVERY;
        let sample = self.sampler.sample(socket)?;
        let events = events(&sample, self.carrier);
        self.carrier = Some(sample.carrier);
        let observe = |what| HostObservation {
            network: Network::default(),
            path: self.path,
            time: sample.at,
            what,
        };
        Ok(events.into_iter().map(observe).collect())
    }
}

/// What of a sample is news.
fn events(sample: &HostSample, carrier_before: Option<bool>) -> Vec<HostEvent> {
    let mut events = Vec::new();
    let went_and_came = sample.carrier_changes > 1 && carrier_before == Some(sample.carrier);
    if went_and_came {
        events.push(HostEvent::Carrier(!sample.carrier));
    }
    if went_and_came || carrier_before != Some(sample.carrier) {
        events.push(HostEvent::Carrier(sample.carrier));
    }
    let card = &sample.card;
    let crc = card.rx_crc_errors;
    // Drivers sum up all errors in one counter, and fill the others as they like.
    let summed = card.rx_errors.saturating_sub(crc + card.rx_fifo_errors + card.rx_missed);
    let other = summed.max(card.rx_alignment_errors + card.rx_length_errors);
    if crc + other > 0 {
        events.push(HostEvent::CardErrors { crc, other });
    }
    let counts = [
        (card.rx_missed + card.rx_fifo_errors, HostEvent::CardDrops as fn(u64) -> HostEvent),
        (sample.socket.drops, HostEvent::SocketDrops),
        (sample.socket.send_failures + card.tx_errors + card.tx_dropped, HostEvent::SendFailures),
    ];
    events.extend(counts.into_iter().filter(|(count, _)| *count > 0).map(|(n, event)| event(n)));
    if sample.wakes.count > 0 {
        events.push(HostEvent::Late(sample.wakes.latest));
    }
    events.extend(sample.clock_step_ns.map(HostEvent::ClockStep));
    events
}

#[cfg(test)]
mod tests {
    use linesman_link::host::{CardCounters, Wakes};
    use linesman_link::interface::OperationalState;

    use super::*;

    fn quiet() -> HostSample {
        HostSample {
            at: Instant::ZERO,
            over: EVERY,
            carrier: true,
            operational: OperationalState::Up,
            carrier_changes: 0,
            card: CardCounters::default(),
            card_restarted: false,
            socket: SocketCounters::default(),
            wakes: Wakes::default(),
            clock_step_ns: None,
            suspended: Span::ZERO,
        }
    }

    #[test]
    fn a_quiet_host_says_its_carrier_once() {
        assert_eq!(events(&quiet(), None), [HostEvent::Carrier(true)]);
        assert_eq!(events(&quiet(), Some(true)), []);
        let blinked = HostSample { carrier_changes: 2, ..quiet() };
        let both = [HostEvent::Carrier(false), HostEvent::Carrier(true)];
        assert_eq!(events(&blinked, Some(true)), both);
    }

    #[test]
    fn errors_are_counted_once_however_a_driver_counts_them() {
        let card = CardCounters { rx_errors: 7, rx_crc_errors: 5, ..CardCounters::default() };
        let sample = HostSample { card, ..quiet() };
        assert_eq!(events(&sample, Some(true)), [HostEvent::CardErrors { crc: 5, other: 2 }]);
        let card = CardCounters { rx_missed: 3, rx_errors: 3, ..CardCounters::default() };
        let sample = HostSample { card, ..quiet() };
        assert_eq!(events(&sample, Some(true)), [HostEvent::CardDrops(3)]);
        let socket = SocketCounters { drops: 2, send_failures: 1, ..SocketCounters::default() };
        let sample = HostSample { socket, clock_step_ns: Some(-5), ..quiet() };
        let expected =
            [HostEvent::SocketDrops(2), HostEvent::SendFailures(1), HostEvent::ClockStep(-5)];
        assert_eq!(events(&sample, Some(true)), expected);
    }
}
