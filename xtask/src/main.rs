//! Developer commands, run as `cargo xtask COMMAND`.
//!
//! `test` is everything that is checked, in one command; `check` what a small change needs; `tidy` holds the house rules; `features`
//! writes `FEATURES.md` from the annotations on tests; `fuzz` and `interop` run those two alone;
//! `bench-peers` measures Linesman beside other MainDevices.

mod annotation;
mod features;
mod files;
mod kind;
mod requirements;
mod test;
mod tidy;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "cargo xtask", about = "Developer commands of Linesman")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Check everything, with a summary at the end
    Test(test::Options),
    /// Check what has changed: format, house rules, lints, tests
    ///
    /// Changed is what differs from the last commit that HEAD shares with `main`: commits that are not on `main`, and what is
    /// not committed yet. Crates with a changed file are linted, with their tests, and tested. Crates that depend on them are
    /// compiled, without their tests. Format, house rules, FEATURES.md and unused dependencies are checked as a whole; they take
    /// seconds. Where the manifest of the workspace has changed, all crates are linted, and those with a changed file tested.
    ///
    /// Not checked are tests of crates that depend on the changed ones, documentation, stories, demo, swarm, habits, fuzzing and
    /// interop: `cargo xtask test`, of which `--only STEP` runs one step.
    Check(test::CheckOptions),
    /// Check the house rules
    Tidy,
    /// Write FEATURES.md from the annotations on tests
    Features {
        /// Fail if it is not up to date, write nothing
        #[arg(long)]
        check: bool,
    },
    /// Fuzz every target
    Fuzz {
        /// How long, per target
        #[arg(long, default_value_t = 300)]
        seconds: u64,
    },
    /// Measure Linesman beside other MainDevices: start to OP, CPU per cycle (root, Linux)
    BenchPeers,
    /// Run the foreign MainDevices against the virtual segment (root, Linux)
    Interop {
        /// Only the checks whose names contain one of these
        names: Vec<String>,
    },
}

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Runs one command; `false` when something that it checks is not as it should be.
fn run(command: Command) -> Result<bool> {
    let root = root()?;
    match command {
        Command::Test(options) => test::run(&root, &options),
        Command::Check(check) => test::check(&root, &check),
        Command::Tidy => tidy::run(&root),
        Command::Features { check } => features::run(&root, check),
        Command::Fuzz { seconds } => test::run(&root, &test::Options::only("fuzz", Some(seconds))),
        Command::BenchPeers => test::run(&root, &test::Options::only("bench-peers", None)),
        Command::Interop { names } => test::run(&root, &test::Options::interop(names)),
    }
}

/// The root of the project: where `ARCHITECTURE.md` is, above this crate.
fn root() -> Result<PathBuf> {
    let here = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let root = here.parent().context("this crate has no folder above it")?;
    if !root.join("ARCHITECTURE.md").exists() {
        bail!(
            "{} is not the root of the project; was it moved since xtask was built? Build it again",
            root.display()
        );
    }
    Ok(root.to_path_buf())
}
