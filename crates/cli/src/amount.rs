//! Durations and counts on the command line: `2s`, `500ms`, `10k`.
//!
//! A plain number has the unit that the option had before it took any.

use linesman_proto::time::Span;

/// Units of time with their length in ns, the longest words first.
const UNITS: [(&str, u64); 14] = [
    ("hours", 3_600_000_000_000),
    ("hour", 3_600_000_000_000),
    ("days", 86_400_000_000_000),
    ("day", 86_400_000_000_000),
    ("min", 60_000_000_000),
    ("ns", 1),
    ("us", 1_000),
    ("µs", 1_000),
    ("μs", 1_000),
    ("ms", 1_000_000),
    ("s", 1_000_000_000),
    ("m", 60_000_000_000),
    ("h", 3_600_000_000_000),
    ("d", 86_400_000_000_000),
];
/// Multiples of counts.
const MULTIPLES: [(&str, u64); 4] =
    [("k", 1_000), ("K", 1_000), ("M", 1_000_000), ("G", 1_000_000_000)];

/// The length of a second, the unit of most options.
pub(crate) const SECOND: Span = Span::s(1);
/// That of a millisecond.
pub(crate) const MILLISECOND: Span = Span::ms(1);
/// That of a microsecond.
pub(crate) const MICROSECOND: Span = Span::us(1);
/// Longest time that a command may be told to last.
pub(crate) const LONGEST: Span = Span::s(1_000_000_000);

/// Reads durations between two, where a plain number counts `plain`.
pub(crate) fn duration(
    plain: Span,
    least: Span,
    most: Span,
) -> impl Fn(&str) -> Result<Span, String> + Clone + Send + Sync + 'static {
    move |text| {
        let wrong = || {
            format!(
                "expected a time such as 2s, 500ms, 10us or 5m; a plain number is in {}",
                unit(plain)
            )
        };
        let span = span(text, plain).ok_or_else(wrong)?;
        match (least..=most).contains(&span) {
            true => Ok(span),
            false => Err(format!("expected {} to {}", short(least), short(most))),
        }
    }
}

/// How long a command lasts: seconds unless said.
pub(crate) fn lasting() -> impl Fn(&str) -> Result<Span, String> + Clone + Send + Sync + 'static {
    duration(SECOND, Span::ZERO, LONGEST)
}

/// A cycle time: microseconds unless said.
pub(crate) fn cycle() -> impl Fn(&str) -> Result<Span, String> + Clone + Send + Sync + 'static {
    duration(MICROSECOND, Span::us(1), Span::s(10))
}

/// Reads counts between two.
pub(crate) fn count(
    least: u64,
    most: u64,
) -> impl Fn(&str) -> Result<u64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number = number_of_things(text);
        let number = number.ok_or("expected a number such as 1000, 10k or 1M")?;
        match (least..=most).contains(&number) {
            true => Ok(number),
            false => Err(format!("expected {least} to {most}")),
        }
    }
}

/// The time that a text says; `None` when it says none.
pub(crate) fn span(text: &str, plain: Span) -> Option<Span> {
    let text = text.trim();
    let unit = UNITS.iter().find_map(|(word, nanos)| Some((text.strip_suffix(word)?, *nanos)));
    let (digits, nanos) = unit.unwrap_or((text, plain.as_nanos()));
    scaled(digits.trim(), nanos).map(Span::ns)
}

/// The count that a text says; `None` when it says none.
pub(crate) fn number_of_things(text: &str) -> Option<u64> {
    let text = text.trim();
    let unit = MULTIPLES.iter().find_map(|(word, times)| Some((text.strip_suffix(word)?, *times)));
    let (digits, times) = unit.unwrap_or((text, 1));
    scaled(&digits.replace('_', ""), times)
}

/// A number with at most a fraction, so many times: exact, and whole in the end.
fn scaled(digits: &str, times: u64) -> Option<u64> {
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let is_number = |text: &str| text.bytes().all(|letter| letter.is_ascii_digit());
    if whole.is_empty() || !is_number(whole) || !is_number(fraction) {
        return None;
    }
    let mut sum = whole.parse::<u64>().ok()?.checked_mul(times)?;
    let mut part = times;
    for digit in fraction.bytes() {
        part /= 10;
        sum = sum.checked_add(part * u64::from(digit - b'0'))?;
    }
    // Half a thing is none.
    (fraction.is_empty() || times > 1).then_some(sum)
}

const fn unit(plain: Span) -> &'static str {
    match plain.as_nanos() {
        1_000 => "microseconds",
        1_000_000 => "milliseconds",
        _ => "seconds",
    }
}

/// The shortest way to write a limit: `20ms`, `24h`.
fn short(span: Span) -> String {
    let nanos = span.as_nanos();
    let units = [("h", 3_600_000_000_000), ("s", 1_000_000_000), ("ms", 1_000_000), ("us", 1_000)];
    let fitting = units.into_iter().find(|(_, unit)| nanos >= *unit && nanos.is_multiple_of(*unit));
    fitting.map_or_else(|| nanos.to_string(), |(word, unit)| format!("{}{word}", nanos / unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_and_without_a_unit() {
        for (text, expected) in [
            ("5", Some(Span::s(5))),
            ("0.7", Some(Span::ms(700))),
            ("2s", Some(Span::s(2))),
            ("500ms", Some(Span::ms(500))),
            ("10us", Some(Span::us(10))),
            ("10µs", Some(Span::us(10))),
            ("1 ms", Some(Span::ms(1))),
            ("1m", Some(Span::s(60))),
            ("1.5min", Some(Span::s(90))),
            ("2h", Some(Span::s(7_200))),
            ("1d", Some(Span::s(86_400))),
            ("7ns", Some(Span::ns(7))),
            ("", None),
            ("s", None),
            ("-1", None),
            ("1e3", None),
            ("2x", None),
            ("1.2.3", None),
            ("NaN", None),
            ("99999999999999999999", None),
            ("99999999999999d", None),
        ] {
            assert_eq!(span(text, SECOND), expected, "{text}");
        }
        assert_eq!(span("500", MILLISECOND), Some(Span::ms(500)));
    }

    #[test]
    fn counts_are_read_with_multiples() {
        for (text, expected) in [
            ("7", Some(7)),
            ("10k", Some(10_000)),
            ("1.5k", Some(1_500)),
            ("1M", Some(1_000_000)),
            ("1_000", Some(1_000)),
            ("1.5", None),
            ("k", None),
            ("10m", None),
        ] {
            assert_eq!(number_of_things(text), expected, "{text}");
        }
    }

    #[test]
    fn what_is_out_of_range_is_told_with_the_range() {
        let every = duration(MILLISECOND, Span::ms(10), Span::s(3_600));
        assert_eq!(every("1s"), Ok(Span::s(1)));
        assert_eq!(every("1ms").unwrap_err(), "expected 10ms to 1h");
        let words =
            "expected a time such as 2s, 500ms, 10us or 5m; a plain number is in milliseconds";
        assert_eq!(every("soon").unwrap_err(), words);
        assert_eq!(count(1, 100)("1k").unwrap_err(), "expected 1 to 100");
        assert!(count(1, 100)("many").unwrap_err().contains("10k"));
    }
}
