//! `linesman capture filter` against `tshark -Y` with the same expressions, on the frames of all real captures.

use std::path::{Path, PathBuf};
use std::process::Command;

use linesman_link::capture::{
    CaptureInterfaceId, CaptureReader, FrameToWrite, InterfaceToWrite, LinkType, PcapngWriter,
};
use linesman_link::unix_time::UnixTime;

use crate::support::{assert_valid, linesman};

/// The program that is compared with.
const TSHARK: &str = "tshark";

/// Expressions that mean the same in both programs.
const EXPRESSIONS: [&str; 64] = [
    "frame",
    "ecat",
    "ecat.cmd == 0x0a || ecat.cmd == 0x0b || ecat.cmd == 0x0c",
    "ecat.cmd in {0x0a..0x0c}",
    "ecat.cmd == \"LRW\"",
    "ecat.cmd == fprd",
    "ecat.cmd != 4",
    "!(ecat.cmd == 4)",
    "! ecat.cmd == 4",
    "not ecat.cmd == 4 and ecat.cnt == 1",
    "ecat.cmd === 4",
    "ecat.cmd !== 4",
    "all ecat.cnt == 1",
    "any ecat.cnt != 1",
    "ecat.cmd not in {4..7}",
    "ecat.lad",
    "ecat.lad != 0",
    "!(ecat.lad == 0)",
    "ecat.lad >= 0x00010000 and ecat.lad < 0x01000000",
    "ecat.ado == 0x0130",
    "ecat.ado >= 0x0300 && ecat.ado <= 0x0313",
    "ecat.ado in {0x0120, 0x0130..0x0137, 0x0502}",
    "ecat.ado not in {0x0130}",
    "ecat.adp == 0x1000 || ecat.adp == 0x1001",
    "ecat.adp > 0x1001",
    "ecat.adp lt 4",
    "ecat.cnt == 0",
    "ecat.cnt gt 1",
    "ecat.cnt ge 1 and ecat.cnt le 2",
    "ecat.cnt ne 1",
    "ecat.cnt eq 3",
    "ecat.cnt == 010",
    "ecat.int & 0x4",
    "ecat.int != 0",
    "ecat.idx == 0",
    "ecat.idx in {0x10..0x20, 0xff}",
    "ecat.subframe.length == 2",
    "ecat.subframe.length > 100",
    "ecat.subframe.more == 1",
    "ecat.subframe.more == 0",
    "ecat.subframe.circulating == 1",
    "ecat.cmd == 4 or ecat.cmd == 5 and ecat.cnt == 0",
    "(ecat.cmd == 4 or ecat.cmd == 5) and ecat.cnt == 0",
    "!(ecat.cmd == 7 || ecat.cmd == 8) && !(ecat.ado == 0x0130 and ecat.cnt > 0)",
    "ecat.sub1.cmd == 12 && ecat.sub2.cmd == 4",
    "ecat.sub2.cnt > 0",
    "ecat.sub3.ado == 0x0130",
    "ecat_mailbox",
    "!ecat_mailbox && ecat.ado >= 0x1000",
    "ecat_mailbox.coe",
    "ecat_mailbox.foe || ecat_mailbox.soe || ecat_mailbox.eoe",
    "ecat_mailbox.type == 3",
    "ecat_mailbox.length > 10",
    "ecat_mailbox.counter == 1",
    "ecat_mailbox.coe.type == 2",
    "ecat_mailbox.coe.sdoidx == 0x1018",
    "ecat_mailbox.coe.sdoidx >= 0x1c00 && ecat_mailbox.coe.sdosub != 0",
    "ecat_mailbox.coe.abortcode",
    "eth.src == 10:10:10:10:10:10",
    "eth.addr == ff:ff:ff:ff:ff:ff and !(eth.src == 12:10:10:10:10:10)",
    "frame.len > 60",
    "frame.number in {5..20, 400}",
    "ecatf.type == 1 and ecatf.length > 14",
    "eth.type == 0x88a4",
];

fn data() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let directory = std::env::var_os("LINESMAN_DATA").map_or(root, PathBuf::from).join("pcap");
    let is_there = directory.is_dir();
    if !is_there {
        eprintln!("SKIPPED: no captures at {}; set LINESMAN_DATA", directory.display());
    }
    is_there.then_some(directory)
}

fn has_tshark() -> bool {
    let found = Command::new(TSHARK).arg("--version").output().is_ok();
    if !found {
        eprintln!("SKIPPED: no tshark on this computer");
    }
    found
}

