//! Filter of the entries of the event log.

use linesman_link::unix_time::UnixTime;
use linesman_maindevice::watch::{EntryKind, Severity};

/// All conditions must hold; what is `None` or empty does not restrict.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Filter {
    /// Not before.
    pub since: Option<UnixTime>,
    /// Not after.
    pub until: Option<UnixTime>,
    /// At least this bad.
    pub severity: Option<Severity>,
    /// One of these.
    pub kinds: Vec<EntryKind>,
    /// SubDevice by number (from 1).
    pub device_no: Option<u32>,
    /// SubDevice by name.
    pub device_name: Option<String>,
    /// Of one run.
    pub run: Option<i64>,
    /// Words that the text holds, whatever their case.
    pub text: Option<String>,
    /// The newest so many.
    pub limit: Option<u32>,
}
