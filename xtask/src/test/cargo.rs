//! The steps that are cargo's own, and the house rules.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Result;

use super::count::Counts;
use super::{Context, Outcome};
use crate::{features, tidy};

/// No dead links. A link to a private item is fine: those who work in the house read private items.
const RUSTDOC_FLAGS: &str = "-D warnings -A rustdoc::private_intra_doc_links";

/// Arguments of clippy by which a warning fails.
const DENY_WARNINGS: [&str; 2] = ["-D", "warnings"];

/// The cargo that runs us.
pub(super) fn cargo() -> PathBuf {
    std::env::var_os("CARGO").map_or_else(|| PathBuf::from("cargo"), PathBuf::from)
}

/// Where cargo puts what it builds.
pub(super) fn target_folder(root: &Path) -> PathBuf {
    match std::env::var_os("CARGO_TARGET_DIR") {
        Some(folder) => root.join(folder),
        None => root.join("target"),
    }
}

pub(super) fn format(context: &Context<'_>) -> Result<Outcome> {
    let ran = context.command("format", cargo(), &["fmt", "--all", "--check"]).run()?;
    if !ran.success() {
        return Ok(Outcome::Failed { count: 0, why: ran.explain() });
    }
    Ok(Outcome::Passed { count: 0, note: "rustfmt agrees".into() })
}

pub(super) fn tidy(context: &Context<'_>) -> Result<Outcome> {
    if tidy::run(context.root)? {
        Ok(Outcome::Passed { count: 0, note: "house rules hold".into() })
    } else {
        Ok(Outcome::Failed { count: 0, why: "house rules are broken, see above".into() })
    }
}

/// Clippy with the whole workspace, and with the library as a program depends on it, without features: in the
/// workspace the command line turns them on.
pub(super) fn lints(context: &Context<'_>) -> Result<Outcome> {
    let workspace = lints_of(context, "--workspace")?;
    if matches!(workspace, Outcome::Failed { .. }) {
        return Ok(workspace);
    }
    let arguments = ["clippy", "--package=linesman", "--lib", "--examples", "--color=never", "--"];
    let arguments = [&arguments[..], &DENY_WARNINGS].concat();
    passed_or_explained(context, "lints-no-features", &arguments, "clippy has no warning")
}

/// Clippy with the packages that an option of cargo names, tests and all features included.
pub(super) fn lints_of(context: &Context<'_>, packages: &str) -> Result<Outcome> {
    let arguments = [
        "clippy",
        packages,
        "--all-targets",
        "--all-features",
        "--keep-going",
        "--color=never",
        "--",
    ];
    let arguments = [&arguments[..], &DENY_WARNINGS].concat();
    passed_or_explained(context, &log("lints", packages), &arguments, "clippy has no warning")
}

/// A run of cargo that passes with this note.
fn passed_or_explained(
    context: &Context<'_>,
    log: &str,
    arguments: &[&str],
    note: &str,
) -> Result<Outcome> {
    let ran = context.command(log, cargo(), arguments).run()?;
    if !ran.success() {
        return Ok(Outcome::Failed { count: 0, why: ran.explain() });
    }
    Ok(Outcome::Passed { count: 0, note: note.into() })
}

/// Crates compile, without their tests. All are asked for, so that cargo takes what it has of the others.
pub(super) fn compile(context: &Context<'_>, crates: &BTreeSet<String>) -> Result<Outcome> {
    let arguments = ["check", "--workspace", "--keep-going", "--color=never"];
    let ran = context.command("dependents", cargo(), &arguments).run()?;
    if !ran.success() {
        return Ok(Outcome::Failed { count: 0, why: ran.explain() });
    }
    Ok(Outcome::Passed { count: crates.len() as u64, note: "crates compile".into() })
}

/// The name of a step's log: that of the step, and of the package if it is one.
fn log(step: &str, packages: &str) -> String {
    match packages.strip_prefix("--package=") {
        Some(package) => format!("{step}-{package}"),
        None => step.to_owned(),
    }
}

/// All tests of the workspace, those in documentation too.
pub(super) fn tests(context: &Context<'_>) -> Result<Outcome> {
    tests_of(context, "--workspace")
}

/// The tests of the packages that an option of cargo names.
pub(super) fn tests_of(context: &Context<'_>, packages: &str) -> Result<Outcome> {
    // Tests that skip something say so; without this flag nobody would see it.
    // A crate that is tested alone has only the features that are asked for: without them its tests of
    // packed captures and of the event log would be left out unnoticed.
    let arguments = ["test", packages, "--all-features", "--no-fail-fast", "--color=never"];
    let arguments = [&arguments[..], &["--", "--show-output"]].concat();
    let ran = context.command(&log("tests", packages), cargo(), &arguments).run()?;
    let counts = Counts::parse(&ran.output);
    for line in &counts.skipped {
        context.note_skip(line);
        println!("    {line}");
    }
    if !ran.success() {
        let mut lines = ran.output.lines();
        while let Some(line) = lines.next() {
            if line.contains("panicked at ") {
                println!("    {line}");
                // What it panicked with.
                println!("    {}", lines.next().unwrap_or_default());
            } else if is_failure(line) {
                println!("    {line}");
            }
        }
        let why = format!("{} failed; {}", counts.failed, ran.status_line());
        return Ok(Outcome::Failed { count: counts.passed, why });
    }
    let mut note = format!("tests in {} programs", counts.programs);
    if counts.ignored > 0 {
        note += &format!(", {} ignored", counts.ignored);
    }
    if !counts.skipped.is_empty() {
        note += &format!(", {} say that they skipped something", counts.skipped.len());
    }
    Ok(Outcome::Passed { count: counts.passed, note })
}

fn is_failure(line: &str) -> bool {
    let program = ["error: test failed", "error: could not compile", "error: doctest failed"];
    let test = line.starts_with("test ") && line.ends_with("FAILED");
    test || program.iter().any(|start| line.starts_with(start))
}

/// The documentation builds without a warning: no dead link.
pub(super) fn docs(context: &Context<'_>) -> Result<Outcome> {
    let arguments = ["doc", "--workspace", "--no-deps", "--document-private-items", "--keep-going"];
    let ran =
        context.command("docs", cargo(), &arguments).env("RUSTDOCFLAGS", RUSTDOC_FLAGS).run()?;
    if !ran.success() {
        return Ok(Outcome::Failed { count: 0, why: ran.explain() });
    }
    Ok(Outcome::Passed { count: 0, note: "rustdoc has no warning".into() })
}

pub(super) fn features(context: &Context<'_>) -> Result<Outcome> {
    if features::run(context.root, true)? {
        Ok(Outcome::Passed { count: 0, note: "FEATURES.md is up to date".into() })
    } else {
        Ok(Outcome::Failed { count: 0, why: "FEATURES.md is not up to date".into() })
    }
}

/// Whether a program is there and answers.
pub(super) fn answers(program: &str, argument: &str) -> bool {
    let output = Command::new(program).arg(argument).output();
    output.is_ok_and(|output| output.status.success())
}
