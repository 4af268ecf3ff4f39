//! Source of rows: one capture, or the files of one recording, read once or twice.

use std::path::PathBuf;

use linesman_capture::expression::Expression;
use linesman_capture::knowledge::{DeviceIndex, FindingTimes, Knowledge};
use linesman_capture::row::{CaptureFrame, CaptureRow};
use linesman_diagnosis::{Diagnosis, Setup};
use linesman_link::input::{Input, STANDARD_INPUT};
use linesman_proto::address::Network;
use linesman_runtime::capture::{Capture, CaptureItem};

use crate::command::bundle::frames;
use crate::command::diagnose::capture::skipped;
use crate::command::diagnose::tap::{TapArguments, TapLinks};
use crate::command::service::address::{DeviceNames, find_all};
use crate::failure::Failure;
use crate::files::{Planned, refuse_what_is_no_file};
use crate::output::{Output, Progress};
use crate::text::finding::percent;
use crate::text::names::Names;
use crate::text::quantity::count;

/// Between two looks at the clock: some tens of milliseconds.
const FRAMES_BETWEEN_LOOKS: u64 = 32_768;

/// Times of several files.
#[derive(clap::Args, Clone, Copy, Default, Debug)]
pub(super) struct FileTimes {
    /// The files were recorded at the same time, as at the two cards of a ring or on the two ways of a tap: their frames
    /// are put in the order of their times, and are numbered in it
    #[arg(long)]
    pub(super) together: bool,
}

/// Files that the frames come from.
pub(super) struct RowSource {
    files: Vec<PathBuf>,
    times: FileTimes,
    planned: Option<Planned>,
    /// Links at which they were recorded inside the line.
    tap: Option<TapLinks>,
}

/// Knowledge of the whole capture.
pub(super) struct LearnedCapture {
    pub(super) knowledge: Knowledge,
    pub(super) diagnosis: Diagnosis,
    pub(super) devices: DeviceIndex,
    pub(super) findings: Vec<FindingTimes>,
    pub(super) names: Names,
}

/// Result of a pass over the frames.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Passed {
    /// Frames.
    pub(super) frames: u64,
    /// True if all could be read.
    pub(super) complete: bool,
}

/// A frame as it is shown to whoever wants rows.
pub(super) struct ShownFrame<'s, 'a> {
    pub(super) item: &'s CaptureItem<'a>,
    pub(super) row: &'s CaptureRow<'a>,
}

impl RowSource {
    /// The files as they were named; several are parts of one recording, one after the other unless `times` says that they
    /// are of the same time.
    pub(super) fn of(
        files: &[PathBuf],
        times: FileTimes,
        project: Option<&PathBuf>,
        tap: &TapArguments,
    ) -> Result<Self, Failure> {
        let is_standard = |file: &PathBuf| file.as_os_str() == STANDARD_INPUT;
        if files.len() > 1 && files.iter().any(is_standard) {
            let reason = "standard input beside other files: its frames have no place among theirs";
            return Err(Failure::new(reason, "name files alone, or `-` alone"));
        }
        if times.together && files.len() > 1 {
            refuse_what_is_no_file(files)?;
        }
        let planned = project.map(|path| Planned::open(path)).transpose()?;
        let tap = tap.links(planned.as_ref().map(|planned| &planned.project))?;
        Ok(Self { files: files.to_vec(), times, planned, tap })
    }

    /// The names, for messages.
    pub(super) fn label(&self) -> String {
        let all: Vec<String> = self.files.iter().map(|file| file.display().to_string()).collect();
        all.join(" + ")
    }

    fn open(&self) -> Result<Capture, Failure> {
        let capture = match self.files.as_slice() {
            [one] => {
                let input = Input::open(one).map_err(linesman_link::capture::CaptureError::from)?;
                Capture::of(frames(input)?)?
            }
            several if self.times.together => Capture::side_by_side(several)?,
            several => Capture::of_files(several)?,
        };
        Ok(match &self.tap {
            Some(tap) => capture.by_tap(tap.tap()),
            None => capture,
        })
    }

    /// A diagnosis that knows what was planned.
    pub(super) fn knowledge(&self) -> Knowledge {
        let planned = self.planned.clone();
        let (project, exchange) =
            planned.map(|Planned { project, exchange }| (project, exchange)).unzip();
        let source = format!("capture:{}", self.label());
        let exchange = exchange.unwrap_or_default();
        let clock = "capture".to_owned();
        let tap_places = self.tap.as_ref().map(TapLinks::before).unwrap_or_default();
        Knowledge::new(Setup { project, exchange, source, clock, tap_places, ..Setup::default() })
    }

    /// Judges the whole capture: SubDevices and findings are known at its end.
    pub(super) fn learn(&self, output: &mut Output) -> Result<LearnedCapture, Failure> {
        let is_file = |path: &PathBuf| std::fs::metadata(path).is_ok_and(|found| found.is_file());
        // What is not there at all is told as such.
        if self.files.iter().any(|path| !path.exists() || path.is_dir()) {
            self.open()?;
        }
        if !self.files.iter().all(is_file) {
            let reason = format!(
                "{}: SubDevices and findings are known at the end alone, and what comes through a pipe \
                 cannot be read twice",
                self.label()
            );
            return Err(Failure::new(reason, "save it to a file first, and name that"));
        }
        let mut capture = self.open()?;
        let mut knowledge = self.knowledge();
        let mut shown = Progress::new();
        let mut frames: u64 = 0;
        while let Some(frame) = capture.next_frame() {
            knowledge.learn(&frame);
            frames += 1;
            if frames.is_multiple_of(FRAMES_BETWEEN_LOOKS) {
                let share = capture.progress();
                shown.show(|| format!("judging: {}", progress(share, frames)));
            }
        }
        shown.clear();
        let is_read = capture.end().is_some_and(|end| end.complete());
        let complete = is_read && capture.fault().is_none();
        knowledge.finish(capture.latest(), complete);
        if let Some(tap) = &self.tap {
            tap.check_all(knowledge.engine(), &capture, &self.label(), output)?;
        }
        let diagnosis = knowledge.engine().diagnosis();
        if output.is_closed() {
            return Err(Failure::new("the command was ended before", "repeat it"));
        }
        let names = crate::command::diagnose::names(knowledge.engine());
        Ok(LearnedCapture {
            devices: knowledge.devices(),
            findings: FindingTimes::all(&diagnosis),
            names,
            diagnosis,
            knowledge,
        })
    }

