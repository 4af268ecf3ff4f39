//! A capture, from its first frame to its last.

use std::path::Path;

use linesman_diagnosis::Engine;
use linesman_link::input::Input;
use linesman_runtime::capture::Capture;
use linesman_runtime::stop::Stop;

use super::{DiagnosisRun, Judged, names};
use crate::failure::Failure;
use crate::output::{Output, Progress};
use crate::text::finding::percent;
use crate::text::quantity::{count, time};

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
    let (path, progress) = (input.name().to_owned(), input.progress());
    let is_whole_known = progress.share().is_some();
    let read =
        || progress.share().map_or_else(String::new, |share| format!("{}, ", percent(share)));
    let mut capture = Capture::of(input)?;
    session.setup.start = capture.start().and_then(|start| start.rfc3339());
    session.setup.clock = "capture".to_owned();
    let mut engine = Engine::new(session.setup.clone());
    let mut shown = Progress::new();
    let mut frames: u64 = 0;
    let mut is_ended = false;
    while let Some(frame) = capture.next_frame() {
        engine.handle_frame(&frame);
        frames += 1;
        if frames.is_multiple_of(FRAMES_BETWEEN_LOOKS) {
            let at = frame.time.as_nanos();
            shown.show(|| format!("{}{}, {}", read(), count(frames, "frame"), time(at)));
        }
        session.follow(&mut engine, output);
        is_ended = is_whole_known && stop.is_set();
        if output.is_closed() || is_ended {
            break;
        }
    }
    shown.clear();
    session.setup.start = capture.start().and_then(|start| start.rfc3339());
    let end = capture.end().cloned();
    let complete = end.as_ref().is_some_and(|end| end.complete());
    if let Some(end) = end.filter(|end| !end.complete()) {
        output.warn(&format!("{}: {end}", path.display()));
    } else if is_ended {
        let (read, frames) = (read(), count(frames, "frame"));
        output.warn(&format!("{}: ended at {read}{frames}: judged so far", path.display()));
    }
    let seen = engine.diagnosis().network.frames.0;
    if seen == 0 {
        return Err(nothing_seen(&path, &capture, frames));
    }
    let at = capture.latest();
    session.end(&mut engine, at, complete, output);
    let names = names(&engine);
    Ok(Judged { engine, names, at })
}

/// Why a capture without EtherCAT says nothing.
fn nothing_seen(path: &Path, capture: &Capture, frames: u64) -> Failure {
    let skipped: Vec<String> = capture
        .skipped()
        .iter()
        .map(|skipped| {
            format!("{} of link type {}", count(skipped.frames, "frame"), skipped.link_type)
        })
        .collect();
    let also = match skipped.is_empty() {
        true => String::new(),
        false => format!(", and {} that carry no Ethernet", skipped.join(", ")),
    };
    let reason = format!(
        "{}: no EtherCAT frame among {}{also}; expected EtherType 0x88A4 or UDP port 34980",
        path.display(),
        count(frames, "Ethernet frame")
    );
    let advice = "record on the card that the line is plugged into, while a MainDevice works: \
                  `tcpdump -i eth0 -w trace.pcap`";
    Failure::new(reason, advice)
}
