//! Clock time of a run beside the time since its start.

use linesman_link::unix_time::UnixTime;
use linesman_proto::time::Span;

use crate::text::quantity::time;

/// The wall clock at the start of a run; without a start it tells nothing.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct WallClock {
    start: Option<UnixTime>,
}

impl WallClock {
    /// The clock of a run that began at this time (RFC 3339).
    pub(super) fn of(start: Option<&str>) -> Self {
        Self { start: start.and_then(UnixTime::parse) }
    }

    /// Whether clock times are known.
    pub(super) const fn is_known(self) -> bool {
        self.start.is_some()
    }

    /// The time of day at a time since the start, in the time zone of this host.
    pub(super) fn time_of_day(self, ns: u64) -> Option<String> {
        Some(self.moment(ns)?.local_time_of_day())
    }

    /// The date, with the offset from UTC, at a time since the start.
    pub(super) fn date(self, ns: u64) -> Option<String> {
        Some(self.moment(ns)?.local_date())
    }

    /// `1.093 s (02:16:32.714)`.
    pub(super) fn both(self, ns: u64) -> String {
        match self.time_of_day(ns) {
            Some(clock) => format!("{} ({clock})", time(ns)),
            None => time(ns),
        }
    }

    fn moment(self, ns: u64) -> Option<UnixTime> {
        Some(self.start? + Span::ns(ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_since_the_start_stands_beside_the_time_of_day() {
        let clock = WallClock::of(Some("2026-03-15T02:16:31.621081636Z"));
        let told = clock.both(1_500_000_000);
        // The hour depends on the time zone of the host.
        assert!(told.starts_with("1.500 s (") && told.ends_with(":33.121)"), "{told}");
        assert!(clock.date(0).is_some_and(|date| date.starts_with("2026-03-1")));
        assert_eq!(WallClock::of(None).both(1_500_000_000), "1.500 s");
        assert!(!WallClock::of(Some("yesterday")).is_known());
    }
}
