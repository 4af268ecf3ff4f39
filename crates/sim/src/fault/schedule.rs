//! Schedule of a fault: its windows of time, one after the other.

use linesman_proto::time::{Instant, Span};

use super::error::FaultError;
use crate::seed::Stream;
use crate::segment_file::{FaultEntry, Schedule};

/// The shortest time that means anything, in ms.
const SHORTEST_MS: f64 = 0.001;
/// The longest time, in ms: some thirty years.
const LONGEST_MS: f64 = 1e12;
/// The most repetitions in a burst.
const LONGEST_BURST: u32 = 100_000;

/// A span in which a fault acts; without an end it lasts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Window {
    pub(crate) from: Instant,
    pub(crate) to: Option<Instant>,
}

/// How windows follow one another.
#[derive(Clone, Debug)]
enum Rhythm {
    Once,
    At(Vec<Span>),
    Every(Span),
    Random { mean: Span, stays: Option<Span>, stream: Box<Stream> },
}

/// The windows of a fault, in the order of time.
#[derive(Clone, Debug)]
pub(crate) struct Windows {
    from: Instant,
    to: Option<Instant>,
    rhythm: Rhythm,
    stays: Option<Span>,
    burst: Option<(u32, Span)>,
    times: u32,
    /// Windows given, bursts not counted.
    given: u32,
    /// Where the present burst began, and how many of it were given.
    in_burst: Option<(Window, u32)>,
    /// The end of the last window.
    last: Instant,
}

impl Windows {
    /// A single window.
    pub(crate) const fn once(from: Instant, to: Option<Instant>) -> Self {
        Self {
            from,
            to,
            rhythm: Rhythm::Once,
            stays: None,
            burst: None,
            times: 1,
            given: 0,
            in_burst: None,
            last: from,
        }
    }

    /// The time over which something is spread that happens so and so often.
    pub(crate) fn first(&self) -> Window {
        let mut copy = self.clone();
        copy.next().unwrap_or(Window { from: self.from, to: self.to })
    }

    fn begins(&mut self) -> Option<(Instant, Option<Span>)> {
        let nth = u64::from(self.given);
        match &mut self.rhythm {
            Rhythm::Once => (nth == 0).then_some((self.from, self.stays)),
            Rhythm::At(times) => {
                times.get(nth as usize).map(|after| (self.from + *after, self.stays))
            }
            Rhythm::Every(every) => Some((self.from + *every * nth, self.stays)),
            Rhythm::Random { mean, stays, stream } => {
                let rate = |mean: Span| 1.0 / mean.as_secs_f64().max(1e-9);
                let from = self.last + stream.wait(rate(*mean));
                let stays = stays.map(|mean| stream.wait(rate(mean)).max(Span::us(1)));
                Some((from, stays.or(self.stays)))
            }
        }
    }
}

impl Iterator for Windows {
    type Item = Window;

    fn next(&mut self) -> Option<Window> {
        let mut window = match (self.in_burst, self.burst) {
            (Some((first, given)), Some((count, every))) if given < count => {
                self.in_burst = Some((first, given + 1));
                let later = every * u64::from(given);
                Window { from: first.from + later, to: first.to.map(|to| to + later) }
            }
            _ => {
                if self.given >= self.times {
                    return None;
                }
                let (from, stays) = self.begins()?;
                self.given += 1;
                let window = Window { from, to: stays.map(|stays| from + stays) };
                self.in_burst = Some((window, 1));
                window
            }
        };
        if self.to.is_some_and(|to| window.from >= to) || window.from == Instant::MAX {
            return None;
        }
        window.to = match (window.to, self.to) {
            (Some(one), Some(other)) => Some(one.min(other)),
            (one, other) => one.or(other),
        };
        self.last = window.to.unwrap_or(Instant::MAX);
        Some(window)
    }
}

