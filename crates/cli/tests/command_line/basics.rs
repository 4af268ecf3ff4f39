//! Basics: what the program says about itself and its surroundings.

use std::process::{Command, Stdio};

use crate::support::{assert_valid, linesman, run};
use serde_json::json;

#[test]
fn the_version_names_the_commit() {
    let run = linesman(["--version"]);
    assert_eq!(run.status, 0);
    let version = run.stdout.trim();
    assert!(version.starts_with(concat!("linesman ", env!("CARGO_PKG_VERSION"))), "{version}");
    let git = Command::new("git").args(["rev-parse", "--short=10", "HEAD"]).output();
    if git.is_ok_and(|git| git.status.success()) {
        let commit = version.split_once('(').and_then(|(_, rest)| rest.strip_suffix(')'));
        let commit = commit.expect("a commit in brackets");
        assert!(commit.len() >= 7 && commit.bytes().all(|b| b.is_ascii_hexdigit()), "{version}");
    }
}

#[test]
fn interfaces_are_listed_as_text_and_as_json() {
    let text = linesman(["interfaces", "--all"]);
    assert_eq!(text.status, 0, "{}", text.stderr);
    assert!(text.stdout.contains("lo") && text.stdout.contains("loopback"), "{}", text.stdout);
    assert!(!text.stdout.contains('\x1b'), "no colour when it is no terminal");
    let run = linesman(["interfaces", "--json"]);
    let report = run.json();
    assert_valid(&report, "interfaces");
    let all = report["interfaces"].as_array().unwrap();
    let loopback = all.iter().find(|interface| interface["name"] == "lo").expect("lo");
    assert_eq!(loopback["suitability"], "unsuitable");
    assert_eq!(loopback["notes"][0]["weight"], "obstacle");
    assert_eq!(loopback["ethercat_frames"], json!(null));
}

#[test]
fn codes_and_names_are_explained() {
    let rows = [
        (vec!["0x001D"], "Compare the length of SyncManager 2"),
        (vec!["0x06010002"], "0x06010002"),
        (vec!["0x0110"], "DL status"),
        (vec!["AL", "status"], "0x0130"),
        (vec!["op"], "outputs yes"),
        (vec!["device-off"], "without power"),
    ];
    for (words, expected) in rows {
        let run = linesman(["explain"].iter().chain(&words));
        assert_eq!(run.status, 0, "{words:?}: {}", run.stderr);
        assert!(run.stdout.contains(expected), "{words:?}: {}", run.stdout);
    }
    let run = linesman(["explain", "no-such-thing"]);
    assert_eq!((run.status, run.stdout.as_str()), (2, ""));
    assert!(run.stderr.contains("do: name an AL status code (0x001D)"), "{}", run.stderr);
}

#[test]
fn each_shell_gets_a_completion() {
    for shell in ["bash", "zsh", "fish"] {
        let run = linesman(["completion", shell]);
        assert_eq!(run.status, 0);
        assert!(run.stdout.contains("interfaces"), "{shell}: {}", run.stdout);
    }
}

#[test]
fn a_wrong_command_line_ends_with_2_and_says_so_as_json_too() {
    let run = linesman(["frobnicate"]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("frobnicate"), "{}", run.stderr);
    let run = linesman(["interfaces", "--jsno", "--json"]);
    assert_eq!(run.status, 2);
    let error = run.json();
    assert_valid(&error, "error");
    assert!(error["reason"].as_str().unwrap().contains("--jsno"), "{error}");
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let mut command = Command::new("sh");
    let program = crate::support::PROGRAM;
    // More than a pipe holds, so that writing must fail.
    let script =
        format!("for i in $(seq 40); do {program} completion zsh || echo BAD >&2; done | head -1");
    let run = run(command.args(["-c", &script]).stdin(Stdio::null()));
    assert_eq!(run.status, 0);
    assert_eq!(run.stderr, "");
}
