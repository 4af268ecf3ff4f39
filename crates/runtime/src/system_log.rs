//! The log of the system (SW-07): what happens on a line, told to journald, where all of a machine's logs
//! come together, are kept, filtered and exported after the program has ended.
//!
//! `journalctl SYSLOG_IDENTIFIER=linesman`, and of one SubDevice
//! `journalctl SYSLOG_IDENTIFIER=linesman LINESMAN_DEVICE=4`. Reference: systemd.journal-fields(7).

use std::io;

use linesman_maindevice::watch::{LogEntry, Severity};
use log::{Level, Record};
use systemd_journal_logger::JournalLog;

/// The name by which entries are found.
const IDENTIFIER: &str = "linesman";

/// The way to the system's log.
pub struct SystemLog {
    journal: JournalLog,
    line: String,
    /// Entries that it did not take, and why the last one was not taken.
    lost: Option<(u64, io::Error)>,
}

impl SystemLog {
    /// Opens it for what happens on a line.
    ///
    /// # Errors
    /// Where there is no journald.
    pub fn open(line: &str) -> io::Result<Self> {
        let journal = JournalLog::empty()?.with_syslog_identifier(IDENTIFIER.to_owned());
        Ok(Self { journal, line: line.to_owned(), lost: None })
    }

    /// Hands an entry over. It is sent at once; a journal that does not take it costs the entry, which is
    /// counted.
    pub fn write(&mut self, entry: &LogEntry, device_name: Option<&str>) {
        let level = match entry.severity {
            Severity::Error => Level::Error,
            Severity::Warning => Level::Warn,
            Severity::Info => Level::Info,
        };
        let no = entry.device.map(|id| id.no().to_string()).unwrap_or_default();
        let at = entry.at.as_nanos().to_string();
        let mut fields: Vec<(&str, &str)> = vec![
            ("LINESMAN_LINE", &self.line),
            ("LINESMAN_KIND", entry.kind.name()),
            ("LINESMAN_TIME_NS", &at),
        ];
        if entry.device.is_some() {
            fields.push(("LINESMAN_DEVICE", &no));
            fields.extend(device_name.map(|name| ("LINESMAN_DEVICE_NAME", name)));
        }
        let sent = self.journal.journal_send(
            &Record::builder()
                .level(level)
                .target(IDENTIFIER)
                .args(format_args!("{}", entry.text))
                .key_values(&fields.as_slice())
                .build(),
        );
        if let Err(error) = sent {
            let lost = self.lost.as_ref().map_or(0, |(lost, _)| *lost);
            self.lost = Some((lost + 1, error));
        }
    }

    /// How many entries it did not take, and why; `None` when it took all.
    #[must_use]
    pub fn lost(&self) -> Option<(u64, &io::Error)> {
        self.lost.as_ref().map(|(count, why)| (*count, why))
    }
}
