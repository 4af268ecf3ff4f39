//! A watchdog: a time that runs out unless it is triggered.
//!
//! Read first: S2 2.10. Ticks run by themselves since power-on; a watchdog of n ticks expires at
//! the first tick that is at least n ticks behind its trigger, that is between n and n + 1 ticks
//! later.

use linesman_proto::register::{WatchdogDivider, WatchdogTime};
use linesman_proto::time::Instant;

/// One watchdog.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Watchdog {
    expires: Option<Instant>,
}

impl Watchdog {
    /// When it will expire, if it runs.
    pub(super) fn expires(&self) -> Option<Instant> {
        self.expires
    }

    pub(super) fn is_running(&self) -> bool {
        self.expires.is_some()
    }

    pub(super) fn stop(&mut self) {
        self.expires = None;
    }

    /// Starts it anew. With time 0 it is off and never expires.
    pub(super) fn trigger(
        &mut self,
        at: Instant,
        ticks_since: Instant,
        divider: WatchdogDivider,
        time: WatchdogTime,
    ) {
        self.expires = time.span(divider).map(|span| {
            let tick = divider.tick().as_nanos();
            let earliest = (at + span).since(ticks_since).as_nanos();
            ticks_since + linesman_proto::time::Span::ns(earliest.next_multiple_of(tick))
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        // The window of S2 2.10: between n and n + 1 ticks behind the trigger.
        #[test]
        fn it_expires_within_one_tick(
            since in 0u64..1_000_000, after in 0u64..10_000_000_000, divider: u16, time in 1u16..
        ) {
            let (divider, time) = (WatchdogDivider(divider), WatchdogTime(time));
            let since = Instant::from_nanos(since);
            let at = since + linesman_proto::time::Span::ns(after);
            let mut watchdog = Watchdog::default();
            watchdog.trigger(at, since, divider, time);
            let expires = watchdog.expires().unwrap();
            prop_assert!(expires >= at + time.span(divider).unwrap());
            prop_assert!(expires < at + time.latest_expiry(divider).unwrap());
        }
    }

    #[test]
    fn time_zero_switches_it_off() {
        let mut watchdog = Watchdog::default();
        watchdog.trigger(Instant::ZERO, Instant::ZERO, WatchdogDivider::RESET, WatchdogTime::RESET);
        assert_eq!(watchdog.expires(), Some(Instant::from_nanos(100_000_000)));
        watchdog.trigger(Instant::ZERO, Instant::ZERO, WatchdogDivider::RESET, WatchdogTime::OFF);
        assert!(!watchdog.is_running());
    }
}
