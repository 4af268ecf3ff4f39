//! Recording of a capture probe on a virtual segment, and what is said of it.

use std::path::Path;

use crate::support::linesman;

const PLANT: &str = r#"
name = "plant"
seed = 7
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "O1"
type = "EL2008"
on = "K1.B"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
[[device]]
name = "I1"
type = "EL1008"
on = "K2.B"
"#;

/// A recording of the plant with these faults, by a probe at these places.
fn recorded(folder: &Path, faults: &str, places: &str, file: &str, form: &str) -> String {
    let plant = folder.join(format!("{file}.toml"));
    std::fs::write(&plant, format!("{PLANT}{faults}")).unwrap();
    let target = folder.join(file).to_str().unwrap().to_owned();
    let place = format!("sim:{}", plant.display());
    let probe = ["--probe-at", places, "--probe-record", &target, "--probe-form", form];
    let run = linesman([&["diagnose", &place, "--seconds", "2"], &probe[..]].concat());
    assert!(run.status <= 3, "{}", run.stderr);
    target
}

// silent: H116
// proves: WS-06 (SP)
#[test]
fn healthy_line_with_two_channels_is_judged_once_and_healthy_in_both_forms() {
    let folder = tempfile::tempdir().unwrap();
    for (file, form) in [("behind.pcapng", "behind"), ("front.pcap", "front")] {
        let file = recorded(folder.path(), "", "maindevice,K2.A", file, form);
        let run = linesman(["diagnose", &file, "--json"]);
        let judged = run.json();
        assert_eq!(judged["findings"].as_array().unwrap().len(), 0, "{judged}");
        assert_eq!(judged["network"]["devices"], 4);
        let info = linesman(["capture", "info", &file, "--json"]).json();
        let ports = info["probe_ports"].as_array().unwrap();
        let places: Vec<_> = ports
            .iter()
            .map(|port| (port["port"].as_u64(), port["subdevices_before"].as_u64()))
            .collect();
        let expected = [(0, 0), (2, 2), (3, 4), (1, 4)];
        assert_eq!(places, expected.map(|(port, before)| (Some(port), Some(before))), "{form}");
        let shown = linesman(["capture", "info", &file]).stdout;
        assert!(shown.contains("Capture probe"), "{shown}");
        assert!(shown.contains("on the link to SubDevice 3, on the way out"), "{shown}");
    }
}

// proves: WS-06
#[test]
fn damage_is_shown_by_the_ports_of_the_probe() {
    let folder = tempfile::tempdir().unwrap();
    let fault = "\n[[fault]]\nkind = \"device-internal\"\ndevice = \"K1\"\nfrom_ms = 1000\n\
                 hits_per_s = 60\n";
    let file = recorded(folder.path(), fault, "maindevice,K2.A", "damaged.pcapng", "behind");
    let judged = linesman(["diagnose", &file, "--json"]);
    assert_eq!(judged.status, 1, "{}", judged.stdout);
    assert!(judged.stdout.contains("had a wrong check sequence at port"), "{}", judged.stdout);
}

#[test]
fn probe_is_refused_where_there_is_no_plug() {
    let folder = tempfile::tempdir().unwrap();
    let plant = folder.path().join("plant.toml");
    std::fs::write(&plant, PLANT).unwrap();
    let place = format!("sim:{}", plant.display());
    let target = folder.path().join("a.pcap").to_str().unwrap().to_owned();
    let run = linesman(["diagnose", &place, "--probe-at", "K9.A", "--probe-record", &target]);
    assert_eq!(run.status, 2, "{}", run.stderr);
    assert!(run.stderr.contains("K9.A"), "{}", run.stderr);
    let run = linesman(["diagnose", &target, "--probe-at", "K1.A", "--probe-record", "b.pcap"]);
    assert_ne!(run.status, 0);
}

// fires: H116
#[test]
fn damage_without_counters_is_placed_by_the_probe_alone() {
    let run = linesman(["lab", "capture-probe", "--seeds", "1..20", "--list"]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("H116 NicDamaged"), "{}", run.stdout);
}

/// The findings of a diagnosis with those that follow from them.
fn codes(judged: &serde_json::Value) -> Vec<String> {
    let findings = judged["findings"].as_array().unwrap().iter();
    findings.map(|finding| finding["code"].as_str().unwrap().to_owned()).collect()
}

