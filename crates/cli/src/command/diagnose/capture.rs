//! A capture, from its first frame to its last.

use std::path::{Path, PathBuf};

use linesman_capture::Survey;
use linesman_diagnosis::Engine;
use linesman_link::input::Input;
use linesman_proto::address::Network;
use linesman_proto::time::Span;
use linesman_runtime::capture::{Capture, CaptureItem};
use linesman_runtime::stop::Stop;

use super::{DiagnosisRun, Judged, names};
use crate::failure::Failure;
use crate::output::{Output, Progress};
use crate::text::finding::percent;
use crate::text::quantity::{count, time};

/// A clock that was set back by as much was set, and no card has put its frames into another order.
const SET_BACK: Span = Span::ms(100);
/// Between two looks at the clock: some tens of milliseconds.
const FRAMES_BETWEEN_LOOKS: u64 = 32_768;

/// Judges a capture. A wish to stop ends the reading of a file; of a pipe only the pipe ends, as when
/// its writer has had enough.
pub(super) fn judge(
    input: Input,
    stop: &Stop,
    session: &mut DiagnosisRun,
    output: &mut Output,
) -> Result<Judged, Failure> {
    let path = input.name().to_owned();
    judge_frames(&path, Capture::of(input)?, stop, session, output)
}

/// Judges the files of one recording as one capture; `together` are files that were recorded side by side.
pub(super) fn judge_files(
    paths: &[PathBuf],
    together: bool,
    stop: &Stop,
    session: &mut DiagnosisRun,
    output: &mut Output,
) -> Result<Judged, Failure> {
    let all: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    let label = all.join(" + ");
    session.setup.source = format!("capture:{label}");
    let capture = match together {
        true => Capture::side_by_side(paths)?,
        false => Capture::of_files(paths)?,
    };
    judge_frames(Path::new(&label), capture, stop, session, output)
}

fn judge_frames(
    path: &Path,
    mut capture: Capture,
    stop: &Stop,
    session: &mut DiagnosisRun,
    output: &mut Output,
) -> Result<Judged, Failure> {
    session.setup.start = capture.start().and_then(|start| start.rfc3339());
    session.setup.clock = "capture".to_owned();
    let tap = session.tap.links(session.setup.project.as_ref())?;
    if let Some(tap) = &tap {
        session.setup.tap_places = tap.before();
        capture = capture.by_tap(tap.tap());
    }
    let mut engine = Engine::new(session.setup.clone());
    if let Some(tap) = &tap {
        tap.check_wiring(&engine)?;
    }
    // The page tells what happened by time.
    let mut survey = session.html.is_some().then(Survey::default);
    let whole = read(path, &mut capture, stop, output, |item, output| {
        match &mut survey {
            Some(survey) => survey.handle_frame(&mut engine, &item.seen),
            None => engine.handle_frame_with(&item.seen, item.print, &mut |_, _| {}),
        }
        session.follow(&mut engine, output);
    });
    session.setup.start = capture.start().and_then(|start| start.rfc3339());
    let at = capture.latest();
    engine.handle_missed(Network::default(), capture.missed(), at);
    match &mut survey {
        Some(survey) => survey.finish(&mut engine, at, whole.is_complete),
        None => engine.finish(at, whole.is_complete),
    }
    // Copies of a capture probe are frames once all have come.
    if engine.diagnosis().network.frames.0 == 0 {
        return Err(nothing_seen(path, &capture, whole.frames));
    }
    if let Some(tap) = &tap {
        tap.check_all(&engine, &capture, &path.display().to_string(), output)?;
    }
    session.surveyed = survey.and_then(|survey| survey.report(&engine));
    session.tell_rest(&mut engine, output);
    let names = names(&engine);
    Ok(Judged { engine, names, at })
}

/// What was read of a capture.
pub(crate) struct ReadFrames {
    /// Ethernet frames.
    pub(crate) frames: u64,
    /// Whether the file was read to its end, and is whole.
    pub(crate) is_complete: bool,
}

/// Hands the frames of a capture to `take`, shows how far it is, and says where it does not get to its end.
pub(crate) fn read(
    path: &Path,
    capture: &mut Capture,
    stop: &Stop,
    output: &mut Output,
    mut take: impl FnMut(&CaptureItem<'_>, &mut Output),
) -> ReadFrames {
    let is_whole_known = capture.progress().is_some();
    let read = |share: Option<f64>| {
        share.map_or_else(String::new, |share| format!("{}, ", percent(share)))
    };
    let mut shown = Progress::new();
    let mut frames: u64 = 0;
    let mut is_ended = false;
    while let Some(item) = capture.next_captured() {
        take(&item, output);
        frames += 1;
        let at = item.seen.time.as_nanos();
        if frames.is_multiple_of(FRAMES_BETWEEN_LOOKS) {
            let share = capture.progress();
            shown.show(|| format!("{}{}, {}", read(share), count(frames, "frame"), time(at)));
        }
        is_ended = is_whole_known && stop.is_set();
        if output.is_closed() || is_ended {
            break;
        }
    }
    shown.clear();
    let end = capture.end().cloned();
    let is_read = end.as_ref().is_some_and(|end| end.complete());
    let is_complete = is_read && capture.fault().is_none();
    if let Some(fault) = capture.fault() {
        output.warn(&format!("{fault}: judged up to there"));
    } else if let Some(end) = end.filter(|end| !end.complete()) {
        output.warn(&format!("{}: {end}", path.display()));
    } else if is_ended {
        let (read, frames) = (read(capture.progress()), count(frames, "frame"));
        output.warn(&format!("{}: ended at {read}{frames}: judged so far", path.display()));
    }
    let (earlier, most) = capture.backward();
    if most >= SET_BACK {
        output.warn(&format!(
            "{}: the clock of the recording was set back by {}: {} are earlier than one before them, and times across \
             that say nothing",
            path.display(),
            most,
            count(earlier, "frame")
        ));
    }
    ReadFrames { frames, is_complete }
}

/// Frames that were passed over, as they carry no Ethernet: `20 frames of link type Wi-Fi (105)`; `None` without any.
pub(crate) fn skipped(capture: &Capture) -> Option<String> {
    let skipped = capture.skipped().iter().map(|skipped| {
        format!("{} of link type {}", count(skipped.frames, "frame"), skipped.link_type)
    });
    let skipped: Vec<String> = skipped.collect();
    (!skipped.is_empty()).then(|| skipped.join(", "))
}

/// Why a capture without EtherCAT says nothing.
pub(crate) fn nothing_seen(path: &Path, capture: &Capture, frames: u64) -> Failure {
    let also = skipped(capture)
        .map_or_else(String::new, |skipped| format!(", and {skipped} that carry no Ethernet"));
    let reason = format!(
        "{}: no EtherCAT frame among {}{also}; expected EtherType 0x88A4 or UDP port 34980",
        path.display(),
        count(frames, "Ethernet frame")
    );
    let advice = "record on the card that the line is plugged into, while a MainDevice works: \
                  `tcpdump -i eth0 -w trace.pcap`";
    Failure::new(reason, advice)
}
