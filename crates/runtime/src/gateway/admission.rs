//! Limits of the gateway: how much is taken of a client, of a host, and in all.

use std::collections::BTreeMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

/// Requests a second of one host, and at once after a pause.
const PER_HOST: u64 = 1_000;
/// Requests a second in all, and at once after a pause.
const IN_ALL: u64 = 2_000;
/// Hosts whose rates are kept apart.
const HOSTS: usize = 256;
/// Requests of a client that wait for their answers.
const PER_CLIENT: usize = 8;
/// Requests of all clients that wait for their answers.
pub(super) const WAITING: usize = 64;
/// Senders of datagrams that are kept apart.
const SENDERS: usize = 2_048;

/// Requests that may come, refilled as time passes.
#[derive(Clone, Copy, Debug)]
struct Allowance {
    /// How many are left, in thousandths.
    left: u64,
    at: Duration,
}

impl Allowance {
    const fn full(per_second: u64, now: Duration) -> Self {
        Self { left: per_second * 1_000, at: now }
    }

    /// Time has passed.
    fn refill(&mut self, per_second: u64, now: Duration) {
        let passed = now.saturating_sub(self.at);
        let more = u64::try_from(passed.as_micros()).unwrap_or(u64::MAX).saturating_mul(per_second);
        // Less than a thousandth is waited for.
        if more >= 1_000 {
            self.left = self.left.saturating_add(more / 1_000).min(per_second * 1_000);
            self.at = now;
        }
    }

    const fn has_one(&self) -> bool {
        self.left >= 1_000
    }

    const fn take(&mut self) {
        self.left = self.left.saturating_sub(1_000);
    }
}

/// Rates of requests. Time is an argument: since the gateway was opened.
#[derive(Debug)]
pub(super) struct RequestRates {
    all: Allowance,
    hosts: BTreeMap<IpAddr, Allowance>,
}

impl RequestRates {
    pub(super) fn new() -> Self {
        Self { all: Allowance::full(IN_ALL, Duration::ZERO), hosts: BTreeMap::new() }
    }

    /// True if a request of this host may be taken now; it counts then.
    pub(super) fn admit(&mut self, host: IpAddr, now: Duration) -> bool {
        self.all.refill(IN_ALL, now);
        if !self.hosts.contains_key(&host) && self.hosts.len() >= HOSTS {
            // The one that was silent for longest starts afresh when it comes again.
            let oldest = self.hosts.iter().min_by_key(|(_, allowance)| allowance.at);
            if let Some(oldest) = oldest.map(|(host, _)| *host) {
                self.hosts.remove(&oldest);
            }
        }
        let of_host = self.hosts.entry(host).or_insert(Allowance::full(PER_HOST, now));
        of_host.refill(PER_HOST, now);
        // A host that asks too much takes nothing from the others.
        if !of_host.has_one() || !self.all.has_one() {
            return false;
        }
        of_host.take();
        self.all.take();
        true
    }
}

/// Whoever asks: a sender of datagrams, or a connection.
#[derive(Debug)]
pub(super) struct GatewayClient {
    /// Tells clients apart.
    pub(super) id: u64,
    waiting: AtomicUsize,
}

/// All clients.
#[derive(Clone, Debug)]
pub(super) struct GatewayClients {
    next: Arc<AtomicU64>,
    waiting: Arc<AtomicUsize>,
}

impl GatewayClients {
    pub(super) fn new() -> Self {
        Self { next: Arc::new(AtomicU64::new(1)), waiting: Arc::default() }
    }

    /// One more.
    pub(super) fn add(&self) -> Arc<GatewayClient> {
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        Arc::new(GatewayClient { id, waiting: AtomicUsize::default() })
    }

    /// Number of clients so far.
    pub(super) fn count(&self) -> u64 {
        self.next.load(Ordering::Relaxed).saturating_sub(1)
    }

    /// A place among the requests that wait for their answers; `None` when this client, or all together, have
    /// enough of them.
    pub(super) fn place(&self, client: &Arc<GatewayClient>) -> Option<WaitingPlace> {
        let of_client = take(&client.waiting, PER_CLIENT);
        let taken = of_client && {
            let of_all = take(&self.waiting, WAITING);
            if !of_all {
                client.waiting.fetch_sub(1, Ordering::AcqRel);
            }
            of_all
        };
        taken.then(|| WaitingPlace { client: Arc::clone(client), all: Arc::clone(&self.waiting) })
    }
}

fn take(waiting: &AtomicUsize, most: usize) -> bool {
    let more = |count: usize| (count < most).then_some(count + 1);
    waiting.fetch_update(Ordering::AcqRel, Ordering::Acquire, more).is_ok()
}

