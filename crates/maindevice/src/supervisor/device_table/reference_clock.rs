//! The clock that all others follow: who it is, how it is, and who stands in for it.

use std::sync::atomic::Ordering;

use linesman_proto::address::{DeviceId, StationAddress};
use linesman_proto::time::DcTime;

use super::{DeviceEntry, DeviceTable};

/// What is known of the clock that all others follow.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct ReferenceClock {
    /// How often clocks were set, and the system time at the start of the run; `None`: not yet.
    pub(crate) base: Option<(u32, DcTime)>,
    /// It is there, and its clock was set since it was last without power; true as long as nobody can know.
    pub(crate) stands: bool,
    /// Whom frames name by its station address, whatever is planned: in a ring the reference, for somebody else stands
    /// in its position in the other half once the ring is open; while the reference does not stand, who gives its
    /// time to the others, `None` if nobody is left who could.
    pub(crate) named: Option<StationAddress>,
    /// While the ring is open: what to add, in ns, to the time that frames of the second card hand round. `None`: they
    /// hand none round.
    pub(crate) second_card_ns: Option<i64>,
    /// The delays that clocks were told are those of the line as it is: else nobody is given a time.
    pub(crate) delays_known: bool,
}

impl Default for ReferenceClock {
    fn default() -> Self {
        Self { base: None, stands: true, named: None, second_card_ns: None, delays_known: true }
    }
}

impl DeviceTable {
    /// The clock of a SubDevice was set: one of 64 bits if it is `wide`, else of 32.
    pub(crate) fn set_clock(&mut self, id: DeviceId, wide: bool) {
        let after = self.clocks_set;
        self.clocks_set += 1;
        if let Some(live) = self.live(id) {
            (live.clock_set, live.clock_wide) = (Some(after), wide);
        }
    }

    /// Whether the clock of a SubDevice was set, and has had power since.
    pub(crate) fn has_clock_set(&self, id: DeviceId) -> bool {
        self.devices.get(id.index()).is_some_and(|live| live.clock_set.is_some())
    }

    /// A SubDevice was seen to have no clock.
    pub(crate) fn note_lacks_clock(&mut self, id: DeviceId) {
        if let Some(live) = self.live(id) {
            live.lacks_clock = true;
        }
    }

    /// True if a SubDevice was seen to have no clock.
    pub(crate) fn lacks_clock(&self, id: DeviceId) -> bool {
        self.devices.get(id.index()).is_some_and(|live| live.lacks_clock)
    }

    /// Clocks were set to a time that was `epoch` when the run began.
    pub(crate) fn set_clock_epoch(&mut self, epoch: DcTime) {
        let times = self.clock_base.map_or(0, |(times, _)| times);
        self.clock_base = Some((times + 1, epoch));
        self.version.fetch_add(1, Ordering::Relaxed);
    }

    /// How the clock is that all others follow.
    pub(crate) fn clock(&self) -> ReferenceClock {
        let reference = self.reference.and_then(|(_, id)| self.devices.get(id?.index()));
        let stands = reference.is_none_or(DeviceEntry::shows_time);
        let of_ring = || self.reference.map(|(station, _)| station).filter(|_| self.is_ring);
        let named = if stands { of_ring() } else { self.stand_in() };
        let second_card_ns = self.second_card_ns;
        let delays_known = self.delays_known.unwrap_or(true);
        ReferenceClock { base: self.clock_base, stands, named, second_card_ns, delays_known }
    }

    /// Who gives the time while the reference does not: the first in the order of processing, so that most are
    /// behind it, of those that have the time of all. One of 32 bits would give the others an upper half of zeros.
    fn stand_in(&self) -> Option<StationAddress> {
        let with_time =
            || self.devices.iter().zip(&self.stations).filter(|(it, _)| it.shows_time());
        let wide = with_time().find(|(live, _)| live.clock_wide);
        wide.or_else(|| with_time().next()).map(|(_, station)| *station)
    }

    /// Those that have the time of all, in the order of processing.
    pub(crate) fn with_time(&self) -> impl Iterator<Item = StationAddress> {
        let all = self.devices.iter().zip(&self.stations);
        all.filter(|(live, _)| live.shows_time()).map(|(_, station)| *station)
    }

    /// Those that have the time of all, whose clock was set first before the others: it has had the longest time to learn its speed,
    /// and one that has just joined may be microseconds off.
    pub(crate) fn with_time_by_age(&self) -> Vec<StationAddress> {
        let all = self.devices.iter().zip(&self.stations);
        let mut with_time: Vec<_> = all.filter(|(live, _)| live.shows_time()).collect();
        with_time.sort_by_key(|(live, _)| live.clock_set);
        with_time.into_iter().map(|(_, station)| *station).collect()
    }

    /// Notes whether the delays that clocks were told are those of the line as it is.
    pub(crate) fn set_delays_known(&mut self, known: bool) {
        if self.delays_known.replace(known) != Some(known) {
            self.version.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// The ring is whole again: what has changed in one half meanwhile, the other one does not know.
    pub(crate) fn note_ring_whole(&mut self) {
        if self.delays_known.is_some() {
            self.ring_mended = true;
            self.set_delays_known(false);
            self.alert();
        }
    }

    /// Notes what is added to the time in frames of the second card; `None`: they hand none round.
    pub(crate) fn set_second_card_ns(&mut self, ns: Option<i64>) {
        self.second_card_ns = ns;
        self.version.fetch_add(1, Ordering::Relaxed);
    }

    /// Whose clock all others follow.
    pub(crate) fn set_reference_clock(&mut self, station: StationAddress, id: Option<DeviceId>) {
        self.reference = Some((station, id));
    }

    /// Whose clock all others follow; `None` before clocks were set.
    pub(crate) fn reference_clock(&self) -> Option<StationAddress> {
        self.reference.map(|(station, _)| station)
    }
}
