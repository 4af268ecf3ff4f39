//! The file of the event log.
//!
//! SQLite with a write-ahead log: one writes, others read at the same time, and a program that is
//! killed loses at most what it had not handed over.

use std::path::{Path, PathBuf};
use std::time::Duration;

use linesman_link::unix_time::UnixTime;
use linesman_maindevice::watch::{EntryKind, Severity};
use rusqlite::types::Value;
use rusqlite::{Connection, ErrorCode, OpenFlags, Row, params_from_iter};

use serde::{Deserialize, Serialize};

use super::filter::Filter;

/// Version of the tables; a file of another one is refused rather than guessed at.
const VERSION: i32 = 2;
/// The first version; it has no findings, and is read as it is.
const WITHOUT_FINDINGS: i32 = 1;
/// How long another writer is waited for.
const PATIENCE: Duration = Duration::from_secs(2);
/// Marks the file as ours (`PRAGMA application_id`): "LMLG".
const APPLICATION: i32 = 0x4C4D_4C47;

const TABLES: &str = "
    CREATE TABLE run (
        id INTEGER PRIMARY KEY,
        started_ns INTEGER NOT NULL,
        ended_ns INTEGER,
        line TEXT NOT NULL,
        project TEXT NOT NULL,
        tool TEXT NOT NULL
    );
    CREATE TABLE entry (
        id INTEGER PRIMARY KEY,
        run INTEGER NOT NULL REFERENCES run(id),
        at_ns INTEGER NOT NULL,
        severity INTEGER NOT NULL,
        kind TEXT NOT NULL,
        device_no INTEGER,
        device_name TEXT,
        text TEXT NOT NULL,
        finding TEXT
    );
    CREATE INDEX entry_at ON entry(at_ns);
    CREATE INDEX entry_run ON entry(run);
";

const ADD_FINDINGS: &str = "ALTER TABLE entry ADD COLUMN finding TEXT; PRAGMA user_version = 2;";

/// What goes wrong with the file.
#[derive(Debug, thiserror::Error)]
pub enum EventLogError {
    /// It is not there.
    #[error("{}: there is no such event log. Do: check the path; `linesman run --log FILE` writes one", path.display())]
    Missing {
        /// Which.
        path: PathBuf,
    },
    /// It is something else.
    #[error("{}: this is no event log of Linesman. Do: give the file that `run --log` wrote", path.display())]
    NotOurs {
        /// Which.
        path: PathBuf,
    },
    /// It was written by a newer Linesman.
    #[error(
        "{}: written by a newer Linesman (format {found}, this one knows {VERSION}). Do: use that one", path.display()
    )]
    TooNew {
        /// Which.
        path: PathBuf,
        /// Its format.
        found: i32,
    },
    /// There is no room on the disk.
    #[error("{}: the disk is full. Do: make room, or put the log elsewhere with --log", path.display())]
    Full {
        /// Which.
        path: PathBuf,
    },
    /// It was there, and is gone.
    #[error("{}: {source}: what was logged is lost. Do: leave the file where it is while it is written", path.display())]
    Gone {
        /// Which.
        path: PathBuf,
        /// What was noticed.
        source: std::io::Error,
    },
    /// The system has no more threads.
    #[error("{}: starting to write it: {source}. Do: end other programs", path.display())]
    Thread {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Anything else.
    #[error("{}: {doing}: {source}. Do: check the path and its permissions", path.display())]
    Database {
        /// Which.
        path: PathBuf,
        /// While doing what.
        doing: &'static str,
        /// What the library says.
        source: rusqlite::Error,
    },
}

/// A run of a MainDevice.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Run {
    /// Its number in the file.
    pub id: i64,
    /// When it began.
    pub started: UnixTime,
    /// When it ended; `None`: it runs, or was killed.
    pub ended: Option<UnixTime>,
    /// The line, as the user gave it: `eth0`.
    pub line: String,
    /// Name of the project.
    pub project: String,
    /// Name and version of the program.
    pub tool: String,
}

/// An entry as it is kept.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct StoredEntry {
    /// Of which run; given by the file.
    pub run: i64,
    /// When.
    pub at: UnixTime,
    /// How bad.
    pub severity: Severity,
    /// What about.
    pub kind: EntryKind,
    /// Number of the SubDevice, from 1.
    pub device_no: Option<u32>,
    /// Its name.
    pub device_name: Option<String>,
    /// What happened.
    pub text: String,
    /// The finding that it is about.
    pub finding: Option<LoggedFinding>,
}

/// What became of a finding; in the file as JSON.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LoggedFinding {
    /// Its name within the run: `F1`.
    pub id: String,
    /// `opened`, `confirmed`, `closed` or `withdrawn`.
    pub event: String,
    /// Its code: `H104`.
    pub code: String,
    /// Its name: `port-errors`.
    pub name: String,
    /// Where, in words.
    pub place: String,
    /// The most likely cause.
    pub cause: String,
    /// The finding that explains it, by its id.
    pub follows_from: Option<String>,
}

/// The open file.
#[derive(Debug)]
pub struct EventLog {
    path: PathBuf,
    connection: Connection,
    /// Version of its tables.
    version: i32,
}