/// A place among the requests that wait; free again when it is dropped.
#[derive(Debug)]
pub(super) struct WaitingPlace {
    client: Arc<GatewayClient>,
    all: Arc<AtomicUsize>,
}

impl Drop for WaitingPlace {
    fn drop(&mut self) {
        self.client.waiting.fetch_sub(1, Ordering::AcqRel);
        self.all.fetch_sub(1, Ordering::AcqRel);
    }
}

/// Senders of datagrams, each a client of its own.
#[derive(Debug)]
pub(super) struct DatagramSenders {
    senders: BTreeMap<SocketAddr, (Arc<GatewayClient>, Duration)>,
}

impl DatagramSenders {
    pub(super) const fn new() -> Self {
        Self { senders: BTreeMap::new() }
    }

    /// The client that sends from there.
    pub(super) fn client(
        &mut self,
        sender: SocketAddr,
        now: Duration,
        clients: &GatewayClients,
    ) -> Arc<GatewayClient> {
        if !self.senders.contains_key(&sender) && self.senders.len() >= SENDERS {
            self.forget();
        }
        let (client, last) = self.senders.entry(sender).or_insert_with(|| (clients.add(), now));
        *last = now;
        Arc::clone(client)
    }

    /// Forgets the older half of those that wait for nothing.
    fn forget(&mut self) {
        let mut times: Vec<Duration> = self.senders.values().map(|(_, last)| *last).collect();
        let middle = times.len() / 2;
        let (_, middle, _) = times.select_nth_unstable(middle);
        let middle = *middle;
        self.senders.retain(|_, (client, last)| {
            *last > middle || client.waiting.load(Ordering::Acquire) > 0
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn host(last: u8) -> IpAddr {
        IpAddr::from([10, 0, 0, last])
    }

    #[test]
    fn host_that_floods_is_limited_and_takes_nothing_from_others() {
        let mut rates = RequestRates::new();
        let admitted = |rates: &mut RequestRates, last, count: u64, now| {
            (0..count).filter(|_| rates.admit(host(last), now)).count() as u64
        };
        let at = Duration::from_secs;
        assert_eq!(admitted(&mut rates, 1, 10_000, at(0)), PER_HOST);
        assert_eq!(admitted(&mut rates, 2, 100, at(0)), 100);
        assert_eq!(admitted(&mut rates, 1, 10, at(0)), 0);
        // After a second there is as much again, however it is asked for.
        let slowly =
            (0..1_000).filter(|milli| rates.admit(host(1), Duration::from_millis(1_000 + milli)));
        assert_eq!(slowly.count(), 1_000);
        // Many hosts at once: the rate in all holds.
        let mut rates = RequestRates::new();
        let of_all: u64 = (0..200).map(|last| admitted(&mut rates, last, 50, at(0))).sum();
        assert_eq!(of_all, IN_ALL);
        assert!(rates.hosts.len() <= HOSTS);
    }

    #[test]
    fn table_of_hosts_stays_bounded() {
        let mut rates = RequestRates::new();
        for number in 0..2_000_u32 {
            let host = IpAddr::from(number.to_be_bytes());
            rates.admit(host, Duration::from_millis(number.into()));
        }
        assert_eq!(rates.hosts.len(), HOSTS);
    }

    #[test]
    fn waiting_requests_are_limited_per_client_and_in_all() {
        let clients = GatewayClients::new();
        let one = clients.add();
        let mut places: Vec<_> = (0..20).filter_map(|_| clients.place(&one)).collect();
        assert_eq!(places.len(), PER_CLIENT);
        places.pop();
        assert!(clients.place(&one).is_some(), "a place that is free is taken again");
        let others: Vec<_> = (0..100).map(|_| clients.add()).collect();
        let more: Vec<_> = others.iter().filter_map(|other| clients.place(other)).collect();
        assert_eq!(more.len() + places.len(), WAITING);
        drop((places, more));
        assert_eq!(clients.waiting.load(Ordering::Acquire), 0);
    }

    #[test]
    fn senders_keep_their_number_and_their_table_stays_bounded() {
        let clients = GatewayClients::new();
        let mut senders = DatagramSenders::new();
        let from = |port: u16| SocketAddr::new(host(1), port);
        let first = senders.client(from(1), Duration::ZERO, &clients);
        let place = clients.place(&first);
        for port in 2..10_000 {
            senders.client(from(port), Duration::from_millis(port.into()), &clients);
            assert!(senders.senders.len() <= SENDERS);
        }
        let again = senders.client(from(1), Duration::from_secs(20), &clients);
        assert_eq!(again.id, first.id, "one that waits for an answer is not forgotten");
        drop(place);
    }
}
