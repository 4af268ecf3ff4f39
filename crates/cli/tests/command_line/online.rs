//! `linesman online`: a network as it is now, driven or not.

use std::cell::Cell;

use crate::support::running::{PLANT, Running, project_of};
use crate::support::{assert_valid, linesman};
use serde_json::Value;
use tempfile::TempDir;

/// Symbols are destroyed on the way into T3 from 0.5 s on, without end.
const NOISE: &str = "\
[[fault]]\nkind = \"emc-noise\"\nat = \"T2.B>T3.A\"\nhits_per_s = 60\nfrom_ms = 500\n";

fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("no number: {value}"))
}

// proves: PLC-03 partial: while all is right, PLC-09 partial: without clocks, PLC-10
// partial: no groups that come and go
#[test]
fn a_running_line_is_shown_with_all_that_is_known() {
    let running = Running::start(PLANT);
    let report = running.until("has counted for a second", |report| {
        !report["cyclic"]["per_second"].is_null() && !report["devices"][2]["dl_status"].is_null()
    });
    assert_valid(&report, "online");
    assert_eq!(
        (&report["driven"], &report["state"]["word"]),
        (&Value::from(true), &Value::from(0))
    );
    assert_eq!((number(&report["planned"]), number(&report["present"])), (3, 3));
    assert_eq!(number(&report["responding"]), 3);
    // The one before: a frame of each, and more of those every cycle.
    assert!(number(&report["cyclic"]["sent"]) > 100 && number(&report["queued"]["sent"]) > 10);
    assert!(report["cyclic"]["per_second"].as_f64().unwrap() > 10.0, "{}", report["cyclic"]);
    let device = &report["devices"][1];
    assert_eq!(device["state"]["text"], "OP");
    assert_eq!(device["planned"]["product_code"], device["found"]["product_code"]);
    assert_eq!((number(&device["station"]), number(&device["auto_increment"])), (0x1002, 0xFFFF));
    assert_eq!(device["wc_state"], false);
    assert_eq!(device["ports"][1]["to"]["station"], 0x1003);
    assert_eq!(device["ports"][0]["to"]["port"], "B", "the coupler's");
    assert_eq!(
        (&device["abnormal_changes"], &device["presence_changes"]),
        (&Value::from(0), &Value::from(1))
    );
    let info = &device["info"];
    assert_eq!((number(&info["object"]), &info["channels"]), (0x8001, &serde_json::json!([])));
    assert!(info["ads_address"].is_null() && info["output_shift_ns"].is_null(), "{info}");
    let mailbox = &report["devices"][2]["mailbox"];
    assert!(number(&mailbox["out_size"]) > 0, "{mailbox}");
    assert!(report["devices"][0]["mailbox"].is_null());
    // The toggle turns over with each good answer.
    let toggle = |report: &Value| number(&report["frames"][0]["input_toggle"]);
    running.until("turns over", |later| toggle(later) != toggle(&report));
    let table = linesman(["online", &running.socket()]);
    assert_eq!(table.status, 0, "{}", table.all());
    for words in ["3 of 3 SubDevices there", "EL3104", "0x1003", "0,1", "Cyclic: ", "sync unit"] {
        assert!(table.stdout.contains(words), "{words}: {}", table.stdout);
    }
    let one = linesman(["online", "--control", &running.socket(), "3"]);
    for words in ["2 port B", "product 0x", "object 0x8002 of the MainDevice"] {
        assert!(one.stdout.contains(words), "{words}: {}", one.all());
    }
    assert_eq!(linesman(["online", &running.socket(), "T9"]).status, 2);
}

// proves: DIA-07 partial: three SubDevices, PLC-14
#[test]
fn errors_are_shown_at_their_port_and_cleared_without_loss() {
    let running = Running::start(&format!("{PLANT}{NOISE}"));
    let errors = |report: &Value, no: usize| number(&report["devices"][no - 1]["errors"]);
    let report = running.until("has errors", |report| errors(report, 3) > 5);
    let device = &report["devices"][2];
    let total =
        |report: &Value, kind: &str| number(&report["devices"][2]["ports"][0][kind]["total"]);
    assert!(total(&report, "physical_layer") > 0, "{device}");
    assert_eq!(errors(&report, 2), 0, "only where they happen");
    let cleared = linesman(["online", &running.socket(), "--clear", "all", "--json"]);
    assert!(cleared.status < 2, "{}", cleared.all());
    let after = cleared.json();
    assert!(
        errors(&after, 3) < errors(&report, 3),
        "{} then {}",
        errors(&report, 3),
        errors(&after, 3)
    );
    assert!(number(&after["cyclic"]["sent"]) < number(&report["cyclic"]["sent"]));
    assert_eq!(after["devices"][2]["errors_lower_bound"], false, "we cleared it ourselves");
    running.until("counts on", |report| errors(report, 3) > errors(&after, 3));
}

