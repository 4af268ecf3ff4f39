//! Rates of requests: how many are taken of a host, and in all.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::time::Duration;

/// Requests a second of one host, and at once after a pause.
const PER_HOST: u64 = 1_000;
/// Requests a second in all, and at once after a pause.
const IN_ALL: u64 = 2_000;
/// Hosts whose rates are kept apart.
const HOSTS: usize = 256;

/// Requests that may come, refilled as time passes.
#[derive(Clone, Copy, Debug)]
struct Allowance {
    /// Requests that are left, in thousandths.
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

/// Rates of requests. Time is an argument: since the server was opened.
#[derive(Debug)]
pub(crate) struct RequestRates {
    all: Allowance,
    hosts: BTreeMap<IpAddr, Allowance>,
}

impl RequestRates {
    pub(crate) fn new() -> Self {
        Self { all: Allowance::full(IN_ALL, Duration::ZERO), hosts: BTreeMap::new() }
    }

    /// True if a request of this host may be taken now; it counts then.
    pub(crate) fn admit(&mut self, host: IpAddr, now: Duration) -> bool {
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
}
