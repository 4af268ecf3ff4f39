//! Values that `linesman online` shows of a run without a line of program: each against what the plant is and what is
//! done to it.

use crate::support::linesman;
use crate::support::running::Running;
use serde_json::{Value, json};

/// A coupler, outputs, inputs of which the last lose their power, and an analogue terminal before them.
const PLANT: &str = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T2"
type = "EL2008"
on = "K1.B"
[[device]]
name = "T3"
type = "EL3104"
on = "T2.B"
[[device]]
name = "T4"
type = "EL1008"
on = "T3.B"
"#;

/// The last terminal loses its power after some seconds, for good.
const OFF: &str = "[[fault]]\nkind = \"device-off\"\ndevice = \"T4\"\nfrom_ms = 8000\n";

/// Type, product code, mailbox sizes, ports with a link.
type Expected = (&'static str, u32, Option<(u16, u16)>, &'static str);

const DEVICES: [Expected; 4] = [
    ("EK1100", 0x044C_2C52, None, "AB"),
    ("EL2008", 0x07D8_3052, None, "AB"),
    ("EL3104", 0x0C20_3052, Some((128, 128)), "AB"),
    ("EL1008", 0x03F0_3052, None, "A"),
];

fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("no number: {value}"))
}

// S1 L1265-1304, S0 L2598-2606: what the function blocks for planned and found SubDevices give.
// proves: PLC-11, PLC-12, PLC-13
#[test]
fn planned_and_found_subdevices_are_listed_with_identity_mailbox_and_links() {
    let running = Running::start(PLANT);
    let report = running.until("has read all links", |report| {
        report["devices"].as_array().unwrap().iter().all(|one| !one["dl_status"].is_null())
    });
    assert_eq!((number(&report["planned"]), number(&report["present"])), (4, 4));
    for (index, (kind, product, mailbox, links)) in DEVICES.into_iter().enumerate() {
        let device = &report["devices"][index];
        let no = index + 1;
        assert_eq!((number(&device["no"]), &device["type"]), (no as u64, &json!(kind)));
        assert_eq!(device["name"], format!("SubDevice {no} ({kind})"));
        assert_eq!(number(&device["station"]), 0x1000 + no as u64);
        assert_eq!(number(&device["auto_increment"]), (0x1_0000 - index as u64) & 0xFFFF);
        for who in ["planned", "found"] {
            let identity = &device[who];
            assert_eq!(
                (number(&identity["vendor_id"]), number(&identity["product_code"])),
                (2, product.into())
            );
            assert_eq!(number(&identity["serial"]), no as u64, "{who}: {identity}");
        }
        let sizes = device["mailbox"]
            .as_object()
            .map(|one| (number(&one["out_size"]), number(&one["in_size"])));
        assert_eq!(sizes, mailbox.map(|(out, back)| (out.into(), back.into())), "{kind}");
        let ports = device["ports"].as_array().unwrap().iter();
        let linked: String = ports
            .filter(|port| port["link"] == true)
            .map(|port| port["port"].as_str().unwrap())
            .collect();
        assert_eq!(linked, links, "{kind}");
        // The word that was read says the same.
        let word = number(&device["dl_status"]);
        for (bit, port) in (4..).zip(["A", "B", "C", "D"]) {
            assert_eq!(
                word >> bit & 1 == 1,
                links.contains(port),
                "{kind}, port {port}: {word:#06X}"
            );
        }
    }
}

// S0 L2487-2532: the cyclic values of each frame, sync unit and SubDevice, and who is there.
// proves: PLC-01
#[test]
fn cyclic_values_follow_what_happens_without_a_program() {
    let running = Running::start(&format!("{PLANT}{OFF}"));
    let report = running
        .until("has counted for a second", |report| !report["cyclic"]["per_second"].is_null());
    let frames = &report["frames"];
    assert_eq!(frames.as_array().unwrap().len(), 1, "{frames}");
    assert_eq!((&frames[0]["wc_state"], &frames[0]["state"]), (&json!(0), &json!(0)));
    assert_eq!(report["state"]["word"], 0);
    assert_eq!((number(&report["responding"]), number(&report["present"])), (4, 4));
    let wc_states = |report: &Value| -> Vec<Value> {
        report["devices"].as_array().unwrap().iter().map(|one| one["wc_state"].clone()).collect()
    };
    assert_eq!(wc_states(&report), [json!(null), json!(false), json!(false), json!(false)]);
    let units = report["sync_units"].as_array().unwrap();
    let shared = units.iter().find(|unit| unit["devices"] == json!([2, 3, 4]));
    assert_eq!(shared.unwrap()["wc_state"], false, "{units:?}");
    // It loses its power: the count falls, its data are missing, its state says so, and its neighbour's port.
    let report = running.until("misses the last", |report| {
        report["devices"][3]["state"]["text"] == "INIT NO_COMM"
            && report["devices"][2]["state"]["text"] == "OP LNK_MIS B"
    });
    assert_eq!((number(&report["present"]), number(&report["responding"])), (3, 3));
    assert_eq!(report["devices"][3]["wc_state"], true, "{}", report["devices"][3]);
    assert_ne!(report["state"]["word"], 0);
    assert_eq!(report["devices"][2]["state"]["word"], 0x2408);
}

