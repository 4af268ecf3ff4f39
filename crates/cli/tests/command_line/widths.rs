//! Text at 60, 80 and 200 columns: no line is longer, but for words that cannot be broken.

use std::fmt::Write as _;
use std::process::Command;

use crate::support::capture::Pcap;
use crate::support::{PROGRAM, linesman};
use tempfile::TempDir;

/// A line with a long name, mailboxes, and a fault.
fn plant() -> String {
    let mut text = "name = \"wide\"\nseed = 3\n".to_owned();
    let first = "Coupler in the cabinet at the far end of the hall";
    let kinds = ["EK1100", "EL1008", "EL3104", "EL7041", "EL2008", "EL4102", "EL6601"];
    for (index, kind) in kinds.iter().enumerate() {
        let name = if index == 0 { first.to_owned() } else { format!("T{index}") };
        let on = match index {
            0 => "maindevice".to_owned(),
            1 => format!("{first}.B"),
            _ => format!("T{}.B", index - 1),
        };
        write!(text, "[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n").unwrap();
    }
    text + "[[fault]]\nkind = \"device-off\"\ndevice = \"T4\"\nfrom_ms = 1000\nto_ms = 1500\n"
}

/// Standard output and standard error, `columns` wide.
fn at(columns: usize, folder: &TempDir, words: &[&str]) -> String {
    let mut command = Command::new(PROGRAM);
    command.args(words).current_dir(folder.path()).env("COLUMNS", columns.to_string());
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    text(output.stdout) + &text(output.stderr)
}

fn place() -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("plant.toml"), plant()).unwrap();
    std::fs::write(folder.path().join("gap.pcap"), Pcap::with_a_gap(200).0).unwrap();
    let done = at(100, &folder, &["scan", "sim:plant.toml", "--save", "machine.toml"]);
    assert!(done.contains("7 SubDevices"), "{done}");
    let log = "run --on sim:plant.toml --seconds 3 --log log.sqlite";
    at(100, &folder, &log.split(' ').collect::<Vec<_>>());
    folder
}

const COMMANDS: [&str; 36] = [
    "--help",
    "diagnose --help",
    "scan sim:plant.toml",
    "scan sim:plant.toml -v",
    "scan sim:plant.toml --against machine.toml",
    "plan machine.toml",
    "plan machine.toml -v",
    "diagnose sim:plant.toml",
    "diagnose sim:plant.toml --follow",
    "diagnose gap.pcap",
    "diagnose gap.pcap none.pcap",
    "state sim:plant.toml",
    "state sim:plant.toml T3 --to safeop --dry-run",
    "counters sim:plant.toml --for 3",
    "probe sim:plant.toml",
    "online sim:plant.toml",
    "online sim:plant.toml 3",
    "interfaces",
    "host -v",
    "run --on sim:plant.toml --seconds 3",
    "log log.sqlite",
    "log log.sqlite --runs",
    "reg sim:plant.toml 2 read al-status",
    "reg sim:plant.toml 2 dump",
    "sdo sim:plant.toml T3 list --entries --values",
    "sdo sim:plant.toml T3 read 0x1018",
    "sdo sim:plant.toml T3 info 0x1018",
    "sii sim:plant.toml 3 read",
    "history sim:plant.toml T3",
    "lab swarm --seeds 0..2",
    "demo --seed 7",
    "explain 0x001B",
    "explain H101",
    "scan nowhere0",
    "run --on gap.pcap",
    "diagnose sim:nowhere.toml",
];

#[test]
fn no_line_is_longer_than_the_terminal_is_wide() {
    let folder = place();
    for columns in [60, 80, 200] {
        for command in COMMANDS {
            let words: Vec<&str> = command.split(' ').collect();
            let text = at(columns, &folder, &words);
            assert!(!text.is_empty(), "{command}");
            for line in text.lines() {
                let is_one_word = line.split_whitespace().count() <= 1;
                let fits = line.chars().count() <= columns || is_one_word;
                assert!(fits, "{columns} columns, {command}: {line}");
            }
        }
    }
}

#[test]
fn a_table_in_a_pipe_has_a_line_for_each_row() {
    let folder = place();
    let place = format!("sim:{}", folder.path().join("plant.toml").display());
    let table = linesman(["state", &place]).stdout;
    let row = table.lines().find(|line| line.starts_with("1 ")).unwrap();
    assert!(row.contains("far end of the hall") && row.contains("INIT"), "{table}");
    let narrow = at(60, &folder, &["state", "sim:plant.toml"]);
    assert!(narrow.lines().any(|line| line.trim() == "far end of the hall"), "{narrow}");
}

#[test]
fn what_programs_read_is_never_broken() {
    let folder = place();
    for command in ["log log.sqlite --csv", "state sim:plant.toml --json", "completion bash"] {
        let words: Vec<&str> = command.split(' ').collect();
        assert_eq!(at(60, &folder, &words), at(200, &folder, &words), "{command}");
    }
}
