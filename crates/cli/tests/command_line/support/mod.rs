//! Runs the program as its users do.

pub(crate) mod bench;
pub(crate) mod capture;
pub(crate) mod drawing;
pub(crate) mod running;
pub(crate) mod schema;
pub(crate) mod segment_file_page;

use std::ffi::OsStr;
use std::process::{Command, Output};

/// The program.
pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_linesman");

/// What a run gave.
pub(crate) struct Run {
    /// Exit status.
    pub(crate) status: i32,
    /// Standard output.
    pub(crate) stdout: String,
    /// Standard error.
    pub(crate) stderr: String,
}

impl Run {
    /// Standard output as one JSON object.
    #[track_caller]
    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|error| panic!("{error}:\n{}\n{}", self.stdout, self.stderr))
    }

    /// Everything it wrote.
    pub(crate) fn all(&self) -> String {
        format!("{}{}", self.stdout, self.stderr)
    }
}

/// Runs the program with these arguments.
pub(crate) fn linesman<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Run {
    run(Command::new(PROGRAM).args(arguments))
}

/// Runs a command to its end.
pub(crate) fn run(command: &mut Command) -> Run {
    let Output { status, stdout, stderr } =
        command.env_remove("COLUMNS").env("TZ", "UTC").output().expect("the program starts");
    let text = |bytes| String::from_utf8(bytes).expect("text is UTF-8");
    let run = Run {
        status: status.code().unwrap_or_else(|| panic!("killed: {status}")),
        stdout: text(stdout),
        stderr: text(stderr),
    };
    assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
    run
}

/// The schema that the program gives for one of its outputs.
pub(crate) fn schema(name: &str) -> serde_json::Value {
    let run = linesman(["schema", name]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    run.json()
}

/// Fails unless `value` is what the program's own schema says.
#[track_caller]
pub(crate) fn assert_valid(value: &serde_json::Value, name: &str) {
    let faults = schema::faults(value, &schema(name));
    assert!(faults.is_empty(), "not as `linesman schema {name}` says:\n{}", faults.join("\n"));
}