/// What changed from one report to a later one.
fn risen(before: &Value, after: &Value, kind: &str, what: &str) -> f64 {
    (number(&after[kind][what]) - number(&before[kind][what])) as f64
}

// S1 L825-844, L1351-1367: cyclic and queued frames apart, each with those sent, a second, and lost.
// proves: DIA-11, HW-30, HW-32, PLC-15
#[test]
fn frames_are_counted_cyclic_and_queued_with_rates_losses_and_errors_of_the_card() {
    // The card spoils some of what it receives: that is lost, and the card counts it.
    let noise = "[[fault]]\nkind = \"nic-damaged\"\nat = \"maindevice\"\npart = \"receiver\"\n\
                 hits_per_s = 4000\nfrom_ms = 3000\n";
    let running = Running::start(&format!("{PLANT}{noise}"));
    let quiet = running.until("has counted for a second", |report| {
        number(&report["time_ns"]) > 1_500_000_000 && !report["queued"]["per_second"].is_null()
    });
    let losses =
        |report: &Value| number(&report["cyclic"]["lost"]) + number(&report["queued"]["lost"]);
    let card = |report: &Value| {
        let card = &report["cards"][0];
        (number(&card["rx_errors"]), number(&card["tx_errors"]))
    };
    let later = running.until("has lost frames", |report| losses(report) > 60);
    let seconds = (number(&later["time_ns"]) - number(&quiet["time_ns"])) as f64 / 1e9;
    for kind in ["cyclic", "queued"] {
        let rate = later[kind]["per_second"].as_f64().unwrap();
        let counted = risen(&quiet, &later, kind, "sent") / seconds;
        assert!(counted > 0.0 && rate > 0.0, "{kind}: {rate} a second, {counted} counted");
    }
    // A cycle of 1 ms: 1000 frames a second, but for those of a busy computer.
    let cyclic = later["cyclic"]["per_second"].as_f64().unwrap();
    assert!((500.0..=1001.0).contains(&cyclic), "{cyclic}");
    let counted = risen(&quiet, &later, "cyclic", "sent") / seconds;
    assert!((500.0..=1001.0).contains(&counted), "{counted}");
    assert!(later["queued"]["per_second"].as_f64().unwrap() < cyclic / 2.0, "{}", later["queued"]);
    // Each frame that the card spoiled is a lost one; what is under way is not told yet, and a busy computer loses some.
    let (received, sent) = card(&later);
    assert_eq!(sent, 0, "nothing is wrong with what it sends");
    assert!(received > 50 && received <= losses(&later) + 5, "{received}, {}", losses(&later));
    let table = linesman(["online", &running.socket()]).stdout;
    for words in ["Cyclic: ", "Queued: ", " a second), ", " lost.", "Card A: link, receive errors "]
    {
        assert!(table.contains(words), "`{words}` is missing: {table}");
    }
    // From a clear on all counts begin anew.
    let cleared = linesman(["online", &running.socket(), "--clear", "all", "--json"]).json();
    assert!(
        number(&cleared["cyclic"]["sent"]) < number(&later["cyclic"]["sent"]) / 2,
        "{}",
        cleared["cyclic"]
    );
}

