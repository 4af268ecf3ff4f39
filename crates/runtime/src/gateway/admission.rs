//! Limits of the gateway: how much is taken of a client, and in all.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

/// Requests of a client that wait for their answers.
const PER_CLIENT: usize = 8;
/// Requests of all clients that wait for their answers.
pub(super) const WAITING: usize = 64;
/// Senders of datagrams that are kept apart.
const SENDERS: usize = 2_048;

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
    use std::net::IpAddr;

    use super::*;

    fn host(last: u8) -> IpAddr {
        IpAddr::from([10, 0, 0, last])
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
