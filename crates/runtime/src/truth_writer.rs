//! Writer of the truth of a running segment, as it happens: to a file, and to whoever listens.
//!
//! The thread that runs the segment hands over what happened and goes on; a thread of its own turns
//! it into lines of JSON, so that no file and no slow reader ever makes the segment late.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use linesman_config::fault::FaultName;
use linesman_proto::time::Instant;
use linesman_sim::segment::Segment;
use linesman_sim::truth::{Effect, Entry, FaultId, Place};
use serde::{Deserialize, Serialize};

use crate::names::Names;
use crate::part::guard;
use crate::watched_file::WatchedFile;

/// Name and version of a line's format.
pub const SCHEMA: &str = "linesman.truth/1";
/// Lines kept for those who ask later; older ones are forgotten.
const KEPT: usize = 100_000;
/// How long a reader may keep the others waiting, before it is left behind.
const PATIENCE: Duration = Duration::from_millis(500);

/// Something that really happened in the segment.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TruthEvent {
    /// `linesman.truth/1`.
    pub schema: String,
    /// Its number in the run, from 1, without a gap.
    pub no: u64,
    /// When, in ns since the start of the segment. Effects on frames that were on their way at
    /// once may be a few µs out of order.
    pub time_ns: u64,
    /// What it is.
    pub event: EventKind,
    /// The fault it belongs to, as `linesman fault SOCKET list` counts them; `null` for what is no
    /// fault.
    pub fault: Option<u32>,
    /// What that fault is.
    pub name: Option<FaultName>,
    /// Where: links as `K1.C-B3.A`, directions as `K1.C>B3.A`, devices by name, cards as
    /// `maindevice.A`.
    pub places: Vec<String>,
    /// What the fault did; `null` where it begins or ends.
    pub effect: Option<EffectReport>,
}

/// What a fault did.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EffectReport {
    /// What it was: `frame-lost`, `frame-spoiled`, `symbol-error`, `signal-lost`, …
    pub kind: String,
    /// The number of the frame in the segment, counted from 1, if it was about one.
    pub frame: Option<u64>,
    /// The same with all its numbers, for people.
    pub text: String,
}

impl From<Effect> for EffectReport {
    fn from(effect: Effect) -> Self {
        let kind = effect.name().to_owned();
        Self { kind, frame: effect.frame(), text: format!("{effect:?}") }
    }
}

/// What kind of event it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum EventKind {
    /// A fault begins to act.
    Begin,
    /// A fault ends or was healed.
    End,
    /// A fault, or something that is none, had an effect.
    Effect,
}

/// What the segment's thread hands over.
enum TruthWriterOrder {
    Fault(FaultName, Vec<Place>),
    Happened(Vec<Entry>),
    Reader(UnixStream, bool),
    /// Nothing more comes. Who may still ask for a reading keeps the way to the thread open.
    End,
}

/// Writes down what happens, until it is finished or dropped.
pub struct TruthWriter {
    sender: Sender<TruthWriterOrder>,
    thread: Option<JoinHandle<io::Result<()>>>,
    watch: TruthWriterWatch,
    /// Faults that were told of so far.
    told: usize,
}

/// Whether all that happens is still written down.
#[derive(Clone, Default, Debug)]
pub struct TruthWriterWatch(Arc<Mutex<Option<String>>>);

impl TruthWriterWatch {
    /// Why not; `None` while all is well.
    #[must_use]
    pub fn trouble(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set(&self, why: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(why);
    }
}

/// Handle by which others read from a truth writer.
#[derive(Clone)]
pub struct TruthReader(Sender<TruthWriterOrder>);

impl TruthWriter {
    /// Begins one: to a file that must not be there yet, if there is to be one.
    ///
    /// # Errors
    /// When the file is there already or cannot be written.
    pub fn begin(segment: &Segment, file: Option<&Path>) -> io::Result<Self> {
        let kept = file;
        let file = file.map(File::create_new).transpose()?.map(BufWriter::new);
        let kept = kept.map(WatchedFile::at);
        let (sender, notes) = mpsc::channel();
        let names = Names::of(segment);
        let watch = TruthWriterWatch::default();
        let mut writer =
            TruthThread { names, file, kept, watch: watch.clone(), ..TruthThread::default() };
        let thread = thread::Builder::new().name("truth".to_owned()).spawn(move || {
            let watch = writer.watch.clone();
            let effect = "what happens is not written down any more";
            guard("the truth log", effect, || writer.run(&notes)).unwrap_or_else(|failure| {
                watch.set(failure.to_string());
                Err(io::Error::other(failure))
            })
        })?;
        Ok(Self { sender, thread: Some(thread), watch, told: 0 })
    }