// S0 L1802-1826: 1 is where the count of "not present" begins, more is lost.
// proves: HW-12
#[test]
fn changes_are_nought_and_one_until_a_subdevice_was_away() {
    let dips = "[[fault]]\nkind = \"brown-out\"\ndevice = \"T4\"\ndip_ms = 300\nfrom_ms = 8000\n";
    let running = Running::start(&format!("{PLANT}{dips}"));
    let changes = |report: &Value, no: usize| {
        let device = &report["devices"][no - 1];
        (number(&device["abnormal_changes"]), number(&device["presence_changes"]))
    };
    let report = running.until("is up", |report| number(&report["time_ns"]) < 7_900_000_000);
    assert!((1..=4).all(|no| changes(&report, no) == (0, 1)), "{}", report["devices"]);
    let report = running.until("was away and is back", |report| {
        changes(report, 4).1 > 1 && report["devices"][3]["al_state"] == "OP"
    });
    assert_eq!(changes(&report, 4).1, 2, "{}", report["devices"][3]);
    assert_eq!(changes(&report, 1), (0, 1), "{}", report["devices"][0]);
    let table = linesman(["online", &running.socket()]).stdout;
    let row = |no: &str| table.lines().find(|line| line.starts_with(no)).unwrap().to_owned();
    assert!(row("1 ").contains(" 0,1 ") && !row("4 ").contains(" 0,1 "), "{table}");
}

/// The line of one port in the view of a SubDevice, by its columns.
fn port_row(socket: &str, no: &str, port: &str) -> String {
    let view = linesman(["online", socket, no]).stdout;
    let row = view.lines().find(|line| line.trim_start().starts_with(&format!("{port} ")));
    row.unwrap_or_else(|| panic!("no port {port}: {view}")).to_owned()
}

/// The plant with a terminal of the first generation in place of the analogue one: it has no counters of forwarded errors.
fn with_an_old_terminal() -> String {
    PLANT.replace("EL3104", "EL3102")
}

/// Symbols are spoiled on the way to the old terminal.
const NOISE: &str =
    "[[fault]]\nkind = \"emc-noise\"\nat = \"T2.B>T3.A\"\nhits_per_s = 300\nfrom_ms = ";

// S0 L1756-1758, L2115-2126: lost links by port; a device without a counter shows "--" for it.
// proves: HW-08, HW-29
#[test]
fn lost_links_stand_at_their_port_and_counters_that_are_not_there_as_dashes() {
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"T3.B-T4.A\"\nfrom_ms = 4000\nto_ms = 4400\n";
    let running = Running::start(&format!("{}{cut}{NOISE}7000\n", with_an_old_terminal()));
    let total = |report: &Value, no: usize, port: usize, kind: &str| {
        report["devices"][no - 1]["ports"][port][kind]["total"].as_u64()
    };
    let report = running.until("has lost a link and frames", |report| {
        total(report, 3, 1, "lost_links") > Some(0)
            && total(report, 3, 0, "invalid_frames") > Some(3)
            && total(report, 4, 0, "forwarded") > Some(0)
    });
    for port in 0..4 {
        assert_eq!(total(&report, 3, port, "forwarded"), None, "{}", report["devices"][2]);
        assert!(total(&report, 4, port, "forwarded").is_some(), "{}", report["devices"][3]);
    }
    // The link of T3's port B was lost once; those of the others never.
    assert_eq!(total(&report, 3, 1, "lost_links"), Some(1), "{}", report["devices"][2]);
    for (no, port) in [(1, 0), (1, 1), (2, 0), (2, 1), (3, 0)] {
        assert_eq!(total(&report, no, port, "lost_links"), Some(0), "{no}, port {port}");
    }
    let row = port_row(&running.socket(), "3", "B");
    let (_, lost) = row.split_once(" -- ").unwrap_or_else(|| panic!("no dashes: {row}"));
    assert!(lost.trim_start().starts_with("1 (register "), "{row}");
    let row = port_row(&running.socket(), "2", "A");
    assert!(!row.contains("--") && row.trim_end().ends_with("0 (register 0)"), "{row}");
    // Symbols are bad where they are spoiled, and nowhere else.
    for (no, is_hit) in [(1, false), (2, false), (3, true), (4, false)] {
        let symbols = total(&report, no, 0, "physical_layer");
        assert_eq!(symbols > Some(0), is_hit, "{no}: {symbols:?}");
    }
}

// proves: HW-29 partial: the place
#[test]
fn damage_is_placed_where_forwarded_errors_are_not_counted() {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("plant.toml");
    std::fs::write(&path, format!("{}{NOISE}2500\n", with_an_old_terminal())).unwrap();
    let run = linesman(["diagnose", &format!("sim:{}", path.display()), "--json"]);
    assert_eq!(run.status, 1, "{}", run.all());
    let finding = &run.json()["findings"][0];
    assert_eq!(finding["code"], "H110", "{finding:#}");
    let place = &finding["place"];
    assert_eq!(place["a"], json!({ "no": 2, "port": "B" }), "{finding:#}");
    assert_eq!(place["b"], json!({ "no": 3, "port": "A" }), "{finding:#}");
    assert_eq!(place["direction"], "a-to-b", "{finding:#}");
}
