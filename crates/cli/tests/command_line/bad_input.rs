//! Unusable input: a clear message, exit status 2, never a panic.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::capture::{HEADER, Pcap, RECORD};
use crate::support::{PROGRAM, Run, assert_valid, linesman};
use tempfile::TempDir;

/// Files of one test.
struct Files(TempDir);

impl Files {
    fn new() -> Self {
        Self(TempDir::new().expect("a temporary directory"))
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).expect("a file can be written");
        path
    }
}

/// Fails unless the run said why nothing could be judged, with all of `words`, and gave advice.
#[track_caller]
fn refused(run: &Run, words: &[&str]) {
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.starts_with("error: "), "{}", run.stderr);
    assert!(run.stderr.contains("\ndo: "), "there is no advice: {}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "`{word}` is missing: {}", run.stderr);
    }
}

#[test]
fn a_segment_file_that_is_none() {
    let files = Files::new();
    let sim = |path: PathBuf| {
        linesman(["sim".as_ref(), path.as_os_str(), "--on".as_ref(), "nope0".as_ref()])
    };
    let rows: [(&str, &[u8], &[&str]); 5] = [
        ("unknown.toml", b"name = \"x\"\nsped = 3\n", &["unknown.toml", "sped"]),
        ("syntax.toml", b"name = \n", &["syntax.toml", "1"]),
        ("binary.toml", &[0xFF, 0xFE, 0, 1, 2, 3, 4, 5, 6, 7], &["byte 0", "UTF-8"]),
        (
            "type.toml",
            b"[[device]]\nname = \"K1\"\ntype = \"EK9\"\non = \"maindevice\"\n",
            &["K1", "EK9"],
        ),
        (
            "place.toml",
            b"[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"K7.B\"\n",
            &["K1", "K7"],
        ),
    ];
    for (name, bytes, words) in rows {
        let run = sim(files.write(name, bytes));
        assert_eq!(run.status, 2, "{name}: {}", run.all());
        for word in words {
            assert!(run.stderr.contains(word), "{name}, `{word}`: {}", run.stderr);
        }
    }
    refused(&sim(files.0.path().join("missing.toml")), &["missing.toml", "no such file"]);
}

#[test]
fn an_interface_that_does_not_exist() {
    let files = Files::new();
    let plant = "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n";
    let plant = files.write("plant.toml", plant);
    let run = linesman(["sim".as_ref(), plant.as_os_str(), "--on".as_ref(), "nope0".as_ref()]);
    refused(&run, &["nope0", "there are:", "lo", "linesman interfaces"]);
    let run = linesman(["sim".as_ref(), plant.as_os_str(), "--on".as_ref(), "a+b+c".as_ref()]);
    refused(&run, &["a+b+c"]);
}

#[test]
fn a_refusal_is_json_when_json_was_asked_for() {
    let run = linesman(["interfaces", "--json", "--nonsense"]);
    assert_eq!(run.status, 2);
    assert_valid(&run.json(), "error");
}

fn diagnose(path: &Path, more: &[&str]) -> Run {
    let start = [OsStr::new("diagnose"), path.as_os_str()];
    linesman(start.into_iter().chain(more.iter().map(OsStr::new)))
}

/// A pcapng file up to the middle of its first block.
const CUT_PCAPNG: [u8; 14] = [0x0A, 0x0D, 0x0D, 0x0A, 0x1C, 0, 0, 0, 0x4D, 0x3C, 0x2B, 0x1A, 1, 0];

#[test]
fn a_capture_that_is_none() {
    let files = Files::new();
    let mut foreign = Pcap::new();
    let mut arp = [0xFF; 60];
    arp[12..14].copy_from_slice(&[0x08, 0x06]);
    foreign.frame(0, &arp);
    let rows: [(&str, &[u8], &[&str]); 6] = [
        ("cut.pcapng", &CUT_PCAPNG, &["first block", "cut off", "record it again"]),
        ("empty.pcap", &[], &["is empty"]),
        ("random.pcap", &[3, 141, 59, 26, 53, 58, 97, 93, 23, 84], &["03 8d 3b 1a", "tcpdump"]),
        ("text.pcapng.gz", b"hello, world, no gzip", &["expected the first bytes of a capture"]),
        ("header.pcap", &Pcap::new().0, &["no EtherCAT frame among 0 Ethernet frames"]),
        ("foreign.pcap", &foreign.0, &["no EtherCAT frame among 1 Ethernet frame;", "0x88A4"]),
    ];
    for (name, bytes, words) in rows {
        let path = files.write(name, bytes);
        let run = diagnose(&path, &[]);
        refused(&run, words);
        assert!(run.stdout.is_empty() && run.stderr.contains(name), "{}", run.all());
        let run = diagnose(&path, &["--json"]);
        refused(&run, words);
        let error = run.json();
        assert_valid(&error, "error");
        assert_eq!(error["schema"], "linesman.error/1");
    }
    refused(&diagnose(&files.0.path().join("missing.pcap"), &[]), &["there is no such file"]);
    let directory = files.0.path().join("directory.pcap");
    fs::create_dir(&directory).unwrap();
    refused(&diagnose(&directory, &[]), &["it is a directory"]);
}