// proves: WS-06 partial: the place of a probe without records
#[test]
fn healthy_line_recorded_by_a_tap_inside_it_is_healthy_where_its_link_is_told() {
    let folder = tempfile::tempdir().unwrap();
    // Each way by an interface of its own, and both by one.
    for file in ["two.pcapng", "one.pcap"] {
        let file = recorded(folder.path(), "", "K1.C", file, "tap");
        let run = linesman(["diagnose", &file, "--probe", "1.C-3.A", "--json"]);
        let judged = run.json();
        assert_eq!(judged["verdict"], "healthy", "{judged}");
        assert_eq!(codes(&judged), Vec::<String>::new(), "{judged}");
        assert_eq!(judged["network"]["devices"], 4);
        // Without it, frames that have passed two SubDevices are nobody's requests.
        let unplaced = linesman(["diagnose", &file, "--json"]);
        assert_ne!(unplaced.json()["verdict"], "healthy", "{}", unplaced.stdout);
    }
}

// proves: WS-06 partial: the place of a probe without records
#[test]
fn frames_that_pass_a_tap_once_were_damaged_behind_its_link() {
    let folder = tempfile::tempdir().unwrap();
    let fault = "\n[[fault]]\nkind = \"cable-degraded\"\nat = \"K2.B>I1.A\"\nfrom_ms = 1000\n\
                 hits_per_s = 400\n";
    for file in ["two.pcapng", "one.pcap"] {
        let file = recorded(folder.path(), fault, "K1.C", file, "tap");
        let run = linesman(["diagnose", &file, "--probe", "1.C-3.A", "--json"]);
        assert_eq!(run.status, 1, "{}", run.all());
        assert!(run.stdout.contains("the tap on the link to "), "{}", run.stdout);
        let turned = linesman(["diagnose", &file, "--probe", "3.A-1.C", "--json"]).stdout;
        assert!(turned.contains("on the way back: they were damaged or lost"), "{turned}");
    }
}

#[test]
fn tap_at_two_links_takes_a_place_for_each_interface() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path(), "", "maindevice,K2.A", "both.pcapng", "tap");
    let interfaces = ["tap0=maindevice-1.A", "tap1=maindevice-1.A", "2=1.C-3.A", "3=1.C-3.A"];
    let places: Vec<&str> = interfaces.iter().flat_map(|place| ["--probe", place]).collect();
    let run = linesman([&["diagnose", &file, "--json"], &places[..]].concat());
    assert_eq!(run.json()["verdict"], "healthy", "{}", run.all());
    // Of two of them nothing was said.
    let run = linesman([&["diagnose", &file], &places[..4]].concat());
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("interface 2 (tap2)"), "{}", run.stderr);
    let run = linesman(["diagnose", &file, "--probe", "eth9=maindevice-1.A"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("`eth9`") && run.stderr.contains("tap3"), "{}", run.stderr);
}

#[test]
fn link_of_a_tap_that_is_none_is_refused_with_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path(), "", "K1.C", "tap.pcapng", "tap");
    let record = recorded(folder.path(), "", "K1.C", "probe.pcapng", "behind");
    let plant = folder.path().join("tap.pcapng.toml");
    let project = folder.path().join("project.toml");
    let planned = PLANT.replace("seed = 7\n", "");
    std::fs::write(&project, planned).unwrap();
    let project = project.to_str().unwrap();
    let place = format!("sim:{}", plant.display());
    let rows: &[(&[&str], &str)] = &[
        (&[&file, "--probe", "3.B"], "`3.B` is no link"),
        (&[&file, "--probe", "K1.C-K2.A"], "no SubDevice is called `K1`"),
        (&[&file, "--probe", "K1.C-K9.A", "--project", project], "no SubDevice is called `K9`"),
        (&[&file, "--probe", "K1.B-K2.A", "--project", project], "1.B leads to 2.A"),
        (&[&file, "--probe", "1.B-3.A"], "1.B leads to 2.A"),
        (&[&file, "--probe", "4.B-5.A"], "broadcasts had passed 2 SubDevices"),
        (&[&file, "--probe", "4.B-5.A", "--project", project], "the line has 4 SubDevices"),
        (&[&file, "--probe", "1.B-2.A"], "broadcasts had passed 2 SubDevices"),
        (&[&file, "--probe", "maindevice.B-4.A"], "second card of a ring"),
        (&[&file, "--probe", "1.B-1.C"], "both ends are at one device"),
        (&[&file, "--probe", "1.C-3.A", "--probe", "3.B-4.A"], "another place was named"),
        (&[&record, "--probe", "1.C-3.A"], "records of a capture probe"),
        (&[&place, "--probe", "1.C-3.A"], "--probe says where a capture was taken"),
        (&[project, "--probe", "1.C-3.A"], "this is a text"),
    ];
    for (arguments, expected) in rows {
        let run = linesman([&["diagnose"], *arguments].concat());
        assert_eq!(run.status, 2, "{arguments:?}: {}", run.all());
        assert!(run.stderr.contains(expected), "{arguments:?}: {}", run.stderr);
        assert!(run.stderr.contains("Do: ") || run.stderr.contains("do: "), "{}", run.stderr);
    }
    // By names, where the project has them.
    let named = ["diagnose", &file, "--probe", "K1.C-K2.A", "--project", project, "--json"];
    assert_eq!(linesman(named).json()["verdict"], "healthy");
}

