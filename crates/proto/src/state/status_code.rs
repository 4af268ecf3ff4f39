//! AL status codes: what a SubDevice means by the number in 0x0134, and what to do about it.
//!
//! Read first: ETG.1020, AL status codes. The table is [`ALL`]; [`lookup`] answers for
//! every number, the unknown and the vendor's own included, since somebody stands before the
//! machine and waits.

use std::fmt;

mod table;

pub use table::ALL;

/// The number in the AL status code register, 0x0134.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Debug)]
pub struct AlStatusCode(pub u16);

impl AlStatusCode {
    /// The bare number.
    #[must_use]
    pub const fn value(self) -> u16 {
        self.0
    }

    /// What it means.
    #[must_use]
    pub fn explain(self) -> StatusCode {
        lookup(self.0)
    }
}

impl fmt::Display for AlStatusCode {
    /// Number and name: `0x001E invalid input configuration`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} {}", self.0, self.explain().name)
    }
}

/// Where the cause of a code usually lies.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Class {
    /// Supply, wiring, memory chip, sensor: something to measure or to replace.
    Hardware,
    /// The SubDevice's firmware, or the sequence in which a MainDevice asks.
    Software,
    /// Settings that do not fit the device, an unsupported cycle time included.
    Configuration,
    /// Jitter, clocks, missed deadlines, watchdog.
    Timing,
}

impl Class {
    /// The word of the diagnosis file format.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hardware => "hardware",
            Self::Software => "software",
            Self::Configuration => "configuration",
            Self::Timing => "timing",
        }
    }
}

impl fmt::Display for Class {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Whose word a code is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Origin {
    /// The specification names it.
    Standard,
    /// The manufacturer of the SubDevice gave it a meaning of its own (0x8000 and above).
    Vendor,
    /// Neither: the number is free or reserved in every table known here.
    Unknown,
}

/// All there is to say about one AL status code.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StatusCode {
    /// The number.
    pub code: AlStatusCode,
    /// The name of the specification, in lower case.
    pub name: &'static str,
    /// Whose word it is.
    pub origin: Origin,
    /// Where the cause usually lies.
    pub class: Class,
    /// At which transition, or in which state, it typically appears.
    pub occurs: &'static str,
    /// The usual cause, in one or two sentences.
    pub cause: &'static str,
    /// What to do, most promising first; each a sentence.
    pub actions: &'static [&'static str],
    /// Where the meaning comes from.
    pub reference: &'static str,
}

impl StatusCode {
    /// Whether the SubDevice says that something is wrong: everything but 0x0000.
    #[must_use]
    pub const fn is_error(&self) -> bool {
        self.code.0 != 0
    }
}

/// What an AL status code means. There is an answer for every number: codes from 0x8000 up are the
/// manufacturer's, others that no table names are said to be unknown.
#[must_use]
pub fn lookup(code: u16) -> StatusCode {
    let wanted = AlStatusCode(code);
    match ALL.binary_search_by_key(&wanted, |entry| entry.code) {
        Ok(index) => ALL[index],
        Err(_) if code >= 0x8000 => StatusCode { code: wanted, ..table::VENDOR_SPECIFIC },
        Err(_) => StatusCode { code: wanted, ..table::UNKNOWN },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_order_and_complete_in_every_entry() {
        assert!(ALL.is_sorted_by(|a, b| a.code < b.code), "codes out of order or twice");
        for entry in ALL.iter().chain([&table::UNKNOWN, &table::VENDOR_SPECIFIC]) {
            let code = entry.code;
            assert!(!entry.name.is_empty(), "{code}: no name");
            assert!(!entry.occurs.is_empty(), "{code}: no transition");
            assert!(entry.cause.ends_with('.'), "{code}: cause is no sentence");
            assert!(!entry.reference.is_empty(), "{code}: no reference");
            assert!(!entry.actions.is_empty(), "{code}: nothing to do");
            for action in entry.actions {
                assert!(action.ends_with('.') && action.len() > 15, "{code}: {action:?}");
            }
        }
    }

    // proves: SW-04 partial, SYN-30 partial
    #[test]
    fn the_codes_of_the_sources_have_ordered_advice() {
        // code, name, class, a word of the first and of a later action
        let table = [
            (0x0003, "invalid device setup", Class::Configuration, "slot", "object 0x1018"),
            (0x001D, "invalid output configuration", Class::Configuration, "SyncManager 2", "ESI"),
            (0x001E, "invalid input configuration", Class::Configuration, "SyncManager 3", "ESI"),
            (0x0035, "DC invalid sync cycle time", Class::Configuration, "0x1C32:05", "discrete"),
            (0x0036, "DC SYNC0 cycle time", Class::Configuration, "0x1C32:05", "discrete"),
            (0x0037, "DC SYNC1 cycle time", Class::Configuration, "0x1C32:05", "discrete"),
            (0x001A, "synchronization error", Class::Timing, "jitter", "capture"),
            (0x001B, "sync manager watchdog", Class::Timing, "task", "hardware errors"),
            (0x002C, "fatal sync error", Class::Timing, "reference clock", "capture"),
            (0x002D, "no sync error", Class::Timing, "by hand", "start time"),
            (0x0030, "invalid DC SYNC configuration", Class::Configuration, "by hand", "0x1C32"),
            (0x0032, "PLL error", Class::Timing, "jitter", "reference clock"),
            (0x0033, "DC sync IO error", Class::Hardware, "replace", "manufacturer"),
            (0x0034, "DC sync timeout", Class::Timing, "jitter", "capture"),
        ];
        for (code, name, class, first, later) in table {
            let entry = lookup(code);
            assert_eq!(entry.name, name, "{code:#06X}");
            assert_eq!(entry.class, class, "{name}");
            assert_eq!(entry.origin, Origin::Standard, "{name}");
            assert!(entry.actions.len() >= 3, "{name}: too little advice");
            assert!(entry.actions[0].contains(first), "{name}: first {:?}", entry.actions[0]);
            let rest = entry.actions[1..].join(" ");
            assert!(rest.contains(later), "{name}: {later:?} is not in {rest:?}");
        }
    }

    #[test]
    fn every_number_has_an_answer() {
        for code in 0..=u16::MAX {
            let entry = lookup(code);
            assert_eq!(entry.code, AlStatusCode(code));
            assert!(!entry.actions.is_empty());
        }
        assert_eq!(lookup(0x8001).origin, Origin::Vendor);
        assert_eq!(lookup(0x0009).origin, Origin::Unknown);
        assert!(!lookup(0).is_error());
    }

    // proves: SW-01 partial
    #[test]
    fn a_code_is_written_with_its_name() {
        assert_eq!(AlStatusCode(0x001E).to_string(), "0x001E invalid input configuration");
        assert_eq!(AlStatusCode(0x9001).to_string(), "0x9001 vendor-specific code");
        assert_eq!(AlStatusCode::INVALID_REQUESTED_STATE_CHANGE.value(), 0x0011);
    }
}
