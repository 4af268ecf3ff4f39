//! `linesman lab`: stories, swarms, scores and recordings in virtual time.

pub(crate) mod capture_probe;
mod excerpts;
mod listener_captures;
mod listener_tables;
mod merge;
pub(crate) mod replay;
pub(crate) mod score;
mod score_tables;

use std::collections::BTreeMap;
use std::num::NonZero;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread;

use linesman_lab::habit::Habit;
use linesman_lab::story::Story;
use linesman_lab::story::run::play;
use linesman_lab::swarm::physics::{PhysicsReport, run_physics_seed};
use linesman_lab::swarm::run::{
    PART_SCHEMA, SeedSum, SwarmOptions, SwarmPart, SwarmReport, run_seed,
};

use crate::amount::number_of_things;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::{Output, Progress};
use crate::text::quantity::count;
use crate::version;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    /// Play stories: a fault, and what must be said about it
    Run {
        /// Play all of them with this habit of the MainDevice, whatever they say; see `score --habit`
        #[arg(long, value_name = "NAME")]
        habit: Option<Habit>,
        /// Markdown files
        #[arg(required = true, value_name = "STORY.md")]
        stories: Vec<PathBuf>,
    },
    /// Play the requests of a recording against a virtual segment, and compare the answers
    Replay(replay::Arguments),
    /// Measure how often the diagnosis is right, on plants and faults drawn by chance
    Score(score::Arguments),
    /// Add up parts of a score or of a swarm that several processes or machines have played
    Merge(merge::Arguments),
    /// Cut recordings at random, and hold the verdicts on them against the truth
    Excerpts(excerpts::Arguments),
    /// Loop a capture probe into plants drawn by chance, and hold what its recording is said to show against the truth
    CaptureProbe(capture_probe::Arguments),
    /// Run plants and faults drawn by chance, and check what must always hold
    Swarm {
        /// From the first seed up to, not including, the second
        #[arg(long, value_name = "A..B", value_parser = seeds)]
        seeds: Range<u64>,
        /// The segment alone: any fault of the catalogue and frames of chance, without MainDevice or
        /// diagnosis
        #[arg(long, conflicts_with = "habit")]
        physics: bool,
        /// Let the MainDevice play a habit of others, see `score --habit`: the diagnosis listens, and must not name a
        /// place where nothing was wrong
        #[arg(long, value_name = "NAME", default_value_t)]
        habit: Habit,
        /// Only what did not hold, and the sum
        #[arg(long, short)]
        quiet: bool,
        /// Write the seeds to a new file, too, for `lab merge`
        #[arg(long, value_name = "FILE.json", conflicts_with = "physics")]
        part: Option<PathBuf>,
    },
}

impl Arguments {
    /// Whether the answer is to be JSON.
    pub(crate) fn wants_json(&self) -> bool {
        match &self.command {
            Command::Replay(arguments) => arguments.json,
            Command::Score(arguments) => arguments.json,
            Command::Merge(arguments) => arguments.json,
            Command::Run { .. } | Command::Swarm { .. } => false,
            Command::Excerpts(_) | Command::CaptureProbe(_) => false,
        }
    }
}

/// Does it.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    match &arguments.command {
        Command::Run { habit, stories } => run_stories(stories, *habit, output),
        Command::Replay(arguments) => replay::run(arguments, output),
        Command::Score(arguments) => score::run(arguments, output),
        Command::Merge(arguments) => merge::run(arguments, output),
        Command::Excerpts(arguments) => excerpts::run(arguments, output),
        Command::CaptureProbe(arguments) => capture_probe::run(arguments, output),
        Command::Swarm { seeds, physics: true, quiet, .. } => {
            Ok(run_physics(seeds.clone(), *quiet, output))
        }
        Command::Swarm { seeds, quiet, habit, part, .. } => {
            run_swarm(seeds.clone(), *habit, *quiet, part.as_deref(), output)
        }
    }
}

/// `3..7`.
fn seeds(text: &str) -> Result<Range<u64>, String> {
    let wrong = || format!("`{text}`: expected two numbers, such as 0..200");
    let (from, to) = text.split_once("..").ok_or_else(wrong)?;
    let number = |text: &str| number_of_things(text).ok_or_else(wrong);
    let (from, to) = (number(from)?, number(to)?);
    if from >= to {
        return Err(format!("`{text}`: expected a second number greater than the first"));
    }
    Ok(from..to)
}

