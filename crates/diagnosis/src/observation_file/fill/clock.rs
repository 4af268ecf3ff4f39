//! Times of a file on one scale.

use linesman_proto::time::{Instant, Span};

use super::super::{Date, ObservationFile, Reading};
use super::WATCH;

/// A file in seconds keeps them as they are from so many on: there is room for earlier values before.
const ROOM_S: f64 = 10.0;
/// Longest time between two readings, in ns; more is a slip of the pen.
const LONGEST_NS: i128 = 1_000_000_000_000_000_000;

/// What the times of a file mean.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    origin: ClockOrigin,
    base: Instant,
    end: Instant,
}

#[derive(Clone, Copy, Debug)]
enum ClockOrigin {
    /// Nothing says a time.
    None,
    /// The earliest date, which is [`WATCH`] after 0.
    Date(Date),
    /// What is added to seconds.
    Seconds(f64),
}

impl Clock {
    pub(super) fn of(file: &ObservationFile) -> Self {
        let readings = file.readings.iter().map(|one| (one.at, one.at_s));
        let emergencies = file.emergencies.iter().map(|one| (one.at, one.at_s));
        let aborts = file.aborts.iter().map(|one| (one.at, one.at_s));
        let own = [(file.at, file.at_s)];
        let all: Vec<(Option<Date>, Option<f64>)> =
            readings.chain(emergencies).chain(aborts).chain(own).collect();
        let first_date = all.iter().filter_map(|(at, _)| *at).min();
        let has_seconds = all.iter().any(|(_, at)| at.is_some());
        // Counters need a time before them, at which they were 0 or what `before` says.
        let counts = |reading: &&Reading| !reading.devices.is_empty();
        let counted = file.readings.iter().filter(counts).filter_map(|one| one.at_s);
        let first_second = counted.chain(file.at_s).reduce(f64::min);
        let origin = match (first_date, first_second) {
            (Some(date), _) => ClockOrigin::Date(date),
            (None, Some(second)) if second < ROOM_S => {
                ClockOrigin::Seconds(WATCH.as_secs_f64() - second)
            }
            (None, Some(_) | None) if has_seconds => ClockOrigin::Seconds(0.0),
            (None, Some(_) | None) => ClockOrigin::None,
        };
        let mut clock = Self { origin, base: Instant::ZERO + WATCH, end: Instant::ZERO + WATCH };
        let latest = all.iter().filter_map(|(at, at_s)| clock.known(*at, *at_s)).max();
        let base = match (clock.known(file.at, file.at_s), latest) {
            (Some(base), _) => base,
            // What is told without a time is told last.
            (None, Some(latest)) if !file.readings.is_empty() => latest + WATCH,
            (None, Some(latest)) => latest.max(clock.base),
            (None, None) => clock.base,
        };
        clock.base = base;
        // Readings alone need no time after them in which nothing was read.
        clock.end = match (file.tells_itself(), latest) {
            (false, Some(latest)) => latest,
            (true, _) | (false, None) => base.max(latest.unwrap_or(base)),
        };
        clock
    }

    /// When the values of the file itself were read.
    pub(super) const fn base(&self) -> Instant {
        self.base
    }

    /// The latest time of all.
    pub(super) const fn end(&self) -> Instant {
        self.end
    }

    /// A moment; that of the file itself where none is given.
    pub(super) fn at(&self, at: Option<Date>, at_s: Option<f64>) -> Instant {
        self.known(at, at_s).unwrap_or(self.base)
    }

    fn known(&self, at: Option<Date>, at_s: Option<f64>) -> Option<Instant> {
        match (self.origin, at, at_s) {
            (ClockOrigin::Date(first), Some(at), _) => {
                let ns = at.ns_since(first).clamp(0, LONGEST_NS);
                Some(Instant::ZERO + WATCH + Span::ns(u64::try_from(ns).unwrap_or(0)))
            }
            (ClockOrigin::Seconds(shift), _, Some(at)) => {
                let seconds = (at + shift).clamp(0.0, 1e9);
                Some(Instant::from_nanos((seconds * 1e9).round() as u64))
            }
            (ClockOrigin::None | ClockOrigin::Date(_) | ClockOrigin::Seconds(_), _, _) => None,
        }
    }
}

impl ObservationFile {
    /// Whether the tables outside of readings hold values, and not the wiring alone.
    fn tells_itself(&self) -> bool {
        self.maindevice.is_some()
            || !self.working_counters.is_empty()
            || self.devices.iter().any(|device| super::Values::of(device).tells())
    }

    /// Whether it gives times at all.
    #[must_use]
    pub fn has_times(&self) -> bool {
        !self.times_are_assumed && !matches!(Clock::of(self).origin, ClockOrigin::None)
    }

    /// The date of the time 0 of the line, where the file gives dates: RFC 3339 without a zone.
    #[must_use]
    pub fn start(&self) -> Option<String> {
        let clock = Clock::of(self);
        let ClockOrigin::Date(first) = clock.origin else { return None };
        let watch = jiff::SignedDuration::from_secs(60);
        first.0.checked_sub(watch).ok().map(|start| start.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_keep_their_values_and_dates_their_distances() {
        let file = |text: &str| ObservationFile::parse(text).unwrap();
        let device = "[[device]]\non = \"maindevice\"\n";
        let uptime =
            file(&format!("{device}[[reading]]\nat_s = 16733.5\n[[reading]]\nat_s = 16734\n"));
        let clock = Clock::of(&uptime);
        assert_eq!(clock.at(None, Some(16_733.5)), Instant::from_nanos(16_733_500_000_000));
        assert_eq!(clock.end(), Instant::from_nanos(16_734_000_000_000));
        let dates = file(&format!(
            "{device}state = \"OP\"\n[[reading]]\nat = 2026-11-20T10:00:00\n[[reading]]\nat = \
             \"2026-11-20T10:00:02.5\"\n"
        ));
        let clock = Clock::of(&dates);
        assert_eq!(clock.at(dates.readings[1].at, None), Instant::ZERO + Span::ms(62_500));
        assert_eq!(clock.end(), Instant::ZERO + Span::ms(122_500), "the file itself is told last");
        assert_eq!(dates.start().as_deref(), Some("2026-11-20T09:59:00"));
    }
}
