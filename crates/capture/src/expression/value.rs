//! Values of an expression: numbers, times, addresses, commands, names.

use linesman_proto::command::Command;

/// Kind of the values of a field.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ValueKind {
    /// There is nothing to compare: the field is there or not.
    Presence,
    /// 0 or 1.
    Boolean,
    /// 8 bits.
    Number8,
    /// 16 bits.
    Number16,
    /// 32 bits.
    Number32,
    /// 16 bits, written in hexadecimal.
    Hex16,
    /// 32 bits, written in hexadecimal.
    Hex32,
    /// 64 bits.
    Number64,
    /// Seconds with a fraction; kept in ns.
    Seconds,
    /// A hardware address.
    Mac,
    /// A command, by number or name.
    Command,
    /// A SubDevice, by number or name.
    SubDevice,
}

impl ValueKind {
    /// The expected value in words.
    #[must_use]
    pub const fn expected(self) -> &'static str {
        match self {
            Self::Presence => "no value: the field is there or not",
            Self::Boolean => "0 or 1",
            Self::Number8 => "a number, 0 to 255",
            Self::Number16 | Self::Hex16 => "a number, 0 to 65535",
            Self::Number32 | Self::Hex32 => "a number, 0 to 4294967295",
            Self::Number64 => "a number of 64 bits",
            Self::Seconds => "seconds, such as 0.002, or a number with a unit, such as 2ms",
            Self::Mac => "a hardware address, such as 02:00:00:00:00:01",
            Self::Command => "a command, by number (0x0c) or name (\"LRW\")",
            Self::SubDevice => {
                "a SubDevice: its number, \"name\", \"type\", station address 0x1003 or \"alias:7\""
            }
        }
    }

    /// The largest value.
    #[must_use]
    const fn most(self) -> i128 {
        match self {
            Self::Presence => -1,
            Self::Boolean => 1,
            Self::Number8 | Self::Command => u8::MAX as i128,
            Self::Number16 | Self::Hex16 | Self::SubDevice => u16::MAX as i128,
            Self::Number32 | Self::Hex32 => u32::MAX as i128,
            Self::Number64 => u64::MAX as i128,
            Self::Mac => 0xFFFF_FFFF_FFFF,
            Self::Seconds => i128::MAX,
        }
    }

    /// The value that a word means; `None` when it means none. Words of SubDevices are found later.
    #[must_use]
    pub fn value(self, word: &str) -> Option<i128> {
        let value = match self {
            Self::Presence => None,
            Self::Boolean if word.eq_ignore_ascii_case("true") => Some(1),
            Self::Boolean if word.eq_ignore_ascii_case("false") => Some(0),
            Self::Seconds => nanoseconds(word),
            Self::Mac => mac(word),
            Self::Command => number(word).or_else(|| command(word)),
            Self::Boolean
            | Self::Number8
            | Self::Number16
            | Self::Number32
            | Self::Hex16
            | Self::Hex32
            | Self::Number64
            | Self::SubDevice => number(word),
        };
        value.filter(|value| *value <= self.most())
    }
}

impl ValueKind {
    /// A value as an expression names it.
    #[must_use]
    pub fn write(self, value: i128) -> String {
        match self {
            Self::Hex16 => format!("{value:#06x}"),
            Self::Hex32 => format!("{value:#010x}"),
            Self::Command => match u8::try_from(value).ok().and_then(Command::from_code) {
                Some(command) => format!("\"{}\"", command.name()),
                None => value.to_string(),
            },
            Self::Mac => {
                let byte = |index: u32| value >> (40 - 8 * index) & 0xFF;
                (0..6).map(|index| format!("{:02x}", byte(index))).collect::<Vec<_>>().join(":")
            }
            Self::Seconds => {
                let sign = if value < 0 { "-" } else { "" };
                let (whole, nanos) = (value.abs() / 1_000_000_000, value.abs() % 1_000_000_000);
                format!("{sign}{whole}.{nanos:09}")
            }
            Self::Presence
            | Self::Boolean
            | Self::Number8
            | Self::Number16
            | Self::Number32
            | Self::Number64
            | Self::SubDevice => value.to_string(),
        }
    }
}

/// A number as C and Wireshark write it: 0x for 16, 0b for 2, a leading 0 for 8.
pub(super) fn number(word: &str) -> Option<i128> {
    let lower = word.to_ascii_lowercase();
    let (digits, radix) = if let Some(hex) = lower.strip_prefix("0x") {
        (hex, 16)
    } else if let Some(binary) = lower.strip_prefix("0b") {
        (binary, 2)
    } else if lower.len() > 1 && lower.starts_with('0') {
        (&lower[1..], 8)
    } else {
        (lower.as_str(), 10)
    };
    // A sign is none of its digits.
    let is_plain = digits.bytes().all(|byte| byte.is_ascii_alphanumeric());
    if !is_plain { None } else { i128::from_str_radix(digits, radix).ok() }
}

/// Seconds, or a number with a unit, in ns.
pub(super) fn nanoseconds(word: &str) -> Option<i128> {
    let word = word.replace('µ', "u");
    let units = [("ns", 0), ("us", 3), ("ms", 6), ("s", 9)];
    let unit = units.iter().find_map(|(unit, digits)| Some((word.strip_suffix(unit)?, *digits)));
    let (text, digits) = unit.unwrap_or((&word, 9_usize));
    let (sign, text) = match text.strip_prefix('-') {
        Some(text) => (-1, text),
        None => (1, text),
    };
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let are_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty() && fraction.is_empty() || !are_digits(whole) || !are_digits(fraction) {
        return None;
    }
    // What is finer than a nanosecond is cut off.
    let fraction = &fraction[..fraction.len().min(digits)];
    let padded = format!("{whole}{fraction:0<digits$}");
    padded.parse::<i128>().ok().map(|nanos| sign * nanos)
}

fn mac(word: &str) -> Option<i128> {
    let parts: Vec<&str> = word.split([':', '-']).collect();
    if parts.len() != 6 || parts.iter().any(|part| part.is_empty() || part.len() > 2) {
        return None;
    }
    parts.iter().try_fold(0, |address, part| {
        Some(address << 8 | i128::from(u8::from_str_radix(part, 16).ok()?))
    })
}

fn command(word: &str) -> Option<i128> {
    let mut all = Command::ALL.iter();
    let found = all.find(|command| command.name().eq_ignore_ascii_case(word))?;
    Some(i128::from(found.code()))
}
