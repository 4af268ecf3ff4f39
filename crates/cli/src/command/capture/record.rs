//! `linesman capture record`: what passes a card, in a ring of files, until something is wrong.

mod condition;

use std::path::{Path, PathBuf};

use linesman_capture::masking::mask_process_data;
use linesman_diagnosis::finding::Severity;
use linesman_diagnosis::report::FindingReport;
use linesman_diagnosis::{Engine, EventKind, FrameSeen, InputKind, Setup};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_proto::address::Network;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::listen::{CardListener, ListenEvent};
use linesman_runtime::ring_recorder::{RingLimits, RingRecorder};
use linesman_runtime::selector::Selector;

use crate::amount::{self, LONGEST, SECOND, lasting};
use crate::command::diagnose::names;
use crate::command::line_access;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Progress};
use crate::text::quantity::{count, time};
use crate::version;
use condition::RecordConditions;

/// Longest wait, so that a wish to stop is noticed.
const NAP: Span = Span::ms(100);
/// Bytes of a megabyte.
const MEGABYTE: u64 = 1_000_000;

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "It listens and never sends, beside whatever MainDevice. The files are named as those of dumpcap, \
                  trace_00001_20260301101650.pcapng and on; all of them are one recording: `linesman diagnose \
                  trace_*.pcapng`.\n\nConditions are those of `linesman capture filter`, but for SubDevices by name and times \
                  around findings: those are known at the end alone.\n\nExit status: 0 recorded, 1 ended by a finding or a \
                  condition, 2 nothing was heard, or an error."
)]
pub(super) struct Arguments {
    /// The card that frames pass: eth0, or eth0+eth1 at the ends of a ring
    #[arg(value_name = "WHERE")]
    place: String,
    /// Name of the recording; a number and the date are added for each file
    #[arg(long, short, value_name = "FILE.pcapng")]
    output: PathBuf,
    /// A new file after so long
    #[arg(long, value_name = "TIME", default_value = "60s",
          value_parser = amount::duration(SECOND, Span::ms(100), LONGEST))]
    every: Span,
    /// A new file after so many megabytes
    #[arg(long, value_name = "MEGABYTES", default_value = "100", value_parser = amount::count(1, 1_000_000))]
    size: u64,
    /// Keep so many files: the oldest are removed
    #[arg(long, value_name = "COUNT", default_value = "10", value_parser = amount::count(1, 99_999))]
    keep: u64,
    /// End after so long; else Ctrl-C or SIGTERM ends it
    #[arg(long = "for", value_name = "TIME", value_parser = lasting())]
    lasts: Option<Span>,
    /// Judge the line meanwhile, and end so long after the first error or warning, so that the files hold what came
    /// before and after it
    #[arg(long, value_name = "TIME", num_args = 0..=1, default_missing_value = "10s", value_parser = lasting())]
    until_finding: Option<Span>,
    /// End after the first frame that meets a condition, such as 'ecat.cmd == "LRW" && wkc.wrong', so that the files
    /// hold what came before and after it
    #[arg(long, value_name = "CONDITION", conflicts_with = "until_finding")]
    until: Option<String>,
    /// Record so long after that frame
    #[arg(long, value_name = "TIME", default_value = "10s", requires = "until", value_parser = lasting())]
    after: Span,
    /// Write only the frames that meet a condition
    #[arg(long, value_name = "CONDITION")]
    only: Option<String>,
    /// Write process data as zeros; addresses and working counters stay
    #[arg(long)]
    mask: bool,
}

