//! `cargo xtask test`: everything that is checked, step by step, with counts and times.

mod cargo;
mod check;
mod count;
mod dependencies;
mod exec;
mod fuzz;
mod habits;
mod interop;
mod peers;
mod product;
mod skips;
mod tools;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use clap::Args;

pub(crate) use check::{CheckOptions, run as check};
use exec::Run;
use skips::AllowedSkips;

/// What to check.
#[derive(Args, Default)]
pub(crate) struct Options {
    /// Only what needs no release build and no root: format, lints, tests, house rules
    #[arg(long)]
    quick: bool,
    /// Only these steps, by name
    #[arg(long, value_name = "STEP")]
    only: Vec<String>,
    /// Install nothing; skip what is not there
    #[arg(long)]
    no_install: bool,
    /// How long to fuzz each target, in seconds
    #[arg(long, value_name = "N")]
    fuzz_seconds: Option<u64>,
    /// How many seeds the swarm runs
    #[arg(long, value_name = "N", default_value_t = 200)]
    swarm_seeds: u64,
    /// How many seeds of this commit are scored
    #[arg(long, value_name = "N", default_value_t = 200)]
    score_seeds: u64,
    /// How many plants the demo draws
    #[arg(long, value_name = "N", default_value_t = 10)]
    demo_seeds: u64,
    /// Only the interop checks whose names contain one of these
    #[arg(long, value_name = "NAME")]
    checks: Vec<String>,
}

impl Options {
    /// One step alone.
    pub(crate) fn only(step: &str, fuzz_seconds: Option<u64>) -> Self {
        Self { only: vec![step.to_owned()], fuzz_seconds, ..Self::default() }
    }

    /// The step with foreign MainDevices alone, and of it only the checks with these names.
    pub(crate) fn interop(checks: Vec<String>) -> Self {
        Self { checks, ..Self::only("interop", None) }
    }
}

/// What the steps share.
struct Context<'a> {
    root: &'a Path,
    options: &'a Options,
    /// Where cargo builds.
    target: PathBuf,
    /// Where the steps write what their commands print.
    logs: PathBuf,
    /// Recordings and device files that are not ours, where there are some.
    data: Option<PathBuf>,
    /// What could not be installed, and why.
    missing: BTreeMap<&'static str, String>,
    /// What the steps have left out so far.
    skipped: RefCell<Vec<String>>,
}

/// How a step ended.
enum Outcome {
    Passed {
        /// How many things were tested.
        count: u64,
        /// What was counted, and what was left out.
        note: String,
    },
    /// Could not be tried here, and why.
    Skipped(String),
    Failed {
        /// How many passed nevertheless.
        count: u64,
        why: String,
    },
}

