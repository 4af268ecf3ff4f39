//! Without the right to open raw sockets: the exact line that gives it.

use std::process::Command;

use crate::support::{PROGRAM, Run, assert_valid, linesman, run};

/// Runs the program as `nobody`, without capabilities; `None`, said aloud, where that cannot be.
fn unprivileged(arguments: &[&str]) -> Option<Run> {
    let mut command = Command::new("setpriv");
    command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "--bounding-set=-all"]);
    command.args(["--inh-caps=-all", PROGRAM]);
    let works = Command::new("setpriv")
        .args(["--reuid=65534", "--regid=65534", "--clear-groups", PROGRAM, "--version"])
        .output()
        .is_ok_and(|output| output.status.success());
    if !works {
        eprintln!("SKIPPED: this user cannot become nobody, or nobody cannot run the program");
        return None;
    }
    Some(run(command.args(arguments)))
}

/// An interface that is up and carries Ethernet frames.
fn card() -> Option<String> {
    let report = linesman(["interfaces", "--json"]).json();
    let all = report["interfaces"].as_array()?;
    let fits = |one: &&serde_json::Value| one["up"] == true && one["kind"] != "loopback";
    let name = all.iter().find(fits).and_then(|one| one["name"].as_str());
    if name.is_none() {
        eprintln!("SKIPPED: there is no network card");
    }
    name.map(str::to_owned)
}

#[test]
fn the_setcap_line_is_told() {
    let Some(card) = card() else { return };
    let listen = format!("listen:{card}");
    for arguments in [&["diagnose", &listen][..], &["diagnose", &listen, "--json"]] {
        let Some(run) = unprivileged(arguments) else { return };
        assert_eq!(run.status, 2, "{}", run.all());
        let line = format!("sudo setcap cap_net_raw+ep {PROGRAM}");
        assert!(run.stderr.contains(&line), "`{line}` is missing: {}", run.stderr);
        if arguments.contains(&"--json") {
            let error = run.json();
            assert_valid(&error, "error");
            assert!(error["next_step"].as_str().unwrap().contains(&line), "{error}");
        }
    }
}

#[test]
fn interfaces_are_listed_all_the_same() {
    let Some(card) = card() else { return };
    let Some(run) = unprivileged(&["interfaces"]) else { return };
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains(&card), "{}", run.stdout);
    assert!(run.stdout.contains("sudo setcap cap_net_raw+ep"), "{}", run.stdout);
}
