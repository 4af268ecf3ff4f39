//! Times as logs write them.

use jiff::civil::{Date as Day, DateTime, Time};

use crate::observation_file::Date;

/// A time by one of the clocks that logs use.
#[derive(Clone, Copy, PartialEq, PartialOrd, Debug)]
pub(super) enum Stamp {
    /// Seconds since the computer was started.
    Uptime(f64),
    /// By the clock on the wall.
    Date(Date),
    /// By the clock on the wall, without a year: seconds since some new year.
    Yearless(f64),
}

impl Stamp {
    /// How many seconds later than another one of the same clock.
    pub(super) fn since(self, other: Self) -> Option<f64> {
        match (self, other) {
            (Self::Uptime(one), Self::Uptime(other))
            | (Self::Yearless(one), Self::Yearless(other)) => Some(one - other),
            (Self::Date(one), Self::Date(other)) => Some(one.ns_since(other) as f64 / 1e9),
            (Self::Uptime(_) | Self::Date(_) | Self::Yearless(_), _) => None,
        }
    }
}

/// The time at the begin of a log line, and the rest of it. Where both clocks stand there, that of the kernel
/// counts.
pub(super) fn at_begin(line: &str) -> (Option<Stamp>, &str) {
    let line = line.trim_start();
    if let Some((stamp, rest)) = bracketed(line) {
        return (Some(stamp), rest);
    }
    let Some((stamp, rest)) = dated(line).or_else(|| syslog(line)) else { return (None, line) };
    // `host kernel: [ 12.5] EtherCAT …`
    let inner = rest.find('[').and_then(|at| bracketed(&rest[at..]));
    match inner {
        Some((inner @ Stamp::Uptime(_), rest)) => (Some(inner), rest),
        Some(_) | None => (Some(stamp), rest),
    }
}

/// `[ 2836.962165] …` or `[Tue Jun 17 17:52:43 2025] …`.
fn bracketed(text: &str) -> Option<(Stamp, &str)> {
    let (inside, rest) = text.strip_prefix('[')?.split_once(']')?;
    let inside = inside.trim();
    if let Ok(seconds) = inside.parse::<f64>()
        && (0.0..1e9).contains(&seconds)
        && inside.starts_with(|one: char| one.is_ascii_digit())
    {
        return Some((Stamp::Uptime(seconds), rest));
    }
    let mut words = inside.split_whitespace();
    let (_, month, day, time, year) =
        (words.next()?, words.next()?, words.next()?, words.next()?, words.next()?);
    let day = Day::new(year.parse().ok()?, month_of(month)?, day.parse().ok()?).ok()?;
    Some((Stamp::Date(Date(DateTime::from_parts(day, time.parse().ok()?))), rest))
}

/// `2026-11-20T10:00:00.123456+01:00 …` or `2026-11-20 10:00:00 …`.
fn dated(text: &str) -> Option<(Stamp, &str)> {
    let mut ends = text.match_indices([' ', '\t']).map(|(at, _)| at).take(2).collect::<Vec<_>>();
    ends.push(text.len());
    let year = text.as_bytes().get(..4).filter(|_| text.len() > 8);
    let starts_with_year = year.is_some_and(|year| year.iter().all(u8::is_ascii_digit));
    if !starts_with_year {
        return None;
    }
    ends.into_iter().rev().find_map(|end| {
        let stamp = text.get(..end)?;
        Some((Stamp::Date(date(stamp)?), &text[end..]))
    })
}

/// `Nov 20 10:00:00 host …`.
fn syslog(text: &str) -> Option<(Stamp, &str)> {
    let mut words = text.split_whitespace();
    let (month, day, time) = (words.next()?, words.next()?, words.next()?);
    let day = Day::new(2000, month_of(month)?, day.parse().ok()?).ok()?;
    let time: Time = time.parse().ok()?;
    let begin = Day::new(2000, 1, 1).ok()?;
    let since = DateTime::from_parts(day, time)
        .duration_since(DateTime::from_parts(begin, Time::midnight()));
    let end = text.find(words.next()?)?;
    Some((Stamp::Yearless(since.as_secs_f64()), &text[end..]))
}

fn month_of(name: &str) -> Option<i8> {
    const NAMES: [&str; 12] =
        ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];
    let at = NAMES.iter().position(|known| known.eq_ignore_ascii_case(name))?;
    i8::try_from(at + 1).ok()
}

