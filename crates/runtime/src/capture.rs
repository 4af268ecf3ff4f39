//! A capture as the diagnosis sees it: frames in the order of the file, in times of the run. The files of one ring of files
//! are one capture, and so are those that were recorded side by side, as at both cards of a ring.

mod tap;

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use linesman_diagnosis::observe::{Direction, Fingerprint, FrameSeen};
use linesman_link::capture::{
    CaptureEnd, CaptureError, CaptureInterface, CaptureInterfaceId, CaptureReader, CapturedFrame,
    FrameDirection, FrameNumber, MergedCaptures, ReadAhead, RunClock, SkippedLinkType,
};
use linesman_link::input::Input;
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::Network;
use linesman_proto::time::{Instant, Span};

pub use self::tap::{CaptureTap, TapFault, TapPlace};

/// Longest time after the last frame that a recorder is believed to have recorded nothing.
const LONGEST_SILENCE: Span = Span::s(86_400);

/// A capture that is being read.
pub struct Capture {
    source: FrameSource,
    clock: RunClock,
    files: RecordingFiles,
    /// Links at which it was recorded inside the line by cards that add no records.
    tap: Option<CaptureTap>,
}

/// Reader of the present file, or of all files that were recorded side by side.
enum FrameSource {
    /// It is read as its frames are asked for: what comes through a pipe is shown as soon as it is there.
    Direct(Box<CaptureReader>),
    /// A thread reads ahead.
    Ahead(ReadAhead<Option<Fingerprint>>),
    /// Several files by the times of their frames.
    Merged(MergedCaptures),
}

/// A frame of a capture, twice.
#[derive(Clone, Copy, Debug)]
pub struct CaptureItem<'a> {
    /// As the file has it; numbered through where there are several.
    pub captured: CapturedFrame<'a>,
    /// As the diagnosis sees it.
    pub seen: FrameSeen<'a>,
    /// Its fingerprint, where it was worked out ahead.
    pub print: Option<&'a Fingerprint>,
    /// The interface that saw it.
    pub interface: &'a CaptureInterface,
}

/// The files of a capture.
#[derive(Default)]
struct RecordingFiles {
    /// Those to come.
    rest: VecDeque<PathBuf>,
    count: usize,
    /// Frames in those before the present one.
    frames_before: u64,
    /// Frames that their recorders lost.
    missed: u64,
    /// All interfaces so far, equal ones of several files once.
    interfaces: Vec<CaptureInterface>,
    /// Which of them each interface of the present file is.
    numbers: Vec<u32>,
    /// The end of the first file that could not be read to its end.
    early: Option<CaptureEnd>,
    /// Why a later file could not be opened.
    fault: Option<CaptureError>,
}

