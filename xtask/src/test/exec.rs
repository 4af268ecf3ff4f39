//! Running a command with a time limit; what it prints goes to a log.

use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

/// How often a running command is looked at.
const LOOK: Duration = Duration::from_millis(50);
/// The longest that a command runs that has no limit of its own: a build of everything on a busy machine with two cores.
const LONGEST: Duration = Duration::from_mins(50);
/// Lines of the log that are shown when a command fails.
const TAIL: usize = 60;

/// A command to be run.
pub(super) struct Run {
    command: Command,
    said: String,
    log: PathBuf,
    limit: Duration,
}

/// What came of it.
pub(super) struct Ran {
    /// `None` when it ran out of time and was ended.
    pub(super) status: Option<ExitStatus>,
    /// All it printed, both streams.
    pub(super) output: String,
    said: String,
    log: PathBuf,
}

impl Run {
    pub(super) fn new(root: &Path, log: PathBuf, program: &Path, arguments: &[&str]) -> Self {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(root).stdin(Stdio::null());
        let name = program.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let said = format!("{name} {}", arguments.join(" "));
        Self { command, said, log, limit: LONGEST }
    }

    pub(super) fn env(mut self, key: &str, value: impl AsRef<std::ffi::OsStr>) -> Self {
        self.command.env(key, value);
        self
    }

    /// Ends the command and its children after this time.
    pub(super) fn limit(mut self, seconds: u64) -> Self {
        self.limit = Duration::from_secs(seconds);
        self
    }

    /// Runs it to its end or to the limit.
    pub(super) fn run(mut self) -> Result<Ran> {
        let file =
            File::create(&self.log).with_context(|| format!("create {}", self.log.display()))?;
        self.command.stdout(file.try_clone()?).stderr(file).process_group(0);
        let mut child = self.command.spawn().with_context(|| format!("start `{}`", self.said))?;
        let end = Instant::now() + self.limit;
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break Some(status);
            }
            if Instant::now() >= end {
                // Its own group, so that what it started ends with it.
                let group = format!("-{}", child.id());
                let _ = Command::new("kill").args(["-KILL", "--", &group]).status();
                child.wait()?;
                break None;
            }
            std::thread::sleep(LOOK);
        };
        let output = std::fs::read(&self.log)?;
        let output = String::from_utf8_lossy(&output).into_owned();
        Ok(Ran { status, output, said: self.said, log: self.log })
    }
}

impl Ran {
    pub(super) fn success(&self) -> bool {
        self.status.is_some_and(|status| status.success())
    }

    /// Shows the end of the log and says in one line how the command ended.
    pub(super) fn explain(&self) -> String {
        let lines: Vec<&str> = self.output.lines().collect();
        for line in &lines[lines.len().saturating_sub(TAIL)..] {
            println!("    {line}");
        }
        self.status_line()
    }

    /// In one line how the command ended.
    pub(super) fn status_line(&self) -> String {
        let how = match self.status {
            None => "ran out of time".to_owned(),
            Some(status) => status.to_string(),
        };
        format!("`{}`: {how}; all of it in {}", self.said, self.log.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sh(script: &str, limit: u64) -> Ran {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("log");
        Run::new(folder.path(), log, Path::new("sh"), &["-c", script]).limit(limit).run().unwrap()
    }

    #[test]
    fn both_streams_and_the_status_are_kept() {
        let ran = sh("echo a; echo b >&2; exit 3", 10);
        assert_eq!(ran.output, "a\nb\n");
        assert_eq!(ran.status.and_then(|status| status.code()), Some(3));
        assert!(ran.explain().contains("exit status: 3"));
    }

    #[test]
    fn what_runs_too_long_is_ended_with_its_children() {
        let start = Instant::now();
        let ran = sh("sleep 60 & sleep 60", 1);
        assert!(ran.status.is_none());
        assert!(start.elapsed() < Duration::from_secs(20));
    }
}
