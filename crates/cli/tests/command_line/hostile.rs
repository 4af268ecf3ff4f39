//! Hostile use, which the cycle must survive: a storm of SDOs, SubDevices that stay in PREOP,
//! descriptions that are missing, files without end, a reader who goes away.

use std::fs;
use std::io::Read as _;
use std::process::{Command, Stdio};

use crate::support::running::{PLANT, Running};
use crate::support::{PROGRAM, linesman};
use tempfile::TempDir;

#[test]
fn a_storm_of_sdos_costs_no_cycle() {
    let running = Running::start(PLANT);
    let socket = running.socket();
    let before = linesman(["online", &socket, "--json"]).json();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..25 {
                    let run = linesman(["sdo", &socket, "3", "read", "0x1018:01"]);
                    assert!(
                        run.status < 2 || run.stderr.contains("wait for its mailbox"),
                        "{}",
                        run.all()
                    );
                }
            });
        }
    });
    let after = linesman(["online", &socket, "--json"]).json();
    let count = |report: &serde_json::Value, what: &str| report["cyclic"][what].as_u64().unwrap();
    assert!(count(&after, "sent") > count(&before, "sent") + 100, "the cycle goes on: {after}");
    let devices = after["devices"].as_array().unwrap();
    assert!(devices.iter().all(|one| one["al_state"] == "OP"), "{after}");
    let errors = |report: &serde_json::Value| {
        report["devices"]
            .as_array()
            .unwrap()
            .iter()
            .map(|one| one["changes"].clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(errors(&after), errors(&before), "nobody left its state");
}

#[test]
fn a_device_that_stays_in_preop_is_no_fault() {
    let folder = TempDir::new().unwrap();
    let (segment, project) = (folder.path().join("line.toml"), folder.path().join("project.toml"));
    fs::write(&segment, PLANT).unwrap();
    let on = format!("sim:{}", segment.display());
    assert_eq!(linesman(["scan", &on, "--save", project.to_str().unwrap()]).status, 0);
    let text = fs::read_to_string(&project).unwrap();
    let at = text.rfind("[device.description]").unwrap();
    fs::write(&project, format!("{}state = \"PREOP\"\n{}", &text[..at], &text[at..])).unwrap();
    let run = linesman(["run", project.to_str().unwrap(), "--on", &on, "--seconds", "2", "--json"]);
    let report = run.json();
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(!report["reached_ns"].is_null() && report["settled"] == true, "{report}");
    assert_eq!(report["counts"]["working_counter_errors"], 0, "{report}");
}

#[test]
fn descriptions_that_are_missing_are_named() {
    let folder = TempDir::new().unwrap();
    let project = folder.path().join("project.toml");
    let device = "[[device]]\nname = \"Drive\"\ntype = \"DRV-1\"\non = \"maindevice\"\n";
    fs::create_dir(folder.path().join("descriptions")).unwrap();
    let other = "<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices><Device Physics=\"YY\">\
                 <Type ProductCode=\"1\" RevisionNo=\"1\">OTHER</Type></Device></Devices></Descriptions></EtherCATInfo>";
    let table = [
        ("esi = [\"nowhere\"]\n", None, "nowhere"),
        ("esi = [\"descriptions\"]\n", None, "nothing says what it needs"),
        (
            "esi = [\"descriptions\"]\n",
            Some(other),
            "none of 1 device descriptions is of type `DRV-1`",
        ),
        (
            "esi = [\"descriptions\"]\n",
            Some("<EtherCATInfo><Vendor>"),
            "nothing says what it needs",
        ),
    ];
    for (esi, file, expected) in table {
        let path = folder.path().join("descriptions/one.xml");
        match file {
            Some(text) => fs::write(&path, text).unwrap(),
            None => drop(fs::remove_file(&path)),
        }
        fs::write(&project, format!("{esi}{device}")).unwrap();
        let run = linesman(["plan", project.to_str().unwrap()]);
        assert_eq!(run.status, 2, "{esi}: {}", run.all());
        assert!(run.stderr.contains(expected), "{expected}: {}", run.stderr);
        assert!(run.stderr.contains("\ndo: "), "{}", run.stderr);
    }
}

#[test]
fn a_file_without_end_is_given_up() {
    for words in [
        &["plan", "/dev/zero"][..],
        &["run", "/dev/zero", "--on", "sim:/dev/zero"],
        &["state", "sim:/dev/zero"],
        &["sii", "sim:/dev/zero", "1", "verify", "/dev/zero"],
    ] {
        let run = linesman(words);
        assert_eq!(run.status, 2, "{words:?}: {}", run.all());
        assert!(run.stderr.contains("/dev/zero"), "{words:?}: {}", run.stderr);
    }
}

#[test]
fn a_reader_who_goes_away_ends_nothing_with_a_panic() {
    let folder = TempDir::new().unwrap();
    let segment = folder.path().join("line.toml");
    fs::write(&segment, PLANT).unwrap();
    let on = format!("sim:{}", segment.display());
    for words in [
        &["run", "--on", &on, "--seconds", "1"][..],
        &["online", &on],
        &["reg", &on, "1", "dump"],
        &["sdo", &on, "3", "list"],
        &["state", &on],
    ] {
        let mut child = Command::new(PROGRAM)
            .args(words)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // One letter is read, then nobody listens any more.
        let mut out = child.stdout.take().unwrap();
        let _ = out.read(&mut [0]);
        drop(out);
        let mut told = String::new();
        child.stderr.take().unwrap().read_to_string(&mut told).unwrap();
        let status = child.wait().unwrap();
        assert!(status.code().is_some_and(|code| code <= 2), "{words:?}: {status} {told}");
        assert!(!told.contains("panicked"), "{words:?}: {told}");
    }
}