impl Capture {
    /// Opens a capture file.
    ///
    /// # Errors
    /// When it is none, or is damaged in its first block.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, CaptureError> {
        Self::of(Input::open(path)?)
    }

    /// Opens the files of one recording, in the order of their first frames. Frames are numbered through.
    ///
    /// # Errors
    /// When one of them is no capture, or is damaged in its first block.
    pub fn of_files(paths: &[PathBuf]) -> Result<Self, CaptureError> {
        let mut rest = VecDeque::from(in_order(paths)?);
        let first = rest.pop_front().unwrap_or_default();
        let mut capture = Self::open(first)?;
        capture.files.count += rest.len();
        capture.files.rest = rest;
        Ok(capture)
    }

    /// Opens files that were recorded at the same time by clocks that agree, as at both cards of a ring. Frames are
    /// numbered through in the order of their times.
    ///
    /// # Errors
    /// When one of them is no capture, or is damaged in its first block.
    pub fn side_by_side(paths: &[PathBuf]) -> Result<Self, CaptureError> {
        let mut first = None;
        for path in paths {
            let origin = RunClock::for_file(path)?.origin();
            first = origin.into_iter().chain(first).min();
        }
        let clock = first.map_or_else(RunClock::default, RunClock::starting_at);
        let source = FrameSource::Merged(MergedCaptures::open(paths)?);
        let files = RecordingFiles { count: 1, ..RecordingFiles::default() };
        Ok(Self { source, clock, files, tap: None })
    }

    /// Reads a capture from an input. Of a file the run begins with the earliest frame of any
    /// interface; a pipe cannot be read twice, and the run begins with its first frame.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn of(input: Input) -> Result<Self, CaptureError> {
        let clock = match input.is_file() {
            true => RunClock::for_file(input.name())?,
            false => RunClock::default(),
        };
        let is_file = input.is_file();
        let source = FrameSource::of(CaptureReader::of(input)?, is_file);
        let files = RecordingFiles { count: 1, ..RecordingFiles::default() };
        Ok(Self { source, clock, files, tap: None })
    }

    /// The same capture, recorded by a tap inside the line.
    #[must_use]
    pub fn by_tap(self, tap: CaptureTap) -> Self {
        Self { tap: Some(tap), ..self }
    }

    /// Contradiction between what was read and what was said of the tap; known at the end.
    #[must_use]
    pub fn tap_fault(&self) -> Option<TapFault> {
        self.tap.as_ref()?.fault(&self.files.interfaces)
    }

    /// The share that has been read, 0 to 1; `None` where nobody knows the whole.
    #[must_use]
    pub fn progress(&self) -> Option<f64> {
        let done = self.files.count - self.files.rest.len() - 1;
        Some((done as f64 + self.source.progress()?) / self.files.count as f64)
    }

    /// The next frame; `None` at the end. Its bytes are borrowed: nothing is copied.
    #[inline]
    pub fn next_frame(&mut self) -> Option<FrameSeen<'_>> {
        self.next_captured().map(|item| item.seen)
    }

    /// The next frame as the file has it, and as the diagnosis sees it.
    #[inline]
    pub fn next_captured(&mut self) -> Option<CaptureItem<'_>> {
        while !self.source.advance() {
            self.source = self.files.after(&self.source)?;
        }
        let Self { source, clock, files, tap } = self;
        if source.interfaces().len() > files.numbers.len() {
            files.describe(source.interfaces());
        }
        let mut captured = source.frame()?;
        captured.number = FrameNumber(captured.number.0 + files.frames_before);
        captured.interface = files.number(captured.interface);
        let at = clock.place(captured.interface, captured.time).at;
        let interface = files.interfaces.get(captured.interface.0 as usize)?;
        let mut seen = FrameSeen {
            network: Network::default(),
            path: None,
            direction: direction(captured.direction),
            time: at,
            number: captured.number.0,
            fcs: captured.fcs,
            truncated: captured.truncated,
            probe: captured.probe,
            bytes: captured.bytes,
        };
        if let Some(tap) = tap {
            seen.probe = tap.record(captured.interface, interface, &seen);
        }
        Some(CaptureItem { captured, seen, print: source.print(), interface })
    }

    /// The start of the run by the capture's clock.
    #[must_use]
    pub fn start(&self) -> Option<UnixTime> {
        self.clock.origin()
    }

    /// The latest time so far: that of a frame, or that up to which the recorder says it has recorded.
    #[must_use]
    pub fn latest(&self) -> Instant {
        let last = self.clock.latest();
        let ended = self.source.interfaces().iter().filter_map(|interface| interface.ended);
        // Who says it recorded for days after the last frame has another clock.
        let is_sound = |at: &Instant| at.since(last) < LONGEST_SILENCE;
        ended.map(|time| self.clock.at(time)).filter(is_sound).fold(last, Instant::max)
    }

    /// True if the recorder says until when it has recorded; known at the end. `tcpdump -w` does not: whether something came
    /// after the last frame is unknown then.
    #[must_use]
    pub fn has_end_mark(&self) -> bool {
        self.source.interfaces().iter().any(|interface| interface.ended.is_some())
    }

    /// Frames that the recorder says it has lost: they are missing in the files, not on the line.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.files.missed.saturating_add(missed(&self.source))
    }

    /// How many frames were earlier than one before them, and by how much at most.
    #[must_use]
    pub fn backward(&self) -> (u64, Span) {
        self.clock.backward()
    }

    /// How it ended; `None` while there may be more. Of several files the first that could not be read to its end
    /// counts.
    #[must_use]
    pub fn end(&self) -> Option<&CaptureEnd> {
        self.source.end().map(|end| self.files.early.as_ref().unwrap_or(end))
    }

    /// A later file that could not be opened; it ended the capture.
    #[must_use]
    pub const fn fault(&self) -> Option<&CaptureError> {
        self.files.fault.as_ref()
    }

    /// The interfaces that were described so far, those that several files describe in the same way once.
    #[must_use]
    pub fn interfaces(&self) -> &[CaptureInterface] {
        &self.files.interfaces
    }

    /// Frames of the present file that were passed over because of their link type.
    #[must_use]
    pub fn skipped(&self) -> &[SkippedLinkType] {
        self.source.skipped()
    }
}

impl FrameSource {
    /// A reader, in a thread of its own where it reads a file and the system gives one.
    fn of(reader: CaptureReader, is_file: bool) -> Self {
        if !is_file {
            return Self::Direct(Box::new(reader));
        }
        let print = |frame: &CapturedFrame<'_>| Fingerprint::of_frame(frame.bytes);
        ReadAhead::start(reader, print).map_or_else(Self::Direct, Self::Ahead)
    }