/// The machine of the sources: couplers, a junction with two branches, 28 SubDevices. One cable is cut and one disturbed.
fn machine() -> String {
    let device = |no: u32, kind: &str, on: &str| {
        format!("[[device]]\nname = \"Term {no}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
    };
    let mut plant = device(1, "EK1100", "maindevice");
    let behind = |no: u32| format!("Term {no}.B");
    for no in 2..=28 {
        plant += &match no {
            6 => device(no, "EK1122", &behind(5)),
            7 => device(no, "EL2008", "Term 6.C"),
            14 => device(no, "EK1100", "Term 6.D"),
            22 => device(no, "EK1100", "Term 6.B"),
            _ => device(no, if no % 2 == 0 { "EL1008" } else { "EL2008" }, &behind(no - 1)),
        };
    }
    plant
        + "[[fault]]\nkind = \"emc-noise\"\nat = \"Term 6.D>Term 14.A\"\nhits_per_s = 40\nfrom_ms = 500\n\
           [[fault]]\nkind = \"link-open\"\nat = \"Term 6.B-Term 22.A\"\nfrom_ms = 3000\n"
}

// S0 L1535-1577: 28 SubDevices, number, address, name, state and errors by port.
// proves: DIA-07
#[test]
fn the_table_has_a_row_for_each_of_twenty_eight_with_its_errors_by_port() {
    let running = Running::start(&machine());
    let report = running.until("is cut and disturbed", |report| {
        let devices = report["devices"].as_array().unwrap();
        let texts = devices.iter().filter_map(|one| one["state"]["text"].as_str());
        let gone = texts.filter(|text| text.contains("NO_COMM")).count();
        gone == 7 && devices.iter().any(|one| number(&one["errors"]) > 0)
    });
    let disturbed: Vec<&Value> = report["devices"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|one| number(&one["errors"]) > 0)
        .collect();
    assert_eq!(disturbed.len(), 1, "where it happens and nowhere else: {disturbed:?}");
    let folder = TempDir::new().unwrap();
    let kept = folder.path().join("kept.json");
    std::fs::write(&kept, report.to_string()).unwrap();
    let table = linesman(["online", kept.to_str().unwrap()]).stdout;
    let rows: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split_whitespace().collect::<Vec<_>>())
        .filter(|words| words.len() > 8 && words[0].parse::<u32>().is_ok())
        .collect();
    assert_eq!(rows.len(), 28, "{table}");
    for (index, row) in rows.iter().enumerate() {
        let device = &report["devices"][index];
        let no = index + 1;
        assert_eq!(row[0], no.to_string(), "{table}");
        let line = row.join(" ");
        let station = format!("0x{:04X}", 0x1000 + no);
        let state = device["state"]["text"].as_str().unwrap();
        let kind = device["type"].as_str().unwrap_or_default();
        assert!(line.contains(&station) && line.contains(state) && line.contains(kind), "{line}");
        let errors = device["ports"].as_array().unwrap().iter().map(|port| {
            number(&port["invalid_frames"]["total"]) + number(&port["physical_layer"]["total"])
        });
        let errors = errors.map(|count| count.to_string()).collect::<Vec<_>>().join("/");
        assert!(row.contains(&errors.as_str()), "{errors} in {line}");
    }
}

// proves: DIA-10
#[test]
fn a_report_is_kept_and_shown_again_without_the_line() {
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    std::fs::write(&plant, PLANT).unwrap();
    let (place, kept) = (format!("sim:{}", plant.display()), folder.path().join("kept.json"));
    let kept = kept.to_str().unwrap();
    let run = linesman(["online", &place, "--save", kept]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("nobody drives it"), "{}", run.stdout);
    std::fs::remove_file(&plant).unwrap();
    let again = linesman(["online", kept]);
    assert_eq!((again.status, &again.stdout), (0, &run.stdout), "{}", again.stderr);
    let detail = linesman(["online", kept, "2"]);
    assert!(detail.stdout.contains("T2"), "{}", detail.all());
    assert_eq!(linesman(["online", kept, "--save", kept]).status, 2, "it is not written over");
    std::fs::write(kept, "{\"schema\": 1}").unwrap();
    let broken = linesman(["online", kept]);
    assert_eq!(broken.status, 2);
    assert!(broken.stderr.contains("--save"), "{}", broken.stderr);
}

