//! A virtual segment: brought up by our own MainDevice in virtual time, which costs little.

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_link::unix_time::UnixTime;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment_file::SegmentFile;

use super::{Arguments, DiagnosisRun};
use crate::command::bundle::recording::BundleRecording;
use crate::command::line_access;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::{Output, Progress};
use crate::text::names::Names;
use crate::text::quantity::{count, time};

/// How long the line runs at least when nobody says.
const LEAST: Span = Span::s(5);
/// How long it runs behind the last beginning or end of a fault.
const BEHIND_FAULTS: Span = Span::s(3);
/// Between two looks for Ctrl-C and events.
const STEP: Span = Span::ms(20);

/// Judges the segment of a file.
pub(super) fn run(
    path: &Path,
    target: AlState,
    arguments: &Arguments,
    mut session: DiagnosisRun,
    output: &mut Output,
) -> Result<Status, Failure> {
    let file = files::segment_file(path)?;
    let until = session.until(lasts(&file));
    let stop = line_access::stop()?;
    let source = session.setup.source.clone();
    let exchanges = session.setup.exchanges.clone();
    let active = arguments.active;
    let options = LabOptions { target, active, source, exchanges, ..LabOptions::default() };
    let mut lab = Lab::new(&file, options).map_err(|error| files::in_file(path, &error))?;
    let mut probe = arguments.probe.begin(path, &mut lab)?;
    // A virtual run has no date: its recording begins in 1970.
    let recorder = session.recorder(UnixTime::EPOCH, &[])?;
    let recorder = Arc::new(Mutex::new(recorder));
    let tap = Arc::clone(&recorder);
    if session.record.is_some() {
        lab.set_recorder(Box::new(move |frame| {
            if let Some(recorder) = &mut *tap.lock().unwrap_or_else(PoisonError::into_inner) {
                recorder.frame(frame);
            }
        }));
    }
    session.begin_bundles(UnixTime::EPOCH, &[])?;
    let recording = Arc::new(Mutex::new(session.recording.take()));
    watch(&mut lab, &recording);
    let names = Names::new(
        lab.project().devices.iter().map(|device| (device.name.clone(), device.type_name.clone())),
    );
    let mut progress = Progress::new();
    while lab.now() < until && !stop.is_set() && !output.is_closed() {
        let next = until.min(lab.now() + STEP);
        lab.run_until(next).map_err(|error| files::in_file(path, &error))?;
        follow(&mut lab, &names, &recording, &mut session, output);
        if let Some(probe) = &mut probe {
            probe.take(&mut lab)?;
        }
        let recording = recorder.lock().unwrap_or_else(PoisonError::into_inner);
        session.look_at_recording(recording.as_ref(), output);
        drop(recording);
        let (now, frames) = (lab.now(), lab.frames());
        progress.show(|| format!("{} of {}, {}", text(now), text(until), count(frames, "frame")));
    }
    progress.clear();
    if let Some(probe) = probe {
        probe.end()?;
    }
    let recorder = recorder.lock().unwrap_or_else(PoisonError::into_inner).take();
    session.end_recording(recorder, lab.now(), output);
    if let Some(failure) = lab.failure() {
        output.warn(&format!("the line was not brought up: {failure}"));
    }
    lab.finish();
    follow(&mut lab, &names, &recording, &mut session, output);
    session.flush(&names, output);
    session.recording = lock(&recording).take();
    session.end_bundles(lab.now(), lab.engine(), output);
    Ok(session.answer(lab.engine(), &names, lab.now(), output))
}

/// Bundles that are recorded of what the lab shows to its diagnosis.
type SharedBundles = Arc<Mutex<Option<BundleRecording>>>;

fn lock(recording: &SharedBundles) -> MutexGuard<'_, Option<BundleRecording>> {
    recording.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps what the diagnosis is shown, where bundles were asked for.
fn watch(lab: &mut Lab, recording: &SharedBundles) {
    if lock(recording).is_none() {
        return;
    }
    let frames = Arc::clone(recording);
    lab.set_tap(Box::new(move |frame| {
        if let Some(recording) = &mut *lock(&frames) {
            recording.frame(frame);
        }
    }));
    let host = Arc::clone(recording);
    lab.set_host_tap(Box::new(move |observation| {
        if let Some(recording) = &mut *lock(&host) {
            recording.host(observation);
        }
    }));
}

fn follow(
    lab: &mut Lab,
    names: &Names,
    recording: &SharedBundles,
    session: &mut DiagnosisRun,
    output: &mut Output,
) {
    let mut recording = lock(recording);
    while let Some(event) = lab.poll_finding_event() {
        if let Some(recording) = &mut *recording {
            recording.event(&event);
        }
        if let Some(follower) = &mut session.follower {
            follower.tell(event, names, output);
        }
    }
    if let Some(recording) = &mut *recording {
        recording.turn(lab.now(), lab.engine(), !session.json, output);
    }
}

/// Long enough to see every fault of the file.
fn lasts(file: &SegmentFile) -> Span {
    let changes = file.faults.iter().flat_map(|fault| [fault.from_ms, fault.to_ms]).flatten();
    let last_ms = changes.fold(0.0, f64::max);
    (Span::ns((last_ms * 1e6) as u64) + BEHIND_FAULTS).max(LEAST)
}

fn text(at: Instant) -> String {
    time(at.as_nanos())
}