/// Works out the windows of an entry. It begins at its own time, but not before `earliest`.
pub(super) fn windows(
    label: &str,
    entry: &FaultEntry,
    schedule: &Schedule,
    earliest: Instant,
    stream: Stream,
) -> Result<Windows, FaultError> {
    let check = ScheduleCheck { label };
    let at = |ms: f64| Instant::from_nanos((ms * 1e6) as u64);
    for (key, value) in [("from_ms", entry.from_ms), ("to_ms", entry.to_ms)] {
        check.range(key, value, 0.0)?;
    }
    let from = entry.from_ms.map_or(earliest, at).max(earliest);
    let stays = check.span("for_ms", schedule.for_ms)?;
    let rhythm = check.rhythm(schedule, stream)?;
    let mut to = entry.to_ms.map(at);
    if let (Rhythm::Once, Some(stays), None) = (&rhythm, stays, schedule.burst) {
        let end = from + stays;
        to = Some(to.map_or(end, |to| to.min(end)));
    }
    if let Some(to) = to
        && to <= from
    {
        let given = format!("{} ms", to.as_nanos() / 1_000_000);
        let allowed = format!("later than its begin, {} ms", from.as_nanos() / 1_000_000);
        return Err(check.value("to_ms", given, allowed));
    }
    let burst = match schedule.burst {
        None => None,
        Some(burst) => {
            let every = check.span("burst.every_ms", Some(burst.every_ms))?.unwrap_or(Span::ZERO);
            if !(1..=LONGEST_BURST).contains(&burst.count) {
                let allowed = format!("1 to {LONGEST_BURST}");
                return Err(check.value("burst.count", burst.count.to_string(), allowed));
            }
            if stays.is_none_or(|stays| stays >= every) {
                return Err(check.stays(schedule, "shorter than `burst.every_ms`"));
            }
            Some((burst.count, every))
        }
    };
    check.fits(schedule, &rhythm, stays, burst)?;
    let times = schedule.times.unwrap_or(u32::MAX);
    if times == 0 {
        return Err(check.value("times", "0".to_owned(), "1 and more".to_owned()));
    }
    Ok(Windows { rhythm, stays, burst, times, ..Windows::once(from, to) })
}

struct ScheduleCheck<'a> {
    label: &'a str,
}

