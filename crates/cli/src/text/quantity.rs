//! Numbers with units, and dates, as people read them.

use linesman_link::unix_time::UnixTime;

/// A time since the start: `512 ns`, `3.250 ms`, `12.004 s`.
pub(crate) fn time(nanos: u64) -> String {
    match nanos {
        0..1_000 => format!("{nanos} ns"),
        1_000..1_000_000 => format!("{:.1} µs", nanos as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.3} ms", nanos as f64 / 1e6),
        _ => format!("{:.3} s", nanos as f64 / 1e9),
    }
}

/// A date of a report (RFC 3339) in the time zone of this host: `2026-03-01 11:16:50.182 +01:00`.
pub(crate) fn date(rfc3339: &str) -> String {
    UnixTime::parse(rfc3339).map_or_else(|| rfc3339.to_owned(), UnixTime::local)
}

/// A number with its digits in groups of three: `1,234,567`.
pub(crate) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// `1 frame`, `2 frames`.
pub(crate) fn count(number: u64, thing: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{} {thing}{plural}", grouped(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_easy_to_read() {
        assert_eq!(time(999), "999 ns");
        assert_eq!(time(3_250_000), "3.250 ms");
        assert_eq!(time(12_004_000_000), "12.004 s");
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(1_234_567), "1,234,567");
        assert_eq!(count(1, "frame"), "1 frame");
        assert_eq!(count(1000, "frame"), "1,000 frames");
    }
}