struct Step {
    name: &'static str,
    /// Part of `--quick`.
    quick: bool,
    /// Only when it is asked for by name.
    alone: bool,
    run: fn(&Context<'_>) -> Result<Outcome>,
}

const STEPS: &[Step] = &[
    Step { name: "format", quick: true, alone: false, run: cargo::format },
    Step { name: "tidy", quick: true, alone: false, run: cargo::tidy },
    Step { name: "dependencies", quick: true, alone: false, run: dependencies::run },
    Step { name: "lints", quick: true, alone: false, run: cargo::lints },
    Step { name: "tests", quick: true, alone: false, run: cargo::tests },
    Step { name: "docs", quick: true, alone: false, run: cargo::docs },
    Step { name: "features", quick: true, alone: false, run: cargo::features },
    Step { name: "release", quick: false, alone: false, run: product::release },
    Step { name: "demo", quick: false, alone: false, run: product::demo },
    Step { name: "stories", quick: false, alone: false, run: product::stories },
    Step { name: "swarm", quick: false, alone: false, run: product::swarm },
    Step { name: "score", quick: false, alone: false, run: product::score },
    Step { name: "habits", quick: false, alone: false, run: habits::run },
    Step { name: "fuzz", quick: false, alone: false, run: fuzz::run },
    Step { name: "interop", quick: false, alone: false, run: interop::run },
    Step { name: "bench-peers", quick: false, alone: true, run: peers::run },
];

/// Runs the chosen steps; `false` when one failed.
pub(crate) fn run(root: &Path, options: &Options) -> Result<bool> {
    for name in &options.only {
        if !STEPS.iter().any(|step| step.name == name) {
            let names: Vec<&str> = STEPS.iter().map(|step| step.name).collect();
            bail!("there is no step {name:?}; the steps are {}", names.join(", "));
        }
    }
    let chosen = |step: &&Step| {
        if options.only.is_empty() {
            !step.alone && (step.quick || !options.quick)
        } else {
            options.only.iter().any(|name| name == step.name)
        }
    };
    let mut context = Context::new(root, options)?;
    let wanted = STEPS
        .iter()
        .filter(chosen)
        .any(|step| matches!(step.name, "tests" | "interop" | "bench-peers"));
    if wanted {
        context.missing = tools::prepare(&context);
    }
    let allowed = AllowedSkips::read(root)?;
    let mut rows = Vec::new();
    for step in STEPS.iter().filter(chosen) {
        take(step.name, &mut rows, || strictly(&allowed, &context, step));
    }
    let passed = summary(&rows);
    println!("{}", allowed.not_tried(&context.skipped.borrow()));
    Ok(passed)
}

/// Takes a step; where nobody watches, one that leaves out what is not on the list has failed.
fn strictly(allowed: &AllowedSkips, context: &Context<'_>, step: &Step) -> Result<Outcome> {
    let before = context.skipped.borrow().len();
    let outcome = (step.run)(context)?;
    if let Outcome::Skipped(why) = &outcome {
        context.note_skip(&format!("{}: {why}", step.name));
    }
    let skipped = context.skipped.borrow();
    match (allowed.unexpected(&skipped[before..]), outcome) {
        (Some(line), Outcome::Passed { count, .. }) if skips::is_strict() => {
            Ok(Outcome::Failed { count, why: format!("left out, and not on the list: {line}") })
        }
        (Some(line), Outcome::Skipped(_)) if skips::is_strict() => {
            Ok(Outcome::Failed { count: 0, why: format!("left out, and not on the list: {line}") })
        }
        (_, outcome) => Ok(outcome),
    }
}

/// A step that was taken.
struct StepResult {
    name: String,
    outcome: Outcome,
    took: Duration,
}

impl StepResult {
    fn failed(&self) -> bool {
        matches!(self.outcome, Outcome::Failed { .. })
    }
}

/// Takes a step and adds its row; an error of its own is a failure.
fn take(name: &str, rows: &mut Vec<StepResult>, step: impl FnOnce() -> Result<Outcome>) {
    println!("== {name}");
    let start = Instant::now();
    let outcome =
        step().unwrap_or_else(|error| Outcome::Failed { count: 0, why: format!("{error:#}") });
    let took = start.elapsed();
    if let Outcome::Failed { why, .. } = &outcome {
        println!("FAILED: {why}");
    }
    rows.push(StepResult { name: name.to_owned(), outcome, took });
}

/// The table at the end; `false` when a step failed.
fn summary(rows: &[StepResult]) -> bool {
    println!("\n{:<16} {:<8} {:>7} {:>8}  ", "step", "result", "count", "time");
    let (mut total, mut failed, mut skipped) = (0, 0, 0);
    let mut time = Duration::ZERO;
    for StepResult { name, outcome, took } in rows {
        let (result, count, note) = match outcome {
            Outcome::Passed { count, note } => ("passed", *count, note.as_str()),
            Outcome::Skipped(why) => {
                skipped += 1;
                ("SKIPPED", 0, why.as_str())
            }
            Outcome::Failed { count, why } => {
                failed += 1;
                ("FAILED", *count, why.lines().next().unwrap_or_default())
            }
        };
        total += count;
        time += *took;
        println!("{name:<16} {result:<8} {count:>7} {:>7.1}s  {note}", took.as_secs_f64());
    }
    println!(
        "{:<16} {:<8} {total:>7} {:>7.1}s  {} steps, {failed} failed, {skipped} skipped",
        "total",
        if failed == 0 { "passed" } else { "FAILED" },
        time.as_secs_f64(),
        rows.len(),
    );
    failed == 0
}

impl<'a> Context<'a> {
    fn new(root: &'a Path, options: &'a Options) -> Result<Self> {
        let target = cargo::target_folder(root);
        let logs = target.join("xtask");
        std::fs::create_dir_all(&logs)?;
        Ok(Self {
            root,
            options,
            target,
            logs,
            data: data_folder(root),
            missing: BTreeMap::new(),
            skipped: RefCell::default(),
        })
    }

    /// Remembers that something is left out.
    fn note_skip(&self, line: &str) {
        self.skipped.borrow_mut().push(line.to_owned());
    }

    /// A command in the project's root that logs to `NAME.log`.
    fn command(&self, log: &str, program: impl AsRef<Path>, arguments: &[&str]) -> Run {
        let log = self.logs.join(format!("{log}.log"));
        let run = Run::new(self.root, log, program.as_ref(), arguments);
        match &self.data {
            Some(data) => run.env("LINESMAN_DATA", data),
            None => run,
        }
    }
}

/// Recordings and device files that are not ours: where the environment says, else beside the project as the tests of the
/// crates take them.
fn data_folder(root: &Path) -> Option<PathBuf> {
    let named = std::env::var_os("LINESMAN_DATA").map(PathBuf::from);
    named.or_else(|| root.join("../shared/data").canonicalize().ok())
}
