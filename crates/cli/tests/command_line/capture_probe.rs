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
