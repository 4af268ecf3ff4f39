//! Captures and readings in whatever form they come: packed, with any name, through pipes, several at
//! once, ended before their end.

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread;
use std::time::Duration;

use crate::support::capture::Pcap;
use crate::support::{PROGRAM, Run, assert_valid, linesman};
use serde_json::Value;
use tempfile::TempDir;

const READINGS: &str = "[[device]]\nname = \"K1\"\non = \"maindevice\"\n";

fn capture(exchanges: u64) -> Vec<u8> {
    let mut capture = Pcap::new();
    capture.exchanges(exchanges);
    capture.0
}

fn xz(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = liblzma::write::XzEncoder::new(Vec::new(), 1);
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn zst(bytes: &[u8]) -> Vec<u8> {
    zstd::encode_all(bytes, 1).unwrap()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn write(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    path
}

fn diagnose(path: &Path, more: &[&str]) -> Run {
    linesman(
        ["diagnose".as_ref(), path.as_os_str()].into_iter().chain(more.iter().map(AsRef::as_ref)),
    )
}

/// The program with a pipe for its standard input.
fn piped(arguments: &[&str]) -> (Child, ChildStdin) {
    let mut child = Command::new(PROGRAM)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let stdin = child.stdin.take().unwrap();
    (child, stdin)
}

fn ended(child: Child) -> Run {
    let output = child.wait_with_output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let status = output.status.code().unwrap_or_else(|| panic!("killed: {}", output.status));
    Run { status, stdout: text(output.stdout), stderr: text(output.stderr) }
}

fn interrupt(child: &Child) {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// How much the program has read so far.
fn read_bytes(child: &Child) -> u64 {
    let io = fs::read_to_string(format!("/proc/{}/io", child.id())).unwrap_or_default();
    let read = io.lines().find_map(|line| line.strip_prefix("rchar: "));
    read.and_then(|bytes| bytes.parse().ok()).unwrap_or(u64::MAX)
}

#[test]
fn a_capture_is_known_by_its_bytes_whatever_it_is_called() {
    let folder = TempDir::new().unwrap();
    let plain = capture(50);
    for (name, bytes) in [
        ("trace.pcap1", plain.clone()),
        ("trace.pcap.2", plain.clone()),
        ("capture", plain.clone()),
        ("12:30", plain.clone()),
        ("packed.xz", xz(&plain)),
        ("packed.zst", zst(&plain)),
        ("no-end", zst(&plain)),
        ("wrong.gz", xz(&plain)),
    ] {
        let path = write(&folder, name, bytes);
        let run = diagnose(&path, &["--json"]);
        assert_eq!((run.status, run.stderr.as_str()), (0, ""), "{name}: {}", run.all());
        let diagnosis = run.json();
        assert_eq!(diagnosis["network"]["datagrams"], 50, "{name}");
        assert_eq!(diagnosis["source"], format!("capture:{}", path.display()));
        // In its own folder it has no path that tells it from a card.
        let run = crate::support::run(
            Command::new(PROGRAM).args(["diagnose", name]).current_dir(folder.path()),
        );
        assert_eq!(run.status, 0, "{name}: {}", run.all());
    }
}

#[test]
fn a_packed_capture_that_is_cut_off_is_judged_as_far_as_it_goes() {
    let folder = TempDir::new().unwrap();
    let plain = capture(20_000);
    for (name, packed) in [("gz", gzip(&plain)), ("xz", xz(&plain)), ("zst", zst(&plain))] {
        let path = write(&folder, name, &packed[..packed.len() / 2]);
        let run = diagnose(&path, &["--json"]);
        let diagnosis = run.json();
        assert_valid(&diagnosis, "diagnosis");
        assert_eq!(diagnosis["complete"], false, "{name}");
        let datagrams = diagnosis["network"]["datagrams"].as_u64().unwrap();
        assert!((1_000..20_000).contains(&datagrams), "{name}: {datagrams}");
        assert!(run.stderr.contains("reading failed"), "{name}: {}", run.stderr);
    }
}

#[test]
fn standard_input_takes_captures_and_readings_packed_or_not() {
    let plain = capture(50);
    for bytes in [plain.clone(), gzip(&plain), xz(&plain), zst(&plain)] {
        let (child, mut stdin) = piped(&["diagnose", "-", "--json"]);
        stdin.write_all(&bytes).unwrap();
        drop(stdin);
        let run = ended(child);
        assert_eq!((run.status, run.stderr.as_str()), (0, ""), "{}", run.all());
        let diagnosis = run.json();
        assert_eq!(diagnosis["source"], "capture:-");
        assert_eq!(diagnosis["complete"], true);
        assert_eq!(diagnosis["network"]["datagrams"], 50);
        assert_eq!(diagnosis["start"], "2023-11-14T22:13:20.000000000Z");
    }
    let utf_16: Vec<u8> =
        format!("\u{FEFF}{READINGS}").encode_utf16().flat_map(u16::to_le_bytes).collect();
    for bytes in [READINGS.as_bytes().to_vec(), gzip(READINGS.as_bytes()), utf_16] {
        let (child, mut stdin) = piped(&["diagnose", "-", "--json"]);
        stdin.write_all(&bytes).unwrap();
        drop(stdin);
        let run = ended(child);
        assert_eq!(run.json()["source"], "-", "{}", run.all());
        assert_eq!(run.json()["network"]["devices"], 1, "{}", run.all());
    }
    let (child, stdin) = piped(&["diagnose", "/dev/stdin"]);
    drop(stdin);
    let run = ended(child);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("/dev/stdin: the file is empty"), "{}", run.stderr);
}

#[test]
fn a_pipe_is_judged_while_it_streams() {
    let (mut child, mut stdin) = piped(&["diagnose", "-", "--follow", "--json"]);
    stdin.write_all(&Pcap::with_a_gap(200).0).unwrap();
    stdin.flush().unwrap();
    // The pipe stays open: whatever is told now was told before the end.
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let event: Value = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
    assert_valid(&event, "event");
    assert_eq!(event["event"], "opened");
    // Ctrl-C ends it, as it ends who writes.
    interrupt(&child);
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    let last: Value = serde_json::from_str(rest.last().unwrap()).unwrap();
    assert_eq!(last["diagnosis"]["complete"], true, "{last}");
    assert_eq!(child.wait().unwrap().code(), Some(1));
    drop(stdin);
}

#[test]
fn a_named_pipe_is_waited_for_until_ctrl_c() {
    let folder = TempDir::new().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let word = pipe.display().to_string();
    let (child, _stdin) = piped(&["diagnose", &word, "--json"]);
    thread::sleep(Duration::from_millis(200));
    let mut writer = fs::OpenOptions::new().write(true).open(&pipe).unwrap();
    writer.write_all(&capture(50)).unwrap();
    drop(writer);
    let run = ended(child);
    assert_eq!(run.status, 0, "{}", run.all());
    assert_eq!(run.json()["network"]["datagrams"], 50);
    // Nobody ever writes into it.
    let (child, _stdin) = piped(&["diagnose", &word]);
    thread::sleep(Duration::from_millis(200));
    interrupt(&child);
    let run = ended(child);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("the file is empty"), "{}", run.stderr);
}

#[test]
fn several_files_are_told_in_a_line_each() {
    let folder = TempDir::new().unwrap();
    let good = write(&folder, "good.pcap0", capture(50));
    let bad = write(&folder, "bad.zst", zst(&Pcap::with_a_gap(200).0));
    let read = write(&folder, "read.txt", READINGS);
    let none = folder.path().join("none.pcap");
    let run = |files: &[&Path], more: &[&str]| {
        let files = files.iter().map(|file| file.as_os_str());
        linesman(
            ["diagnose".as_ref()].into_iter().chain(files).chain(more.iter().map(AsRef::as_ref)),
        )
    };
    let all = run(&[&good, &bad, &none, &read], &[]);
    assert_eq!(all.status, 1, "a fault outweighs what cannot be read: {}", all.all());
    let lines: Vec<&str> = all.stdout.lines().collect();
    for (line, (verdict, file)) in lines[1..].iter().zip([
        ("HEALTHY", "good.pcap0"),
        ("FAULTY", "bad.zst"),
        ("NOT JUDGED", "none.pcap"),
        ("", "read.txt"),
    ]) {
        assert!(line.starts_with(verdict) && line.contains(file), "{}", all.stdout);
    }
    assert!(lines[2].contains("error") && lines[3].contains("no such file"), "{}", all.stdout);
    assert_eq!(run(&[&good, &none], &[]).status, 2);
    assert_eq!(run(&[&good, &good], &[]).status, 0);
    let run_json = run(&[&good, &bad, &none], &["--json"]);
    assert_eq!(run_json.status, 1);
    let report = run_json.json();
    assert_valid(&report, "diagnoses");
    assert_eq!(report["schema"], "linesman.diagnoses/1");
    assert_eq!(report["files"][0]["diagnosis"]["verdict"], "healthy");
    assert_eq!(report["files"][1]["diagnosis"]["verdict"], "faulty");
    let reason = report["files"][2]["error"]["reason"].as_str().unwrap();
    assert!(reason.contains("no such file"), "{report}");
    let refused = run(&[&good, &bad], &["--html", "x.html"]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("`--html`"), "{}", refused.stderr);
    let refused = run(&[&good, Path::new("listen:eth0")], &[]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("`listen:eth0`: this is no file"), "{}", refused.stderr);
}

#[test]
fn ctrl_c_in_a_long_capture_gives_the_verdict_so_far() {
    let folder = TempDir::new().unwrap();
    let path = write(&folder, "long.pcap", capture(600_000));
    let word = path.display().to_string();
    let (mut child, _stdin) = piped(&["diagnose", &word, "--json"]);
    // Its handler of signals is there once it reads.
    while read_bytes(&child) < 4_000_000 {
        thread::sleep(Duration::from_millis(1));
    }
    interrupt(&child);
    let mut out = String::new();
    child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
    let run = ended(child);
    let diagnosis: Value = serde_json::from_str(&out).unwrap();
    assert_valid(&diagnosis, "diagnosis");
    assert_eq!(diagnosis["complete"], false, "{}", run.stderr);
    let frames = diagnosis["network"]["frames"].as_u64().unwrap();
    assert!((1..1_200_000).contains(&frames), "{frames}");
    let said = run.stderr.lines().find(|line| line.contains("ended at ")).unwrap();
    assert!(said.contains(" %, ") && said.contains("judged so far"), "{said}");
}

#[test]
fn pipe_that_ends_before_anything_came_is_called_so() {
    for words in [&["diagnose", "-"][..], &["capture", "info", "-"], &["capture", "list", "-"]] {
        let (child, stdin) = piped(words);
        drop(stdin);
        let run = ended(child);
        assert_eq!(run.status, 2, "{}", run.all());
        assert!(run.stderr.contains("standard input ended before anything came"), "{}", run.all());
        assert!(
            run.stderr.contains("do: look whether the command before the pipe"),
            "{}",
            run.all()
        );
    }
}

#[test]
fn frames_without_ethernet_are_named_where_they_are_left_out() {
    let folder = TempDir::new().unwrap();
    let mut bytes = capture(10);
    // The link type of the file: Wi-Fi.
    bytes[20..24].copy_from_slice(&105_u32.to_le_bytes());
    let path = write(&folder, "wifi.pcap", bytes);
    let (path, out) = (path.to_str().unwrap(), folder.path().join("some.pcapng"));
    let csv = folder.path().join("rows.csv");
    let rows: &[&[&str]] = &[
        &["capture", "list", path],
        &["capture", "filter", path, "cyclic", "-o", out.to_str().unwrap()],
        &["capture", "export", path, "--csv", csv.to_str().unwrap()],
    ];
    for words in rows {
        let run = linesman(*words);
        let said = "20 frames of link type Wi-Fi (105) were left out: they carry no Ethernet";
        assert!(run.stderr.contains(said), "{words:?}: {}", run.all());
    }
}

#[test]
fn clock_that_was_set_back_is_told_with_how_far() {
    let folder = TempDir::new().unwrap();
    let mut bytes = capture(20);
    let path = write(&folder, "steady.pcap", &bytes);
    let run = linesman(["diagnose", path.to_str().unwrap()]);
    assert!(!run.stderr.contains("set back"), "{}", run.all());
    // The second half, an hour earlier.
    let record = 16 + 60;
    for number in 20..40 {
        let at = 24 + number * record;
        let seconds = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) - 3_600;
        bytes[at..at + 4].copy_from_slice(&seconds.to_le_bytes());
    }
    let path = write(&folder, "back.pcap", bytes);
    for words in [
        ["diagnose", path.to_str().unwrap()].as_slice(),
        &["capture", "info", path.to_str().unwrap()],
    ] {
        let run = linesman(words);
        let said = "the clock of the recording was set back by 3599.999 s: 20 frames are earlier";
        assert!(run.stderr.contains(said), "{}", run.all());
    }
}
