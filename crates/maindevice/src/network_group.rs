//! Networks of one process that keep one time: the first that starts leads, the others follow (DC-12).
//!
//! Whoever leads leaves its reference clock to itself, and tells with each frame that brings the time of that clock what
//! it is. Whoever follows has its own reference clock led to that time. What is told lies in four numbers that one
//! writes and others read without a lock: a reader that meets a change looks again, a few times.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, AtomicUsize, Ordering};

use linesman_proto::time::{DcTime, Instant};

/// Binary places of a speed.
pub(crate) const SPEED_PLACES: u32 = 48;
/// So often a reader looks again.
const ATTEMPTS: u32 = 8;

/// Place of a network among the networks of one process that keep one time. All count their [`Instant`]s from the same
/// moment.
#[derive(Clone, Debug, Default)]
pub struct NetworkGroup {
    told: Arc<ToldTime>,
    rank: usize,
}

#[derive(Debug, Default)]
struct ToldTime {
    /// The rank of the one that leads, counted from 1; 0: nobody does.
    leader: AtomicUsize,
    /// Networks below this rank have begun, or never will.
    begun: AtomicUsize,
    /// Odd while the others are being written; 0: nothing was told yet.
    version: AtomicU64,
    at: AtomicU64,
    time: AtomicU64,
    speed: AtomicI64,
}

/// A time of the network at a time of the run, and how much faster it goes, in 2^-48.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct TimePair {
    pub(crate) at: Instant,
    pub(crate) time: u64,
    pub(crate) speed: i64,
}

impl TimePair {
    /// The time of the network at another time of the run.
    pub(crate) fn time_at(&self, at: Instant) -> DcTime {
        let later = at.as_nanos().wrapping_sub(self.at.as_nanos()) as i64;
        let gained = (i128::from(later) * i128::from(self.speed)) >> SPEED_PLACES;
        DcTime(self.time.wrapping_add_signed(later).wrapping_add_signed(gained as i64))
    }
}

/// The one that leads a group, until it is dropped.
#[derive(Debug)]
pub(crate) struct GroupLead(Arc<ToldTime>);

/// Turn of a network to begin; dropped, those behind it need not wait for it any more.
#[derive(Debug)]
pub(crate) struct GroupTurn(NetworkGroup);

impl NetworkGroup {
    /// A group whose networks begin when they like; copies are the same place.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Places of a group whose networks begin one after the other, so that the first of them that has clocks leads.
    #[must_use]
    pub fn in_order(count: usize) -> Vec<Self> {
        let told = Arc::<ToldTime>::default();
        (0..count).map(|rank| Self { told: Arc::clone(&told), rank }).collect()
    }

    /// True while one of its networks leads.
    #[must_use]
    pub fn is_led(&self) -> bool {
        self.leader().is_some()
    }

    /// Place of the network that leads, from 0 in the order of [`NetworkGroup::in_order`]; `None` while nobody does.
    #[must_use]
    pub fn leader(&self) -> Option<usize> {
        self.told.leader.load(Ordering::Acquire).checked_sub(1)
    }

    /// The lead, if nobody has it.
    pub(crate) fn lead(&self) -> Option<GroupLead> {
        let order = Ordering::AcqRel;
        let taken = self.told.leader.compare_exchange(0, self.rank + 1, order, Ordering::Acquire);
        taken.is_ok().then(|| GroupLead(Arc::clone(&self.told)))
    }

    /// Its turn to begin.
    pub(crate) fn turn(&self) -> GroupTurn {
        GroupTurn(self.clone())
    }

    /// True while one before it has neither begun nor given up.
    pub(crate) fn waits(&self) -> bool {
        self.told.begun.load(Ordering::Acquire) < self.rank
    }

    /// What was told last; `None` before that, or if it changes all the time.
    pub(crate) fn told(&self) -> Option<TimePair> {
        let told = &self.told;
        for _ in 0..ATTEMPTS {
            let before = told.version.load(Ordering::SeqCst);
            if before == 0 {
                return None;
            }
            let at = Instant::from_nanos(told.at.load(Ordering::SeqCst));
            let time = told.time.load(Ordering::SeqCst);
            let speed = told.speed.load(Ordering::SeqCst);
            if before.is_multiple_of(2) && told.version.load(Ordering::SeqCst) == before {
                return Some(TimePair { at, time, speed });
            }
        }
        None
    }
}

impl GroupLead {
    /// Tells the others the time.
    pub(crate) fn tell(&self, pair: TimePair) {
        let told = &self.0;
        told.version.fetch_add(1, Ordering::SeqCst);
        told.at.store(pair.at.as_nanos(), Ordering::SeqCst);
        told.time.store(pair.time, Ordering::SeqCst);
        told.speed.store(pair.speed, Ordering::SeqCst);
        told.version.fetch_add(1, Ordering::SeqCst);
    }
}

impl Drop for GroupLead {
    fn drop(&mut self) {
        self.0.leader.store(0, Ordering::Release);
    }
}

impl Drop for GroupTurn {
    fn drop(&mut self) {
        self.0.told.begun.fetch_max(self.0.rank + 1, Ordering::AcqRel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_network_leads_until_it_is_gone() {
        let group = NetworkGroup::new();
        let lead = group.lead().expect("nobody leads yet");
        assert!(group.is_led() && group.lead().is_none());
        drop(lead);
        assert!(!group.is_led() && group.lead().is_some());
    }

    #[test]
    fn networks_in_order_wait_until_those_before_them_have_begun_or_are_gone() {
        let group = NetworkGroup::in_order(3);
        let waiting = || group.iter().map(NetworkGroup::waits).collect::<Vec<_>>();
        let mut turns: Vec<_> = group.iter().map(NetworkGroup::turn).collect();
        assert_eq!(waiting(), [false, true, true]);
        drop(turns.remove(0));
        assert_eq!(waiting(), [false, false, true]);
        let _lead = group[1].lead().expect("the first did not want to");
        assert_eq!(group[2].leader(), Some(1));
        drop(turns);
        assert_eq!(waiting(), [false; 3]);
    }

    #[test]
    fn what_the_first_tells_the_others_read_and_reckon_on() {
        let group = NetworkGroup::new();
        assert_eq!(group.told(), None);
        let lead = group.lead().expect("nobody leads yet");
        // 1/1024 too fast.
        let pair = TimePair { at: Instant::from_nanos(4_000), time: 9_000_000, speed: 1 << 38 };
        lead.tell(pair);
        let told = group.told().expect("it was told");
        assert_eq!(told, pair);
        assert_eq!(told.time_at(Instant::from_nanos(4_000)), DcTime(9_000_000));
        assert_eq!(told.time_at(Instant::from_nanos(6_048)), DcTime(9_002_050));
        assert_eq!(told.time_at(Instant::from_nanos(1_952)), DcTime(8_997_950));
    }
}