    /// For whoever tells that not all is written down.
    #[must_use]
    pub fn watch(&self) -> TruthWriterWatch {
        self.watch.clone()
    }

    /// Takes what happened in a segment since the last call.
    pub fn take(&mut self, segment: &mut Segment) {
        for fault in &segment.truth().faults()[self.told..] {
            let _ = self.sender.send(TruthWriterOrder::Fault(fault.name, fault.places.clone()));
            self.told += 1;
        }
        if !segment.truth().entries().is_empty() {
            let _ = self.sender.send(TruthWriterOrder::Happened(segment.take_truth()));
        }
    }

    /// For those who want to read.
    #[must_use]
    pub fn reading(&self) -> TruthReader {
        TruthReader(self.sender.clone())
    }

    /// Ends it: everything is written, readers are told that no more comes.
    ///
    /// # Errors
    /// When the file could not be written to its end.
    pub fn finish(mut self) -> io::Result<()> {
        self.end()
    }

    fn end(&mut self) -> io::Result<()> {
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let _ = self.sender.send(TruthWriterOrder::End);
        thread.join().unwrap_or_else(|_| Err(io::Error::other("the writer failed")))
    }
}

impl Drop for TruthWriter {
    fn drop(&mut self) {
        // Whoever wants to know whether all was written finishes it.
        let _ = self.end();
    }
}

impl TruthReader {
    /// Sends what happened so far to `stream`, and what comes from now on if it wants to follow;
    /// then closes it.
    pub fn send_to(&self, stream: UnixStream, follow: bool) {
        // A writer that has ended closes the stream, which says so.
        let _ = self.0.send(TruthWriterOrder::Reader(stream, follow));
    }
}

/// The thread that writes.
#[derive(Default)]
struct TruthThread {
    names: Names,
    file: Option<BufWriter<File>>,
    kept: Option<WatchedFile>,
    watch: TruthWriterWatch,
    faults: Vec<(FaultName, Vec<Place>)>,
    lines: VecDeque<Box<str>>,
    readers: Vec<UnixStream>,
    no: u64,
    /// The first thing that went wrong with the file; nothing is written to it afterwards.
    failed: Option<io::Error>,
}

impl TruthThread {
    fn run(&mut self, notes: &Receiver<TruthWriterOrder>) -> io::Result<()> {
        while let Ok(first) = notes.recv() {
            let mut note = Some(first);
            let mut ended = false;
            while let Some(one) = note {
                ended |= matches!(one, TruthWriterOrder::End);
                self.note(one);
                note = notes.try_recv().ok();
            }
            self.flush();
            if ended {
                break;
            }
        }
        self.failed.take().map_or(Ok(()), Err)
    }

    fn note(&mut self, note: TruthWriterOrder) {
        match note {
            TruthWriterOrder::End => {}
            TruthWriterOrder::Fault(name, places) => self.faults.push((name, places)),
            TruthWriterOrder::Happened(entries) => {
                for entry in entries {
                    self.write(&entry);
                }
            }
            TruthWriterOrder::Reader(stream, follow) => self.welcome(stream, follow),
        }
    }

    fn write(&mut self, entry: &Entry) {
        self.no += 1;
        let event = self.event(entry);
        let Ok(mut line) = serde_json::to_string(&event) else { return };
        line.push('\n');
        if let Some(file) = &mut self.file
            && let Err(error) = file.write_all(line.as_bytes())
        {
            self.fail(error);
        }
        self.readers.retain_mut(|reader| reader.write_all(line.as_bytes()).is_ok());
        if self.lines.len() == KEPT {
            self.lines.pop_front();
        }
        self.lines.push_back(line.into_boxed_str());
    }

    fn event(&self, entry: &Entry) -> TruthEvent {
        let (event, at, fault, place, effect) = match *entry {
            Entry::Begin { at, fault } => (EventKind::Begin, at, Some(fault), None, None),
            Entry::End { at, fault } => (EventKind::End, at, Some(fault), None, None),
            Entry::Effect { at, fault, place, effect } => {
                (EventKind::Effect, at, fault, Some(place), Some(effect))
            }
        };
        let record = fault.and_then(|FaultId(index)| self.faults.get(index as usize));
        let places = match (&place, record) {
            (Some(place), _) => vec![self.names.place(place)],
            (None, Some((_, places))) => places.iter().map(|one| self.names.place(one)).collect(),
            (None, None) => Vec::new(),
        };
        TruthEvent {
            schema: SCHEMA.to_owned(),
            no: self.no,
            time_ns: Instant::as_nanos(at),
            event,
            fault: fault.map(|FaultId(index)| index + 1),
            name: record.map(|(name, _)| *name),
            places,
            effect: effect.map(EffectReport::from),
        }
    }

