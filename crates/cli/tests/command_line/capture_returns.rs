//! Frames going out and coming back, and wrong working counters among them, beside what tshark shows of the same
//! recordings: times and counters are put together here, without any code of ours.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command as Program;

use crate::capture_dissection::files;
use crate::capture_info::info;
use crate::captures::captures;
use crate::support::linesman;
use tempfile::TempDir;

/// A frame as tshark shows it.
struct DissectedFrame {
    number: u64,
    /// In ns since 1970.
    time: i128,
    is_return: bool,
    /// Index and commands of all datagrams, by which a return belongs to its request.
    key: String,
    /// By logical address: the working counter.
    counters: Vec<(String, u16)>,
}

/// The EtherCAT frames of a capture; `None`, said aloud, without tshark.
fn dissected(path: &Path) -> Option<Vec<DissectedFrame>> {
    let mut tshark = Program::new("tshark");
    tshark.arg("-r").arg(path).args(["-Y", "ecat", "-T", "fields", "-E", "separator=|"]);
    let fields = [
        "frame.number",
        "frame.time_epoch",
        "eth.src",
        "ecat.idx",
        "ecat.cmd",
        "ecat.lad",
        "ecat.cnt",
    ];
    for field in fields {
        tshark.args(["-e", field]);
    }
    let Ok(output) = tshark.output() else {
        eprintln!("SKIPPED: tshark is not here to judge what a capture holds");
        return None;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap().lines().map(frame).collect())
}

fn frame(line: &str) -> DissectedFrame {
    let columns: Vec<&str> = line.split('|').collect();
    let [number, time, source, index, commands, logical, counters] = columns[..] else {
        panic!("tshark printed {line}");
    };
    let (seconds, part) = time.split_once('.').unwrap();
    let nanos: i128 = format!("{part:0<9}").parse().unwrap();
    let is_logical = |command: &&str| ["0x0a", "0x0b", "0x0c"].contains(command);
    let commanded = commands.split(',').zip(counters.split(','));
    let counted = commanded.filter(|(command, _)| is_logical(command));
    let addressed = logical.split(',').zip(counted);
    DissectedFrame {
        number: number.parse().unwrap(),
        time: seconds.parse::<i128>().unwrap() * 1_000_000_000 + nanos,
        // The first controller marks the source address.
        is_return: u8::from_str_radix(&source[..2], 16).unwrap() & 2 != 0,
        key: format!("{index} {commands}"),
        counters: addressed
            .map(|(address, (command, counter))| {
                (format!("{command} {address}"), counter.parse().unwrap())
            })
            .collect(),
    }
}

/// Times from each frame going out to its return, in ns.
fn response_times(frames: &[DissectedFrame]) -> Vec<i128> {
    let mut sent = BTreeMap::new();
    let mut times = Vec::new();
    for frame in frames {
        if !frame.is_return {
            sent.insert(&frame.key, frame.time);
        } else if let Some(at) = sent.remove(&frame.key) {
            times.push(frame.time - at);
        }
    }
    times
}

// proves: WS-04 (P)
#[test]
fn each_frame_of_a_capture_is_paired_with_its_return_as_tshark_times_them() {
    let Some(directory) = captures() else { return };
    let mut pairs = 0;
    for path in files(&directory) {
        let Some(frames) = dissected(&path) else { return };
        let times = response_times(&frames);
        let response = &info(&path)["timing"]["response"];
        let ours = ["count", "min_ns", "max_ns"].map(|key| response[key].as_i64());
        let theirs = [
            (!times.is_empty()).then_some(times.len() as i64),
            times.iter().min().map(|time| *time as i64),
            times.iter().max().map(|time| *time as i64),
        ];
        assert_eq!(ours, theirs, "{}: number, shortest, longest", path.display());
        pairs += times.len();
    }
    assert!(pairs > 20_000, "{pairs} pairs");
}

/// A line on which a coupler and its terminal start anew.
const PLANT: &str = "\
name = \"press\"

[[device]]
name = \"K1\"
type = \"EK1100\"
on = \"maindevice\"

[[device]]
name = \"T1\"
type = \"EL1008\"
on = \"K1.B\"

[[device]]
name = \"T2\"
type = \"EL2008\"
on = \"T1.B\"

[[device]]
name = \"K2\"
type = \"EK1100\"
on = \"K1.C\"

[[device]]
name = \"T4\"
type = \"EL2008\"
on = \"K2.B\"

[[fault]]
kind = \"brown-out\"
device = \"K2\"
dip_ms = 50
from_ms = 2000
";

// proves: WS-13 (P)
#[test]
fn wrong_working_counters_of_a_recording_are_those_that_tshark_shows_and_lead_to_the_verdict() {
    let folder = TempDir::new().unwrap();
    let (plant, recording) = (folder.path().join("press.toml"), folder.path().join("press.pcapng"));
    fs::write(&plant, PLANT).unwrap();
    let (on, file) = (format!("sim:{}", plant.display()), recording.to_str().unwrap());
    let run = linesman(["diagnose", &on, "--seconds", "6", "--record", file]);
    assert_eq!(run.status, 1, "{}", run.all());

    let told = info(&recording);
    let datagrams = told["cyclic"].as_array().unwrap().iter();
    let datagrams = datagrams.flat_map(|frame| frame["datagrams"].as_array().unwrap());
    let logical: Vec<_> = datagrams.filter(|one| !one["logical"].is_null()).collect();
    assert_eq!(logical.len(), 1, "{told:#}");
    let misses = logical[0]["misses"].as_array().unwrap();
    assert_eq!(misses.len(), 1, "{misses:?}");
    let wrong =
        linesman(["capture", "filter", file, "datagram(ecat.lad && wkc.wrong)", "--numbers"]);
    let wrong: Vec<u64> = wrong.stdout.lines().map(|line| line.parse().unwrap()).collect();
    assert_eq!(misses[0]["count"].as_u64(), Some(wrong.len() as u64));

    let verdict = linesman(["diagnose", file, "--json"]).json();
    let first = &verdict["findings"][0];
    assert_eq!(
        (&first["cause"], &first["place"]["no"]),
        (&"brown-out".into(), &4.into()),
        "{verdict:#}"
    );

    let Some(frames) = dissected(&recording) else { return };
    let returned: Vec<(u64, u16)> = frames
        .iter()
        .filter(|frame| frame.is_return)
        .flat_map(|frame| frame.counters.iter().map(|(_, counter)| (frame.number, *counter)))
        .collect();
    let full = returned.iter().map(|(_, counter)| *counter).max().unwrap();
    let is_low = |(_, counter): &&(u64, u16)| *counter < full;
    let up = returned.iter().skip_while(is_low);
    let low: Vec<u64> = up.filter(is_low).map(|(number, _)| *number).collect();
    assert_eq!(misses[0]["expected"].as_u64(), Some(full.into()));
    // What comes back while the SubDevice is set up anew is low, but no miss.
    assert!(low.starts_with(&wrong), "{wrong:?}, tshark shows {low:?}");
    assert!(wrong.len() > 100 && low.len() - wrong.len() <= 10, "{} of {}", wrong.len(), low.len());
}