#[test]
fn a_capture_cut_off_later_is_judged_as_far_as_it_goes() {
    let files = Files::new();
    let mut capture = Pcap::new();
    capture.exchanges(100);
    let whole = diagnose(&files.write("whole.pcap", &capture.0), &["--json"]);
    assert_eq!((whole.status, whole.stderr.as_str()), (0, ""), "{}", whole.all());
    assert_eq!(whole.json()["complete"], true);
    // Cut inside of the record behind 50 exchanges, at several places.
    for more in [1, 15, 17, RECORD - 1] {
        let cut = &capture.0[..HEADER + 100 * RECORD + more];
        let run = diagnose(&files.write("cut.pcap", cut), &["--json"]);
        let diagnosis = run.json();
        assert_valid(&diagnosis, "diagnosis");
        assert_eq!(diagnosis["complete"], false, "{more}");
        assert_eq!(diagnosis["network"]["datagrams"], 50, "{more}");
        assert_eq!(diagnosis["network"]["devices"], 2, "{more}");
        assert_eq!(run.status, 0, "what can be read is healthy: {diagnosis}");
        assert!(run.stderr.contains("ends after 100 frames"), "{}", run.stderr);
    }
}

#[test]
fn a_selector_that_is_none() {
    refused(&diagnose(Path::new("tap:eth0"), &[]), &["`tap:` is not known", "listen:eth0"]);
    let run = diagnose(Path::new("tap:eth0"), &["--json"]);
    assert_valid(&run.json(), "error");
    assert_eq!(run.status, 2);
}

#[test]
fn a_project_that_is_none() {
    let files = Files::new();
    let mut capture = Pcap::new();
    capture.exchanges(2);
    let capture = files.write("good.pcap", &capture.0);
    let project = files.write("plan.toml", "nam = \"x\"\n");
    let run = diagnose(&capture, &["--project", project.to_str().unwrap()]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("plan.toml") && run.stderr.contains("nam"), "{}", run.stderr);
}

#[test]
fn an_option_that_says_nothing_there_is_refused() {
    let rows = [
        ("trace.pcap", vec!["--seconds", "3"], "--seconds"),
        ("trace.pcap", vec!["--active"], "--active"),
        ("read.toml", vec!["--record", "x.pcapng"], "--record"),
        ("listen:nope0", vec!["--to", "op"], "--to"),
        ("sim:plant.toml", vec!["--project", "plan.toml"], "--project"),
    ];
    for (place, more, option) in rows {
        let run = diagnose(Path::new(place), &more);
        refused(&run, &[place, &format!("leave out `{option}`")]);
    }
}

#[test]
fn a_long_capture_is_judged_frame_by_frame() {
    let files = Files::new();
    let mut capture = Pcap::new();
    capture.exchanges(150_000);
    let run = diagnose(&files.write("long.pcap", &capture.0), &["--json"]);
    assert_eq!((run.status, run.stderr.as_str()), (0, ""), "{}", run.all());
    let network = &run.json()["network"];
    assert_eq!(network["frames"], 300_000);
    assert_eq!(network["datagrams"], 150_000);
    assert_eq!(network["unanswered"], 0);
}

#[test]
fn an_answer_that_does_not_fit_on_the_disk_is_none() {
    let Ok(full) = fs::OpenOptions::new().write(true).open("/dev/full") else {
        eprintln!("SKIPPED: there is no /dev/full");
        return;
    };
    let mut command = Command::new(PROGRAM);
    let output = command.args(["explain", "H110"]).stdout(full).output().expect("it starts");
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert!(
        told.contains("standard output: writing the answer") && told.contains("do: "),
        "{told}"
    );
}
