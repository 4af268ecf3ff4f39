//! One way to call a SubDevice: its name with its type, in every answer, and taken by every command.

use std::fs;
use std::path::Path;

use crate::support::linesman;
use crate::support::running::PLANT;
use tempfile::TempDir;

#[test]
fn every_command_takes_every_way_to_call_a_subdevice() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("plant.toml");
    fs::write(&path, PLANT).unwrap();
    let on = format!("sim:{}", path.display());
    let log = folder.path().join("log.sqlite").display().to_string();
    let run = linesman(["run", "--on", &on, "--seconds", "1", "--log", &log]);
    assert_eq!(run.status, 0, "{}", run.all());
    let words = [
        "3",
        "0x1003",
        "position:2",
        "T3",
        "T3 (EL3104)",
        "'T3 (EL3104)'",
        "SubDevice 3",
        "EL3104",
    ];
    for word in words {
        for command in [
            &["state"][..],
            &["sdo", "read", "0x1018"],
            &["sii", "read"],
            &["reg", "read", "al-status"],
            &["online"],
        ] {
            // A line that is only looked at tells no types, and has no station addresses yet.
            if command[0] == "online" && matches!(word, "0x1003" | "EL3104") {
                continue;
            }
            let mut arguments = vec![command[0], &on, word];
            arguments.extend(&command[1..]);
            let done = linesman(arguments.iter().copied());
            assert_eq!(done.status, 0, "{arguments:?}: {}", done.all());
        }
    }
    // The line was run as it was found: nobody gave its SubDevices names.
    for word in ["3", "SubDevice 3", "SubDevice 3 (EL3104)", "'SubDevice 3 (EL3104)'"] {
        let read = linesman(["log", &log, "--device", word]);
        assert!(
            read.stdout.contains("'SubDevice 3 (EL3104)' (1003): OP reached"),
            "{}",
            read.all()
        );
        assert!(!read.stdout.contains("0 of"), "{word}: {}", read.stdout);
    }
}

#[test]
fn answers_call_a_subdevice_by_name_and_type() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("plant.toml");
    let fault = "[[fault]]\nkind = \"link-open\"\nat = \"T2.B-T3.A\"\nfrom_ms = 1000\n";
    fs::write(&path, format!("{PLANT}{fault}")).unwrap();
    let on = format!("sim:{}", path.display());
    let link = "link T2 (EL2008) port B ↔ T3 (EL3104) port A";
    let diagnosed = linesman(["diagnose", &on, "--follow"]);
    // While it happens, and at the end.
    assert!(diagnosed.stdout.matches(link).count() >= 2, "{}", diagnosed.stdout);
    let page = folder.path().join("page.html");
    linesman(["diagnose", &on, "--html", &page.display().to_string()]);
    assert!(fs::read_to_string(page).unwrap().contains("T3 (EL3104)"));
    // Of what was found without names, the number and the type.
    let run = linesman(["run", "--on", &on, "--seconds", "3"]);
    let link = "link SubDevice 2 (EL2008) port B ↔ SubDevice 3 (EL3104) port A";
    assert!(run.stdout.contains(link), "{}", run.stdout);
    assert!(!run.stdout.contains("SubDevice SubDevice"), "{}", run.stdout);
}

#[test]
fn names_of_a_segment_go_to_their_subdevices_in_any_order_of_the_file() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("segment.toml");
    // Frames reach what hangs on port B before what hangs on port C.
    let rows =
        [("K1", "EK1100", "maindevice"), ("Far", "EK1100", "K1.C"), ("Term", "EL6601", "K1.B")];
    let devices = rows.map(|(name, kind, on)| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    });
    fs::write(&path, devices.concat()).unwrap();
    let on = format!("sim:{}", path.display());
    let states = linesman(["state", &on]);
    for row in ["2   0x1002   Term  EL6601", "3   0x1003   Far   EK1100"] {
        assert!(states.stdout.contains(row), "{}", states.all());
    }
    let named = linesman(["sdo", &on, "Term", "read", "0x1018:02"]);
    assert!(named.stdout.contains("0x19C93052"), "{}", named.all());
}

/// Labels say "SubDevice" where there is no name, so that nothing else has to.
#[test]
fn no_text_says_subdevice_before_a_label() {
    fn look(folder: &Path, found: &mut Vec<String>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                look(&path, found);
            } else if path.extension().is_some_and(|end| end == "rs") {
                let text = fs::read_to_string(&path).unwrap();
                let wrong = ["SubDevice {label", "SubDevices {label", "SubDevice {who}"];
                let is_wrong = |line: &&str| wrong.iter().any(|words| line.contains(words));
                let lines = text.lines().filter(is_wrong);
                found.extend(lines.map(|line| format!("{}: {}", path.display(), line.trim())));
            }
        }
    }
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = Vec::new();
    for name in ["cli", "config", "diagnosis", "linesman", "maindevice", "runtime"] {
        look(&crates.join(name).join("src"), &mut found);
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
