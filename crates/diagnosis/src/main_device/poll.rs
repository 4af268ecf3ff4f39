//! Registers that a MainDevice reads again and again, and how often.

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::{Addressing, Effect};
use linesman_proto::frame::Datagram;
use linesman_proto::register::ErrorCounters;
use linesman_proto::time::{Instant, Span};
use serde::{Deserialize, Serialize};

/// Registers of which the times are kept; the one that was read longest ago gives way.
const KEPT: usize = 48;
/// Intervals from whose middle the usual one is taken.
const INTERVALS: usize = 8;
/// Read so often from one address, a register is polled.
const POLLED: u64 = 4;
/// Not read for so many of its intervals, and for [`STOPPED_AFTER`], it is polled no longer.
const STOPPED_INTERVALS: u64 = 4;
/// The shortest time after which a poll has stopped.
const STOPPED_AFTER: Span = Span::s(1);
/// Registers of the EEPROM interface: read until a transfer is done, not to watch anything.
const EEPROM: core::ops::Range<u16> = 0x0500..0x0510;
/// Process RAM: mailboxes and process data.
const FIRST_RAM: u16 = 0x1000;

/// A way to access a register.
#[derive(Clone, Copy, PartialEq, Eq, Debug, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Access {
    /// Read from all at once, values ORed together: BRD.
    Broadcast,
    /// Read from one SubDevice at a time by its station address: FPRD.
    Station,
    /// Read from one SubDevice at a time by its position: APRD.
    Position,
    /// Read from one SubDevice and written to those behind it: FRMW, ARMW.
    Distributed,
    /// Written, which clears it: error counters.
    Cleared,
}

impl Access {
    /// The access of a datagram, if it is one that is watched.
    #[inline]
    fn of(effect: Effect, datagram: &Datagram<'_>) -> Option<Self> {
        if effect.multiple_write {
            return Some(Self::Distributed);
        }
        if effect.writes {
            let clears = ErrorCounters::cover(datagram.ado(), datagram.data_len());
            return clears.then_some(Self::Cleared);
        }
        match (effect.reads, effect.addressing) {
            (true, Addressing::Broadcast) => Some(Self::Broadcast),
            (true, Addressing::Station) => Some(Self::Station),
            (true, Addressing::Position) => Some(Self::Position),
            (true, Addressing::Logical | Addressing::None) | (false, _) => None,
        }
    }
}

/// A register that is accessed again and again.
#[derive(Clone, Copy, Debug)]
pub struct Poll {
    /// Its address.
    pub register: RegisterAddress,
    /// Bytes.
    pub len: u16,
    /// The access.
    pub access: Access,
    /// The SubDevice whose accesses are timed.
    address: u16,
    /// Accesses to that one.
    times: u64,
    /// The latest of them.
    last: Instant,
    /// The latest intervals between them, in a circle.
    intervals: [Span; INTERVALS],
}

impl Poll {
    /// The usual interval between two accesses to the same SubDevice.
    #[must_use]
    pub fn interval(&self) -> Option<Span> {
        let known =
            usize::try_from(self.times.saturating_sub(1)).map_or(INTERVALS, |n| n.min(INTERVALS));
        let mut intervals = self.intervals;
        let intervals = intervals.get_mut(..known)?;
        intervals.sort_unstable();
        intervals.get(known / 2).copied()
    }

    /// Whether it is polled at `now`.
    fn is_polled(&self, now: Instant) -> bool {
        let Some(interval) = self.interval().filter(|_| self.times >= POLLED) else { return false };
        now.since(self.last) <= STOPPED_AFTER.max(interval * STOPPED_INTERVALS)
    }

    fn again(&mut self, at: Instant) {
        let slot = (self.times.saturating_sub(1) % INTERVALS as u64) as usize;
        if let Some(interval) = self.intervals.get_mut(slot) {
            *interval = at.since(self.last);
        }
        (self.times, self.last) = (self.times + 1, at);
    }
}

/// The registers that one MainDevice accesses.
#[derive(Clone, Default, Debug)]
pub(super) struct Polls {
    all: Vec<Poll>,
    /// Index of the one that was accessed last: many are accessed of one SubDevice after the other.
    latest: usize,
}

impl Polls {
    /// Takes a datagram of a request that was sent at `at`.
    pub(super) fn take(&mut self, effect: Effect, datagram: &Datagram<'_>, at: Instant) {
        let (register, len) = (datagram.ado(), datagram.data_len() as u16);
        if register.0 >= FIRST_RAM || EEPROM.contains(&register.0) {
            return;
        }
        let Some(access) = Access::of(effect, datagram) else { return };
        // Broadcasts may come with any position, as one that passes a second card of a ring.
        let address = if effect.addressing == Addressing::Broadcast { 0 } else { datagram.adp() };
        let is_it =
            |poll: &Poll| poll.register == register && poll.len == len && poll.access == access;
        // Some are accessed of one SubDevice after the other, some in turns.
        if !self.all.get(self.latest).is_some_and(is_it) {
            self.latest += 1;
            if !self.all.get(self.latest).is_some_and(is_it) {
                self.latest = self.all.iter().position(is_it).unwrap_or(self.all.len());
            }
        }
        if let Some(poll) = self.all.get_mut(self.latest) {
            if poll.address == address && at >= poll.last {
                poll.again(at);
            }
            return;
        }
        let intervals = [Span::default(); INTERVALS];
        let new = Poll { register, len, access, address, times: 1, last: at, intervals };
        if self.all.len() < KEPT {
            self.all.push(new);
        } else if let Some(oldest) = self.all.iter_mut().min_by_key(|poll| poll.last) {
            *oldest = new;
        }
    }

    /// Those that are polled at `now`, by address.
    pub(super) fn polled(&self, now: Instant) -> Vec<Poll> {
        let mut polled: Vec<Poll> =
            self.all.iter().filter(|poll| poll.is_polled(now)).copied().collect();
        polled.sort_by_key(|poll| (poll.register, poll.access, poll.len));
        polled
    }
}
