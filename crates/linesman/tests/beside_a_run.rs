//! Services for single SubDevices beside a running MainDevice, through its control socket.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use support::{PROGRAM, assert_valid, linesman};
use tempfile::TempDir;

const PLANT: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"T2\"\ntype = \"EL2008\"\non = \"K1.B\"\n\
[[device]]\nname = \"T3\"\ntype = \"EL3104\"\non = \"T2.B\"\n";

/// A run in a process of its own, and its socket; ended with the test.
struct Running {
    child: Child,
    folder: TempDir,
}

impl Running {
    fn start() -> Self {
        let folder = TempDir::new().unwrap();
        let plant = folder.path().join("plant.toml");
        std::fs::write(&plant, PLANT).unwrap();
        let child = Command::new(PROGRAM)
            .args(["run", "--on", &format!("sim:{}", plant.display()), "--control"])
            .arg(folder.path().join("socket"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let running = Self { child, folder };
        // The socket is there once the line is being driven, on a busy computer a little later.
        for _ in 0..600 {
            let states = linesman(["state", &running.socket(), "--json"]);
            if states.status == 0
                && states.json()["devices"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .all(|one| one["al_state"] == "OP")
            {
                return running;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("the line does not come up");
    }

    fn socket(&self) -> String {
        self.folder.path().join("socket").display().to_string()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

// proves: DIA-08 partial: requests beside a run
#[test]
fn subdevices_are_asked_while_the_line_runs() {
    let running = Running::start();
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

#[test]
fn a_socket_without_a_run_is_told() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("socket");
    drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
    let run = linesman(["state", path.to_str().unwrap()]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("is it still running?"), "{}", run.stderr);
    let running = Running::start();
    let nobody = linesman(["state", &running.socket(), "9"]);
    assert_eq!(nobody.status, 2, "{}", nobody.all());
}