    /// A reader gets what there is, and stays if it follows.
    fn welcome(&mut self, mut stream: UnixStream, follow: bool) {
        if stream.set_write_timeout(Some(PATIENCE)).is_err() {
            return;
        }
        let (front, back) = self.lines.as_slices();
        let all = [front, back].concat().concat();
        if stream.write_all(all.as_bytes()).is_ok() && follow {
            self.readers.push(stream);
        }
    }

    fn flush(&mut self) {
        let Some(file) = &mut self.file else { return };
        let kept = self.kept.as_ref().map_or(Ok(()), WatchedFile::check);
        if let Err(error) = file.flush().and(kept) {
            self.fail(error);
        }
    }

    fn fail(&mut self, error: io::Error) {
        self.watch.set(error.to_string());
        self.failed.get_or_insert(error);
        self.file = None;
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use linesman_proto::address::Path as Card;
    use linesman_proto::time::Span;
    use linesman_sim::segment_file::{FaultEntry, SegmentFile};

    use super::*;

    const PLANT: &str = r#"
        [[device]]
        name = "K1"
        type = "EK1100"
        on = "maindevice"
        [[device]]
        name = "I1"
        type = "EL1008"
        on = "K1.B"
    "#;

    fn plant() -> Segment {
        Segment::build(&SegmentFile::parse(PLANT).unwrap()).unwrap()
    }

    fn events(text: &str) -> Vec<TruthEvent> {
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    #[test]
    fn what_happens_is_read_by_early_and_late_readers_and_from_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("truth.jsonl");
        let mut segment = plant();
        let mut truth_writer = TruthWriter::begin(&segment, Some(&path)).unwrap();
        let (mut early, end) = UnixStream::pair().unwrap();
        truth_writer.reading().send_to(end, true);

        let second = Instant::ZERO + Span::s(1);
        let fault = FaultEntry::new(FaultName::LinkOpen).at("K1.B-I1.A");
        let id = segment.inject(second, &fault).unwrap();
        let mut frame = vec![0xFF; 12];
        frame.extend([0x88, 0xA4, 13, 0x10, 7, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]);
        // It meets the break before the port behind which it is has closed.
        segment.handle_frame(second + Span::ns(100), Card::A, &frame);
        segment.heal(second + Span::ms(2), id);
        segment.advance(second + Span::ms(3));
        truth_writer.take(&mut segment);
        assert!(segment.truth().entries().is_empty(), "they are in the journal now");

        let (mut late, end) = UnixStream::pair().unwrap();
        let still_held = truth_writer.reading();
        still_held.send_to(end, false);
        let mut heard = [String::new(), String::new()];
        late.read_to_string(&mut heard[1]).unwrap();
        truth_writer.finish().unwrap();
        early.read_to_string(&mut heard[0]).unwrap();
        let written = std::fs::read_to_string(&path).unwrap();
        assert_eq!(heard, [written.clone(), written.clone()]);

        let all = events(&written);
        let numbers: Vec<u64> = all.iter().map(|event| event.no).collect();
        assert_eq!(numbers, (1..=all.len() as u64).collect::<Vec<_>>());
        let begin = all.iter().find(|event| event.event == EventKind::Begin).unwrap();
        assert_eq!((begin.fault, begin.name), (Some(1), Some(FaultName::LinkOpen)));
        assert_eq!(begin.places, ["K1.B-I1.A"]);
        assert!(begin.time_ns >= 1_000_000_000 && begin.effect.is_none());
        let kinds: Vec<&str> =
            all.iter().filter_map(|event| event.effect.as_ref()).map(|one| &*one.kind).collect();
        assert!(kinds.contains(&"signal-lost") && kinds.contains(&"frame-lost"), "{all:?}");
        assert!(all.iter().any(|event| event.event == EventKind::End), "{all:?}");

        let again = TruthWriter::begin(&segment, Some(&path)).err().unwrap();
        assert_eq!(again.kind(), io::ErrorKind::AlreadyExists);
    }
}