/// The frames of all captures in one file: so tshark starts once for an expression, not once for each file.
fn all_frames(directory: &Path, target: &Path) -> usize {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let mut writer = PcapngWriter::new(std::fs::File::create(target).unwrap(), "").unwrap();
    let interface = InterfaceToWrite { name: "", description: "", link_type: LinkType::Ethernet };
    writer.add_interface(&interface).unwrap();
    for file in &files {
        let mut reader = CaptureReader::open(file).unwrap();
        while let Some(frame) = reader.next_frame() {
            let time = frame.time.unwrap_or(UnixTime::EPOCH);
            let frame =
                FrameToWrite::new(CaptureInterfaceId(0), time, frame.direction, frame.stored);
            writer.write_frame(&frame).unwrap();
        }
    }
    writer.finish().unwrap();
    files.len()
}

fn by_tshark(file: &Path, expression: &str) -> Vec<u64> {
    let mut command = Command::new(TSHARK);
    command.arg("-r").arg(file).args(["-Y", expression, "-T", "fields", "-e", "frame.number"]);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{expression}: {}", String::from_utf8_lossy(&output.stderr));
    numbers(&String::from_utf8(output.stdout).unwrap())
}

fn by_linesman(file: &Path, expression: &str) -> Vec<u64> {
    let file = file.to_str().unwrap();
    let run = linesman(["capture", "filter", file, expression, "--numbers"]);
    assert_eq!(run.status, 0, "{expression}: {}", run.stderr);
    numbers(&run.stdout)
}

fn numbers(text: &str) -> Vec<u64> {
    text.lines().map(|line| line.parse().unwrap()).collect()
}

/// Frames that one of two lists has alone.
fn differences(ours: &[u64], theirs: &[u64]) -> Vec<u64> {
    let lacks = |list: &[u64], number: &u64| list.binary_search(number).is_err();
    let only_ours = ours.iter().filter(|number| lacks(theirs, number));
    only_ours.chain(theirs.iter().filter(|number| lacks(ours, number))).copied().collect()
}