/// A date with time in a cell of its own, as lists of vendors write it: `24/07/2015 10:36:32 840 ms`,
/// `20.11.2026 10:00:00.123`, `2026-11-20 10:00:00`, `11/20/2026 10:36:32 PM`.
pub(super) fn date(text: &str) -> Option<Date> {
    let text = text.trim();
    // `+0100` is an offset, too.
    let offset = text.len().checked_sub(5).and_then(|at| text.split_at_checked(at));
    let offset = offset.filter(|(time, offset)| {
        time.contains('T') && offset.starts_with(['+', '-']) && offset.is_ascii()
    });
    let with_colon =
        offset.map(|(time, offset)| format!("{time}{}:{}", &offset[..3], &offset[3..]));
    if let Some(date) = Date::read(with_colon.as_deref().unwrap_or(text)) {
        return Some(date);
    }
    let mut words = text.split_whitespace();
    let (day, time) = (words.next()?, words.next()?);
    let parts: Vec<i16> =
        day.split(['/', '.', '-']).map(|part| part.parse().ok()).collect::<Option<_>>()?;
    let [one, two, three] = parts[..] else { return None };
    let (year, month, day) = if one > 31 {
        (one, two, three)
    } else if two > 12 {
        (three, one, two)
    } else {
        (three, two, one)
    };
    let year = if year < 100 { year + 2000 } else { year };
    let day = Day::new(year, i8::try_from(month).ok()?, i8::try_from(day).ok()?).ok()?;
    let mut time: Time = time.trim_end_matches([',', ';']).replace(',', ".").parse().ok()?;
    for word in words {
        if word.eq_ignore_ascii_case("pm") && time.hour() < 12 {
            time = time.checked_add(jiff::SignedDuration::from_hours(12)).ok()?;
        } else if let Ok(millis @ 0..=999) = word.parse::<i64>() {
            time = time.checked_add(jiff::SignedDuration::from_millis(millis)).ok()?;
        } else if !["ms", "am", "pm"].contains(&word.to_ascii_lowercase().as_str()) {
            // A date with something behind it is no date.
            return None;
        }
    }
    Some(Date(DateTime::from_parts(day, time)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str) -> Date {
        Date::read(text).unwrap()
    }

    #[test]
    fn begins_of_log_lines_are_told_from_what_they_say() {
        let rows = [
            ("[ 2836.962165] EtherCAT 0: a", Some(Stamp::Uptime(2836.962165)), "EtherCAT 0: a"),
            (
                "[Tue Jun 17 17:52:43 2025] EtherCAT 0: a",
                Some(Stamp::Date(at("2025-06-17T17:52:43"))),
                "EtherCAT 0: a",
            ),
            (
                "2025-06-17T17:52:43.5+02:00 box kernel: EtherCAT 0: a",
                Some(Stamp::Date(at("2025-06-17T15:52:43.5"))),
                "box kernel: EtherCAT 0: a",
            ),
            (
                "2025-06-17T17:52:43+0200 box kernel: EtherCAT 0: a",
                Some(Stamp::Date(at("2025-06-17T15:52:43"))),
                "box kernel: EtherCAT 0: a",
            ),
            (
                "Jan  2 00:00:01 box kernel: [  12.5] EtherCAT 0: a",
                Some(Stamp::Uptime(12.5)),
                "EtherCAT 0: a",
            ),
            (
                "Jan  2 00:00:01 box kernel: EtherCAT 0: a",
                Some(Stamp::Yearless(86_401.0)),
                "box kernel: EtherCAT 0: a",
            ),
            ("EtherCAT 0: a", None, "EtherCAT 0: a"),
            ("[none] a", None, "[none] a"),
            ("[nan] a", None, "[nan] a"),
        ];
        for (line, stamp, rest) in rows {
            let (read, left) = at_begin(line);
            assert_eq!((read, left.trim()), (stamp, rest), "{line}");
        }
    }

    #[test]
    fn dates_of_lists_are_read() {
        for (text, expected) in [
            ("24/07/2015 10:36:32 840 ms", "2015-07-24T10:36:32.840"),
            ("20.11.2026 10:00:00.123", "2026-11-20T10:00:00.123"),
            ("20.11.2026 10:00:00,123", "2026-11-20T10:00:00.123"),
            ("11/20/2026 10:36:32 PM 5 ms", "2026-11-20T22:36:32.005"),
            ("2026-11-20 10:00:00", "2026-11-20T10:00:00"),
        ] {
            assert_eq!(date(text), Some(at(expected)), "{text}");
        }
        for text in [
            "",
            "20.11.2026 10:00:00 x",
            "10:00:00",
            "32.13.2026 10:00:00",
            "a/b/c 10:00:00",
            "20.11.2026 25:00:00",
        ] {
            assert_eq!(date(text), None, "{text}");
        }
    }
}
