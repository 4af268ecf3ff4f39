//! Tells the program which commit it was built from. Without git, or outside of a clone, it knows
//! only its version.

use std::path::Path;
use std::process::Command;

fn main() {
    let commit = git(&["rev-parse", "--short=10", "HEAD"]).unwrap_or_default();
    println!("cargo::rustc-env=LINESMAN_COMMIT={commit}");
    println!("cargo::rerun-if-changed=build.rs");
    // `logs/HEAD` grows with each commit and each checkout, of a worktree too.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"])
        && Path::new(&log).exists()
    {
        println!("cargo::rerun-if-changed={log}");
    }
}

/// What git says, on one line; `None` when it is not there or does not know.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !text.is_empty()).then_some(text)
}