#[test]
fn a_line_that_nobody_drives_is_looked_at_and_a_cut_is_seen() {
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"T2.B\"\nfrom_ms = 300\n";
    std::fs::write(&plant, format!("{PLANT}{cut}")).unwrap();
    let place = format!("sim:{}", plant.display());
    let report = linesman(["online", &place, "--json"]);
    assert_eq!(report.status, 0, "{}", report.all());
    let report = report.json();
    assert_valid(&report, "online");
    assert_eq!((&report["driven"], number(&report["present"])), (&Value::from(false), 3));
    assert_eq!(report["devices"][2]["al_state"], "INIT");
    assert!(report["devices"][2]["wc_state"].is_null());
    let later = linesman(["online", &place, "--json", "--seconds", "2"]);
    assert_eq!(later.status, 1, "{}", later.all());
    let later = later.json();
    assert_eq!((number(&later["planned"]), number(&later["present"])), (3, 2));
    let texts: Vec<&str> =
        (0..3).map(|place| later["devices"][place]["state"]["text"].as_str().unwrap()).collect();
    assert_eq!(texts, ["INIT", "INIT LNK_MIS B", "INIT NO_COMM"]);
    let lost = number(&later["devices"][1]["ports"][1]["lost_links"]["total"]);
    assert_eq!(lost, 1, "{}", later["devices"][1]["ports"]);
}

#[test]
fn the_live_view_tells_what_changes_a_line_each() {
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"T2.B\"\nfrom_ms = 300\n";
    std::fs::write(&plant, format!("{PLANT}{cut}")).unwrap();
    let place = format!("sim:{}", plant.display());
    let live = ["online", &place, "--live", "--seconds", "1", "--interval-ms", "50"];
    let lines = linesman(live);
    assert!(lines.stdout.contains("T3: INIT NO_COMM, was INIT"), "{}", lines.all());
    let json = linesman(live.into_iter().chain(["--json"]));
    let reports: Vec<Value> =
        json.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(reports.len() > 3, "{}", reports.len());
    assert_valid(reports.last().unwrap(), "online");
    for (arguments, words) in [
        (vec!["online", "listen:eth0"], "nothing can be driven there"),
        (vec!["online"], "WHERE"),
        (vec!["online", &place, "--interval-ms", "1"], "interval-ms"),
        (vec!["online", &place, "--seconds=-1"], "seconds"),
    ] {
        let wrong = linesman(arguments.iter().copied());
        assert_eq!(wrong.status, 2, "{arguments:?}: {}", wrong.all());
        assert!(wrong.stderr.contains(words), "{arguments:?}: {}", wrong.stderr);
    }
}

// S0 L1302-1348: state, CRC, lost frames, errors of the card and the log side by side, "ERR SAFEOP" with
// its code.
// proves: DIA-01
#[test]
fn state_errors_lost_frames_and_log_stand_in_one_view() {
    let plant = format!(
        "{}[[fault]]\nkind = \"watchdog-starved\"\ndevice = \"T3\"\nwatchdog_ms = 0.2\nfrom_ms = 6000\n\
         [[fault]]\nkind = \"nic-damaged\"\nat = \"maindevice\"\npart = \"receiver\"\nhits_per_s = 400\n\
         from_ms = 5000\n[[fault]]\nkind = \"emc-noise\"\nat = \"K1.B>T2.A\"\nhits_per_s = 60\n\
         from_ms = 5000\n",
        PLANT.replace("EL3104", "EL4102")
    );
    let running = Running::start(&plant);
    let report = running.until("fails", |report| {
        let text = report["devices"][2]["state"]["text"].as_str().unwrap_or_default();
        let lost = number(&report["cyclic"]["lost"]) + number(&report["queued"]["lost"]);
        text.starts_with("ERR SAFEOP")
            && lost > 0
            && number(&report["devices"][1]["errors"]) > 0
            && report["cards"][0]["rx_errors"].as_u64().is_some_and(|errors| errors > 0)
    });
    let folder = TempDir::new().unwrap();
    let kept = folder.path().join("kept.json");
    std::fs::write(&kept, report.to_string()).unwrap();
    let view = linesman(["online", kept.to_str().unwrap()]).stdout;
    let cyclic = format!("{} lost. Queued", report["cyclic"]["lost"]);
    let receive = format!("receive errors {}, send errors 0", report["cards"][0]["rx_errors"]);
    for part in [
        "ERR SAFEOP",
        "(0x001B sync manager watchdog)",
        "Latest:",
        "OP to SAFEOP, 0x001B",
        &cyclic,
        &receive,
    ] {
        assert!(view.contains(part), "{part} in {view}");
    }
}

