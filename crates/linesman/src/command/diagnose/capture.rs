//! A capture file, from its first frame to its last.

use std::path::Path;

use linesman_diagnosis::Engine;
use linesman_runtime::capture::Capture;

use super::Session;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Progress};
use crate::text::quantity::{count, time};

/// Between two looks at the clock: some tens of milliseconds.
const FRAMES_BETWEEN_LOOKS: u64 = 32_768;

/// Judges a capture.
pub(super) fn run(
    path: &Path,
    mut session: Session,
    output: &mut Output,
) -> Result<Status, Failure> {
    let mut capture = Capture::open(path)?;
    session.setup.start = capture.start().and_then(|start| start.rfc3339());
    session.setup.clock = "capture".to_owned();
    let mut engine = Engine::new(session.setup.clone());
    let mut progress = Progress::new();
    let mut frames: u64 = 0;
    while let Some(frame) = capture.next_frame() {
        engine.handle_frame(&frame);
        frames += 1;
        if frames.is_multiple_of(FRAMES_BETWEEN_LOOKS) {
            progress
                .show(|| format!("{}, {}", count(frames, "frame"), time(frame.time.as_nanos())));
        }
        session.follow(&mut engine, output);
        if output.is_closed() {
            break;
        }
    }
    progress.clear();
    let end = capture.end().cloned();
    let complete = end.as_ref().is_some_and(|end| end.complete());
    if let Some(end) = end.filter(|end| !end.complete()) {
        output.warn(&format!("{}: {end}", path.display()));
    }
    let seen = engine.diagnosis().network.frames.0;
    if seen == 0 {
        return Err(nothing_seen(path, &capture, frames));
    }
    Ok(session.conclude(engine, capture.latest(), complete, output))
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