    /// Shows each frame, until `see` says that it has seen enough. With `facts`, rows say what the frames before tell.
    pub(super) fn each(
        &self,
        facts: bool,
        output: &mut Output,
        see: &mut dyn FnMut(&ShownFrame<'_, '_>, &mut Output) -> Result<bool, Failure>,
    ) -> Result<Passed, Failure> {
        let mut capture = self.open()?;
        let mut knowledge = facts.then(|| self.knowledge());
        let mut shown = Progress::new();
        let mut passed = Passed::default();
        let mut before = None;
        let mut is_ended = false;
        while let Some(item) = capture.next_captured() {
            let CaptureItem { captured, seen, .. } = &item;
            let date_ns = captured.time.map(|time| time.as_nanos());
            let since = date_ns.zip(before).map_or(0, |(date, before)| date - before);
            before = date_ns.or(before);
            let frame = CaptureFrame {
                number: captured.number.0,
                time: seen.time,
                date_ns,
                since_previous_ns: since,
                interface: captured.interface.0,
                direction: seen.direction,
                captured_len: captured.stored.len() as u32,
                original_len: captured.original_len,
                truncated: captured.truncated,
                fcs: captured.fcs,
                probe: captured.probe,
                bytes: captured.bytes,
            };
            let mut row = CaptureRow::of(frame);
            if let Some(knowledge) = &mut knowledge {
                knowledge.annotate(seen, &mut row);
            }
            passed.frames += 1;
            is_ended = !see(&ShownFrame { item: &item, row: &row }, output)? || output.is_closed();
            // It borrows from the capture up to here.
            drop(row);
            if is_ended {
                break;
            }
            if passed.frames.is_multiple_of(FRAMES_BETWEEN_LOOKS) {
                let share = capture.progress();
                shown.show(|| progress(share, passed.frames));
            }
        }
        shown.clear();
        passed.complete = is_ended || self.tell_end(&capture, output);
        if let (Some(tap), Some(mut knowledge), false) = (&self.tap, knowledge, is_ended) {
            knowledge.finish(capture.latest(), passed.complete);
            tap.check_all(knowledge.engine(), &capture, &self.label(), output)?;
        }
        Ok(passed)
    }

    /// Says how a capture ended, if it is not whole; whether it is.
    fn tell_end(&self, capture: &Capture, output: &Output) -> bool {
        if let Some(skipped) = skipped(capture) {
            output.warn(&format!(
                "{}: {skipped} were left out: they carry no Ethernet",
                self.label()
            ));
        }
        if let Some(fault) = capture.fault() {
            output.warn(&format!("{fault}: its frames and those behind are missing"));
            return false;
        }
        match capture.end().filter(|end| !end.complete()) {
            None => true,
            Some(end) => {
                output.warn(&format!("{}: {end}", self.label()));
                false
            }
        }
    }

    /// A condition as the user has written it; SubDevices and findings in it are looked up in the whole capture.
    pub(super) fn condition(
        &self,
        text: &str,
        learned: &mut Option<LearnedCapture>,
        output: &mut Output,
    ) -> Result<Expression, Failure> {
        let failure = |error: linesman_capture::expression::ExpressionError| {
            let reason = format!(
                "the condition, column {}: {}\n{}",
                error.at.start + 1,
                error.reason,
                error.pointer(text)
            );
            Failure::new(reason, error.next_step)
        };
        let mut expression = Expression::parse(text).map_err(failure)?;
        if expression.needs().whole && learned.is_none() {
            *learned = Some(self.learn(output)?);
        }
        let Some(learned) = learned else { return Ok(expression) };
        let model = learned.knowledge.engine().model(Network::default());
        let devices: Vec<DeviceNames<'_>> = model
            .map(|model| model.devices.as_slice())
            .unwrap_or_default()
            .iter()
            .map(|device| DeviceNames {
                id: device.id,
                station: device.station.map_or(0, |station| station.0),
                alias: device.alias.map_or(0, |alias| alias.0),
                name: device.name.as_deref().unwrap_or_default(),
                type_name: device.type_name.as_deref().unwrap_or_default(),
            })
            .collect();
        let place = self.label();
        let find = |word: &str| match find_all(&devices, &place, word) {
            Ok(found) => Ok(found.iter().map(|id| id.no()).collect()),
            Err(failure) => Err((failure.reason, failure.next_step)),
        };
        expression.resolve(find, &learned.findings).map_err(failure)?;
        Ok(expression)
    }
}

fn progress(share: Option<f64>, frames: u64) -> String {
    let share = share.map_or_else(String::new, |share| format!("{}, ", percent(share)));
    format!("{share}{}", count(frames, "frame"))
}