/// Frames of a capture that meet a condition.
fn matched(file: &str, condition: &str, probe: &[&str]) -> u64 {
    let run = linesman([&["capture", "filter", file, condition, "--json"], probe].concat());
    assert_eq!(run.status, 0, "{}", run.all());
    run.json()["matched"].as_u64().unwrap()
}

// proves: WS-06 partial: the place of a probe without records
#[test]
fn capture_commands_read_a_tap_inside_the_line_where_its_link_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let probe = ["--probe", "1.C-3.A"];
    for file in ["two.pcapng", "one.pcap"] {
        let file = recorded(folder.path(), "", "K1.C", file, "tap");
        let info = linesman([&["capture", "info", &file, "--json"], &probe[..]].concat()).json();
        let recording = &info["recording"];
        assert_eq!(recording["requests"], recording["returns"], "{recording}");
        assert_eq!(recording["returns_alone"], 0, "{recording}");
        assert_eq!(info["probe_ports"][0]["subdevices_before"], 2, "{info}");
        let told = linesman([&["capture", "timeline", &file, "--json"], &probe[..]].concat());
        let is_finding = |event: &&serde_json::Value| event["kind"] == "finding";
        let told = told.json();
        assert_eq!(told["events"].as_array().unwrap().iter().find(is_finding), None);
        assert_eq!(matched(&file, "out", &probe), matched(&file, "back", &probe));
        assert_eq!(matched(&file, "wkc.wrong", &probe), 0);
        // Addresses are counted up by the two SubDevices before the tap: the second one is not asked for the third.
        let third = matched(&file, "subdevice == 3 && ecat.cmd == \"APRD\" && out", &probe);
        let fourth = matched(&file, "subdevice == 4 && ecat.cmd == \"APRD\" && out", &probe);
        assert!(third > 0 && fourth > 0, "{third}, {fourth}");
        // Without it, they are nobody's requests.
        let unplaced = linesman(["capture", "info", &file, "--json"]).json();
        assert_ne!(unplaced["recording"]["returns_alone"], 0);
        let listed = linesman([&["capture", "list", &file, "-n", "1"], &probe[..]].concat());
        assert!(listed.stdout.contains("  out  "), "{}", listed.stdout);
    }
}

#[test]
fn capture_commands_refuse_a_link_of_a_tap_that_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path(), "", "K1.C", "tap.pcapng", "tap");
    let record = recorded(folder.path(), "", "K1.C", "probe.pcapng", "behind");
    let rows: [(&[&str], &str, &str); 5] = [
        (&["info", &file], "4.B-5.A", "broadcasts had passed 2 SubDevices"),
        (&["timeline", &file], "3.B", "`3.B` is no link"),
        (&["filter", &file, "out"], "K1.C-K2.A", "no SubDevice is called `K1`"),
        (&["filter", &file, "out"], "4.B-5.A", "broadcasts had passed 2 SubDevices"),
        (&["list", &record], "1.C-3.A", "records of a capture probe"),
    ];
    for (command, link, expected) in rows {
        let run = linesman([&["capture"], command, &["--probe", link]].concat());
        assert_eq!(run.status, 2, "{command:?}: {}", run.all());
        assert!(run.stderr.contains(expected), "{command:?}: {}", run.stderr);
    }
}

// proves: WS-06
#[test]
fn copies_at_the_ports_of_a_probe_have_their_way_and_no_wrong_working_counter() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path(), "", "maindevice,K2.A", "probe.pcapng", "behind");
    let (out, back) = (matched(&file, "out", &[]), matched(&file, "back", &[]));
    // The first copies of all come before it is known which port is which.
    assert!(back > 1_000 && back.abs_diff(out) <= 4, "{out} out, {back} back");
    assert_eq!(matched(&file, "out && (esl.port == 1 || esl.port == 3)", &[]), 0);
    assert_eq!(matched(&file, "wkc.wrong", &[]), 0);
}
