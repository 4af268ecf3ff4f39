//! What the tests share: real captures, and captures made by hand.

#![allow(dead_code, unreachable_pub, reason = "each test file uses a part of it")]
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests read files and say so"
)]
#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

pub mod plant;
pub mod script;
pub mod watcher;

use std::path::{Path, PathBuf};

use linesman_diagnosis::{Diagnosis, Direction, Engine, FrameSeen, Setup};
use linesman_link::capture::{CaptureReader, FrameDirection};
use linesman_proto::address::Network;
use linesman_proto::time::{Instant, Span};

/// The folder with captures of real hardware, if it is there.
pub fn real_captures() -> Option<PathBuf> {
    let root = std::env::var_os("LINESMAN_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let folder = root.join("pcap");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no real captures in {} (set LINESMAN_DATA)", folder.display());
    None
}

/// The engine after a whole capture file.
pub fn read_capture(path: &Path) -> Engine {
    read_some_of_capture(path, |_| true)
}

/// The engine after those frames of a capture file that `wanted` takes.
pub fn read_some_of_capture(path: &Path, wanted: impl Fn(&[u8]) -> bool) -> Engine {
    let mut engine = Engine::new(Setup { source: path.display().to_string(), ..Setup::default() });
    let mut reader = CaptureReader::open(path).unwrap();
    let mut first = None;
    let mut now = Instant::default();
    while let Some(frame) = reader.next_frame() {
        if !wanted(frame.bytes) {
            continue;
        }
        if let Some(time) = frame.time {
            let first = *first.get_or_insert(time);
            now = Instant::default() + time.since(first).unwrap_or(Span::ns(0));
        }
        engine.handle_frame(&FrameSeen {
            network: Network(0),
            path: None,
            direction: match frame.direction {
                FrameDirection::Incoming => Direction::Received,
                FrameDirection::Outgoing => Direction::Sent,
                FrameDirection::Unknown => Direction::Unknown,
            },
            time: now,
            number: frame.number.0,
            fcs: frame.fcs,
            truncated: frame.truncated,
            probe: None,
            bytes: frame.bytes,
        });
    }
    let complete = reader.end().is_some_and(|end| end.complete());
    engine.finish(now, complete);
    engine
}

/// What the report says, for messages.
pub fn text(diagnosis: &Diagnosis) -> String {
    serde_json::to_string_pretty(diagnosis).unwrap()
}