// S4 L47-48: a line in trouble shows it by its acyclic frames, from 2 a second to 77.
// proves: JCT-13
#[test]
fn a_line_in_trouble_asks_around_and_that_shows() {
    let dips = "[[fault]]\nkind = \"brown-out\"\ndevices = [\"T3\"]\ndip_ms = 60\nevery_ms = 700\n\
                from_ms = 6000\nto_ms = 16000\n";
    let running = Running::start(&format!("{PLANT}{dips}"));
    // A busy computer may look for the first time when the trouble has begun: then it is quiet after it.
    let (quiet, troubled) = (Cell::new(f64::MAX), Cell::new(0.0_f64));
    running.until("asks around, in trouble alone", |report| {
        if let Some(rate) = report["queued"]["per_second"].as_f64() {
            match number(&report["time_ns"]) / 1_000_000 {
                2_000..6_000 | 20_000.. => quiet.set(quiet.get().min(rate)),
                7_000..16_000 => troubled.set(troubled.get().max(rate)),
                _ => {}
            }
        }
        troubled.get() > quiet.get() * 3.0
    });
    let view = linesman(["online", &running.socket()]).stdout;
    assert!(view.contains("Queued: ") && view.contains(" a second), "), "{view}");
}

// S0 L2634-2638: the last protocol error stays until the next clean access; states are not touched.
// proves: SW-09, PLC-17
#[test]
fn mailbox_errors_are_shown_apart_and_erased_by_a_clean_access() {
    let running = Running::start(PLANT);
    let socket = running.socket();
    let mailbox = || linesman(["online", &socket, "--json"]).json()["devices"][2].clone();
    assert_eq!(
        (&mailbox()["mailbox"]["errors"], &mailbox()["al_state"]),
        (&Value::from(0), &Value::from("OP"))
    );
    let refused = linesman(["sdo", &socket, "3", "read", "0x9999:01", "--type", "udint"]);
    assert_eq!(refused.status, 1, "{}", refused.all());
    assert!(!refused.all().contains("start-up list"), "nobody asked for one: {}", refused.all());
    let after = mailbox();
    // The dictionary was asked for the entry, too.
    let errors = number(&after["mailbox"]["errors"]);
    assert!(errors >= 1, "{after}");
    assert_eq!(
        (&after["al_state"], &after["state"]["word"]),
        (&Value::from("OP"), &Value::from(8))
    );
    let standing = &after["mailbox"]["standing"][0];
    assert_eq!(standing["protocol"], "CoE");
    assert!(standing["text"].as_str().unwrap().contains("0x06020000"), "{standing}");
    let table = linesman(["online", &socket]).stdout;
    assert!(table.contains("CoE failed, "), "{table}");
    assert_eq!(linesman(["sdo", &socket, "3", "read", "0x1018:01"]).status, 0);
    let clean = mailbox();
    assert_eq!(clean["mailbox"]["standing"].as_array().unwrap().len(), 0, "erased");
    assert_eq!(clean["mailbox"]["errors"], errors, "but counted");
}