// proves: WS-08 (UP), WS-09
#[test]
fn filter_picks_the_frames_that_tshark_picks() {
    let (Some(directory), true) = (data(), has_tshark()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("all.pcapng");
    let files = all_frames(&directory, &file);
    assert!(files >= 17, "{files} captures");
    let mut wrong = Vec::new();
    let mut picked = 0;
    for expression in EXPRESSIONS {
        let (ours, theirs) = (by_linesman(&file, expression), by_tshark(&file, expression));
        picked += usize::from(!theirs.is_empty());
        let differing = differences(&ours, &theirs);
        if !differing.is_empty() {
            let few = &differing[..differing.len().min(5)];
            wrong.push(format!("{expression}: {} against {}: {few:?}", ours.len(), theirs.len()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(picked > 45, "of {} expressions {picked} pick any frame", EXPRESSIONS.len());
    // The comparison sees a difference where there is one.
    let ours = by_linesman(&file, "ecat.cmd == 4");
    assert!(!differences(&ours, &by_tshark(&file, "ecat.cmd == 5")).is_empty());
}

fn one(name: &str) -> Option<String> {
    let file = data()?.join(format!("{name}.pcapng"));
    Some(file.to_str().unwrap().to_owned())
}

// proves: WS-08, WS-12 partial
#[test]
fn selection_is_saved_with_interfaces_and_times() {
    let Some(file) = one("ec-replay-ek1100-el2828-el2889") else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in ["some.pcapng", "some.pcap"] {
        let target = folder.path().join(name);
        let run = linesman([
            "capture".as_ref(),
            "filter".as_ref(),
            file.as_ref(),
            "cyclic and out".as_ref(),
            "-o".as_ref(),
            target.as_os_str(),
            "--json".as_ref(),
        ]);
        assert_eq!(run.status, 0, "{}", run.stderr);
        let report = run.json();
        assert_valid(&report, "capture-filter");
        let matched = report["matched"].as_u64().unwrap();
        assert!(matched > 100, "{report}");
        let mut reader = CaptureReader::open(&target).unwrap();
        let mut original = CaptureReader::open(&file).unwrap();
        let mut count = 0;
        while let Some(frame) = reader.next_frame() {
            count += 1;
            let is_it = loop {
                let Some(other) = original.next_frame() else { break false };
                if other.bytes == frame.bytes && other.time == frame.time {
                    break true;
                }
            };
            assert!(is_it, "frame {count} of {name} is not in the original, or out of order");
        }
        assert_eq!(count, matched);
        let again = linesman([
            "capture".as_ref(),
            "filter".as_ref(),
            file.as_ref(),
            "cyclic".as_ref(),
            "-o".as_ref(),
            target.as_os_str(),
        ]);
        assert_eq!(again.status, 2, "a file that is there is not written over");
    }
}

// proves: WS-08
#[test]
fn subdevice_is_found_by_number_name_and_station() {
    let Some(file) = one("ec-replay-ek1100-el2828-el2889") else { return };
    let picked = |condition: &str| by_linesman(Path::new(&file), condition);
    let by_number = picked("subdevice == 2 && !cyclic");
    assert!(by_number.len() > 100);
    assert_eq!(picked("subdevice == \"EL2828\" and not cyclic"), by_number);
    assert_eq!(picked("subdevice == 0x1001 && !cyclic"), by_number);
    let others = picked("subdevice in {1, 3} && !cyclic");
    assert!(!others.is_empty() && others != by_number);
    let nobody = linesman(["capture", "filter", &file, "cyclic && subdevice == \"Pump\""]);
    assert_eq!(nobody.status, 2);
    assert!(nobody.stderr.contains("column 24"), "{}", nobody.stderr);
    assert!(nobody.stderr.contains("SubDevice 2 (EL2828)"), "{}", nobody.stderr);
}

// proves: WS-10
#[test]
fn field_of_a_frame_becomes_a_condition_that_picks_it() {
    let Some(file) = one("ec-replay-ek1100-el2828-el2889") else { return };
    let like = |words: &[&str]| {
        let mut all = vec!["capture", "filter", &file, "--like-frame"];
        all.extend(words);
        let run = linesman(all);
        assert_eq!(run.status, 0, "{}", run.stderr);
        run.stdout.trim().to_owned()
    };
    for (words, expected) in [
        (&["900", "--field", "ecat.ado"][..], "ecat.ado == 0x0502"),
        (&["900", "--field", "ecat.cmd"], "ecat.cmd == \"FPRD\""),
        (&["3053", "--field", "ecat.sub2.ado"], "ecat.sub2.ado == 0x0130"),
        (&["3053", "--field", "ecat.cmd"], "ecat.cmd in {\"FPRD\", \"LRW\"}"),
    ] {
        let condition = like(words);
        assert_eq!(condition, expected);
        let number: u64 = words[0].parse().unwrap();
        assert!(by_linesman(Path::new(&file), &condition).contains(&number), "{condition}");
    }
    let condition = like(&["3053"]);
    let picked = by_linesman(Path::new(&file), &condition);
    assert!(picked.contains(&3053) && picked.contains(&3055), "{condition}");
    let missing = linesman(["capture", "filter", &file, "--like-frame", "999999"]);
    assert_eq!(missing.status, 2);
}

// proves: WS-07
#[test]
fn times_are_absolute_differences_or_in_the_cycle() {
    let Some(file) = one("ec-replay-ek1100-el2828-el2889") else { return };
    let times = |form: &str| {
        let words = ["capture", "list", &file, "--time", form, "--where", "cyclic", "-n", "3"];
        let run = linesman(words);
        assert_eq!(run.status, 0, "{}", run.stderr);
        let rows = run.stdout.lines().skip(1).filter(|line| line[..8].trim() != "");
        rows.map(|line| line[10..].trim_start().to_owned()).collect::<Vec<_>>()
    };
    let absolute = times("absolute");
    assert!(absolute.iter().all(|row| row.starts_with("20") && row.contains(" +00:00  ")));
    let starts = |rows: &[String], at: usize, with: &str| rows[at].starts_with(with);
    let difference = times("difference");
    assert!(starts(&difference, 0, "0.000000000") && !starts(&difference, 2, "0.000000000"));
    let in_cycle = times("cycle");
    assert!(starts(&in_cycle, 0, "0.000000000"), "{in_cycle:?}");
    assert!(!starts(&in_cycle, 1, "0.000000000") && starts(&in_cycle, 2, "0.000000000"));
}

#[test]
fn wrong_condition_is_shown_where_it_is_wrong() {
    for (condition, column, advice) in [
        ("ecat.cmd = 4", 10, "compare by =="),
        ("ecat.cmd ==", 12, "write a command"),
        ("ecat.cmdd == 4", 1, "did you mean ecat.cmd?"),
        ("ecat.cmd == 300", 13, "write a command"),
        ("(ecat.cmd == 4", 15, "put `)` there"),
        ("ecat.cnt in {1 2}", 16, "put `}` there"),
        ("cyclic == 1", 1, "write cyclic alone"),
        ("ecat.cmd == 4 AND cyclic", 15, "small letters"),
        ("", 1, "write a condition"),
    ] {
        let run = linesman(["capture", "filter", "/dev/null", condition]);
        assert_eq!(run.status, 2, "{condition}");
        assert!(run.stderr.contains(&format!("column {column}:")), "{condition}: {}", run.stderr);
        assert!(run.stderr.contains(advice), "{condition}: {}", run.stderr);
    }
}