fn run_stories(
    stories: &[PathBuf],
    habit: Option<Habit>,
    output: &mut Output,
) -> Result<Status, Failure> {
    let mut held = 0;
    for path in stories {
        let text = files::text(path, "a story")?;
        let mut story = Story::parse(&text).map_err(|error| files::in_file(path, &error))?;
        story.front.habit = habit.unwrap_or(story.front.habit);
        let report = play(&story, &files::NamedFiles::of(path));
        held += usize::from(report.held());
        output.text(&format!("{report}"));
    }
    output.line(&format!(
        "{held} of {} held.",
        if stories.len() == 1 {
            "1 story".to_owned()
        } else {
            format!("{} stories", stories.len())
        }
    ));
    Ok(if held == stories.len() { Status::Good } else { Status::Findings })
}

fn run_swarm(
    seeds: Range<u64>,
    habit: Habit,
    quiet: bool,
    part: Option<&Path>,
    output: &mut Output,
) -> Result<Status, Failure> {
    if let Some(path) = part {
        files::refuse_to_overwrite(path)?;
    }
    let (from, to) = (seeds.start, seeds.end);
    let mut progress = Progress::new();
    let mut done = 0;
    let report = swarm(seeds, habit, |seed| {
        done += 1;
        if !quiet || !seed.is_green {
            progress.clear();
            output.line(&seed.words);
        }
        progress.show(|| format!("{done} of {}", count(to - from, "seed")));
    });
    progress.clear();
    output.line(&sum(&report));
    let status = status_of(&report);
    if let Some(path) = part {
        let (schema, tool) = (PART_SCHEMA.to_owned(), version::tool());
        let part =
            SwarmPart { schema, tool, seeds: (from, to), options: habit, cases: report.seeds };
        files::write_new(path, "the part of the swarm", &merge::text_of(path, &part)?)?;
    }
    Ok(status)
}

fn status_of(report: &SwarmReport) -> Status {
    if report.is_green() { Status::Good } else { Status::Findings }
}

fn run_physics(seeds: Range<u64>, quiet: bool, output: &mut Output) -> Status {
    let total = seeds.end - seeds.start;
    let mut progress = Progress::new();
    let (mut done, mut failed, mut faults, mut effective, mut frames) = (0, 0, 0, 0, 0);
    on_all_processors(seeds, run_physics_seed, |seed: PhysicsReport| {
        done += 1;
        failed += u64::from(!seed.is_green());
        faults += seed.faults.len() as u64;
        effective += seed.effective as u64;
        frames += seed.tally.sent;
        if !quiet || !seed.is_green() {
            progress.clear();
            output.line(&seed.to_string());
        }
        progress.show(|| format!("{done} of {}", count(total, "seed")));
    });
    progress.clear();
    output.line(&format!(
        "{}, {failed} failed: {}, {effective} of them with an effect; {} sent, each seed twice.",
        count(total, "seed"),
        count(faults, "fault"),
        count(frames, "frame"),
    ));
    if failed == 0 { Status::Good } else { Status::Findings }
}

/// Runs the seeds and gives their reports in order.
fn swarm(seeds: Range<u64>, habit: Habit, mut show: impl FnMut(&SeedSum)) -> SwarmReport {
    let options = SwarmOptions { habit, ..SwarmOptions::default() };
    let mut report = SwarmReport::default();
    on_all_processors(
        seeds,
        |seed| SeedSum::from(&run_seed(seed, &options)),
        |of_seed| {
            show(&of_seed);
            report.seeds.push(of_seed);
        },
    );
    report
}

/// Runs the seeds on all processors, and hands on each report in the order of the seeds.
fn on_all_processors<R: Send>(
    seeds: Range<u64>,
    run: impl Fn(u64) -> R + Sync,
    mut hand_on: impl FnMut(R),
) {
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    let next = AtomicU64::new(seeds.start);
    thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        for _ in 0..threads {
            let (sender, next, run) = (sender.clone(), &next, &run);
            scope.spawn(move || {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= seeds.end || sender.send((seed, run(seed))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        let mut early = BTreeMap::new();
        let mut expected = seeds.start;
        for (seed, report) in receiver {
            early.insert(seed, report);
            while let Some(report) = early.remove(&expected) {
                hand_on(report);
                expected += 1;
            }
        }
    });
}

fn sum(report: &SwarmReport) -> String {
    let all = report.seeds.len() as u64;
    let failed = report.failed().count();
    let checked = report.seeds.iter().map(|seed| seed.counters_checked).sum();
    let frames = report.seeds.iter().map(|seed| seed.frames).sum();
    format!(
        "{} run, {failed} failed; in {} a fault had an effect. {} passed, {} checked.",
        count(all, "seed"),
        report.with_effect(),
        count(frames, "frame"),
        count(checked, "working counter")
    )
}
