//! Lines on virtual cables: a segment at one end, this program at the other, each test in a network
//! namespace of its own. Needs root and `ip`.

use crate::support::assert_valid;
use crate::support::bench::beside_segment;

#[test]
fn a_scan_finds_each_subdevice_and_its_neighbours() {
    let Some(run) = beside_segment(r#""$LINESMAN" scan near0 --json"#) else { return };
    assert_eq!(run.status, 0, "{}", run.all());
    let scan = run.json();
    assert_valid(&scan, "scan");
    let devices = scan["devices"].as_array().unwrap();
    let types: Vec<_> = devices.iter().map(|device| device["type"].as_str().unwrap()).collect();
    assert_eq!(types, ["EK1100", "EL1008", "EL2008"]);
    let products: Vec<_> = devices.iter().map(|device| device["product_code"].as_u64()).collect();
    assert_eq!(products, [0x044C_2C52, 0x03F0_3052, 0x07D8_3052].map(Some));
    for (index, device) in devices.iter().enumerate() {
        assert_eq!(
            (device["no"].as_u64(), device["position"].as_u64()),
            (Some(index as u64 + 1), Some(index as u64))
        );
        let ports = device["ports"].as_array().unwrap();
        let port = |name| ports.iter().find(|port| port["port"] == name).expect("a port");
        let before = if index == 0 { "A" } else { "B" };
        assert_eq!(port("A")["to"], serde_json::json!({ "no": index, "port": before }));
        let after = serde_json::json!({ "no": index + 2, "port": "A" });
        let after = if index == 2 { serde_json::Value::Null } else { after };
        assert_eq!(port("B")["to"], after, "SubDevice {}", index + 1);
        assert_eq!(port("B")["open"], index < 2);
    }
}

#[test]
fn what_a_scan_saves_is_a_project() {
    let script = r#"
        "$LINESMAN" scan near0 --save "$DIRECTORY/machine.toml" || exit 9
        cat "$DIRECTORY/machine.toml"
        "$LINESMAN" scan near0 --save "$DIRECTORY/machine.toml"
    "#;
    let Some(run) = beside_segment(script) else { return };
    assert_eq!(run.status, 2, "a file that is there stays: {}", run.all());
    assert!(run.stderr.contains("is there already"), "{}", run.stderr);
    assert!(run.stdout.contains("3 SubDevices"), "{}", run.stdout);
    let start = run.stdout.find("name = ").expect("a project");
    let end = run.stdout.rfind("\n").unwrap();
    let project: toml::Value = toml::from_str(&run.stdout[start..end]).expect("TOML");
    assert_eq!(project["device"].as_array().unwrap().len(), 3);
}

#[test]
fn a_line_where_nobody_answers_is_told_with_what_to_check() {
    // A cable whose far end nobody holds: frames vanish.
    let script = r#"kill -INT $sim; wait $sim; "$LINESMAN" scan near0 --json"#;
    let Some(run) = beside_segment(script) else { return };
    assert_eq!(run.status, 2, "{}", run.all());
    let error = run.json();
    assert_valid(&error, "error");
    assert!(error["reason"].as_str().unwrap().contains("near0"), "{error}");
    assert!(error["next_step"].as_str().unwrap().contains("IN port"), "{error}");
}

#[test]
fn an_idle_line_is_healthy_for_both_who_look() {
    // A second program hears all that goes over the cable.
    let script = r#"
        "$LINESMAN" diagnose listen:near0 --seconds 2 --json > "$DIRECTORY/heard.json" &
        heard=$!
        sleep 0.5
        "$LINESMAN" diagnose near0 --seconds 0.7 --json
        status=$?
        wait $heard
        cat "$DIRECTORY/heard.json" >&2
        exit $status
    "#;
    let Some(run) = beside_segment(script) else { return };
    assert_eq!(run.status, 0, "{}", run.all());
    let diagnosis = run.json();
    assert_valid(&diagnosis, "diagnosis");
    assert_eq!(diagnosis["verdict"], "healthy");
    assert_eq!(diagnosis["network"]["devices"], 3);
    assert_eq!(diagnosis["network"]["al_state_highest"], "INIT", "states are left alone");
    let heard: serde_json::Value = serde_json::from_str(&run.stderr).expect("what was heard");
    assert_eq!(heard["network"]["devices"], 3, "{heard}");
}

#[test]
fn a_line_that_another_maindevice_drives_is_left_alone() {
    // It sits at the other end of the cable, as one of another computer would: no lock tells of it.
    let script = r#"
        ip link add near1 type veth peer name far1; ip link set near1 up; ip link set far1 up
        "$LINESMAN" diagnose far1 --seconds 3 > /dev/null 2>&1 &
        other=$!
        sleep 0.8
        "$LINESMAN" scan near1; echo "scan $?"
        "$LINESMAN" diagnose near1 --seconds 0.1; echo "diagnose $?"
        "$LINESMAN" run --on near1 --seconds 0.1; echo "run $?"
        wait $other
    "#;
    let Some(run) = beside_segment(script) else { return };
    assert_eq!(run.stdout, "scan 2\ndiagnose 2\nrun 2\n", "{}", run.stderr);
    let heard = "near1: another MainDevice drives this line: ";
    assert_eq!(run.stderr.matches(heard).count(), 3, "{}", run.stderr);
    assert_eq!(run.stderr.matches("EtherCAT frames from").count(), 3, "{}", run.stderr);
    assert_eq!(run.stderr.matches("`linesman diagnose listen:near1`").count(), 3);
}

#[test]
fn silence_is_told_with_what_to_check() {
    let script = r#""$LINESMAN" diagnose listen:near0 --seconds 0.2 --json"#;
    let Some(run) = beside_segment(script) else { return };
    assert_eq!(run.status, 2, "{}", run.all());
    assert_valid(&run.json(), "error");
    assert!(run.stderr.contains("no EtherCAT frame was heard"), "{}", run.stderr);
}

#[test]
fn an_interface_that_vanishes_ends_the_look_with_what_was_seen() {
    let script = r#"
        (sleep 1; ip link delete near0) &
        "$LINESMAN" diagnose near0 --seconds 20 --json
    "#;
    let Some(run) = beside_segment(script) else { return };
    let diagnosis = run.json();
    assert_valid(&diagnosis, "diagnosis");
    assert_eq!(diagnosis["complete"], false, "{diagnosis}");
    assert_eq!(diagnosis["network"]["devices"], 3);
    assert!(run.stderr.contains("near0") && run.stderr.contains("judged as far"), "{}", run.stderr);
}

#[test]
fn a_fault_put_on_a_running_line_is_found_and_heals() {
    let script = r#"
        "$LINESMAN" diagnose near0 --seconds 3 --json > "$DIRECTORY/found.json" &
        look=$!
        sleep 1
        "$LINESMAN" fault "$DIRECTORY/control" inject link-open --at I1.B-O1.A > /dev/null || exit 8
        sleep 0.5
        "$LINESMAN" fault "$DIRECTORY/control" heal 1 --json || exit 9
        wait $look
        status=$?
        cat "$DIRECTORY/found.json" >&2
        exit $status
    "#;
    let Some(run) = beside_segment(script) else { return };
    assert_eq!(run.status, 1, "{}", run.all());
    let faults = run.json();
    assert_valid(&faults, "faults");
    assert_eq!(faults["faults"][0]["name"], "link-open");
    assert_eq!(faults["faults"][0]["places"], serde_json::json!(["I1.B-O1.A"]));
    let diagnosis: serde_json::Value = serde_json::from_str(&run.stderr).expect("a diagnosis");
    let findings = diagnosis["findings"].as_array().unwrap();
    let link = findings.iter().find(|one| one["place"]["kind"] == "link").expect("a link");
    assert_eq!(link["place"]["a"], serde_json::json!({ "no": 2, "port": "B" }), "{diagnosis:#}");
    assert_eq!(link["state"], "closed", "healed: {diagnosis:#}");
}

#[test]
fn what_cannot_be_put_on_a_line_is_refused() {
    let script = r#"
        fault() { "$LINESMAN" fault "$DIRECTORY/control" "$@"; echo "$?"; }
        fault list
        fault inject link-open --at K1.C-K9.A
        fault heal 5
        "$LINESMAN" fault "$DIRECTORY/nobody" list --json; echo "$?"
    "#;
    let Some(run) = beside_segment(script) else { return };
    assert!(run.stdout.starts_with("No faults so far.\n0\n2\n2\n{"), "{}", run.all());
    assert!(run.stdout.ends_with("}\n2\n"), "{}", run.all());
    assert!(run.stderr.contains("K9") && run.stderr.contains("no fault 5"), "{}", run.stderr);
    assert!(run.stderr.contains("--on NIC --control "), "{}", run.stderr);
}

#[test]
fn ctrl_c_ends_a_watch_and_what_was_seen_is_judged() {
    let script = r#"
        "$LINESMAN" counters near0 --for 600 --every-ms 100 --json & watch=$!
        sleep 3; kill -INT $watch; wait $watch"#;
    let Some(run) = beside_segment(script) else { return };
    assert_eq!(run.status, 0, "{}", run.all());
    let report = run.json();
    assert_valid(&report, "counters");
    assert_eq!(report["diagnosis"]["verdict"], "healthy");
    assert!((0.1..60.0).contains(&report["seconds"].as_f64().unwrap()), "{report}");
}