// S0 L2630: how often a SubDevice left OP by itself; here also why.
// proves: PLC-16
#[test]
fn who_leaves_op_by_itself_is_counted_with_the_reason() {
    let fault = "[[fault]]\nkind = \"watchdog-starved\"\ndevice = \"T3\"\nwatchdog_ms = 0.5\nfrom_ms = 500\nto_ms = 900\n";
    // A terminal whose own software watches the outputs.
    let plant = PLANT.replace("EL3104", "EL4102");
    let running = Running::start(&format!("{plant}{fault}"));
    let report =
        running.until("falls", |report| number(&report["devices"][2]["abnormal_changes"]) > 0);
    let device = &report["devices"][2];
    let change = &device["history"][0];
    assert_eq!((&change["from"], &change["to"]), (&Value::from("OP"), &Value::from("SAFEOP")));
    assert_eq!(change["al_code"], 0x1B, "{change}");
    for other in [0, 1] {
        assert_eq!(report["devices"][other]["abnormal_changes"], 0);
    }
    let detail = linesman(["online", &running.socket(), "3"]).stdout;
    assert!(detail.contains("OP to SAFEOP, 0x001B"), "{detail}");
    running.until("comes back", |report| report["devices"][2]["state"]["word"] == 8);
}

/// A ring whose cables to the cards are cut for a while, one after the other.
const RING: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"T2\"\ntype = \"EL3104\"\non = \"K1.B\"\n\
[[device]]\nname = \"K3\"\ntype = \"EK1100\"\non = \"K1.C\"\n\
[ring]\ncloses_at = \"K3.C\"\n\
[[fault]]\nkind = \"link-open\"\nat = \"maindevice.A-K1.A\"\nfrom_ms = 2500\nto_ms = 5500\n\
[[fault]]\nkind = \"link-open\"\nat = \"K3.C-maindevice.B\"\nfrom_ms = 8000\nto_ms = 11000\n";

// proves: PLC-07 partial: the lock after a link error and its reset
#[test]
fn network_that_is_locked_after_a_link_error_goes_on_when_it_is_reset() {
    let lost = format!(
        "{PLANT}[[fault]]\nkind = \"link-open\"\nat = \"maindevice-K1.A\"\nfrom_ms = 2500\nto_ms = 4000\n"
    );
    let project = project_of(PLANT, "");
    let network = "[network]\nlock_after_link_error = true\n\n[[device]]";
    let locks = project.replacen("[[device]]", network, 1);
    let running = Running::with(&lost, &[("project.toml", &locks)]);
    let word = |report: &Value| number(&report["state"]["word"]);
    let report = running.until("is locked", |report| word(report) & 0x0003 == 0x0003);
    let text = report["state"]["text"].as_str().unwrap();
    assert!(text.contains("I/O locked after link error (reset required)"), "{text}");
    // The link is back, and all wait in SAFEOP.
    running.until("waits", |report| word(report) == 0x0402);
    let reset = linesman(["online", &running.socket(), "--reset", "--json"]);
    assert_valid(&reset.json(), "online");
    assert_eq!(word(&reset.json()) & 0x0002, 0, "{}", reset.all());
    running.until("is well", |report| word(report) == 0);
    // A line that nobody drives has nothing to be reset.
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    std::fs::write(&plant, PLANT).unwrap();
    let alone = linesman(["online", &format!("sim:{}", plant.display()), "--reset"]);
    assert_eq!(alone.status, 2, "{}", alone.all());
    assert!(alone.stderr.contains("nothing to reset"), "{}", alone.stderr);
}

// S0 L2573-2593: what is wrong with the network, a bit for each; 0 is well.
// proves: PLC-07 partial: the bits that a line can bring about; clocks are in clocks.rs
#[test]
fn the_word_of_the_network_says_what_is_wrong() {
    let running = Running::start(RING);
    let word = |report: &Value| number(&report["state"]["word"]);
    let has = |bits: u64, words: &str| {
        let report = running.until(words, |report| word(report) & bits == bits);
        let text = report["state"]["text"].as_str().unwrap();
        assert!(text.starts_with("Not OK") && text.contains(words), "{text}");
    };
    has(0x0001, "link error");
    has(0x0008, "one frame missing (redundancy)");
    has(0x0004, "link error of the redundancy adapter");
    running.until("is whole again", |report| word(report) == 0 && report["state"]["text"] == "OK");
    for (state, bit, words) in [
        ("preop", 0x0200, "at least one device in PREOP"),
        ("safeop", 0x0400, "at least one device in SAFEOP"),
        ("init", 0x0100, "at least one device in INIT"),
    ] {
        let asked = linesman(["state", &running.socket(), "2", "--to", state]);
        assert_eq!(asked.status, 0, "{}", asked.all());
        has(bit, words);
    }
    let asked = linesman(["state", &running.socket(), "2", "--to", "op"]);
    assert_eq!(asked.status, 0, "{}", asked.all());
    running.until("is well", |report| word(report) == 0);
}
