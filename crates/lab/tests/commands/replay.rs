//! Recordings of real lines, played against segments that are built from what they show.

#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "a test reads files")]

use std::path::PathBuf;

use linesman_diagnosis::{Direction, FrameSeen};
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
            probe: None,
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
        // What earlier messages left in a mailbox is foretold; only the byte that closes it is not.
        let foretold = report.equal_but.iter().all(|one| {
            ["time", "counter", "closing byte of a mailbox"].contains(&one.reason.as_str())
        });
        if report.different > 0 || !foretold {
            wrong.push(format!("{}: {report}", path.display()));
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
    assert!(judged > 20_000, "only {judged} datagrams were compared");
}

/// A recording that begins in the middle of a run tells less; what it tells still comes out.
#[test]
fn recordings_may_begin_in_the_middle() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = std::env::var("LINESMAN_DATA").unwrap_or(root.to_owned());
    let mut wrong = Vec::new();
    // From here on mappings and mailboxes are still set up in what is left.
    for (name, tenths) in [
        ("ec-replay-ek1100-el2828-el2889", &[1, 3, 5][..]),
        ("echist-replay-mailbox-el3004", &[1, 3, 7]),
        ("ec-soem-sdinfo-ek1100-el1004", &[1, 3]),
        ("echist-no-reborrow-202307", &[1, 3]),
    ] {
        let path = PathBuf::from(format!("{data}/pcap/{name}.pcapng"));
        if !path.exists() {
            eprintln!("SKIPPED: no {}; set LINESMAN_DATA", path.display());
            continue;
        }
        let whole = record(&path);
        for tenths in tenths {
            let from = whole.turns.len() * tenths / 10;
            let recording =
                Recording { turns: whole.turns[from..].to_vec(), ..Recording::default() };
            let learned = learn(&recording);
            let mut model = model(&learned, &[]).unwrap();
            let report = play(&recording, &mut model);
            println!("==== {name} from {tenths} tenths on\n{report}");
            // Three in a hundred: the first answers may rest on what went before.
            if report.different * 100 > report.compared * 3 {
                wrong.push(format!("{name} from {tenths} tenths on: {report}"));
            }
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
}