impl EventLog {
    /// Opens a log to write, and makes it when it is not there.
    ///
    /// # Errors
    /// [`EventLogError`]; a file that is something else is left as it is.
    pub fn create(path: &Path) -> Result<Self, EventLogError> {
        let connection = Connection::open(path).map_err(|error| at(path, "opening it", error))?;
        let mut log = Self { path: path.to_owned(), connection, version: VERSION };
        log.prepare()?;
        if log.has_no_tables()? {
            log.batch("making its tables", TABLES)?;
            log.pragma("application_id", APPLICATION)?;
            log.pragma("user_version", VERSION)?;
        }
        log.check()?;
        if log.version == WITHOUT_FINDINGS {
            log.batch("adding findings to its tables", ADD_FINDINGS)?;
            log.version = VERSION;
        }
        log.batch("preparing it", "PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL;")?;
        Ok(log)
    }

    /// Opens a log to read.
    ///
    /// # Errors
    /// [`EventLogError`].
    pub fn open(path: &Path) -> Result<Self, EventLogError> {
        if !path.exists() {
            return Err(EventLogError::Missing { path: path.to_owned() });
        }
        let connection = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY)
            .map_err(|error| at(path, "opening it", error))?;
        let mut log = Self { path: path.to_owned(), connection, version: VERSION };
        log.prepare()?;
        log.check()?;
        Ok(log)
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Notes that a run begins; gives its number.
    ///
    /// # Errors
    /// [`EventLogError`].
    pub fn begin(
        &mut self,
        started: UnixTime,
        line: &str,
        project: &str,
        tool: &str,
    ) -> Result<i64, EventLogError> {
        let sql = "INSERT INTO run (started_ns, line, project, tool) VALUES (?1, ?2, ?3, ?4)";
        (self.connection.execute(sql, (nanos(started), line, project, tool)))
            .map_err(|error| at(&self.path, "noting a run", error))?;
        Ok(self.connection.last_insert_rowid())
    }

    /// Notes that it has ended.
    ///
    /// # Errors
    /// [`EventLogError`].
    pub fn end(&mut self, run: i64, ended: UnixTime) -> Result<(), EventLogError> {
        (self
            .connection
            .execute("UPDATE run SET ended_ns = ?1 WHERE id = ?2", (nanos(ended), run)))
        .map_err(|error| at(&self.path, "noting the end of a run", error))?;
        Ok(())
    }

    /// Adds entries, all or none.
    ///
    /// # Errors
    /// [`EventLogError`]; then none was added.
    pub fn append(&mut self, entries: &[StoredEntry]) -> Result<(), EventLogError> {
        let path = &self.path;
        let fail = |error| at(path, "adding entries", error);
        let transaction = self.connection.transaction().map_err(fail)?;
        {
            let sql = "INSERT INTO entry (run, at_ns, severity, kind, device_no, device_name, text, \
                       finding) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)";
            let mut insert = transaction.prepare_cached(sql).map_err(fail)?;
            for entry in entries {
                let values = (
                    entry.run,
                    nanos(entry.at),
                    entry.severity as u8,
                    entry.kind.name(),
                    entry.device_no,
                    entry.device_name.as_deref(),
                    entry.text.as_str(),
                    entry.finding.as_ref().and_then(|one| serde_json::to_string(one).ok()),
                );
                insert.execute(values).map_err(fail)?;
            }
        }
        transaction.commit().map_err(fail)
    }

