//! The step that finds dependencies that a crate declares and does not use, by cargo-machete.
//!
//! What it takes for unused wrongly is named, with the reason, under `[package.metadata.cargo-machete]` in the manifest of
//! the crate.

use std::path::PathBuf;
use std::process::Command;

use anyhow::Result;

use super::cargo::cargo;
use super::{Context, Outcome};

/// The version that is installed and asked for: another one may find other things.
const VERSION: &str = "0.9.2";

/// Folders with crates.
const FOLDERS: &[&str] = &["crates", "xtask", "fuzz", "interop"];

pub(super) fn run(context: &Context<'_>) -> Result<Outcome> {
    let program = match program(context)? {
        Ok(program) => program,
        Err(why) => return Ok(Outcome::Skipped(why)),
    };
    let ran = context.command("dependencies", program, FOLDERS).limit(120).run()?;
    if !ran.success() {
        let unused = unused(&ran.output);
        if unused.is_empty() {
            return Ok(Outcome::Failed { count: 0, why: ran.explain() });
        }
        for line in &unused {
            println!("    {line}");
        }
        let why = format!("{} dependencies are not used: {}", unused.len(), unused.join(", "));
        return Ok(Outcome::Failed { count: 0, why });
    }
    Ok(Outcome::Passed { count: 0, note: "cargo-machete finds none that is not used".into() })
}

/// Unused dependencies in what the program prints, each with the manifest that declares it.
fn unused(output: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut manifest = None;
    for line in output.lines() {
        if let Some((_, path)) = line.split_once(" -- ") {
            manifest = Some(path.trim_end_matches(':'));
        } else if let (Some(name), Some(path)) = (line.strip_prefix('\t'), manifest) {
            found.push(format!("{name} in {path}"));
        } else {
            manifest = None;
        }
    }
    found
}

/// Where the program is, installed if it is missing and we may; else why there is none.
fn program(context: &Context<'_>) -> Result<Result<PathBuf, String>> {
    let folder = context.target.join("tools");
    let own = folder.join("bin/cargo-machete");
    for program in [PathBuf::from("cargo-machete"), own.clone()] {
        if is_wanted(&program) {
            return Ok(Ok(program));
        }
    }
    let missing = format!("cargo-machete {VERSION} is not installed");
    if context.options.no_install {
        return Ok(Err(missing));
    }
    println!("cargo install cargo-machete {VERSION}");
    let version = format!("--version={VERSION}");
    let root = format!("--root={}", folder.display());
    // It runs for less than a second, so that building it quickly is worth more than what it gains by being optimised.
    let arguments = ["install", "cargo-machete", "--locked", "--debug", &version, &root];
    let ran = context
        .command("install-machete", cargo(), &arguments)
        .env("CARGO_TARGET_DIR", folder.join("build"))
        .env("CARGO_PROFILE_DEV_DEBUG", "0")
        .limit(900)
        .run()?;
    if !ran.success() || !is_wanted(&own) {
        return Ok(Err(format!("{missing}, and cannot be: {}", ran.status_line())));
    }
    // What it was built from is not needed again.
    let _ = std::fs::remove_dir_all(folder.join("build"));
    Ok(Ok(own))
}

fn is_wanted(program: &PathBuf) -> bool {
    let output = Command::new(program).arg("--version").output();
    output.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).contains(VERSION))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unused_dependencies_are_read_with_their_manifest() {
        let output = "Analyzing dependencies of crates in crates,xtask...\n\
                      cargo-machete found the following unused dependencies in crates:\n\
                      linesman-runtime -- crates/runtime/Cargo.toml:\n\tlinesman-lab\n\tlog\n\n\
                      If you believe cargo-machete is wrong:\n\tnot this\n";
        assert_eq!(
            unused(output),
            ["linesman-lab in crates/runtime/Cargo.toml", "log in crates/runtime/Cargo.toml"]
        );
        assert_eq!(unused("Done!\n"), Vec::<String>::new());
    }
}
