//! Ring of capture files: the last stretch of a line, in files of limited length of which the oldest give way.

use std::collections::VecDeque;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use linesman_diagnosis::FrameSeen;
use linesman_link::capture::CaptureWriteError;
use linesman_link::unix_time::UnixTime;
use linesman_proto::time::{Instant, Span};

use crate::record::Recorder;
use crate::watched_file::WatchedFile;

/// Bytes that a frame takes in a file beside its own, about.
const BESIDE_FRAME: u64 = 48;
/// Ending of names that have none.
const ENDING: &str = "pcapng";

/// Lengths of a ring.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RingLimits {
    /// A new file begins when one has so many bytes.
    pub bytes: u64,
    /// A new file begins when one lasts so long.
    pub lasts: Span,
    /// Number of files that stay; at least one.
    pub files: usize,
}

/// A recording in a ring of files.
///
/// From `trace.pcapng` the names `trace_00001_20260301101650.pcapng` and on are made, as dumpcap makes them. Only files
/// that it has written itself are removed.
pub struct RingRecorder {
    base: PathBuf,
    application: String,
    start: UnixTime,
    names: Vec<String>,
    limits: RingLimits,
    recorder: Option<Recorder>,
    /// Files that are there, oldest first; the last one is being written.
    kept: VecDeque<WatchedFile>,
    number: u64,
    began: Instant,
    bytes: u64,
    removed: u64,
    fault: Option<CaptureWriteError>,
}

impl RingRecorder {
    /// A ring that begins with the first frame. `start` is the date of the run's time 0; `names` are those of the cards.
    #[must_use]
    pub fn new(
        base: &Path,
        application: &str,
        start: UnixTime,
        names: &[String],
        limits: RingLimits,
    ) -> Self {
        Self {
            base: base.to_owned(),
            application: application.to_owned(),
            start,
            names: names.to_vec(),
            limits,
            recorder: None,
            kept: VecDeque::new(),
            number: 0,
            began: Instant::ZERO,
            bytes: 0,
            removed: 0,
            fault: None,
        }
    }

    /// Writes a frame. What goes wrong is told by [`fault`](Self::fault), and nothing is written after it.
    pub fn frame(&mut self, frame: &FrameSeen<'_>) {
        if self.fault.is_some() {
            return;
        }
        let is_over =
            self.bytes >= self.limits.bytes || frame.time.since(self.began) >= self.limits.lasts;
        if (self.recorder.is_none() || is_over)
            && let Err(fault) = self.turn_over(frame.time)
        {
            self.fault = Some(fault);
            return;
        }
        let Some(recorder) = &mut self.recorder else { return };
        recorder.frame(frame);
        self.bytes += frame.bytes.len() as u64 + BESIDE_FRAME;
    }

    /// Notes frames that passed and were not shown.
    pub const fn missed(&mut self, count: u64) {
        if let Some(recorder) = &mut self.recorder {
            recorder.missed(count);
        }
    }

    /// The first fault.
    #[must_use]
    pub fn fault(&self) -> Option<&CaptureWriteError> {
        self.fault.as_ref().or_else(|| self.recorder.as_ref()?.fault())
    }

    /// The files that are there, oldest first.
    #[must_use]
    pub fn files(&self) -> Vec<&Path> {
        self.kept.iter().map(WatchedFile::path).collect()
    }

    /// Files that gave way.
    #[must_use]
    pub const fn removed(&self) -> u64 {
        self.removed
    }

    /// Ends the present file, and begins the next.
    fn turn_over(&mut self, now: Instant) -> Result<(), CaptureWriteError> {
        if let Some(recorder) = self.recorder.take() {
            recorder.finish(now)?;
        }
        while self.kept.len() >= self.limits.files.max(1) {
            let Some(oldest) = self.kept.pop_front() else { break };
            // Who has put another file there wants to keep it.
            if oldest.check().is_ok() {
                fs::remove_file(oldest.path())?;
                self.removed += 1;
            }
        }
        self.number += 1;
        let path = self.path(self.start + now.since(Instant::ZERO));
        self.recorder = Some(Recorder::create(&path, &self.application, self.start, &self.names)?);
        self.kept.push_back(WatchedFile::at(&path));
        (self.began, self.bytes) = (now, 0);
        Ok(())
    }

