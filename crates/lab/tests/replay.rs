//! Recordings of real lines, played against segments that are built from what they show.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]
#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "a test reads files")]

use std::path::PathBuf;

use linesman_diagnosis::{Direction, FrameSeen};
use linesman_lab::replay::compare::Class;
use linesman_lab::replay::{Recorder, Recording, Report, learn, model, play};
use linesman_link::capture::{CaptureReader, RunClock};
use linesman_proto::address::Network;

fn record(path: &PathBuf) -> Recording {
    let mut clock = RunClock::for_file(path).unwrap();
    let mut reader = CaptureReader::open(path).unwrap();
    let mut recorder = Recorder::default();
    while let Some(frame) = reader.next_frame() {
        let moment = clock.place(frame.interface, frame.time);
        recorder.take(&FrameSeen {
            network: Network::default(),
            path: None,
            direction: Direction::Unknown,
            time: moment.at,
            number: frame.number.0,
            fcs: frame.fcs,
            truncated: frame.truncated,
            bytes: frame.bytes,
        });
    }
    recorder.finish()
}

fn replay(path: &PathBuf) -> Report {
    let recording = record(path);
    let learned = learn(&recording);
    match model(&learned, &[]) {
        Ok(mut model) => play(&recording, &mut model),
        Err(_) => Report::without_devices(&recording),
    }
}

// proves: FRM-02 partial: commands of these recordings, FRM-15 partial, ESC-14 partial
#[test]
fn recordings_of_real_lines_come_out_the_same() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = std::env::var("LINESMAN_DATA").unwrap_or(root.to_owned());
    let Ok(entries) = std::fs::read_dir(format!("{data}/pcap")) else {
        eprintln!("SKIPPED: no captures in {data}/pcap; set LINESMAN_DATA");
        return;
    };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let (mut judged, mut wrong) = (0, Vec::new());
    for path in &paths {
        let report = replay(path);
        println!("==== {}\n{report}", path.display());
        judged += report.compared;
        // Fields beside times and counters that were not compared: at most one datagram in a hundred.
        let others = report
            .equal_but
            .iter()
            .filter(|one| one.reason != Class::Time.name() && one.reason != Class::Counter.name());
        let exempt: u64 = others.map(|one| one.datagrams).sum();
        if report.different > 0 || exempt * 100 > report.compared.max(100) {
            wrong.push(format!("{}: {exempt} exempt\n{report}", path.display()));
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
    assert!(judged > 20_000, "only {judged} datagrams were compared");
}
