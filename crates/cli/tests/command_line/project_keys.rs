//! Every key of a project file, misspelt: each is refused with the line and what was meant.

use std::collections::BTreeSet;
use std::fs;

use crate::support::{linesman, schema};
use serde_json::Value;
use tempfile::TempDir;

/// The properties of every table of the schema, by the name of the table.
fn tables(schema: &Value) -> Vec<(String, BTreeSet<String>)> {
    let keys = |table: &Value| -> BTreeSet<String> {
        table["properties"]
            .as_object()
            .map_or_else(BTreeSet::new, |all| all.keys().cloned().collect())
    };
    let mut tables = vec![("Project".to_owned(), keys(schema))];
    for (name, table) in schema["$defs"].as_object().unwrap() {
        let keys = keys(table);
        if !keys.is_empty() {
            tables.push((name.clone(), keys));
        }
    }
    tables
}

/// What leads from the begin of a file to a table of its device.
macro_rules! device {
    ($way:literal) => {
        concat!("[[device]]\nname = \"D\"\non = \"maindevice\"\n", $way)
    };
}

/// Where a table of the schema stands in a file: what comes before its keys, and behind them.
fn place(table: &str) -> Option<(&'static str, &'static str)> {
    Some(match table {
        "Project" => ("", ""),
        "Network" => ("[network]\n", ""),
        "ProjectTask" => ("[[task]]\n", ""),
        "Ring" => ("[ring]\n", ""),
        "ProjectGateway" => ("[gateway]\n", ""),
        "ProjectDevice" => ("[[device]]\n", ""),
        "ProjectGroup" => ("[[group]]\n", ""),
        "IdentificationChoice" => (device!("identification = { "), " }"),
        "Description" => (device!("[device.description]\n"), ""),
        "WatchdogChoice" => (device!("watchdog = { "), " }"),
        "ClockChoice" => (device!("clock = { "), " }"),
        "Mapping" => (device!("[[device.mapping]]\n"), ""),
        "SyncTimes" => (device!("sync_times = { "), " }"),
        "DirectionTimes" => (device!("sync_times = { outputs = { "), " } }"),
        "StartUpEntry" => (device!("[[device.start_up]]\n"), ""),
        "EthernetChoice" => (device!("[[device.start_up]]\ntransition = \"IP\"\neoe = { "), " }"),
        "DescribedMailbox" => (device!("[device.description]\nmailbox = { "), " }"),
        "DescribedSyncManager" => (device!("[device.description]\nsync_managers = [{ "), " }]"),
        "DescribedPdo" => (device!("[device.description]\npdos = [{ "), " }]"),
        "DescribedEntry" => (device!("[device.description]\npdos = [{ entries = [{ "), " }] }]"),
        _ => return None,
    })
}

#[test]
fn every_misspelt_key_is_refused_with_its_line_and_what_was_meant() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("project.toml");
    let mut tried = 0;
    for (table, keys) in tables(&schema("project")) {
        let (before, behind) =
            place(&table).unwrap_or_else(|| panic!("the table {table} has no place in this test"));
        for key in &keys {
            // Two letters changed places, or one doubled: as hands do.
            let mut letters: Vec<char> = key.chars().collect();
            match letters.len() {
                0..3 => letters.push('x'),
                len => letters.swap(len - 2, len - 1),
            }
            let mut wrong: String = letters.into_iter().collect();
            if wrong == *key || keys.contains(&wrong) {
                wrong.push('x');
            }
            fs::write(&path, format!("{before}{wrong} = 1{behind}\n")).unwrap();
            let run = linesman(["plan", path.to_str().unwrap()]);
            let told = format!("{table}.{key} as `{wrong}`: {}", run.stderr);
            assert_eq!(run.status, 2, "{told}");
            assert!(run.stderr.contains(&format!("unknown field `{wrong}`")), "{told}");
            let line = before.lines().count() + usize::from(behind.is_empty());
            assert!(run.stderr.contains(&format!("line {}", line.max(1))), "line {line}: {told}");
            assert!(run.stderr.contains(&format!("`{key}`")), "what was meant: {told}");
            tried += 1;
        }
    }
    assert!(tried > 80, "{tried} keys");
}
