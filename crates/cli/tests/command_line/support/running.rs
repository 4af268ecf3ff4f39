//! A run in a process of its own, and its control socket.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::io::{BufRead as _, BufReader, Write as _};
use std::os::unix::net::UnixStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

use super::{PROGRAM, linesman};

/// A coupler, outputs, and a terminal with a mailbox.
pub(crate) const PLANT: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"T2\"\ntype = \"EL2008\"\non = \"K1.B\"\n\
[[device]]\nname = \"T3\"\ntype = \"EL3104\"\non = \"T2.B\"\n";

/// The project of a plant, as a scan saves it, with these lines for its last device.
#[track_caller]
pub(crate) fn project_of(plant: &str, lines: &str) -> String {
    let folder = TempDir::new().unwrap();
    let (segment, project) = (folder.path().join("line.toml"), folder.path().join("project.toml"));
    std::fs::write(&segment, plant).unwrap();
    let on = format!("sim:{}", segment.display());
    let saved = linesman(["scan", &on, "--save", project.to_str().unwrap()]);
    assert_eq!(saved.status, 0, "{}", saved.all());
    let text = std::fs::read_to_string(&project).unwrap();
    let at = text.rfind("[device.description]").unwrap();
    format!("{}{lines}\n{}", &text[..at], &text[at..])
}

/// Ended with the test.
pub(crate) struct Running {
    child: Child,
    folder: TempDir,
}

impl Running {
    /// Runs a plant, and waits until all SubDevices are in OP.
    #[track_caller]
    pub(crate) fn start(plant: &str) -> Self {
        Self::with(plant, &[])
    }

    /// The same of a plant of this project, with these files beside it.
    #[track_caller]
    pub(crate) fn with(plant: &str, files: &[(&str, &str)]) -> Self {
        Self::run(plant, files, &[])
    }

    /// The same of a plant as it is, with these options of the command.
    #[track_caller]
    pub(crate) fn with_options(plant: &str, options: &[&str]) -> Self {
        Self::run(plant, &[], options)
    }

    /// The same of a plant of this project, with these files beside it and these options.
    #[track_caller]
    pub(crate) fn with_files(plant: &str, files: &[(&str, &str)], options: &[&str]) -> Self {
        Self::run(plant, files, options)
    }

    #[track_caller]
    fn run(plant: &str, files: &[(&str, &str)], options: &[&str]) -> Self {
        let folder = TempDir::new().unwrap();
        let file = folder.path().join("plant.toml");
        std::fs::write(&file, plant).unwrap();
        let mut project = None;
        for (name, text) in files {
            let file = folder.path().join(name);
            std::fs::write(&file, text).unwrap();
            // The project is a TOML file; what it names comes beside it.
            project = project.or(name.ends_with(".toml").then_some(file));
        }
        let child = Command::new(PROGRAM)
            .arg("run")
            .args(project)
            .args(["--on", &format!("sim:{}", file.display()), "--control"])
            .arg(folder.path().join("socket"))
            .args(options)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let planned = plant.matches("[[device]]").count();
        let running = Self { child, folder };
        running.until("comes up", |report| {
            let devices = report["devices"].as_array().unwrap();
            devices.len() == planned && devices.iter().all(|one| one["al_state"] == "OP")
        });
        running
    }

    /// Its socket.
    pub(crate) fn socket(&self) -> String {
        self.folder.path().join("socket").display().to_string()
    }

    /// How it goes, as its socket tells.
    #[track_caller]
    pub(crate) fn status(&self) -> Value {
        self.ask(r#"{"do":"status"}"#)["run"].clone()
    }

    /// Answer of its socket to a line of JSON.
    #[track_caller]
    pub(crate) fn ask(&self, request: &str) -> Value {
        let mut stream = UnixStream::connect(self.socket()).unwrap();
        stream.write_all(format!("{request}\n").as_bytes()).unwrap();
        let mut line = String::new();
        BufReader::new(stream).read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap()
    }

    /// What `linesman online` reports of it, once that is as expected; on a busy computer that takes a while.
    #[track_caller]
    pub(crate) fn until(&self, what: &str, done: impl Fn(&Value) -> bool) -> Value {
        let mut last = String::new();
        for _ in 0..600 {
            let run = linesman(["online", &self.socket(), "--json"]);
            if run.status < 2 && done(&run.json()) {
                return run.json();
            }
            last = run.all();
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("it never {what}: {last}");
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
