//! Links that are reported and dead: frames vanish, and the open port into nothing is named.

use crate::support::linesman;
use serde_json::{Value, json};
use tempfile::TempDir;

/// Two couplers; the cable between them is of this kind.
fn plant(medium: &str, fault: &str) -> String {
    let device = |name: &str, kind: &str, on: &str| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    [
        device("K1", "EK1100", "maindevice"),
        device("T2", "EL2008", "K1.B"),
        device("K3", "EK1100", "K1.C"),
        format!("cable_m = 20.0\nmedium = \"{medium}\"\n"),
        device("T4", "EL1008", "K3.B"),
        format!("[[fault]]\n{fault}from_ms = 2500\n"),
    ]
    .concat()
}

/// The first finding, when ports may be closed for a moment to look for it.
fn found(medium: &str, fault: &str) -> Value {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("plant.toml");
    std::fs::write(&path, plant(medium, fault)).unwrap();
    let run = linesman(["diagnose", &format!("sim:{}", path.display()), "--active", "--json"]);
    assert_eq!(run.status, 1, "{medium}, {fault}: {}", run.all());
    let diagnosis = run.json();
    assert!(diagnosis["network"]["lost"].as_u64().unwrap() > 100, "frames vanish: {diagnosis:#}");
    diagnosis["findings"][0].clone()
}

// S4 L13: what reports a link early or for ever, and a media converter whose fibre is broken.
// proves: JCT-07
#[test]
fn link_that_is_reported_but_dead_is_found_as_open_port_into_nothing() {
    let false_link = "kind = \"false-link\"\nat = \"K1.C-K3.A\"\n";
    let broken = "kind = \"link-open\"\nat = \"K1.C-K3.A\"\n";
    let one_fibre = "kind = \"link-open\"\nat = \"K1.C>K3.A\"\n";
    for (medium, fault) in [("direct", false_link), ("converters", broken), ("fibre", one_fibre)] {
        let finding = found(medium, fault);
        assert_eq!(finding["code"], "H100", "{medium}: {finding:#}");
        let place = &finding["place"];
        assert_eq!(place["kind"], "link", "{medium}: {finding:#}");
        assert_eq!(place["a"], json!({ "no": 1, "port": "C" }), "{medium}: {finding:#}");
        assert_eq!(place["b"], json!({ "no": 3, "port": "A" }), "{medium}: {finding:#}");
        assert_eq!(finding["cause"], "false-link", "{medium}: {finding:#}");
        let evidence = finding["evidence"].to_string();
        assert!(evidence.contains("closed for a moment"), "{medium}: {evidence}");
        let actions = finding["actions"].to_string();
        assert!(actions.contains("media converter"), "{medium}: {actions}");
    }
}
