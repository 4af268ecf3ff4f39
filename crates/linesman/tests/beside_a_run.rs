//! Services for single SubDevices beside a running MainDevice, through its control socket.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use support::running::{PLANT, Running};
use support::{assert_valid, linesman};
use tempfile::TempDir;

// proves: DIA-08 partial: requests beside a run
#[test]
fn subdevices_are_asked_while_the_line_runs() {
    let running = Running::start(PLANT);
    let socket = running.socket();
    let states = linesman(["state", &socket, "--json"]).json();
    assert_valid(&states, "states");
    assert_eq!(states["devices"].as_array().unwrap().len(), 3);
    let vendor = linesman(["sdo", &socket, "3", "read", "0x1018:1"]);
    assert_eq!(vendor.status, 0, "{}", vendor.all());
    assert!(vendor.stdout.contains("0x00000002"), "{}", vendor.stdout);
    assert!(
        !vendor.stderr.contains("taken to PREOP"),
        "its state is left alone: {}",
        vendor.stderr
    );
    let status = linesman(["reg", &socket, "0x1002", "read", "0x0130"]);
    assert!(status.stdout.contains("OP"), "{}", status.all());
    let refused =
        linesman(["sdo", &socket, "3", "write", "0x1018:1", "5", "--type", "udint", "--json"]);
    assert_eq!(refused.status, 1, "{}", refused.all());
    assert_valid(&refused.json(), "refusal");
    let down = linesman(["state", &socket, "3", "--to", "preop"]);
    assert_eq!(down.status, 0, "{}", down.all());
    let states = linesman(["state", &socket, "3", "--json"]).json();
    assert_eq!(states["devices"][0]["al_state"], "PREOP", "it stays where it was asked to go");
    let up = linesman(["state", &socket, "3", "--to", "op"]);
    assert_eq!(up.status, 0, "{}", up.all());
}

// S0 L1568, L2431-2440: "clear error".
// proves: DIA-08
#[test]
fn an_error_is_cleared_while_the_line_runs() {
    let running = Running::start(&format!(
        "{PLANT}\n[[fault]]\nkind = \"config-mismatch\"\ndevice = \"T3\"\nfrom_ms = 2000\n"
    ));
    let socket = running.socket();
    // From then on it refuses SAFEOP, which nobody notices until it is asked for that.
    let refused = (0..100).any(|_| {
        let down = linesman(["state", &socket, "3", "--to", "preop"]);
        assert_eq!(down.status, 0, "{}", down.all());
        linesman(["state", &socket, "3", "--to", "safeop", "--json"]).status == 1
    });
    assert!(refused, "it never refuses");
    let state = || linesman(["state", &socket, "3", "--json"]).json()["devices"][0].clone();
    let erroneous = (0..100).any(|_| state()["al_error"] == true);
    assert!(erroneous, "{}", state());
    let cleared = linesman(["state", &socket, "3", "--acknowledge", "--json"]);
    assert_eq!(cleared.status, 0, "{}", cleared.all());
    let device = &cleared.json()["devices"][0];
    assert_eq!(
        (&device["al_state"], &device["al_error"]),
        (&"PREOP".into(), &false.into()),
        "{device}"
    );
    // The others have run on meanwhile.
    let states = linesman(["state", &socket, "--json"]).json();
    assert_eq!(states["devices"][1]["al_state"], "OP");
}

#[test]
fn a_socket_without_a_run_is_told() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("socket");
    drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
    let run = linesman(["state", path.to_str().unwrap()]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("is it still running?"), "{}", run.stderr);
    let running = Running::start(PLANT);
    let nobody = linesman(["state", &running.socket(), "9"]);
    assert_eq!(nobody.status, 2, "{}", nobody.all());
}
