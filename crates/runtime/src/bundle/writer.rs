//! Writer of bundles: a thread, so that a diagnosis does not wait for a disk.

use std::collections::VecDeque;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, SyncSender, TrySendError};
use std::thread::{self, JoinHandle};

use linesman_diagnosis::Diagnosis;
use linesman_link::capture::CaptureWriteError;
use linesman_link::unix_time::UnixTime;

use super::archive::{KeptFrames, Members, write};
use super::history::Kept;
use super::manifest::{BundleFinding, Manifest};
use crate::watched_file::WatchedFile;

/// Bundles on their way to the disk.
const WAITING: usize = 2;
/// News that nobody has fetched.
const NEWS: usize = 64;
/// Numbers that are tried until a name is free.
const MOST_NAMES: u64 = 1_000_000;

/// News of a bundle.
#[derive(Debug)]
pub enum BundleNews {
    /// It is written.
    Written {
        /// Where.
        path: PathBuf,
        /// The findings for which it was written.
        findings: Vec<BundleFinding>,
        /// Its length in bytes.
        bytes: u64,
    },
    /// An older one gave way.
    Removed {
        /// Which.
        path: PathBuf,
    },
    /// One could not be written.
    Failed {
        /// Why.
        reason: String,
    },
}

/// Channel by which a recorder tells what became of its bundles.
pub type BundleReceiver = Receiver<BundleNews>;

/// A bundle to be written.
pub(super) struct Job {
    /// Stretches and what was left out are filled in when it is written.
    pub(super) manifest: Manifest,
    pub(super) kept: Kept,
    pub(super) project: Option<String>,
    pub(super) diagnosis: Diagnosis,
    pub(super) report: String,
    pub(super) cards: Vec<String>,
    /// The date of the run's time 0.
    pub(super) start: UnixTime,
    /// The date of its first finding.
    pub(super) found: UnixTime,
}

/// Reads the bundle at the first path, and writes at the second what is to bear its name; else why not.
pub type BundleRework = fn(&Path, &Path) -> Result<(), String>;

/// Limits of a folder of bundles.
#[derive(Clone, Copy, Debug)]
pub(super) struct FolderLimits {
    pub(super) files: usize,
    pub(super) bytes: u64,
}

/// The thread.
pub(super) struct BundleWriter {
    jobs: Option<SyncSender<Box<Job>>>,
    news: SyncSender<BundleNews>,
    thread: Option<JoinHandle<()>>,
}

impl BundleWriter {
    /// Starts it.
    pub(super) fn start(
        folder: &Path,
        limits: FolderLimits,
        rework: Option<BundleRework>,
    ) -> io::Result<(Self, BundleReceiver)> {
        fs::create_dir_all(folder)?;
        let (jobs, taken) = mpsc::sync_channel::<Box<Job>>(WAITING);
        let (news, told) = mpsc::sync_channel(NEWS);
        let (folder, written) = (folder.to_owned(), VecDeque::new());
        let mut files = Folder { folder, limits, rework, written, number: 0 };
        let tell = news.clone();
        let thread = thread::Builder::new().name("bundles".to_owned()).spawn(move || {
            for job in taken {
                files.take(&job, &tell);
            }
        })?;
        Ok((Self { jobs: Some(jobs), news, thread: Some(thread) }, told))
    }

    /// Hands a bundle over. Where the disk does not keep up it is not written, and that is told.
    pub(super) fn write(&self, job: Job) {
        let Some(jobs) = &self.jobs else { return };
        let reason = match jobs.try_send(Box::new(job)) {
            Ok(()) => return,
            Err(TrySendError::Full(_)) => "a bundle is not written: the disk does not keep up",
            Err(TrySendError::Disconnected(_)) => "a bundle is not written: its thread has failed",
        };
        let _ = self.news.try_send(BundleNews::Failed { reason: reason.to_owned() });
    }

    /// Waits until all are written.
    pub(super) fn finish(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // A panic was told by its hook; nothing is lost but bundles.
            let _ = thread.join();
        }
    }
}

impl Drop for BundleWriter {
    fn drop(&mut self) {
        self.finish();
    }
}

/// The folder that bundles are written to.
struct Folder {
    folder: PathBuf,
    limits: FolderLimits,
    rework: Option<BundleRework>,
    /// Those that were written and are there, oldest first, with their lengths.
    written: VecDeque<(WatchedFile, u64)>,
    number: u64,
}

impl Folder {
    fn take(&mut self, job: &Job, news: &SyncSender<BundleNews>) {
        match self.write(job) {
            Ok((path, bytes)) => {
                self.written.push_back((WatchedFile::at(&path), bytes));
                let findings =
                    job.manifest.triggers.iter().map(|trigger| trigger.finding.clone()).collect();
                let _ = news.try_send(BundleNews::Written { path, findings, bytes });
                self.make_room(news);
            }
            Err(error) => {
                let reason = format!("{}: writing a bundle: {error}", self.folder.display());
                let _ = news.try_send(BundleNews::Failed { reason });
            }
        }
    }

    /// Writes under another name first: what bears the name of a bundle is whole.
    fn write(&mut self, job: &Job) -> Result<(PathBuf, u64), CaptureWriteError> {
        let path = self.free_name(job.found)?;
        let (part, reworked) = (path.with_extension("part"), path.with_extension("reworked"));
        let written = self.write_to(job, &part).and_then(|()| {
            let ready = match self.rework {
                Some(rework) => {
                    rework(&part, &reworked).map_err(io::Error::other)?;
                    &reworked
                }
                None => &part,
            };
            fs::hard_link(ready, &path)?;
            Ok(fs::metadata(ready)?.len())
        });
        // They are not needed any more, whatever became of them.
        let _ = fs::remove_file(&part);
        if self.rework.is_some() {
            let _ = fs::remove_file(&reworked);
        }
        written.map(|bytes| (path, bytes))
    }

    fn write_to(&self, job: &Job, part: &Path) -> Result<(), CaptureWriteError> {
        let members = Members {
            manifest: job.manifest.clone(),
            project: job.project.clone(),
            diagnosis: Some(&job.diagnosis),
            report: Some(&job.report),
        };
        let file = File::create_new(part)?;
        let frames = KeptFrames::of(&job.kept, job.start, &job.cards);
        write(&file, members, &frames)
    }

    /// The next name that is free.
    fn free_name(&mut self, found: UnixTime) -> io::Result<PathBuf> {
        while self.number < MOST_NAMES {
            self.number += 1;
            let name = format!("bundle_{:05}_{}.zip", self.number, found.local_digits());
            let path = self.folder.join(name);
            if !path.exists() {
                return Ok(path);
            }
        }
        Err(io::Error::other("no name is free"))
    }

    /// Removes the oldest until the limits hold; the newest stays in any case.
    fn make_room(&mut self, news: &SyncSender<BundleNews>) {
        let all = |written: &VecDeque<(WatchedFile, u64)>| -> u64 {
            written.iter().map(|(_, bytes)| *bytes).sum()
        };
        while self.written.len() > 1
            && (self.written.len() > self.limits.files.max(1)
                || all(&self.written) > self.limits.bytes)
        {
            let Some((oldest, _)) = self.written.pop_front() else { break };
            // Who has put another file there wants to keep it.
            if oldest.check().is_ok() && fs::remove_file(oldest.path()).is_ok() {
                let path = oldest.path().to_owned();
                let _ = news.try_send(BundleNews::Removed { path });
            }
        }
    }
}