impl ScheduleCheck<'_> {
    fn value(&self, key: &str, given: String, allowed: String) -> FaultError {
        FaultError::Value { entry: self.label.to_owned(), key: key.to_owned(), given, allowed }
    }

    fn range(&self, key: &str, value: Option<f64>, low: f64) -> Result<(), FaultError> {
        match value.filter(|ms| !(low..=LONGEST_MS).contains(ms)) {
            None => Ok(()),
            Some(ms) => Err(self.value(key, ms.to_string(), format!("{low} and more"))),
        }
    }

    fn span(&self, key: &str, ms: Option<f64>) -> Result<Option<Span>, FaultError> {
        self.range(key, ms, SHORTEST_MS)?;
        Ok(ms.map(|ms| Span::ns((ms * 1e6) as u64)))
    }

    fn stays(&self, schedule: &Schedule, allowed: &str) -> FaultError {
        let given = schedule.for_ms.map_or("not given".to_owned(), |ms| ms.to_string());
        self.value("for_ms", given, allowed.to_owned())
    }

    fn rhythm(&self, schedule: &Schedule, stream: Stream) -> Result<Rhythm, FaultError> {
        let said = [
            ("at_ms", schedule.at_ms.is_some()),
            ("every_ms", schedule.every_ms.is_some()),
            ("random", schedule.random.is_some()),
        ];
        let said: Vec<&str> = said.iter().filter(|(_, said)| *said).map(|(key, _)| *key).collect();
        if let [first, second, ..] = said.as_slice() {
            let given = format!("given beside `{first}`");
            return Err(self.value(second, given, "one of at_ms, every_ms and random".to_owned()));
        }
        if let Some(times) = &schedule.at_ms {
            for ms in times.as_slice() {
                self.range("at_ms", Some(*ms), 0.0)?;
            }
            let times = times.as_slice().iter().map(|ms| Span::ns((ms * 1e6) as u64));
            return Ok(Rhythm::At(times.collect()));
        }
        if let Some(every) = self.span("every_ms", schedule.every_ms)? {
            return Ok(Rhythm::Every(every));
        }
        let Some(random) = schedule.random else { return Ok(Rhythm::Once) };
        let mean = self.span("random.mean_ms", Some(random.mean_ms))?.unwrap_or(Span::s(1));
        let stays = self.span("random.for_ms", random.for_ms)?;
        Ok(Rhythm::Random { mean, stays, stream: Box::new(stream) })
    }

    /// One window ends before the next begins.
    fn fits(
        &self,
        schedule: &Schedule,
        rhythm: &Rhythm,
        stays: Option<Span>,
        burst: Option<(u32, Span)>,
    ) -> Result<(), FaultError> {
        let whole = stays.map(|stays| match burst {
            Some((count, every)) => every * u64::from(count - 1) + stays,
            None => stays,
        });
        match (rhythm, whole) {
            (Rhythm::Once, _) => Ok(()),
            (Rhythm::Random { stays: Some(_), .. }, _) if burst.is_none() => Ok(()),
            (_, None) => Err(self.stays(schedule, "how long it stays each time, in ms")),
            (Rhythm::Random { .. }, Some(_)) => Ok(()),
            (Rhythm::Every(every), Some(whole)) if whole < *every => Ok(()),
            (Rhythm::Every(_), Some(_)) => {
                Err(self.stays(schedule, "shorter than `every_ms`, with all of a burst"))
            }
            (Rhythm::At(times), Some(whole)) => {
                if times.windows(2).all(|pair| pair[0] + whole < pair[1]) {
                    return Ok(());
                }
                let given = schedule.at_ms.as_ref().map_or(&[][..], |times| times.as_slice());
                let allowed = "times that rise, with more than `for_ms` from one to the next";
                Err(self.value("at_ms", format!("{given:?}"), allowed.to_owned()))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::segment_file::{BurstTimes, RandomTimes, Times};

    fn of(from_to: (f64, Option<f64>), schedule: &Schedule) -> Result<Windows, FaultError> {
        let entry =
            FaultEntry { from_ms: Some(from_to.0), to_ms: from_to.1, ..FaultEntry::default() };
        windows("fault 1", &entry, schedule, Instant::ZERO, Seed(1).stream("windows"))
    }

    fn ms(windows: Windows) -> Vec<(u64, Option<u64>)> {
        let ms = |at: Instant| at.as_nanos() / 1_000_000;
        windows.take(6).map(|window| (ms(window.from), window.to.map(ms))).collect()
    }

    #[test]
    fn windows_follow_the_schedule() {
        let once = Schedule::default();
        assert_eq!(ms(of((5.0, None), &once).unwrap()), [(5, None)]);
        assert_eq!(ms(of((5.0, Some(9.0)), &once).unwrap()), [(5, Some(9))]);
        let stays = Schedule { for_ms: Some(20.0), ..Schedule::default() };
        assert_eq!(ms(of((5.0, None), &stays).unwrap()), [(5, Some(25))]);
        let at = Schedule { at_ms: Some(Times::Many(vec![0.0, 50.0])), ..stays.clone() };
        assert_eq!(ms(of((5.0, None), &at).unwrap()), [(5, Some(25)), (55, Some(75))]);
        let every = Schedule { every_ms: Some(100.0), ..stays.clone() };
        let expected = [(5, Some(25)), (105, Some(125)), (205, Some(210))];
        assert_eq!(ms(of((5.0, Some(210.0)), &every).unwrap()), expected, "its end is the end");
        let twice = Schedule { times: Some(2), ..every };
        assert_eq!(ms(of((5.0, None), &twice).unwrap()), expected[..2]);
        let burst = Some(BurstTimes { count: 3, every_ms: 30.0 });
        let bursts = Schedule { at_ms: Some(Times::Many(vec![0.0, 500.0])), burst, ..stays };
        let begins: Vec<u64> =
            ms(of((0.0, None), &bursts).unwrap()).into_iter().map(|window| window.0).collect();
        assert_eq!(begins, [0, 30, 60, 500, 530, 560]);
    }

    #[test]
    fn chance_has_its_mean() {
        let random = Some(RandomTimes { mean_ms: 100.0, for_ms: Some(20.0) });
        let schedule = Schedule { random, ..Schedule::default() };
        let all: Vec<Window> = of((0.0, None), &schedule).unwrap().take(2_000).collect();
        let end = all.last().and_then(|last| last.to).unwrap();
        let mean = end.as_nanos() as f64 / 2_000.0 / 1e6;
        assert!((110.0..130.0).contains(&mean), "{mean}");
        assert!(all.windows(2).all(|pair| pair[0].to.unwrap() < pair[1].from));
    }

    #[test]
    fn what_does_not_go_together_is_refused() {
        let some = |every_ms, for_ms| Schedule { every_ms, for_ms, ..Schedule::default() };
        let at = |times: &[f64], for_ms| Schedule {
            at_ms: Some(Times::Many(times.to_vec())),
            for_ms,
            ..Schedule::default()
        };
        let burst = Some(BurstTimes { count: 3, every_ms: 5.0 });
        for (schedule, expected) in [
            (some(Some(10.0), None), "`for_ms` is not given"),
            (some(Some(10.0), Some(10.0)), "shorter than `every_ms`"),
            (some(Some(-1.0), Some(10.0)), "`every_ms` is -1"),
            (at(&[5.0, 5.0], Some(1.0)), "times that rise"),
            (Schedule { every_ms: Some(9.0), ..at(&[5.0], Some(1.0)) }, "given beside `at_ms`"),
            (Schedule { burst, ..some(None, Some(6.0)) }, "shorter than `burst.every_ms`"),
            (Schedule { burst, ..some(Some(12.0), Some(4.0)) }, "with all of a burst"),
            (Schedule { times: Some(0), ..some(Some(9.0), Some(1.0)) }, "`times` is 0"),
        ] {
            let error = of((0.0, None), &schedule).unwrap_err().to_string();
            assert!(error.contains(expected), "{schedule:?}: {error}");
        }
    }
}
