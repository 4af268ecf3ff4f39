//! Fuzzing: with libFuzzer where it is installed, else by seeded mutation on the stable compiler.

use std::process::Command;

use anyhow::{Context as _, Result};

use super::cargo::cargo;
use super::{Context, Outcome};

/// A target per step run, unless said otherwise: enough to try each corpus and its neighbourhood.
const SMOKE_SECONDS: u64 = 7;

pub(super) fn run(context: &Context<'_>) -> Result<Outcome> {
    let seconds = context.options.fuzz_seconds.unwrap_or(SMOKE_SECONDS);
    let targets = targets(context)?;
    let coverage = has_lib_fuzzer();
    let way = if coverage {
        "libFuzzer"
    } else {
        "seeded mutation without coverage (cargo-fuzz and a nightly compiler are not both here)"
    };
    println!("{} targets, {seconds} s each, {way}", targets.len());
    let mut failed = Vec::new();
    let mut why = String::new();
    if !coverage {
        // As the tests build it, with all its checks: after that step there is nothing left to build.
        let arguments = ["build", "--profile=test", "--workspace", "--example=replay"];
        let ran = context.command("fuzz-build", cargo(), &arguments).run()?;
        if !ran.success() {
            return Ok(Outcome::Failed { count: 0, why: ran.explain() });
        }
    }
    for target in &targets {
        let log = format!("fuzz-{target}");
        let ran = if coverage {
            let time = format!("-max_total_time={seconds}");
            let found = context.target.join(format!("fuzz-found/{target}"));
            std::fs::create_dir_all(&found)?;
            let found = found.to_string_lossy().into_owned();
            let corpus = format!("fuzz/corpus/{target}");
            // New inputs go to the first folder, so that the committed corpus stays as it is.
            let target = ["--features=libfuzzer", target];
            let options = ["--", &time, "-max_len=4096"];
            let arguments =
                [&["+nightly", "fuzz", "run"], &target[..], &[&found, &corpus], &options].concat();
            // The compiler that runs us would override `+nightly`.
            context
                .command(&log, "cargo", &arguments)
                .env("RUSTUP_TOOLCHAIN", "nightly")
                .env("CARGO_TARGET_DIR", context.target.join("fuzz"))
                .limit(seconds + 900)
                .run()?
        } else {
            let program = context.target.join("debug/examples/replay");
            let arguments = [target.as_str(), "--seconds", &seconds.to_string()];
            context.command(&log, program, &arguments).limit(seconds + 120).run()?
        };
        if let Some(line) = ran.output.lines().rev().find(|line| !line.trim().is_empty()) {
            println!("    {target}: {}", line.trim());
        }
        if !ran.success() {
            failed.push(target.as_str());
            why = ran.explain();
        }
    }
    let count = (targets.len() - failed.len()) as u64;
    if failed.is_empty() {
        return Ok(Outcome::Passed { count, note: format!("targets, {seconds} s each, {way}") });
    }
    Ok(Outcome::Failed { count, why: format!("{}; {why}", failed.join(", ")) })
}

/// The targets are the folders of the corpora.
fn targets(context: &Context<'_>) -> Result<Vec<String>> {
    let mut targets = Vec::new();
    for entry in std::fs::read_dir(context.root.join("fuzz/corpus")).context("fuzz/corpus")? {
        targets.push(entry?.file_name().to_string_lossy().into_owned());
    }
    targets.sort();
    Ok(targets)
}

fn has_lib_fuzzer() -> bool {
    let works = |arguments: &[&str]| {
        let output =
            Command::new("cargo").args(arguments).env("RUSTUP_TOOLCHAIN", "nightly").output();
        output.is_ok_and(|output| output.status.success())
    };
    works(&["fuzz", "--version"]) && works(&["--version"])
}
