//! Entries of the synchronisation objects 0x1C32 (outputs) and 0x1C33 (inputs), in words.
//!
//! Reference: ETG.1020, synchronisation; S0 L496-534.

use super::{ObjectAddress, ObjectIndex, SyncTypes};
use crate::time::Span;

/// Time over which a counter counts.
const SINCE_START: &str = "since the device started";

/// The value of an entry in words; `None` for other objects, and where the number says all.
#[must_use]
pub fn in_words(object: ObjectAddress, value: u64) -> Option<String> {
    if !matches!(object.index, ObjectIndex::OUTPUT_SYNC | ObjectIndex::INPUT_SYNC) {
        return None;
    }
    match object.subindex {
        0x01 => mode(value).map(str::to_owned),
        SyncTypes::SUBINDEX => Some(SyncTypes(u16::try_from(value).ok()?).to_string()),
        0x02 | 0x03 | 0x05..=0x07 | 0x09 | 0x0A | 0x0F..=0x12 => Some(Span::ns(value).to_string()),
        0x08 => (value & 1 != 0).then(|| "it is measuring its own times".to_owned()),
        0x0B => counted(value, "cycles without fresh data in time"),
        0x0C => counted(value, "cycles in which it was not done with its work"),
        0x0D => counted(value, "cycles in which outputs were taken over late"),
        0x0E => counted(value, "cycles in which the same outputs came again"),
        0x20 if value != 0 => Some("it was out of step in recent cycles".to_owned()),
        _ => None,
    }
}

/// Entry 01.
const fn mode(value: u64) -> Option<&'static str> {
    match value {
        0x00 => Some("free run"),
        0x01 => Some("in step with its own frames"),
        0x02 => Some("in step with SYNC0"),
        0x03 => Some("in step with SYNC1"),
        0x22 => Some("in step with the frames of the outputs"),
        _ => None,
    }
}

fn counted(value: u64, what: &str) -> Option<String> {
    (value > 0).then(|| format!("{what}, {SINCE_START}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(subindex: u8, value: u64) -> Option<String> {
        let object = ObjectAddress { index: ObjectIndex::OUTPUT_SYNC, subindex };
        in_words(object, value)
    }

    // proves: SYN-21
    #[test]
    fn entries_of_the_synchronisation_objects_are_told_in_words() {
        assert_eq!(words(0x02, 0x0098_9680).as_deref(), Some("10 ms"));
        assert_eq!(words(0x05, 0x0002_49F0).as_deref(), Some("150 µs"));
        for (subindex, value, expected) in [
            (0x01, 0, "free run"),
            (0x01, 1, "in step with its own frames"),
            (0x01, 2, "in step with SYNC0"),
            (0x01, 3, "in step with SYNC1"),
            (0x01, 0x22, "in step with the frames of the outputs"),
            (0x03, 0, "0 ns"),
            (0x03, 35_600, "35.6 µs"),
            (0x04, 0x0807, "free run, in step with frames, with SYNC0, its delay is fixed"),
            (0x06, 12_000, "12 µs"),
            (0x07, 800, "800 ns"),
            (0x08, 1, "it is measuring its own times"),
            (0x09, 1_500, "1.5 µs"),
            (0x0A, 1_000_000, "1 ms"),
            (0x0B, 3, "cycles without fresh data in time, since the device started"),
            (0x0C, 1, "cycles in which it was not done with its work, since the device started"),
            (0x0D, 1, "cycles in which outputs were taken over late, since the device started"),
            (0x0E, 1, "cycles in which the same outputs came again, since the device started"),
            (0x12, 2_000, "2 µs"),
            (0x20, 1, "it was out of step in recent cycles"),
        ] {
            assert_eq!(words(subindex, value).as_deref(), Some(expected), "{subindex:#04X}");
        }
        for (subindex, value) in [(0x00, 32), (0x01, 7), (0x08, 0), (0x0B, 0), (0x13, 1), (0x20, 0)]
        {
            assert_eq!(words(subindex, value), None, "{subindex:#04X}");
        }
        let other = ObjectAddress { index: ObjectIndex(0x1C12), subindex: 2 };
        assert_eq!(in_words(other, 1), None);
    }
}
