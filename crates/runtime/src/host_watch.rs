//! Watch over one card by the host, in the words of the diagnosis.

use linesman_diagnosis::HostObservation;
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_link::host::{HostSample, HostSampler};
use linesman_link::socket::SocketCounters;
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};
use linesman_session::card::{CardSample, CardWatch};

/// How often the card is asked.
const EVERY: Span = Span::ms(100);
/// How often it is looked whether the kernel tells of the card by itself: a link that came or went is known so
/// exactly.
const NEWS: Span = Span::ms(1);

/// Asks the host about a card from time to time.
pub struct HostWatch {
    sampler: HostSampler,
    path: Path,
    news: CardWatch,
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
        Ok(Self { sampler, path, news: CardWatch::default(), next: now, next_news: now })
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
        let taken = self.sampler.sample(socket)?;
        let observe = |what| HostObservation {
            network: Network::default(),
            path: self.path,
            time: taken.at,
            what,
        };
        Ok(self.news.events(&sample(&taken)).map(observe).collect())
    }
}

/// A sample of the host, as of any card.
fn sample(sample: &HostSample) -> CardSample {
    let card = &sample.card;
    let crc = card.rx_crc_errors;
    // Drivers sum up all errors in one counter, and fill the others as they like.
    let summed = card.rx_errors.saturating_sub(crc + card.rx_fifo_errors + card.rx_missed);
    CardSample {
        carrier: sample.carrier,
        carrier_changes: sample.carrier_changes,
        crc,
        damaged: summed.max(card.rx_alignment_errors + card.rx_length_errors),
        card_drops: card.rx_missed + card.rx_fifo_errors,
        socket_drops: sample.socket.drops,
        send_failures: sample.socket.send_failures + card.tx_errors + card.tx_dropped,
        latest_wake: (sample.wakes.count > 0).then_some(sample.wakes.latest),
        clock_step_ns: sample.clock_step_ns,
    }
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
    fn errors_are_counted_once_however_a_driver_counts_them() {
        let of = |card| sample(&HostSample { card, ..quiet() });
        let expected = CardSample { carrier: true, ..CardSample::default() };
        let card = CardCounters { rx_errors: 7, rx_crc_errors: 5, ..CardCounters::default() };
        assert_eq!(of(card), CardSample { crc: 5, damaged: 2, ..expected });
        let card = CardCounters { rx_missed: 3, rx_errors: 3, ..CardCounters::default() };
        assert_eq!(of(card), CardSample { card_drops: 3, ..expected });
        let socket = SocketCounters { drops: 2, send_failures: 1, ..SocketCounters::default() };
        let busy = sample(&HostSample { socket, clock_step_ns: Some(-5), ..quiet() });
        let expected =
            CardSample { socket_drops: 2, send_failures: 1, clock_step_ns: Some(-5), ..expected };
        assert_eq!(busy, expected);
    }
}
