//! Commands that messages and documents advise: each exists, with its options, and those that a command
//! prints can be run as they are printed.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::running::{PLANT, Running};
use crate::support::{Run, linesman};
use tempfile::TempDir;

/// The help of each command, and of each command within it.
struct Helps {
    of: BTreeMap<String, String>,
    within: BTreeMap<String, BTreeMap<String, String>>,
}

impl Helps {
    fn read() -> Self {
        let top = linesman(["--help"]).stdout;
        let mut helps = Self { of: BTreeMap::new(), within: BTreeMap::new() };
        for name in commands(&top) {
            let help = linesman([name.as_str(), "--help"]).stdout;
            let mut within = BTreeMap::new();
            for inner in commands(&help) {
                // Some take the line and the SubDevice before the word.
                let tries = [vec![], vec!["x"], vec!["x", "1"]];
                let inner_help = tries.iter().find_map(|before| {
                    let words =
                        [&[name.as_str()], &before[..], &[inner.as_str(), "--help"]].concat();
                    let run = linesman(words);
                    (run.status == 0).then_some(run.stdout)
                });
                within.insert(inner, inner_help.unwrap());
            }
            helps.within.insert(name.clone(), within);
            helps.of.insert(name, help);
        }
        assert!(helps.of.len() > 15, "{:?}", helps.of.keys());
        helps
    }

    /// What is wrong with a command.
    fn fault(&self, words: &[&str]) -> Option<String> {
        let (name, rest) = words.split_first()?;
        let Some(help) = self.of.get(*name) else { return Some(format!("there is no `{name}`")) };
        let within = &self.within[*name];
        let inner = rest.iter().find_map(|word| within.get(*word));
        rest.iter().find_map(|word| {
            let option: String =
                word.chars().take_while(|c| *c == '-' || c.is_ascii_lowercase()).collect();
            if !option.starts_with("--") || option.len() < 3 {
                return None;
            }
            let has = |help: &String| {
                help.split(|c: char| !(c == '-' || c.is_ascii_lowercase())).any(|one| one == option)
            };
            let is_known = has(help) || inner.is_some_and(has);
            (!is_known).then(|| format!("`{name}` has no `{option}`"))
        })
    }
}

/// The names under "Commands:".
fn commands(help: &str) -> Vec<String> {
    let behind = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    behind
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next().map(str::to_owned))
        .collect()
}

/// Sources and documents of the project.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && !matches!(name.as_str(), "target" | ".git" | "data") {
            files(&path, found);
        } else if matches!(path.extension().and_then(|end| end.to_str()), Some("rs" | "md"))
            && name != "CHANGELOG.md"
        {
            found.push(path);
        }
    }
}

/// Strings and comments that go on in the next line become one.
fn joined(text: &str) -> String {
    let mut result = String::new();
    for line in text.lines() {
        let words = line.trim_start();
        let comment = ["//!", "///", "//"].iter().find_map(|mark| words.strip_prefix(mark));
        match (result.strip_suffix('\\').map(str::len), comment) {
            (Some(len), _) => {
                result.truncate(len);
                result.push_str(words);
            }
            (None, Some(comment)) => {
                result.push_str(comment);
                continue;
            }
            (None, None) => result.push_str(&format!("\n{line}")),
        }
    }
    result
}

/// The commands of a text: in backticks, or at the begin of a line.
fn mentioned(text: &str) -> Vec<String> {
    let quoted = text.match_indices("`linesman ").map(|(at, mark)| (at + mark.len(), '`'));
    let begun = text.match_indices("\nlinesman ").map(|(at, mark)| (at + mark.len(), '\n'));
    let rest = |(at, end): (usize, char)| {
        let stop = [end, '\n', '#', '|', '>', ';'];
        text[at..].split(stop).next().unwrap_or_default().trim().to_owned()
    };
    quoted.chain(begun).map(rest).collect()
}

#[test]
fn every_command_that_is_named_exists() {
    let helps = Helps::read();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let (mut all, mut faults, mut count) = (Vec::new(), Vec::new(), 0);
    files(&root, &mut all);
    for path in all {
        let Ok(text) = fs::read_to_string(&path) else { continue };
        for command in mentioned(&joined(&text)) {
            let words: Vec<&str> = command.split_whitespace().collect();
            // A placeholder, or a value that is put in when it is written.
            let is_name = |word: &str| word.chars().all(|c| c == '-' || c.is_ascii_lowercase());
            if words.first().is_none_or(|word| !is_name(word) || word.starts_with('-')) {
                continue;
            }
            count += 1;
            let fault = helps.fault(&words);
            faults.extend(fault.map(|fault| format!("{}: {command}: {fault}", path.display())));
        }
    }
    assert!(count > 200, "only {count} were found");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Runs each command that was advised.
#[track_caller]
fn run_what_is_advised(run: &Run, folder: &TempDir) -> Vec<String> {
    let advised = mentioned(&format!("\n{}", run.all()));
    assert!(!advised.is_empty(), "nothing is advised: {}", run.all());
    for command in &advised {
        let mut program = std::process::Command::new(crate::support::PROGRAM);
        let words: Vec<&str> = command.split_whitespace().collect();
        let mut limited = words.clone();
        if words[0] == "run" {
            limited.extend(["--seconds", "1"]);
        }
        let again = crate::support::run(program.args(limited).current_dir(folder.path()));
        assert!(again.status != 2, "`linesman {command}` of {}\n{}", run.all(), again.all());
    }
    advised
}

#[test]
fn what_a_command_advises_can_be_run_as_it_is_printed() {
    let folder = TempDir::new().unwrap();
    let plant = format!(
        "{PLANT}[[fault]]\nkind = \"cable-degraded\"\nat = \"K1.B>T2.A\"\nfrom_ms = 1000\nhits_per_s = 200.0\n"
    );
    let path = folder.path().join("plant.toml");
    fs::write(&path, plant).unwrap();
    let on = format!("sim:{}", path.display());
    for (words, expected) in [
        (vec!["sdo", &on, "1", "read", "0x1018"], format!("scan {on} -v")),
        (vec!["state", &on, "T9"], format!("scan {on}")),
        (vec!["state", &on, "--to", "op"], format!("run --on {on}")),
        (vec!["diagnose", &on], "explain H".to_owned()),
        (vec!["log", "nowhere.sqlite"], String::new()),
        (vec!["scan", "nowhere0"], "interfaces".to_owned()),
    ] {
        let run = linesman(words.iter().copied());
        if expected.is_empty() {
            assert!(run.stderr.contains("`linesman run --log FILE`"), "{}", run.stderr);
            continue;
        }
        let advised = run_what_is_advised(&run, &folder);
        let is_there = advised.iter().any(|command| command.starts_with(&expected));
        assert!(is_there, "{expected}: {advised:?}");
    }
    // Beside a run its socket is named, not a card.
    let running = Running::start(PLANT);
    let socket = running.socket();
    let run = linesman(["state", &socket, "nobody"]);
    let advised = run_what_is_advised(&run, &folder);
    assert_eq!(advised, [format!("online {socket}")], "{}", run.all());
}
