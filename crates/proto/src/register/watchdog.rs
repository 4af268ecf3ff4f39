//! Watchdog times (0x0400, 0x0410, 0x0420) as spans.
//!
//! Reference: S2 2.10. A watchdog time counts ticks, and the divider says how long a tick is; the
//! first tick may already be running, so expiry comes up to one tick late.

use crate::time::Span;

/// The watchdog divider, 0x0400.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct WatchdogDivider(pub u16);

impl WatchdogDivider {
    /// The value after a reset: a tick of 100 µs.
    pub const RESET: Self = Self(0x09C2);

    /// Length of a tick: the value plus 2, times 40 ns. 80 ns to 2.62 ms.
    #[must_use]
    pub const fn tick(self) -> Span {
        Span::ns((self.0 as u64 + 2) * 40)
    }

    /// The divider whose tick is the shortest that is not below `tick`; `None` above 2.62 ms.
    #[must_use]
    pub fn for_tick(tick: Span) -> Option<Self> {
        let periods = tick.as_nanos().div_ceil(40);
        u16::try_from(periods.saturating_sub(2)).ok().map(Self)
    }
}

impl Default for WatchdogDivider {
    fn default() -> Self {
        Self::RESET
    }
}

/// A watchdog time, 0x0410 (PDI) or 0x0420 (process data), in ticks.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct WatchdogTime(pub u16);

impl WatchdogTime {
    /// The value after a reset: 100 ms with the divider after a reset.
    pub const RESET: Self = Self(0x03E8);
    /// Switched off.
    pub const OFF: Self = Self(0);

    /// How long it certainly holds without a trigger; `None` when it is switched off.
    #[must_use]
    pub fn span(self, divider: WatchdogDivider) -> Option<Span> {
        (self.0 != 0).then(|| divider.tick() * u64::from(self.0))
    }

    /// After how long without a trigger it has certainly expired; `None` when it is switched off.
    #[must_use]
    pub fn latest_expiry(self, divider: WatchdogDivider) -> Option<Span> {
        self.span(divider).map(|span| span + divider.tick())
    }

    /// The shortest time that holds for `span`; `None` when that is more than 65,535 ticks. A span
    /// of zero switches the watchdog off.
    #[must_use]
    pub fn for_span(span: Span, divider: WatchdogDivider) -> Option<Self> {
        u16::try_from(span.as_nanos().div_ceil(divider.tick().as_nanos())).ok().map(Self)
    }
}

impl Default for WatchdogTime {
    fn default() -> Self {
        Self::RESET
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::table;

    // proves: HW-21 partial
    #[test]
    fn a_hundred_milliseconds_after_reset() {
        assert_eq!(WatchdogDivider::RESET.tick(), Span::us(100));
        assert_eq!(WatchdogTime::RESET.span(WatchdogDivider::RESET), Some(Span::ms(100)));
        let latest = WatchdogTime::RESET.latest_expiry(WatchdogDivider::RESET);
        assert_eq!(latest, Some(Span::us(100_100)));
        assert_eq!(table::WATCHDOG_DIVIDER.reset, Some(u64::from(WatchdogDivider::RESET.0)));
        for register in [table::WATCHDOG_TIME_PDI, table::WATCHDOG_TIME_PROCESS_DATA] {
            assert_eq!(register.reset, Some(u64::from(WatchdogTime::RESET.0)));
        }
    }

    #[test]
    fn zero_switches_it_off() {
        assert_eq!(WatchdogTime::OFF.span(WatchdogDivider::RESET), None);
        assert_eq!(WatchdogTime::OFF.latest_expiry(WatchdogDivider::RESET), None);
        let off = WatchdogTime::for_span(Span::ZERO, WatchdogDivider::RESET);
        assert_eq!(off, Some(WatchdogTime::OFF));
    }

    #[test]
    fn spans_are_rounded_up_to_ticks() {
        let divider = WatchdogDivider::RESET;
        assert_eq!(WatchdogTime::for_span(Span::ms(20), divider), Some(WatchdogTime(200)));
        assert_eq!(WatchdogTime::for_span(Span::us(20_001), divider), Some(WatchdogTime(201)));
        assert_eq!(WatchdogTime::for_span(Span::s(7), divider), None);
        assert_eq!(WatchdogDivider::for_tick(Span::us(100)), Some(divider));
        assert_eq!(WatchdogDivider::for_tick(Span::ns(1)).unwrap().tick(), Span::ns(80));
        assert_eq!(WatchdogDivider::for_tick(Span::ms(3)), None);
    }
}
