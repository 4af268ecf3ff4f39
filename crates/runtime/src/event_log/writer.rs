//! The thread that writes the event log.
//!
//! Whoever runs a network hands entries over and goes on: nothing here ever waits for the disk on
//! the caller's thread. While the file cannot be written, entries are kept and tried again; when too
//! many wait, the oldest are dropped and counted.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use linesman_link::unix_time::UnixTime;
use linesman_maindevice::watch::LogEntry;

use super::super::part::guard;
use super::super::watched_file::WatchedFile;
use super::store::{EventLog, EventLogError, LoggedFinding, StoredEntry};

/// So many entries may be on their way to the thread.
const ON_THE_WAY: usize = 4_096;
/// So many are kept while the file cannot be written.
const KEPT: usize = 100_000;
/// How long entries are gathered, so that a burst is one transaction.
const GATHER: Duration = Duration::from_millis(100);
/// How long to wait after a failure.
const RETRY: Duration = Duration::from_secs(1);

/// How the writing went.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct WriterReport {
    /// Entries in the file.
    pub written: u64,
    /// Entries that are lost, because the file could not be written for too long.
    pub dropped: u64,
    /// The last failure, if it still fails.
    pub failure: Option<String>,
}

enum WriterOrder {
    Entry(Box<StoredEntry>),
    End(UnixTime),
}

/// A run that is being logged.
#[derive(Debug)]
pub struct EventLogWriter {
    run: i64,
    orders: SyncSender<WriterOrder>,
    thread: Option<JoinHandle<()>>,
    report: Arc<Mutex<WriterReport>>,
}

impl EventLogWriter {
    /// Begins a run in a log, and a thread that writes to it.
    ///
    /// # Errors
    /// When the run cannot be noted; a later failure is told by [`report`](Self::report).
    pub fn start(
        mut log: EventLog,
        started: UnixTime,
        line: &str,
        project: &str,
        tool: &str,
    ) -> Result<Self, EventLogError> {
        let run = log.begin(started, line, project, tool)?;
        let (orders, receiver) = sync_channel(ON_THE_WAY);
        let report = Arc::new(Mutex::new(WriterReport::default()));
        let shared = Arc::clone(&report);
        let (path, file) = (log.path().to_owned(), WatchedFile::at(log.path()));
        let thread = thread::Builder::new().name("event-log".into()).spawn(move || {
            let report = Arc::clone(&shared);
            let log_thread = LogThread { log, run, file, waiting: VecDeque::new(), report };
            let worked =
                guard("the event log", "nothing more is logged", || log_thread.work(&receiver));
            if let Err(failure) = worked {
                lock(&shared).failure = Some(failure.to_string());
            }
        });
        let thread = Some(thread.map_err(|source| EventLogError::Thread { path, source })?);
        Ok(Self { run, orders, thread, report })
    }

    /// Number of the run in the file.
    #[must_use]
    pub fn run(&self) -> i64 {
        self.run
    }

    /// Hands an entry over, and the finding that it is about; never waits.
    pub fn write(
        &self,
        at: UnixTime,
        entry: LogEntry,
        device_name: Option<&str>,
        finding: Option<LoggedFinding>,
    ) {
        let LogEntry { severity, kind, device, text, .. } = entry;
        let (device_no, device_name) = (device.map(|id| id.no()), device_name.map(str::to_owned));
        let run = self.run;
        let entry = StoredEntry { run, at, severity, kind, device_no, device_name, text, finding };
        match self.orders.try_send(WriterOrder::Entry(Box::new(entry))) {
            Ok(()) => {}
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {
                lock(&self.report).dropped += 1;
            }
        }
    }

    /// How it goes.
    #[must_use]
    pub fn report(&self) -> WriterReport {
        lock(&self.report).clone()
    }

    /// Writes what is left, notes the end of the run, and ends the thread.
    pub fn finish(mut self, ended: UnixTime) -> WriterReport {
        // The thread may be gone; then the report says what is lost.
        let _ = self.orders.send(WriterOrder::End(ended));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        self.report()
    }
}

struct LogThread {
    log: EventLog,
    run: i64,
    file: WatchedFile,
    waiting: VecDeque<StoredEntry>,
    report: Arc<Mutex<WriterReport>>,
}

