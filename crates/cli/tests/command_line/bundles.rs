//! Bundles: written beside a run, judged again, anonymised, and hostile ones.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Read as _, Write as _};
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use crate::support::{assert_valid, linesman};

/// A name that only the customer knows.
const SECRET: &str = "Umformwerk";
/// A serial number.
const SERIAL: u32 = 0x5E71_A1ED;

/// Two couplers with a terminal each, a noisy cable between them, and later none.
fn plant(from_s: u32) -> String {
    let rows = [
        ("K1", "EK1100", "maindevice".to_owned()),
        ("B2", "EL1008", format!("{SECRET}-K1.B")),
        ("K3", "EK1100", format!("{SECRET}-K1.C")),
        ("B4", "EL2008", format!("{SECRET}-K3.B")),
    ];
    let devices = rows.map(|(name, kind, on)| {
        format!("[[device]]\nname = \"{SECRET}-{name}\"\ntype = \"{kind}\"\non = \"{on}\"\nserial = {SERIAL}\n")
    });
    let link = format!("{SECRET}-K1.C-{SECRET}-K3.A");
    let faults = [("emc-noise", 0, 2, "hits_per_s = 400.0\n"), ("link-open", 5, 6, "")];
    let faults = faults.map(|(kind, from, to, more)| {
        let (from, to) = ((from_s + from) * 1_000, (from_s + to) * 1_000);
        format!(
            "[[fault]]\nkind = \"{kind}\"\nat = \"{link}\"\nfrom_ms = {from}\nto_ms = {to}\n{more}"
        )
    });
    format!("name = \"{SECRET}\"\nseed = 7\n{}{}", devices.concat(), faults.concat())
}

/// Runs the plant for so long, and gives its bundles in order.
fn recorded(folder: &TempDir, from_s: u32, more: &[&str]) -> Vec<PathBuf> {
    let path = folder.path().join(format!("{SECRET}.toml"));
    fs::write(&path, plant(from_s)).unwrap();
    let bundles = folder.path().join("bundles");
    let (on, lasts) = (format!("sim:{}", path.display()), (from_s + 9).to_string());
    let to = bundles.to_str().unwrap();
    let mut arguments = vec!["run", "--on", &on, "--seconds", &lasts, "--bundles", to];
    arguments.extend(more);
    let run = linesman(arguments);
    assert_eq!(run.status, 1, "{}", run.all());
    let mut files: Vec<PathBuf> =
        fs::read_dir(&bundles).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    for file in &files {
        let name = file.file_name().unwrap().to_str().unwrap();
        let is_removed = run.stdout.contains(&format!("{name} is removed"));
        assert!(run.stdout.contains(name) && !is_removed, "{}", run.all());
    }
    files
}

fn members(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut archive = ZipArchive::new(Cursor::new(fs::read(path).unwrap())).unwrap();
    let mut members = BTreeMap::new();
    for index in 0..archive.len() {
        let mut member = archive.by_index(index).unwrap();
        let name = member.name().unwrap().into_owned();
        let mut bytes = Vec::new();
        member.read_to_end(&mut bytes).unwrap();
        members.insert(name, bytes);
    }
    members
}

