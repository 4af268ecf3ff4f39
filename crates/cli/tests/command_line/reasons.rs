//! Reasons that a person is told to look for: a lost link, interference against a fault inside a
//! device, hardware before software.

use crate::support::linesman;
use serde_json::{Value, json};
use tempfile::TempDir;

const PLANT: &str = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T2"
type = "EL1008"
on = "K1.B"
[[device]]
name = "T3"
type = "EL4102"
on = "T2.B"
[[device]]
name = "K4"
type = "EK1100"
on = "K1.C"
cable_m = 20.0
[[device]]
name = "T5"
type = "EL2008"
on = "K4.B"
[[device]]
name = "T6"
type = "EL4102"
on = "T5.B"
"#;

/// The plant with a fault, diagnosed: as JSON, and as people read it.
fn diagnosed(fault: &str) -> (Value, String) {
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    std::fs::write(&plant, format!("{PLANT}[[fault]]\n{fault}")).unwrap();
    let on = format!("sim:{}", plant.display());
    let json = linesman(["diagnose", &on, "--json"]);
    assert_eq!(json.status, 1, "{fault}: {}", json.all());
    let text = linesman(["diagnose", &on]).stdout;
    // Words are wrapped where the line ends.
    (json.json(), text.split_whitespace().collect::<Vec<_>>().join(" "))
}

fn first(diagnosis: &Value) -> &Value {
    &diagnosis["findings"][0]
}

/// The cause of a finding and what else it may be.
fn causes(finding: &Value) -> Vec<&str> {
    let others = finding["alternatives"].as_array().unwrap();
    let others = others.iter().map(|other| other["cause"].as_str().unwrap());
    std::iter::once(finding["cause"].as_str().unwrap()).chain(others).collect()
}

// S0 L1749-1752: a damaged cable or plug, a poor contact of the E-bus, a lost supply.
// proves: HW-09
#[test]
fn a_lost_link_has_its_three_reasons_and_each_its_own_advice() {
    let (cable, text) = diagnosed("kind = \"link-open\"\nat = \"K1.C-K4.A\"\nfrom_ms = 2000\n");
    let finding = first(&cable);
    assert_eq!(finding["code"], "H101", "{text}");
    assert!(causes(finding).contains(&"supply-off") && causes(finding).contains(&"device-off"));
    assert!(
        text.contains("Seat the plugs at both ends") && text.contains("exchange the cable"),
        "{text}"
    );
    assert!(text.contains("measure its supply"), "{text}");

    // Between two terminals there is no plug.
    let (contact, text) = diagnosed("kind = \"link-open\"\nat = \"T2.B-T3.A\"\nfrom_ms = 2000\n");
    assert_eq!(first(&contact)["code"], "H101", "{text}");
    assert!(text.contains("press the terminals together and look at the contacts"), "{text}");
    assert!(!text.contains("Seat the plugs"), "{text}");

    // It came back without its address: it was without power, and no cable is to blame.
    let (supply, text) =
        diagnosed("kind = \"device-off\"\ndevice = \"K4\"\nfrom_ms = 2000\nto_ms = 3000\n");
    assert_eq!(first(&supply)["code"], "H150", "{text}");
    assert!(causes(first(&supply)).contains(&"device-off"), "{text}");
    assert!(text.to_lowercase().contains("supply"), "{text}");
}

// S0 L1832-1835, S1 L480-481: outside of the device both kinds are counted, in any ratio, now and then.
// proves: HW-26, HW-27, DIA-03
#[test]
fn interference_a_fault_inside_a_device_and_its_firmware_are_told_apart() {
    let (noise, text) = diagnosed(
        "kind = \"emc-noise\"\nat = \"K1.C>K4.A\"\nhits_per_s = 600\nbursts_per_s = 30\nfrom_ms = 1000\n",
    );
    let finding = first(&noise);
    assert_eq!(finding["code"], "H110", "{text}");
    assert!(causes(finding).contains(&"emc-noise"), "{:?}", causes(finding));
    let place = &finding["place"];
    assert_eq!(place["a"], json!({ "no": 1, "port": "C" }), "{text}");
    assert_eq!(place["b"], json!({ "no": 4, "port": "A" }), "{text}");
    let evidence = finding["evidence"].to_string();
    assert!(
        evidence.contains("could not decode") && evidence.contains("bad frames"),
        "both kinds: {evidence}"
    );
    assert!(text.contains("sources of noise") && text.contains("shield"), "{text}");

    // Symbols are clean, frames are not: no noise does that.
    let (inside, text) =
        diagnosed("kind = \"device-internal\"\ndevice = \"T5\"\nhits_per_s = 60\nfrom_ms = 1000\n");
    let finding = first(&inside);
    assert_eq!(
        (&finding["code"], &finding["cause"]),
        (&"H111".into(), &"device-internal".into()),
        "{text}"
    );
    assert_eq!((&finding["place"]["kind"], &finding["place"]["no"]), (&json!("device"), &json!(5)));
    assert!(!causes(finding).contains(&"emc-noise"), "{:?}", causes(finding));
    assert!(text.contains("Exchange T5 ("), "{text}");

    // Frames come back whole, and one device does not do its work: no counter moves.
    let (firmware, text) =
        diagnosed("kind = \"firmware-fault\"\ndevice = \"T6\"\nhow = \"hangs\"\nfrom_ms = 2000\n");
    let finding = first(&firmware);
    assert_eq!(finding["cause"], "firmware-fault", "{text}");
    assert_eq!((&finding["place"]["kind"], &finding["place"]["no"]), (&json!("device"), &json!(6)));
    assert!(!text.contains("H110") && !text.contains("H111"), "{text}");
}

// S0 L2262-2270, S1 L961-971: what the hardware did comes first; that a watchdog expired follows from it.
// proves: SW-06
#[test]
fn a_hardware_cause_wins_over_the_software_symptom() {
    let (diagnosis, text) =
        diagnosed("kind = \"link-open\"\nat = \"K1.C-K4.A\"\nfrom_ms = 2000\nto_ms = 2600\n");
    let findings = diagnosis["findings"].as_array().unwrap();
    let serious: Vec<&Value> = findings.iter().filter(|one| one["severity"] != "info").collect();
    assert_eq!(serious.len(), 1, "one cause: {text}");
    assert!(serious[0]["code"].as_str().unwrap().starts_with('H'), "{text}");
    // The same expired watchdog without a cause in the hardware is the host's.
    let (starved, text) = diagnosed(
        "kind = \"watchdog-starved\"\ndevice = \"T6\"\nwatchdog_ms = 0.3\nfrom_ms = 2000\n",
    );
    assert!(!first(&starved)["code"].as_str().unwrap().starts_with('H'), "{text}");
    assert!(starved["findings"].to_string().contains("0x001B"), "{text}");
    // The order in which to look, for whoever looks by hand.
    let order = linesman(["explain", "running-errors"]).stdout;
    let place = |word: &str| order.find(word).unwrap_or_else(|| panic!("{word}: {order}"));
    assert!(place("Hardware first") < place("Watchdog") && place("Watchdog") < place("capture"));
}
