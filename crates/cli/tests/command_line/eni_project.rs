//! A network configuration of another tool (ENI) where a project may be named.

use std::fs;
use std::path::PathBuf;

use crate::support::capture::Pcap;
use crate::support::{Run, linesman};
use linesman_runtime::capture::Capture;
use tempfile::TempDir;

const PLANT: &str = r#"
name = "plant"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "O1"
type = "EL2008"
on = "K1.B"
[[device]]
name = "O2"
type = "EL2008"
on = "O1.B"
"#;

struct Bench(TempDir);

impl Bench {
    /// A plant, a project that was saved of it, and the ENI of that.
    fn new() -> Self {
        let bench = Self(TempDir::new().unwrap());
        bench.write("plant.toml", PLANT.as_bytes());
        let place = bench.place();
        for words in [
            &["scan", &place, "--save", &bench.path("machine.toml")][..],
            &[
                "plan",
                &bench.path("machine.toml"),
                "--cycle-us",
                "1000",
                "--export",
                &bench.path("eni.xml"),
            ],
        ] {
            let run = linesman(words);
            assert_eq!(run.status, 0, "{}", run.all());
        }
        bench
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn place(&self) -> String {
        format!("sim:{}", self.path("plant.toml"))
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).unwrap();
    }

    /// A recording of the plant in OP from its fifth second on, so that nobody sees how it came up. `spoil` changes
    /// frames that came back.
    fn late_recording(&self, spoil: impl Fn(&mut [u8])) -> String {
        let whole = self.path("whole.pcapng");
        if !PathBuf::from(&whole).exists() {
            let run = linesman(["diagnose", &self.place(), "--seconds", "8", "--record", &whole]);
            assert_eq!(run.status, 0, "{}", run.all());
        }
        let mut capture = Capture::open(&whole).unwrap();
        let (mut pcap, mut first) = (Pcap::new(), None);
        while let Some(frame) = capture.next_frame() {
            let at = frame.time.as_nanos() / 1_000;
            if at < 5_000_000 {
                continue;
            }
            // The marked source tells that it came back.
            let mut bytes = frame.bytes.to_vec();
            if bytes[6] & 2 != 0 {
                spoil(&mut bytes);
            }
            pcap.frame(at - *first.get_or_insert(at), &bytes);
        }
        self.write("late.pcap", &pcap.0);
        self.path("late.pcap")
    }
}

fn gaps(run: &Run) -> Vec<String> {
    let coverage = run.json()["coverage"].to_string();
    let all = coverage.split('"').filter(|word| word.contains("working-counter-unknown"));
    all.map(str::to_owned).collect()
}

#[test]
fn the_working_counters_of_an_eni_are_known_without_the_bring_up() {
    let bench = Bench::new();
    let late = bench.late_recording(|_| {});
    let without = linesman(["diagnose", &late, "--json"]);
    assert!(!gaps(&without).is_empty(), "{}", without.all());
    let with = linesman(["diagnose", &late, "--project", &bench.path("eni.xml"), "--json"]);
    assert_eq!(gaps(&with), [""; 0], "{}", with.all());
    assert_eq!(with.json()["findings"].as_array().unwrap().len(), 0, "{}", with.all());
}

/// Takes 1 from the working counter of each LWR that has 2.
fn one_is_missing(bytes: &mut [u8]) {
    let mut at = 16;
    loop {
        let len = usize::from(u16::from_le_bytes([bytes[at + 6], bytes[at + 7]]));
        let (data, more) = (len & 0x07FF, len & 0x8000 != 0);
        let counter = at + 10 + data;
        if bytes[at] == 11 && bytes[counter] == 2 {
            bytes[counter] = 1;
        }
        if !more {
            return;
        }
        at = counter + 2;
    }
}

#[test]
fn a_working_counter_that_was_always_too_low_is_found_by_the_eni() {
    let bench = Bench::new();
    let late = bench.late_recording(one_is_missing);
    let without = linesman(["diagnose", &late, "--json"]);
    assert_ne!(without.status, 1, "nothing says that it is too low: {}", without.all());
    let with = linesman(["diagnose", &late, "--project", &bench.path("eni.xml"), "--json"]);
    assert_eq!(with.status, 1, "{}", with.all());
    assert!(with.stdout.contains("working-counter"), "{}", with.all());
}

#[test]
fn a_scan_is_held_against_an_eni() {
    let bench = Bench::new();
    let same = linesman(["scan", &bench.place(), "--against", &bench.path("eni.xml")]);
    assert_eq!(same.status, 0, "{}", same.all());
    assert!(same.stdout.contains("All is as planned."), "{}", same.all());
    let other =
        PLANT.replace("type = \"EL2008\"\non = \"O1.B\"", "type = \"EL1008\"\non = \"O1.B\"");
    bench.write("plant.toml", other.as_bytes());
    let other = linesman(["scan", &bench.place(), "--against", &bench.path("eni.xml")]);
    assert_eq!(other.status, 1, "{}", other.all());
    assert!(other.stdout.contains("EL2008"), "{}", other.all());
}

#[test]
fn a_project_is_saved_of_an_eni_and_says_the_same_of_who_is_where() {
    let bench = Bench::new();
    let saved = linesman(["plan", &bench.path("eni.xml"), "--save", &bench.path("saved.toml")]);
    assert_eq!(saved.status, 0, "{}", saved.all());
    assert!(saved.stdout.contains("The ENI does not hold:\n- "), "{}", saved.all());
    let run = linesman(["scan", &bench.place(), "--against", &bench.path("saved.toml")]);
    assert_eq!(run.status, 0, "{}", run.all());
    let again = linesman(["plan", &bench.path("saved.toml"), "--save", &bench.path("again.toml")]);
    assert_eq!(again.status, 2, "{}", again.all());
    assert!(again.stderr.contains("it is a project already"), "{}", again.all());
}

#[test]
fn what_is_no_eni_is_refused_with_what_it_is() {
    let bench = Bench::new();
    let eni = fs::read_to_string(bench.path("eni.xml")).unwrap();
    let start = eni.find("<PreviousPort").unwrap();
    let (mut unwired, mut rest) = (eni[..start].to_owned(), &eni[start..]);
    while let Some(end) = rest.find("</PreviousPort>") {
        rest = &rest[end + "</PreviousPort>".len()..];
        let next = rest.find("<PreviousPort").unwrap_or(rest.len());
        unwired.push_str(&rest[..next]);
        rest = &rest[next..];
    }
    for (content, expected) in [
        ("<html><body/></html>", "line 1, html: no network configuration"),
        (
            "<?xml version=\"1.0\"?>\n<EtherCATInfo><Vendor/></EtherCATInfo>",
            "EtherCATInfo: no network",
        ),
        (&eni[..eni.len() / 2], "the file ends within"),
        ("\u{FEFF}<EtherCATConfig><Config/></EtherCATConfig>", "has no SubDevices"),
        (&*unwired, "does not say how its 3 SubDevices are wired"),
        ("name = 3", "name"),
    ] {
        bench.write("wrong", content.as_bytes());
        let file = bench.path("wrong");
        for words in [
            vec!["scan".to_owned(), bench.place(), "--against".to_owned(), file.clone()],
            vec!["diagnose".to_owned(), bench.path("machine.toml"), "--project".to_owned(), file],
        ] {
            let run = linesman(&words);
            assert_eq!(run.status, 2, "{}", run.all());
            assert!(run.stderr.contains(expected), "{expected}: {}", run.all());
            assert!(run.stderr.contains("\ndo: "), "{}", run.all());
        }
    }
}
