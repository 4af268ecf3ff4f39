//! `linesman state`: with one SubDevice silent, and checks before anything is changed.

use crate::support::bench::beside_segment;
use crate::support::running::{PLANT, Running};
use crate::support::{assert_valid, linesman};

#[test]
fn one_silent_subdevice_is_a_row_of_the_table_and_keeps_the_others_from_being_changed() {
    let off = "[[fault]]\nkind = \"device-off\"\ndevice = \"T3\"\nfrom_ms = 2500\n";
    let running = Running::start(&format!("{PLANT}{off}"));
    let socket = running.socket();
    running.until("loses one", |report| report["devices"][2]["present"] == false);
    let table = linesman(["state", &socket]);
    assert_eq!(table.status, 1, "{}", table.all());
    let rows: Vec<&str> = table.stdout.lines().collect();
    assert!(rows[1].ends_with("OP") && rows[2].ends_with("OP"), "{}", table.stdout);
    assert!(rows[3].starts_with("3 ") && rows[3].ends_with("no answer"), "{}", table.stdout);
    let json = linesman(["state", &socket, "--json"]);
    assert_eq!(json.status, 1, "{}", json.all());
    let report = json.json();
    assert_valid(&report, "states");
    assert_eq!(report["devices"][2]["al_state"], serde_json::Value::Null);
    // All are looked at before one is changed.
    let refused = linesman(["state", &socket, "--to", "safeop"]);
    assert_eq!(refused.status, 2, "{}", refused.all());
    for words in ["no answer; nothing was changed", &format!("`linesman online {socket}`")] {
        assert!(refused.stderr.contains(words), "{words}: {}", refused.stderr);
    }
    let after = linesman(["state", &socket, "--json"]).json();
    assert_eq!(after["devices"][0]["al_state"], "OP", "{after}");
    // The silent one alone is no table.
    let alone = linesman(["state", &socket, "3"]);
    assert_eq!((alone.status, alone.stdout.as_str()), (2, ""), "{}", alone.all());
}

#[test]
fn what_is_asked_for_is_checked_before_anything_is_changed() {
    let script = r#"
        states() { "$LINESMAN" state near0 | awk 'NR > 1 { print $NF }' | tr '\n' ' '; echo; }
        "$LINESMAN" state near0 --to op; echo "op $?"
        states
        "$LINESMAN" state near0 --to boot; echo "boot $?"
        "$LINESMAN" state near0 9 --to preop; echo "nobody $?"
        "$LINESMAN" state near0 3 --to safeop --dry-run; echo "dry $?"
        states
        "$LINESMAN" state near0 --to safeop > /dev/null; echo "safeop $?"
        states
        "$LINESMAN" state near0 2 --to op > /dev/null; echo "inputs $?"
        "$LINESMAN" state near0 --to preop --dry-run --json
    "#;
    let Some(run) = beside_segment(script) else { return };
    let mut lines = run.stdout.lines();
    let expected = ["op 2", "INIT INIT INIT ", "boot 2", "nobody 2"];
    let first: Vec<&str> = lines.by_ref().take(4).collect();
    assert_eq!(first, expected, "{}", run.all());
    let dry: Vec<&str> = lines.by_ref().take(4).collect();
    assert!(dry[1].ends_with("INIT → PREOP → SAFEOP"), "{dry:?}");
    assert_eq!(dry[2..], ["Nothing was changed.", "dry 0"]);
    let then: Vec<&str> = lines.by_ref().take(4).collect();
    assert_eq!(then, ["INIT INIT INIT ", "safeop 0", "SAFEOP SAFEOP SAFEOP ", "inputs 0"]);
    for words in [
        "near0: OP: SubDevice 3 (EL2008): with outputs it needs somebody who sends them",
        "`linesman run --on near0` drives all to OP",
        "near0: BOOT: SubDevice 1 (EK1100), SubDevice 2 (EL1008), SubDevice 3 (EL2008): no mailbox for it; nothing was changed",
    ] {
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
    let report: serde_json::Value =
        serde_json::from_str(&lines.collect::<Vec<_>>().join("\n")).unwrap();
    assert_valid(&report, "states");
    for at in 0..3 {
        assert_eq!(report["devices"][at]["steps"], serde_json::json!(["PREOP"]), "{report:#}");
    }
}
