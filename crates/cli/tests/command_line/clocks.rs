//! Distributed clocks from a person's side: what comes from the description of a device, who can be the
//! reference, how far clocks and times are apart.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::running::Running;
use crate::support::{assert_valid, linesman};
use serde_json::{Value, json};
use tempfile::TempDir;

/// An axis with SYNC0 in every cycle and SYNC1 in every second one, as its maker describes it.
const ESI: &str = r##"<EtherCATInfo><Vendor><Id>2</Id><Name>x</Name></Vendor><Descriptions><Devices>
<Device Physics="KK"><Type ProductCode="#x4711" RevisionNo="#x00010000">AXIS-1</Type><Name>Axis</Name>
<Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu>
<Sm StartAddress="#x1000" ControlByte="#x64" Enable="1" DefaultSize="2">Outputs</Sm>
<Sm StartAddress="#x1100" ControlByte="#x20" Enable="1" DefaultSize="2">Inputs</Sm>
<RxPdo Sm="0" Fixed="1"><Index>#x1600</Index><Name>Out</Name><Entry><Index>#x7000</Index><SubIndex>1</SubIndex>
<BitLen>16</BitLen><Name>Speed</Name><DataType>INT</DataType></Entry></RxPdo>
<TxPdo Sm="1" Fixed="1"><Index>#x1a00</Index><Name>In</Name><Entry><Index>#x6000</Index><SubIndex>1</SubIndex>
<BitLen>16</BitLen><Name>Place</Name><DataType>INT</DataType></Entry></TxPdo>
<Dc><OpMode><Name>DcSync</Name><Desc>In step</Desc><AssignActivate>#x0700</AssignActivate>
<CycleTimeSync0 Factor="1">0</CycleTimeSync0><ShiftTimeSync0>25000</ShiftTimeSync0>
<CycleTimeSync1 Factor="2">0</CycleTimeSync1><ShiftTimeSync1>1000</ShiftTimeSync1></OpMode>
<OpMode><Name>DcOff</Name><Desc>Free</Desc><AssignActivate>#x0000</AssignActivate></OpMode></Dc>
<Eeprom><ByteSize>2048</ByteSize><ConfigData>050d010000000000</ConfigData></Eeprom></Device>
</Devices></Descriptions></EtherCATInfo>"##;

/// A coupler, and two axes whose clocks are set like this.
fn project(first: &str, second: &str) -> String {
    let mut text = "esi = [\"axis.xml\"]\n[[task]]\nname = \"motion\"\ncycle_us = 2000\n\
                    [[device]]\nname = \"K1\"\non = \"maindevice\"\n[device.description]\nports = \"YK\"\n"
        .to_owned();
    for (name, on, clock) in [("X1", "K1.B", first), ("X2", "X1.B", second)] {
        writeln!(text, "[[device]]\nname = \"{name}\"\ntype = \"AXIS-1\"\non = \"{on}\"\n{clock}")
            .unwrap();
    }
    text
}

struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new(project: &str) -> Self {
        let bench = Self { folder: TempDir::new().unwrap() };
        bench.write("axis.xml", ESI);
        bench.write("machine.toml", project);
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    fn plan(&self) -> Value {
        let run = linesman(["plan", text(&self.path("machine.toml")).as_str(), "--json"]);
        assert!(run.status <= 1, "{}", run.all());
        let report = run.json();
        assert_valid(&report, "plan");
        report
    }
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// What a plan says of the clocks of its axes: activation, SYNC0, shift, SYNC1.
fn settings(report: &Value) -> Vec<Value> {
    let devices = report["clock"]["devices"].as_array().unwrap();
    let keys = ["assign_activate", "sync0_cycle_ns", "sync0_shift_ns", "sync1_cycle_ns"];
    devices.iter().map(|one| keys.iter().map(|key| one[key].clone()).collect()).collect()
}

// S0 L300-310: period and enabling of SYNC0 and SYNC1, and the shift on top, are the maker's; whoever changes
// them is warned.
// proves: SYN-12
#[test]
fn clock_settings_come_from_the_description_and_changed_ones_are_warned_of() {
    let mode = "clock = { mode = \"DcSync\" }";
    let as_described = Bench::new(&project(mode, mode));
    let report = as_described.plan();
    let own = json!([0x0700, 2_000_000, 25_000, 4_001_000]);
    assert_eq!(settings(&report), [own.clone(), own.clone()]);
    assert_eq!(report["clock"]["reference"], 2, "the first that is in step");
    assert_eq!(report["notes"], json!([]), "{report}");
    // Each setting that is changed is told with both values.
    for (change, expected, words) in [
        (
            "assign_activate = 0x0300",
            json!([0x0300, 2_000_000, 25_000, 4_001_000]),
            "assign_activate 0x0300 instead of 0x0700",
        ),
        (
            "sync0_cycle_us = 1000",
            json!([0x0700, 1_000_000, 25_000, 2_001_000]),
            "cycle of SYNC0 1000000 ns instead of 2000000 ns",
        ),
        (
            "sync0_shift_ns = 30000",
            json!([0x0700, 2_000_000, 30_000, 4_001_000]),
            "shift of SYNC0 30000 ns instead of 25000 ns",
        ),
        (
            "sync1_cycle_us = 2000",
            json!([0x0700, 2_000_000, 25_000, 2_000_000]),
            "cycle of SYNC1 2000000 ns instead of 4001000 ns",
        ),
    ] {
        let changed = format!("clock = {{ mode = \"DcSync\", reference = true, {change} }}");
        let bench = Bench::new(&project(mode, &changed));
        let report = bench.plan();
        assert_eq!(settings(&report), [own.clone(), expected], "{change}");
        assert_eq!(report["clock"]["reference"], 3, "the one that was chosen");
        let notes = report["notes"].as_array().unwrap();
        let note = notes.iter().find(|note| note.as_str().unwrap().contains(words));
        let note = note.unwrap_or_else(|| panic!("{words}: {report}")).as_str().unwrap();
        assert!(note.contains("X2") && note.contains("DcSync") && !note.contains("X1"), "{note}");
        // People see it, too, and are told before anything runs.
        let shown = linesman(["plan", text(&bench.path("machine.toml")).as_str()]);
        let shown = shown.all().split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(shown.contains(words), "{shown}");
    }
}

// S0 L724-726, S1 L1483-1492: the first that is in step is the reference clock, and its time is spread by its
// place in the line: 0xFFED, which is -19, is the twentieth.
// proves: DC-03
#[test]
fn the_first_subdevice_in_step_is_the_reference_clock_unless_another_is_chosen() {
    let line = |first: &str, second: &str| {
        let mut text = "esi = [\"axis.xml\"]\n[[device]]\nname = \"B1\"\non = \"maindevice\"\n\
                        [device.description]\noutputs_bits = 8\n"
            .to_owned();
        for no in 2..20 {
            let on = no - 1;
            writeln!(
                text,
                "[[device]]\nname = \"B{no}\"\non = \"B{on}.B\"\n[device.description]\noutputs_bits = 8"
            )
            .unwrap();
        }
        for (no, clock) in [(20, first), (21, second)] {
            let on = no - 1;
            writeln!(
                text,
                "[[device]]\nname = \"B{no}\"\ntype = \"AXIS-1\"\non = \"B{on}.B\"\n{clock}"
            )
            .unwrap();
        }
        Bench::new(&text).plan()
    };
    let spread = |report: &Value| {
        let rows = report["tasks"][0]["frames"][0]["datagrams"].as_array().unwrap();
        let row = rows.iter().find(|row| row["role"] == "reference-clock").unwrap();
        json!([row["command"], row["address"], row["register"]])
    };
    let mode = "clock = { mode = \"DcSync\" }";
    let by_itself = line(mode, mode);
    assert_eq!(by_itself["clock"]["reference"], 20);
    assert_eq!(spread(&by_itself), json!(["ARMW", 0xFFED, 0x0910]));
    let chosen = line(mode, "clock = { mode = \"DcSync\", reference = true }");
    assert_eq!(chosen["clock"]["reference"], 21);
    assert_eq!(spread(&chosen), json!(["ARMW", 0xFFEC, 0x0910]));
}

// The same settings in the registers of a line that runs.
#[test]
fn clock_settings_of_the_description_reach_the_registers() {
    let mode = "clock = { mode = \"DcSync\" }";
    let project = project(mode, mode);
    let running = Running::with(&plant(""), &[("machine.toml", &project), ("axis.xml", ESI)]);
    let read = |register: &str, len: &str| {
        let words = ["reg", &running.socket(), "3", "read", register, "--len", len, "--json"];
        linesman(words).json()["bytes"].as_str().unwrap().to_owned()
    };
    assert_eq!(read("SYNC0-cycle-time", "4"), "80 84 1E 00", "2,000,000 ns");
    assert_eq!(read("SYNC1-cycle-time", "4"), "E8 0C 3D 00", "4,001,000 ns");
    assert_eq!(read("activation", "1"), "07", "cyclic operation, SYNC0, SYNC1");
}

/// The line of the project, with faults.
fn plant(more: &str) -> String {
    let mut text = "name = \"axes\"\nseed = 4\n[[device]]\nname = \"K1\"\ntype = \"EK1100\"\n\
                    on = \"maindevice\"\n"
        .to_owned();
    for (name, on, ppm) in [("X1", "K1.B", 100.0), ("X2", "X1.B", -20.0)] {
        writeln!(
            text,
            "[[device]]\nname = \"{name}\"\ntype = \"esi:axis.xml#AXIS-1\"\non = \"{on}\"\nclock_ppm = {ppm:.1}"
        )
        .unwrap();
    }
    text + more
}

// S0 L743-757: a coupler can be the reference clock from some revision on.
// proves: DC-05
#[test]
fn who_is_too_old_to_be_the_reference_clock_is_told_in_scan_and_plan() {
    let bench = Bench::new("");
    for (kind, product, since) in [
        ("BK1150", 0x047E_2C22, 16),
        ("EK1100", 0x044C_2C52, 17),
        ("EK1101", 0x044D_2C52, 17),
        ("EK1122", 0x0462_2C52, 17),
        ("EK1501", 0x05DD_2C52, 17),
        ("EK1501-0010", 0x05DD_2C52, 17),
        ("EK1521", 0x05F1_2C52, 18),
        ("EK1521-0010", 0x05F1_2C52, 18),
        ("EK1541", 0x0605_2C52, 16),
        ("EK1561", 0x0619_2C52, 16),
        ("EK1814", 0x0716_2C52, 16),
        ("CU1128", 0x0468_5432, 0),
    ] {
        let doubted = |number: i32| {
            let revision = number << 16;
            bench.write(
                "machine.toml",
                &format!(
                    "[[device]]\nname = \"K1\"\ntype = \"{kind}\"\non = \"maindevice\"\nvendor_id = 2\n\
                     product_code = {product}\nrevision = {revision}\nclock = {{ reference = true }}\n\
                     [device.description]\n"
                ),
            );
            let doubts = bench.plan()["findings"].clone();
            let doubt =
                doubts.as_array().unwrap().iter().find(|one| one["name"] == "reference-clock");
            let text = doubt.map(|doubt| doubt["text"].as_str().unwrap().to_owned());
            if let Some(text) = &text {
                assert!(text.contains(&format!("{since:04}")) && text.contains(kind), "{text}");
            }
            text.is_some()
        };
        assert!(!doubted(since) && !doubted(since + 3), "{kind}");
        assert_eq!(since > 1 && doubted((since - 1).max(1)), since > 1, "{kind}");
    }
    // Found on a line: the coupler of the library is new enough; a terminal with a clock can be it always.
    let place = bench.path("plant.toml");
    fs::write(
        &place,
        "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
         [[device]]\nname = \"O1\"\ntype = \"EL4102\"\non = \"K1.B\"\n\
         [[device]]\nname = \"I1\"\ntype = \"EL1008\"\non = \"O1.B\"\n",
    )
    .unwrap();
    let scan = linesman(["scan", &format!("sim:{}", place.display()), "--json"]);
    let scan = scan.json();
    assert_valid(&scan, "scan");
    for device in scan["devices"].as_array().unwrap() {
        assert_eq!(device["reference_clock"], device["dc"], "{device}");
    }
    assert_eq!(scan["devices"][1]["reference_clock"], true);
}

// S0 L2593: the deviation of the clocks is watched against a window: "DC not in sync".
// proves: DC-21
#[test]
fn a_clock_that_leaves_the_sync_window_is_logged_and_shown_and_sets_the_bit_of_the_network() {
    let mode = "clock = { mode = \"DcSync\" }";
    let window = "[network]\nsync_window_ns = 400\n[[task]]";
    let machine = project(mode, mode).replacen("[[task]]", window, 1);
    let drift = |times: &str| {
        plant(&format!("[[fault]]\nkind = \"clock-drift\"\ndevice = \"X2\"\nppm = 900\n{times}"))
    };
    // In the log: it leaves the window, and comes back when it is healed.
    let bench = Bench::new(&machine);
    bench.write("plant.toml", &drift("from_ms = 3000\nto_ms = 3500\n"));
    let (on, log) =
        (format!("sim:{}", bench.path("plant.toml").display()), bench.path("log.sqlite"));
    let ran = linesman([
        "run",
        text(&bench.path("machine.toml")).as_str(),
        "--on",
        &on,
        "--seconds",
        "60",
        "--no-diagnosis",
        "--log",
        text(&log).as_str(),
    ]);
    assert!(ran.status <= 1, "{}", ran.all());
    let told = linesman(["log", text(&log).as_str(), "--kind", "clock", "--json"]).json();
    let entries: Vec<&Value> = told["entries"].as_array().unwrap().iter().collect();
    let texts: Vec<&str> = entries.iter().map(|entry| entry["text"].as_str().unwrap()).collect();
    assert!(texts.len() >= 2, "{texts:?}");
    assert!(
        texts[0].contains("its clock has left the sync window")
            && texts[0].contains("400 ns allowed")
    );
    assert!(texts.last().unwrap().contains("within the sync window again"), "{texts:?}");
    assert!(entries.iter().all(|entry| entry["no"] == 3), "the one whose clock it is: {texts:?}");
    assert_eq!(entries[0]["severity"], "warning");
    // In the table, and in the word of the network, as long as it lasts; before, all is well.
    let running =
        Running::with(&drift("from_ms = 6000\n"), &[("machine.toml", &machine), ("axis.xml", ESI)]);
    let well = running.until("tells how far clocks are off", |report| {
        !report["devices"][2]["clock_difference_ns"].is_null()
    });
    assert_valid(&well, "online");
    assert_eq!(well["state"]["word"], 0, "{well}");
    let difference = |report: &Value| report["devices"][2]["clock_difference_ns"].as_u64().unwrap();
    assert!(difference(&well) <= 400, "{well}");
    assert!(
        well["devices"][0]["clock_difference_ns"].is_null(),
        "no SyncSignals, nothing to watch"
    );
    assert!(well["devices"][1]["clock_difference_ns"].is_null(), "the reference");
    let apart = running
        .until("drifts out of the window", |report| report["devices"][2]["clock_apart"] == true);
    assert!(difference(&apart) > 400, "{apart}");
    assert_eq!(apart["state"]["word"].as_u64().unwrap() & 0x1000, 0x1000, "{}", apart["state"]);
    assert!(apart["state"]["text"].as_str().unwrap().contains("clocks not in sync"), "{apart}");
    let table = linesman(["online", &running.socket()]).stdout;
    assert!(table.contains("clock off") && table.contains("reference"), "{table}");
}

// S0 L776-778: the host's time and that of the network are not identical, and the offset is visible. The
// reference's quartz is 100 ppm fast: 100 µs more in each second.
// proves: DC-09
#[test]
fn the_offset_between_the_time_of_the_network_and_that_of_the_host_is_shown() {
    let mode = "clock = { mode = \"DcSync\" }";
    let project = project(mode, mode);
    let running = Running::with(&plant(""), &[("machine.toml", &project), ("axis.xml", ESI)]);
    let offset = |report: &Value| report["clock"]["ahead_ns"].as_i64();
    let first = running.until("tells the offset", |report| offset(report).is_some());
    assert_eq!(first["clock"]["reference"], 2);
    let at = |report: &Value| report["time_ns"].as_i64().unwrap();
    let later = running
        .until("has run for three seconds more", |report| at(report) > at(&first) + 3_000_000_000);
    let moved = offset(&later).unwrap() - offset(&first).unwrap();
    // Both are told once a second: that is how far the times are uncertain.
    let expected = (at(&later) - at(&first)) / 10_000;
    assert!((moved - expected).abs() < 130_000, "{moved} ns in {expected}");
    assert!(offset(&later).unwrap().abs() < 5_000_000, "{later}");
    let table = linesman(["online", &running.socket()]).stdout;
    assert!(table.contains("The network's time, that of 2, is"), "{table}");
}