    /// The runs, the oldest first.
    ///
    /// # Errors
    /// [`EventLogError`].
    pub fn runs(&self) -> Result<Vec<Run>, EventLogError> {
        let fail = |error| at(&self.path, "reading its runs", error);
        let sql = "SELECT id, started_ns, ended_ns, line, project, tool FROM run ORDER BY id";
        let mut statement = self.connection.prepare(sql).map_err(fail)?;
        let run = |row: &Row<'_>| {
            Ok(Run {
                id: row.get(0)?,
                started: time(row.get(1)?),
                ended: row.get::<_, Option<i64>>(2)?.map(time),
                line: row.get(3)?,
                project: row.get(4)?,
                tool: row.get(5)?,
            })
        };
        let runs = statement.query_map((), run).map_err(fail)?;
        runs.collect::<Result<_, _>>().map_err(fail)
    }

    /// The entries that a filter wants, the oldest first.
    ///
    /// # Errors
    /// [`EventLogError`].
    pub fn entries(&self, filter: &Filter) -> Result<Vec<StoredEntry>, EventLogError> {
        let fail = |error| at(&self.path, "reading its entries", error);
        let (condition, values) = condition(filter);
        let limit = filter.limit.map_or(-1, i64::from);
        // The newest are chosen, and shown in the order in which they happened.
        let finding = if self.version == WITHOUT_FINDINGS { "NULL" } else { "finding" };
        let sql = format!(
            "SELECT * FROM (SELECT run, at_ns, severity, kind, device_no, device_name, text, \
             {finding}, id FROM entry {condition} ORDER BY at_ns DESC, id DESC LIMIT {limit}) ORDER BY at_ns, id"
        );
        let mut statement = self.connection.prepare(&sql).map_err(fail)?;
        let entry = |row: &Row<'_>| {
            let severity: u8 = row.get(2)?;
            let kind: String = row.get(3)?;
            let finding: Option<String> = row.get(7)?;
            Ok(StoredEntry {
                run: row.get(0)?,
                at: time(row.get(1)?),
                severity: Severity::ALL
                    .get(usize::from(severity))
                    .copied()
                    .unwrap_or(Severity::Error),
                kind: EntryKind::from_name(&kind).unwrap_or(EntryKind::Host),
                device_no: row.get(4)?,
                device_name: row.get(5)?,
                text: row.get(6)?,
                finding: finding.and_then(|text| serde_json::from_str(&text).ok()),
            })
        };
        let entries = statement.query_map(params_from_iter(values), entry).map_err(fail)?;
        entries.collect::<Result<_, _>>().map_err(fail)
    }

    /// How many entries there are in all.
    ///
    /// # Errors
    /// [`EventLogError`].
    pub fn count(&self) -> Result<u64, EventLogError> {
        let count =
            self.connection.query_row("SELECT count(*) FROM entry", (), |row| row.get::<_, i64>(0));
        count.map(i64::unsigned_abs).map_err(|error| at(&self.path, "counting its entries", error))
    }

    fn prepare(&self) -> Result<(), EventLogError> {
        (self.connection.busy_timeout(PATIENCE))
            .map_err(|error| at(&self.path, "opening it", error))
    }

    fn has_no_tables(&self) -> Result<bool, EventLogError> {
        let sql = "SELECT count(*) FROM sqlite_schema";
        let count: i64 = (self.connection.query_row(sql, (), |row| row.get(0)))
            .map_err(|error| at(&self.path, "reading it", error))?;
        Ok(count == 0)
    }

    fn check(&mut self) -> Result<(), EventLogError> {
        let read = |name| {
            (self.connection.pragma_query_value(None, name, |row| row.get::<_, i32>(0)))
                .map_err(|error| at(&self.path, "reading it", error))
        };
        if read("application_id")? != APPLICATION {
            return Err(EventLogError::NotOurs { path: self.path.clone() });
        }
        match read("user_version")? {
            found @ WITHOUT_FINDINGS..=VERSION => {
                self.version = found;
                Ok(())
            }
            found => Err(EventLogError::TooNew { path: self.path.clone(), found }),
        }
    }

    fn batch(&self, doing: &'static str, sql: &str) -> Result<(), EventLogError> {
        self.connection.execute_batch(sql).map_err(|error| at(&self.path, doing, error))
    }

    fn pragma(&self, name: &str, value: i32) -> Result<(), EventLogError> {
        (self.connection.pragma_update(None, name, value))
            .map_err(|error| at(&self.path, "making its tables", error))
    }
}

fn condition(filter: &Filter) -> (String, Vec<Value>) {
    let mut parts: Vec<String> = Vec::new();
    let mut values: Vec<Value> = Vec::new();
    let mut add = |part: &str, value: Value| {
        values.push(value);
        parts.push(part.replace('?', &format!("?{}", values.len())));
    };
    if let Some(since) = filter.since {
        add("at_ns >= ?", nanos(since).into());
    }
    if let Some(until) = filter.until {
        add("at_ns <= ?", nanos(until).into());
    }
    if let Some(severity) = filter.severity {
        add("severity >= ?", i64::from(severity as u8).into());
    }
    if let Some(no) = filter.device_no {
        add("device_no = ?", i64::from(no).into());
    }
    if let Some(name) = &filter.device_name {
        add("device_name = ?", name.clone().into());
    }
    if let Some(run) = filter.run {
        add("run = ?", run.into());
    }
    if let Some(text) = &filter.text {
        add("instr(lower(text), ?) > 0", text.to_lowercase().into());
    }
    if !filter.kinds.is_empty() {
        let marks: Vec<_> = (filter.kinds.iter())
            .map(|kind| {
                values.push(kind.name().to_owned().into());
                format!("?{}", values.len())
            })
            .collect();
        parts.push(format!("kind IN ({})", marks.join(", ")));
    }
    let condition = match parts.is_empty() {
        true => String::new(),
        false => format!("WHERE {}", parts.join(" AND ")),
    };
    (condition, values)
}

fn at(path: &Path, doing: &'static str, source: rusqlite::Error) -> EventLogError {
    let path = path.to_owned();
    match source.sqlite_error_code() {
        Some(ErrorCode::DiskFull) => EventLogError::Full { path },
        Some(ErrorCode::NotADatabase) => EventLogError::NotOurs { path },
        _ => EventLogError::Database { path, doing, source },
    }
}

/// SQLite has 64 bits: until the year 2262.
fn nanos(time: UnixTime) -> i64 {
    i64::try_from(time.as_nanos()).unwrap_or(i64::MAX)
}

fn time(nanos: i64) -> UnixTime {
    UnixTime::from_nanos(i128::from(nanos))
}

#[cfg(test)]
mod tests;