    fn path(&self, begun: UnixTime) -> PathBuf {
        let mut name = self.base.file_stem().map_or_else(OsString::new, OsString::from);
        name.push(format!("_{:05}_{}.", self.number, begun.local_digits()));
        name.push(self.base.extension().unwrap_or(ENDING.as_ref()));
        self.base.with_file_name(name)
    }

    /// Ends the ring, with the time `until` which it was recorded.
    ///
    /// # Errors
    /// The first fault.
    pub fn finish(mut self, until: Instant) -> Result<(), CaptureWriteError> {
        match (self.fault, self.recorder.take()) {
            (Some(fault), _) => Err(fault),
            (None, Some(recorder)) => recorder.finish(until),
            (None, None) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use linesman_diagnosis::Direction;
    use linesman_link::capture::CaptureReader;
    use linesman_proto::address::{Network, Path as Card};
    use tempfile::TempDir;

    use super::*;

    fn frame(number: u64, time: Instant, bytes: &[u8]) -> FrameSeen<'_> {
        FrameSeen {
            network: Network::default(),
            path: Some(Card::A),
            direction: Direction::Sent,
            time,
            number,
            fcs: None,
            truncated: false,
            probe: None,
            bytes,
        }
    }

    fn ring(folder: &TempDir, limits: RingLimits) -> RingRecorder {
        let start = UnixTime::from_nanos(1_700_000_000_000_000_000);
        let base = folder.path().join("trace.pcapng");
        RingRecorder::new(&base, "test", start, &["eth0".to_owned()], limits)
    }

    fn times(path: &Path) -> Vec<i128> {
        let mut reader = CaptureReader::open(path).unwrap();
        let mut times = Vec::new();
        while let Some(frame) = reader.next_frame() {
            times.push(frame.time.unwrap().as_nanos() - 1_700_000_000_000_000_000);
        }
        times
    }

    // proves: WS-12 (U) partial: the ring of files
    #[test]
    fn ring_keeps_the_last_files_and_each_begins_when_the_one_before_is_over() {
        let folder = TempDir::new().unwrap();
        let limits = RingLimits { bytes: u64::MAX, lasts: Span::ms(10), files: 2 };
        let mut ring = ring(&folder, limits);
        for number in 1..=35 {
            ring.frame(&frame(number, Instant::from_nanos(number * 1_000_000), &[0x88; 60]));
        }
        assert_eq!(ring.removed(), 2);
        let files: Vec<PathBuf> = ring.files().into_iter().map(Path::to_owned).collect();
        ring.finish(Instant::from_nanos(36_000_000)).unwrap();
        let names: Vec<_> = files.iter().map(|path| path.file_name().unwrap()).collect();
        assert!(names[0].to_str().unwrap().starts_with("trace_00003_2023111"), "{names:?}");
        assert!(names[1].to_str().unwrap().starts_with("trace_00004_2023111"), "{names:?}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
        let (first, last) = (times(&files[0]), times(&files[1]));
        assert_eq!((first.first(), first.last()), (Some(&21_000_000), Some(&30_000_000)));
        assert_eq!((last.first(), last.last()), (Some(&31_000_000), Some(&35_000_000)));
    }

    #[test]
    fn file_of_somebody_else_in_the_place_of_an_old_one_stays() {
        let folder = TempDir::new().unwrap();
        let limits = RingLimits { bytes: 500, lasts: Span::s(60), files: 1 };
        let mut ring = ring(&folder, limits);
        let bytes = [0x88; 60];
        for number in 1..=3 {
            ring.frame(&frame(number, Instant::from_nanos(number), &bytes));
        }
        let first = ring.files()[0].to_owned();
        for number in 4..=6 {
            ring.frame(&frame(number, Instant::from_nanos(number), &bytes));
        }
        assert!(!first.exists(), "500 bytes are over");
        let second = ring.files()[0].to_owned();
        let other = folder.path().join("other");
        fs::write(&other, "mine").unwrap();
        fs::rename(&other, &second).unwrap();
        for number in 7..=20 {
            ring.frame(&frame(number, Instant::from_nanos(number), &bytes));
        }
        assert!(ring.fault().is_some(), "what is written there would be lost");
        assert_eq!(fs::read_to_string(&second).unwrap(), "mine");
    }
}