    #[inline]
    fn print(&self) -> Option<&Fingerprint> {
        match self {
            Self::Ahead(reader) => reader.prepared()?.as_ref(),
            Self::Direct(_) | Self::Merged(_) => None,
        }
    }

    #[inline]
    fn advance(&mut self) -> bool {
        match self {
            Self::Direct(reader) => reader.advance(),
            Self::Ahead(reader) => reader.advance(),
            Self::Merged(captures) => captures.advance(),
        }
    }

    #[inline]
    fn frame(&self) -> Option<CapturedFrame<'_>> {
        match self {
            Self::Direct(reader) => reader.frame(),
            Self::Ahead(reader) => reader.frame(),
            Self::Merged(captures) => captures.frame(),
        }
    }

    #[inline]
    fn interfaces(&self) -> &[CaptureInterface] {
        match self {
            Self::Direct(reader) => reader.interfaces(),
            Self::Ahead(reader) => reader.interfaces(),
            Self::Merged(captures) => captures.interfaces(),
        }
    }

    fn skipped(&self) -> &[SkippedLinkType] {
        match self {
            Self::Direct(reader) => reader.skipped(),
            Self::Ahead(reader) => reader.skipped(),
            Self::Merged(captures) => captures.skipped(),
        }
    }

    fn progress(&self) -> Option<f64> {
        match self {
            Self::Direct(reader) => reader.progress(),
            Self::Ahead(reader) => reader.progress(),
            Self::Merged(captures) => captures.progress(),
        }
    }

    fn end(&self) -> Option<&CaptureEnd> {
        match self {
            Self::Direct(reader) => reader.end(),
            Self::Ahead(reader) => reader.end(),
            Self::Merged(captures) => captures.end(),
        }
    }
}

impl RecordingFiles {
    /// Opens the file after one that has ended; `None` when it was the last.
    #[cold]
    fn after(&mut self, ended: &FrameSource) -> Option<FrameSource> {
        let end = ended.end()?;
        if !end.complete() {
            self.early.get_or_insert_with(|| end.clone());
        }
        let next = self.rest.pop_front()?;
        self.frames_before += end.frames;
        self.missed = self.missed.saturating_add(missed(ended));
        self.numbers.clear();
        match CaptureReader::open(next) {
            Ok(reader) => Some(FrameSource::of(reader, true)),
            Err(error) => {
                self.fault = Some(error);
                self.rest.clear();
                None
            }
        }
    }

    /// Takes the interfaces of the present file.
    #[cold]
    fn describe(&mut self, described: &[CaptureInterface]) {
        for interface in &described[self.numbers.len()..] {
            let is_same = |known: &CaptureInterface| {
                known.name == interface.name
                    && known.description == interface.description
                    && known.link_type == interface.link_type
            };
            // Two of one file are two, however alike.
            let taken = self.numbers.clone();
            let mut known = self.interfaces.iter().zip(0..);
            let found = known.find(|(known, no)| is_same(known) && !taken.contains(no));
            let no = found.map(|(_, no)| no).unwrap_or_else(|| {
                self.interfaces.push(interface.clone());
                self.interfaces.len() as u32 - 1
            });
            self.numbers.push(no);
        }
    }

    fn number(&self, interface: CaptureInterfaceId) -> CaptureInterfaceId {
        let number = self.numbers.get(interface.0 as usize);
        number.map_or(interface, |number| CaptureInterfaceId(*number))
    }
}

/// Frames that the recorder of a file says it has lost.
fn missed(source: &FrameSource) -> u64 {
    let told = source.interfaces().iter().filter_map(|interface| interface.drops);
    told.fold(0, u64::saturating_add)
}

/// Files in the order of their first frames; those without a time stay where they are.
fn in_order(paths: &[PathBuf]) -> Result<Vec<PathBuf>, CaptureError> {
    let mut dated = Vec::new();
    let mut latest = None;
    for path in paths {
        let mut reader = CaptureReader::open(path)?;
        let first = reader.next_frame().and_then(|frame| frame.time);
        latest = first.or(latest);
        dated.push((latest, path.clone()));
    }
    dated.sort_by_key(|(first, _)| *first);
    Ok(dated.into_iter().map(|(_, path)| path).collect())
}

/// The same word of the diagnosis.
#[must_use]
pub const fn direction(direction: FrameDirection) -> Direction {
    match direction {
        FrameDirection::Incoming => Direction::Received,
        FrameDirection::Outgoing => Direction::Sent,
        FrameDirection::Unknown => Direction::Unknown,
    }
}