/// Does what was asked.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let cards = cards(&arguments.place)?;
    check(&arguments.output)?;
    let stop = line_access::stop()?;
    let clock = HostClock::start();
    let conditions = RecordConditions::parse(
        arguments.only.as_deref(),
        arguments.until.as_deref(),
        clock.started_at(),
    )?;
    let mut card_listener = CardListener::open(&cards, clock)?;
    let limits = RingLimits {
        bytes: arguments.size * MEGABYTE,
        lasts: arguments.every,
        files: arguments.keep as usize,
    };
    let ring =
        RingRecorder::new(&arguments.output, &version::tool(), clock.started_at(), &cards, limits);
    let mut recording = RingRecording {
        ring,
        clock,
        engine: None,
        conditions,
        after: arguments.until_finding,
        after_awaited: arguments.after,
        awaited: None,
        masked: arguments.mask.then(Vec::new),
        until: arguments.lasts.map_or(Instant::MAX, |lasts| clock.now() + lasts),
        finding: None,
        frames: 0,
        left_out: 0,
        missed: 0,
        unmasked: 0,
    };
    let mut progress = Progress::new();
    let mut lost = None;
    while !stop.is_set() && clock.now() < recording.until && !output.is_closed() {
        let deadline = recording.until.min(clock.now() + NAP);
        if let Err(error) = recording.hear(&mut card_listener, deadline) {
            lost = Some(error);
            break;
        }
        if recording.ring.fault().is_some() {
            break;
        }
        recording.tell_finding(&mut progress, output);
        recording.tell_awaited(&mut progress, output);
        let frames = recording.frames;
        progress.show(|| format!("{}, {}", count(frames, "frame"), time(clock.now().as_nanos())));
    }
    progress.clear();
    recording.conclude(lost, &arguments.output, output)
}

/// The cards that a word means; they are listened on, whether it says so or not.
fn cards(place: &str) -> Result<Vec<String>, Failure> {
    match place.parse::<Selector>()? {
        Selector::Cards(names) | Selector::Listen(names) => Ok(names),
        selector @ Selector::Segment(_) => Err(Failure::new(
            format!("`{selector}`: a virtual segment has no card that could be listened on"),
            format!("record it with `linesman diagnose {selector} --record trace.pcapng`"),
        )),
        Selector::File(path) => Err(Failure::new(
            format!("{}: this is recorded already", path.display()),
            "name a network card, such as eth0; `linesman interfaces` lists them",
        )),
    }
}

/// Refuses a name that files cannot be made of before anything is listened to.
fn check(path: &Path) -> Result<(), Failure> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    if !folder.is_dir() {
        let reason = format!("{}: there is no such folder", folder.display());
        return Err(Failure::new(reason, "make it first, or name another one"));
    }
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("pcapng") if path.file_stem().is_some() => Ok(()),
        Some(_) | None => {
            let reason = format!("{}: recordings are written as pcapng", path.display());
            Err(Failure::new(reason, "let the name end in .pcapng"))
        }
    }
}

/// A recording that is being made.
struct RingRecording {
    ring: RingRecorder,
    clock: HostClock,
    /// Which frames are written, and which one ends the recording.
    conditions: RecordConditions,
    /// Time that is recorded after that one.
    after_awaited: Span,
    /// When it came, and whether that was told.
    awaited: Option<(Instant, bool)>,
    /// Judges the line, where a finding ends the recording; from the first frame on.
    engine: Option<Engine>,
    /// Time that is recorded after the first finding.
    after: Option<Span>,
    /// Room for a frame without process data, where they are masked.
    masked: Option<Vec<u8>>,
    until: Instant,
    finding: Option<FindingReport>,
    frames: u64,
    /// Frames that met no condition, and were not written.
    left_out: u64,
    /// Frames for which the socket had no room.
    missed: u64,
    /// Frames that could not be taken apart, and were left out of a masked recording.
    unmasked: u64,
}

impl RingRecording {
    fn hear(
        &mut self,
        card_listener: &mut CardListener,
        deadline: Instant,
    ) -> Result<(), LinkError> {
        card_listener.hear(deadline, |heard| match heard {
            ListenEvent::Frame(frame) => self.frame(&frame),
            ListenEvent::Host(observation) => {
                if let Some(engine) = &mut self.engine {
                    engine.handle_host(&observation);
                }
            }
            ListenEvent::Missed(missed, at) => {
                self.missed += missed;
                self.ring.missed(missed);
                if let Some(engine) = &mut self.engine {
                    engine.handle_missed(Network::default(), missed, at);
                }
            }
        })?;
        if let Some(engine) = &mut self.engine {
            engine.handle_timeout(self.clock.now());
        }
        Ok(())
    }

    fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.frames += 1;
        if self.after.is_some() {
            self.engine.get_or_insert_with(|| begin(self.clock)).handle_frame(frame);
        }
        let decision = self.conditions.judge(frame);
        if decision.is_awaited && self.awaited.is_none() {
            self.awaited = Some((frame.time, false));
            self.until = self.until.min(frame.time + self.after_awaited);
        }
        if !decision.is_written {
            self.left_out += 1;
            return;
        }
        let Some(room) = &mut self.masked else { return self.ring.frame(frame) };
        room.clear();
        room.extend_from_slice(frame.bytes);
        if mask_process_data(room) {
            self.ring.frame(&FrameSeen { bytes: room, ..*frame });
        } else {
            self.unmasked += 1;
        }
    }

    /// Says what was found first, and when the recording ends for it.
    fn tell_finding(&mut self, progress: &mut Progress, output: &mut Output) {
        let (Some(engine), Some(after)) = (&mut self.engine, self.after) else { return };
        while let Some(event) = engine.poll_event() {
            let is_wrong = event.finding.severity > Severity::Info;
            if event.kind != EventKind::Confirmed || !is_wrong || self.finding.is_some() {
                continue;
            }
            self.until = self.until.min(event.at + after);
            progress.clear();
            let (place, finding) = (names(engine).place(&event.finding.place), &event.finding);
            output.line(&format!(
                "{} {} at {place}: {}; the recording ends {} later",
                finding.code,
                finding.name,
                finding.cause,
                time(after.as_nanos())
            ));
            self.finding = Some(event.finding);
        }
    }

    /// Says that the frame has come that was waited for, and when the recording ends for it.
    fn tell_awaited(&mut self, progress: &mut Progress, output: &mut Output) {
        let Some((at, is_told @ false)) = &mut self.awaited else { return };
        *is_told = true;
        let (at, after) = (time(at.as_nanos()), time(self.after_awaited.as_nanos()));
        progress.clear();
        output.line(&format!(
            "the condition of --until was met at {at}; the recording ends {after} later"
        ));
    }

    fn conclude(
        self,
        lost: Option<LinkError>,
        base: &Path,
        output: &mut Output,
    ) -> Result<Status, Failure> {
        let files: Vec<PathBuf> = self.ring.files().into_iter().map(Path::to_owned).collect();
        let removed = self.ring.removed();
        self.ring.finish(self.clock.now()).map_err(|error| {
            let reason = format!("{}: recording the line: {error}", base.display());
            Failure::new(reason, "make room there, leave the files where they are, and record anew")
        })?;
        if self.missed > 0 {
            let missed = count(self.missed, "frame");
            output.warn(&format!(
                "{missed} passed for which there was no room: they are not recorded"
            ));
        }
        if self.unmasked > 0 {
            let left_out = count(self.unmasked, "frame");
            output.warn(&format!("{left_out} could not be taken apart to be masked: left out"));
        }
        if let Some(error) = lost {
            let failure = Failure::from(error);
            if self.frames == 0 {
                return Err(failure);
            }
            output.warn(&format!("{}; recorded as far as it went", failure.reason));
        }
        if self.frames == 0 {
            let reason = "no EtherCAT frame was heard, and no file was written";
            let advice = "check that the MainDevice runs, and that its line passes this card";
            return Err(Failure::new(reason, advice));
        }
        let frames = self.frames - self.left_out;
        if frames == 0 {
            let reason = format!(
                "none of {} meets the condition of --only, and no file was written",
                count(self.frames, "frame")
            );
            let advice = "try it on a recording: `linesman capture filter trace.pcapng CONDITION`";
            return Err(Failure::new(reason, advice));
        }
        for file in &files {
            output.line(&file.display().to_string());
        }
        let older = match removed {
            0 => String::new(),
            removed => format!(", {} removed", count(removed, "older file")),
        };
        output.line(&format!(
            "{} in {}{older}; judge them together: `linesman diagnose` with all of these names",
            count(frames, "frame"),
            count(files.len() as u64 + removed, "file"),
        ));
        Ok(if self.finding.is_some() || self.awaited.is_some() {
            Status::Findings
        } else {
            Status::Good
        })
    }
}

fn begin(clock: HostClock) -> Engine {
    let start = clock.started_at().rfc3339();
    let clock = "host, monotonic".to_owned();
    Engine::new(Setup { input: InputKind::Listened, start, clock, ..Setup::default() })
}
