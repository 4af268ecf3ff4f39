//! Speed of `linesman diagnose` on a capture, with tshark on the same file beside it.
//!
//! `cargo bench -p linesman-cli`. The capture is made here: a plant of 30 SubDevices in the lab, brought
//! to OP and run until there are enough frames. Both programs then read it in turns; what counts is
//! the ratio of their best times, since a machine has slow moments and no fast ones.

#![allow(clippy::unwrap_used, reason = "a measurement that fails may panic")]

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant as Clock};

use linesman_diagnosis::Direction;
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_link::capture::{
    CaptureInterfaceId, FrameDirection, FrameToWrite, InterfaceToWrite, LinkType, PcapngWriter,
};
use linesman_link::unix_time::UnixTime;
use linesman_proto::time::Span;
use linesman_sim::seed::Seed;
use linesman_sim::segment_file::{PlantOptions, plant};

/// Frames in the capture: requests and answers.
const FRAMES: u64 = 600_000;
/// How often each program reads it.
const ROUNDS: usize = 3;

fn main() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("plant.pcapng");
    let frames = record(&file);
    let megabytes = std::fs::metadata(&file).unwrap().len() / 1_000_000;
    println!("capture: {frames} frames, {megabytes} MB");
    let mut ours = Duration::MAX;
    let mut theirs = Duration::MAX;
    let has_tshark = Command::new("tshark").arg("--version").stdout(Stdio::null()).status().is_ok();
    for _ in 0..ROUNDS {
        ours = ours.min(time(
            Command::new(env!("CARGO_BIN_EXE_linesman")).args(["diagnose", "--json"]).arg(&file),
        ));
        if has_tshark {
            let fields = ["-T", "fields", "-e", "ecat.cmd", "-e", "ecat.cnt"];
            theirs = theirs.min(time(Command::new("tshark").arg("-r").arg(&file).args(fields)));
        }
    }
    let rate = |time: Duration| frames as f64 / time.as_secs_f64();
    println!("linesman diagnose: {:>10.0} frames/s", rate(ours));
    if has_tshark {
        println!("tshark:            {:>10.0} frames/s", rate(theirs));
        println!("ratio:             {:>10.1}", theirs.as_secs_f64() / ours.as_secs_f64());
    } else {
        println!("tshark is not installed: no ratio");
    }
}

fn time(command: &mut Command) -> Duration {
    let begin = Clock::now();
    let status = command.stdout(Stdio::null()).stderr(Stdio::null()).status().unwrap();
    assert!(status.success(), "{command:?}: {status}");
    begin.elapsed()
}

/// Runs a plant until enough frames are recorded.
fn record(path: &Path) -> u64 {
    let sink = BufWriter::new(File::create(path).unwrap());
    let mut writer = PcapngWriter::new(sink, "linesman bench").unwrap();
    let interface =
        InterfaceToWrite { name: "lab0", description: "", link_type: LinkType::Ethernet };
    writer.add_interface(&interface).unwrap();
    let shared = Arc::new(Mutex::new((writer, 0)));
    let tap = Arc::clone(&shared);
    let options = PlantOptions { min_devices: 30, max_devices: 30, ..PlantOptions::default() };
    let mut lab = Lab::new(&plant(Seed(1), &options), LabOptions::default()).unwrap();
    lab.set_recorder(Box::new(move |seen| {
        let mut shared = tap.lock().unwrap();
        let (writer, frames) = &mut *shared;
        *frames += 1;
        writer
            .write_frame(&FrameToWrite {
                interface: CaptureInterfaceId(0),
                time: UnixTime::from_nanos(seen.time.as_nanos().into()),
                direction: match seen.direction {
                    Direction::Sent => FrameDirection::Outgoing,
                    Direction::Received => FrameDirection::Incoming,
                    Direction::Unknown => FrameDirection::Unknown,
                },
                with_fcs: false,
                crc_error: false,
                original_len: None,
                bytes: seen.bytes,
            })
            .unwrap();
    }));
    while shared.lock().unwrap().1 < FRAMES {
        let until = lab.now() + Span::s(5);
        lab.run_until(until).unwrap();
    }
    let mut shared = shared.lock().unwrap();
    shared.0.flush().unwrap();
    shared.1
}