impl LogThread {
    fn work(mut self, orders: &Receiver<WriterOrder>) {
        let mut pause = GATHER;
        loop {
            match orders.recv_timeout(pause) {
                Ok(WriterOrder::Entry(entry)) => {
                    self.keep(*entry);
                    // Gather what comes with it.
                    while let Ok(order) = orders.try_recv() {
                        match order {
                            WriterOrder::Entry(entry) => self.keep(*entry),
                            WriterOrder::End(ended) => return self.end(Some(ended)),
                        }
                    }
                    if pause == RETRY {
                        continue;
                    }
                    pause = self.flush();
                }
                Ok(WriterOrder::End(ended)) => return self.end(Some(ended)),
                Err(RecvTimeoutError::Timeout) => pause = self.flush(),
                Err(RecvTimeoutError::Disconnected) => return self.end(None),
            }
        }
    }

    fn keep(&mut self, entry: StoredEntry) {
        if self.waiting.len() == KEPT {
            self.waiting.pop_front();
            lock(&self.report).dropped += 1;
        }
        self.waiting.push_back(entry);
    }

    /// Writes what waits; says how long to wait before the next time.
    fn flush(&mut self) -> Duration {
        // What is written to a file that was removed is lost without an error.
        if let Err(source) = self.file.check() {
            let path = self.file.path().to_owned();
            lock(&self.report).failure = Some(EventLogError::Gone { path, source }.to_string());
            return RETRY;
        }
        if self.waiting.is_empty() {
            return GATHER;
        }
        let result = self.log.append(self.waiting.make_contiguous());
        let mut report = lock(&self.report);
        match result {
            Ok(()) => {
                report.written += self.waiting.len() as u64;
                report.failure = None;
                self.waiting.clear();
                GATHER
            }
            Err(error) => {
                report.failure = Some(error.to_string());
                RETRY
            }
        }
    }

    fn end(mut self, ended: Option<UnixTime>) {
        self.flush();
        lock(&self.report).dropped += self.waiting.len() as u64;
        if self.file.check().is_ok()
            && let Some(ended) = ended
            && let Err(error) = self.log.end(self.run, ended)
        {
            lock(&self.report).failure = Some(error.to_string());
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use linesman_maindevice::watch::{EntryKind, Severity};
    use linesman_proto::address::DeviceId;
    use linesman_proto::time::Instant;

    use super::*;
    use crate::event_log::Filter;

    fn entry(text: String) -> LogEntry {
        LogEntry {
            at: Instant::ZERO,
            severity: Severity::Error,
            kind: EntryKind::State,
            device: Some(DeviceId(4)),
            text,
        }
    }

    #[test]
    fn what_was_handed_over_is_in_the_file_at_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.sqlite");
        let log = EventLog::create(&path).unwrap();
        let writer =
            EventLogWriter::start(log, UnixTime::EPOCH, "eth0", "plant", "linesman 1").unwrap();
        for number in 0..3_000 {
            let at = UnixTime::from_nanos(number);
            writer.write(at, entry(format!("entry {number}")), Some("Term 5"), None);
        }
        let report = writer.finish(UnixTime::from_nanos(9_999));
        assert_eq!(report, WriterReport { written: 3_000, dropped: 0, failure: None });
        let log = EventLog::open(&path).unwrap();
        let entries = log.entries(&Filter::default()).unwrap();
        assert_eq!(entries.len(), 3_000);
        assert_eq!(entries[7].text, "entry 7");
        assert_eq!(entries[7].device_no, Some(5));
        assert_eq!(log.runs().unwrap()[0].ended, Some(UnixTime::from_nanos(9_999)));
    }

    #[test]
    fn a_file_that_cannot_be_written_any_more_costs_entries_and_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.sqlite");
        let log = EventLog::create(&path).unwrap();
        let writer =
            EventLogWriter::start(log, UnixTime::EPOCH, "eth0", "plant", "linesman 1").unwrap();
        // Somebody takes the table away.
        let other = rusqlite::Connection::open(&path).unwrap();
        other.execute_batch("DROP TABLE entry").unwrap();
        for number in 0..10 {
            writer.write(
                UnixTime::from_nanos(number),
                entry(format!("entry {number}")),
                None,
                None,
            );
        }
        let report = writer.finish(UnixTime::from_nanos(9_999));
        assert_eq!((report.written, report.dropped), (0, 10));
        assert!(report.failure.unwrap().contains("no such table"), "says why");
    }
}