fn archive(path: &Path, members: &BTreeMap<String, Vec<u8>>) {
    let mut archive = ZipWriter::new(fs::File::create(path).unwrap());
    for (name, bytes) in members {
        archive.start_file(name, SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap();
}

/// Code, place and cause of each error and warning.
fn found(diagnosis: &Value) -> Vec<String> {
    let mut all = Vec::new();
    let mut open: Vec<&Value> = diagnosis["findings"].as_array().unwrap().iter().collect();
    while let Some(finding) = open.pop() {
        open.extend(finding["consequences"].as_array().unwrap());
        if finding["severity"] != "info" {
            all.push(format!("{} {} {}", finding["code"], finding["place"], finding["cause"]));
        }
    }
    all.sort();
    all
}

fn judged(path: &Path) -> Value {
    let run = linesman(["diagnose", path.to_str().unwrap(), "--json"]);
    assert_eq!(run.status, 1, "{}", run.all());
    for word in ["not found again", "new:"] {
        assert!(!run.stderr.contains(word), "{}", run.all());
    }
    run.json()
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

#[test]
fn bundle_of_two_faults_anonymised_gives_the_same_findings_elsewhere() {
    let folder = TempDir::new().unwrap();
    let bundles = recorded(&folder, 2, &["--bundle-after", "8s"]);
    let [bundle] = bundles.as_slice() else { panic!("{bundles:?}") };
    let before = members(bundle);
    let said: Value = serde_json::from_slice(&before["diagnosis.json"]).unwrap();
    assert!(contains(&before["diagnosis.json"], SECRET.as_bytes()) || said["source"] != "");
    assert!(contains(&before["frames.pcapng"], &SERIAL.to_le_bytes()), "it was read");
    let codes: Vec<String> = found(&said);
    assert!(codes.iter().any(|code| code.contains("H110")), "{codes:?}");
    assert!(codes.iter().any(|code| code.contains("H101")), "{codes:?}");
    assert_eq!(found(&judged(bundle)), codes);

    let elsewhere = TempDir::new().unwrap();
    let other = elsewhere.path().join("case.zip");
    let (from, to) = (bundle.to_str().unwrap(), other.to_str().unwrap());
    let run = linesman(["bundle", "anonymise", from, "-o", to]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("1 serial number"), "{}", run.all());
    fs::remove_dir_all(folder.path().join("bundles")).unwrap();
    assert_eq!(found(&judged(&other)), codes);
    for (name, bytes) in members(&other) {
        for part in [SECRET.as_bytes(), &SERIAL.to_le_bytes(), SERIAL.to_string().as_bytes()] {
            assert!(!contains(&bytes, part), "{name} holds {part:?}");
        }
    }
    let run = linesman(["bundle", "info", to]);
    assert!(run.stdout.contains("replaced"), "{}", run.all());
}

#[test]
fn bundle_of_planned_line_loses_the_names_of_its_project() {
    let folder = TempDir::new().unwrap();
    let segment = folder.path().join("segment.toml");
    fs::write(&segment, plant(1)).unwrap();
    let on = format!("sim:{}", segment.display());
    let bundles = folder.path().join("bundles");
    let to = bundles.to_str().unwrap();
    let run = linesman(["diagnose", &on, "--bundles", to, "--bundle-after", "6s", "--json"]);
    assert_eq!(run.status, 1, "{}", run.all());
    let bundle = fs::read_dir(&bundles).unwrap().next().unwrap().unwrap().path();
    let before = members(&bundle);
    assert!(contains(&before["project.toml"], SECRET.as_bytes()));
    assert!(contains(&before["report.txt"], SECRET.as_bytes()));
    assert_eq!(found(&judged(&bundle)), found(&run.json()));
    let other = folder.path().join("other.zip");
    let (from, to) = (bundle.to_str().unwrap(), other.to_str().unwrap());
    let run = linesman(["bundle", "anonymise", from, "-o", to, "--json"]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert_valid(&run.json(), "bundle");
    assert_eq!(found(&judged(&other)), found(&judged(&bundle)));
    for (name, bytes) in members(&other) {
        assert!(!contains(&bytes, SECRET.as_bytes()), "{name}");
    }
}

#[test]
fn bundle_of_a_line_with_groups_loses_their_names_and_can_be_judged() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let rows = [("K1", "EK1100", "maindevice"), ("B2", "EL1008", "K1.B"), ("X3", "EK1100", "K1.C")];
    let devices = rows.map(|(name, kind, on)| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    });
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"K1.B-B2.A\"\nfrom_ms = 2000\nto_ms = 3000\n";
    fs::write(path("plant.toml"), devices.concat() + cut).unwrap();
    let on = format!("sim:{}", path("plant.toml"));
    let run = linesman(["scan", &on, "--save", &path("saved.toml")]);
    assert_eq!(run.status, 0, "{}", run.all());
    let named = fs::read_to_string(path("saved.toml")).unwrap().replace("SubDevice", SECRET);
    let group = format!(
        "[[group]]\nname = \"{SECRET}-tool\"\nfirst = \"{SECRET} 3 (EK1100)\"\nplaces = [\"{SECRET} 1 (EK1100).C\"]\n\
         identification = {{ by = \"serial\", value = {SERIAL} }}\noptional = true\n"
    );
    fs::write(path("project.toml"), named + &group).unwrap();
    let run = linesman([
        "run",
        &path("project.toml"),
        "--on",
        &on,
        "--seconds",
        "6",
        "--bundles",
        &path("bundles"),
    ]);
    assert_eq!(run.status, 1, "{}", run.all());
    let bundle = fs::read_dir(path("bundles")).unwrap().next().unwrap().unwrap().path();
    assert!(contains(&members(&bundle)["project.toml"], SECRET.as_bytes()));
    let (from, to) = (bundle.display().to_string(), path("other.zip"));
    let run = linesman(["bundle", "anonymise", &from, "-o", &to]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert_eq!(found(&judged(Path::new(&to))), found(&judged(&bundle)));
    for (name, bytes) in members(Path::new(&to)) {
        for part in [SECRET.as_bytes(), SERIAL.to_string().as_bytes()] {
            assert!(!contains(&bytes, part), "{name} holds {part:?}");
        }
    }
}

#[test]
fn bundles_are_anonymised_as_they_are_written_and_the_same_is_found() {
    let folder = TempDir::new().unwrap();
    let plain = recorded(&folder, 2, &[]);
    let other = TempDir::new().unwrap();
    let hidden = recorded(&other, 2, &["--bundle-anonymise"]);
    assert_eq!(hidden.len(), plain.len());
    for (plain, hidden) in plain.iter().zip(&hidden) {
        assert_eq!(found(&judged(plain)), found(&judged(hidden)));
        for (name, bytes) in members(hidden) {
            assert!(!contains(&bytes, SECRET.as_bytes()), "{name} names the customer");
            assert!(!contains(&bytes, &SERIAL.to_le_bytes()), "{name} has a serial number");
        }
    }
    let left: Vec<_> = fs::read_dir(other.path().join("bundles")).unwrap().collect();
    assert_eq!(left.len(), hidden.len(), "nothing else stays in the folder");
}

#[test]
fn findings_far_apart_are_found_again_though_frames_between_are_left_out() {
    let folder = TempDir::new().unwrap();
    let narrow = ["--bundle-memory", "4", "--bundle-before", "2s", "--bundle-after", "1s"];
    let bundles = recorded(&folder, 30, &narrow);
    assert!(bundles.len() > 1, "{bundles:?}");
    let run = linesman(["bundle", "info", bundles.last().unwrap().to_str().unwrap()]);
    assert!(run.stdout.contains("before it left out"), "{}", run.all());
    for bundle in &bundles {
        let said: Value = serde_json::from_slice(&members(bundle)["diagnosis.json"]).unwrap();
        assert_eq!(found(&judged(bundle)), found(&said));
    }
}

#[test]
fn oldest_bundle_gives_way_and_that_is_said() {
    let folder = TempDir::new().unwrap();
    let bundles = recorded(&folder, 1, &["--bundle-after", "1s", "--bundle-keep", "1"]);
    let [bundle] = bundles.as_slice() else { panic!("{bundles:?}") };
    assert!(!bundle.to_str().unwrap().contains("_00001_"), "{bundle:?}");
}

#[test]
fn members_are_as_their_schemas_say_and_frames_are_a_capture() {
    let folder = TempDir::new().unwrap();
    let bundles = recorded(&folder, 1, &[]);
    let bundle = &bundles[0];
    let members = members(bundle);
    let json = |name: &str| serde_json::from_slice::<Value>(&members[name]).unwrap();
    assert_valid(&json("manifest.json"), "bundle");
    assert_valid(&json("diagnosis.json"), "diagnosis");
    let lines = String::from_utf8(members["observations.jsonl"].clone()).unwrap();
    for line in lines.lines() {
        assert_valid(&serde_json::from_str(line).unwrap(), "bundle-observation");
    }
    let frames = folder.path().join("frames.pcapng");
    fs::write(&frames, &members["frames.pcapng"]).unwrap();
    let list = |path: &Path| linesman(["capture", "list", path.to_str().unwrap()]).stdout;
    assert_eq!(list(bundle), list(&frames));
}

#[test]
fn same_run_gives_the_same_bytes() {
    let folders = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let [first, second] = folders.each_ref().map(|folder| {
        let path = recorded(folder, 1, &[]).remove(0);
        let mut members = members(&path);
        // It names the folder.
        for name in ["manifest.json", "diagnosis.json", "report.txt"] {
            members.remove(name);
        }
        members
    });
    assert!(first == second);
}

#[test]
fn findings_that_are_not_found_again_are_told() {
    let folder = TempDir::new().unwrap();
    let bundle = recorded(&folder, 1, &[]).remove(0);
    let mut members = members(&bundle);
    let mut manifest: Value = serde_json::from_slice(&members["manifest.json"]).unwrap();
    manifest["findings"][0]["code"] = "H999".into();
    members.insert("manifest.json".to_owned(), serde_json::to_vec(&manifest).unwrap());
    let other = folder.path().join("other.zip");
    archive(&other, &members);
    let run = linesman(["diagnose", other.to_str().unwrap()]);
    assert!(run.stderr.contains("not found again: H999"), "{}", run.all());
    assert!(run.stderr.contains("new: "), "{}", run.all());
    assert!(!run.stdout.contains("As when the bundle was written"), "{}", run.all());
}

#[test]
fn hostile_archives_are_refused_in_clear_words() {
    let folder = TempDir::new().unwrap();
    let bundle = recorded(&folder, 1, &[]).remove(0);
    let whole = fs::read(&bundle).unwrap();
    let members = members(&bundle);
    let path = folder.path().join("hostile.zip");
    let refused = |expected: &str| {
        for arguments in [vec!["diagnose"], vec!["bundle", "info"], vec!["capture", "info"]] {
            let arguments = arguments.into_iter().chain([path.to_str().unwrap()]);
            let run = linesman(arguments);
            assert_eq!(run.status, 2, "{expected}: {}", run.all());
            assert!(run.stderr.contains(expected), "{expected}: {}", run.all());
        }
    };
    for cut in [4, 100, whole.len() / 2, whole.len() - 1] {
        fs::write(&path, &whole[..cut]).unwrap();
        refused("cut off or damaged");
    }
    archive(&path, &BTreeMap::from([("../../etc/passwd".to_owned(), b"x".to_vec())]));
    refused("without manifest.json");
    assert!(!folder.path().join("../../etc/passwd").exists() || Path::new("/etc/passwd").exists());
    let mut without = members.clone();
    without.remove("frames.pcapng");
    archive(&path, &without);
    let run = linesman(["diagnose", path.to_str().unwrap()]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("without frames.pcapng"), "{}", run.all());
    let mut newer = members.clone();
    newer.insert(
        "manifest.json".to_owned(),
        br#"{"schema":"linesman.bundle/9","tool":"t"}"#.to_vec(),
    );
    archive(&path, &newer);
    refused("received `linesman.bundle/9`");
    let mut bomb = members.clone();
    bomb.insert("manifest.json".to_owned(), vec![b' '; 40_000_000]);
    archive(&path, &bomb);
    refused("unpacks to more than");
    let mut broken = members;
    broken.insert("observations.jsonl".to_owned(), b"{".to_vec());
    archive(&path, &broken);
    let run = linesman(["diagnose", path.to_str().unwrap()]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("observations.jsonl in it is damaged"), "{}", run.all());
}

#[test]
fn options_that_make_no_sense_are_refused() {
    for (arguments, expected) in [
        (vec!["diagnose", "trace.pcapng", "--bundles", "x"], "recorded already"),
        (vec!["diagnose", "eth0", "--bundle-after", "3"], "--bundles"),
        (vec!["run", "--on", "eth0", "--no-diagnosis", "--bundles", "x"], "--no-diagnosis"),
    ] {
        let run = linesman(arguments);
        assert_eq!(run.status, 2, "{}", run.all());
        assert!(run.stderr.contains(expected), "{}", run.all());
    }
}
