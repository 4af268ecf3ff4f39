//! `linesman lab score`: how often the diagnosis is right.

use std::ops::Range;
use std::path::{Path, PathBuf};

use linesman_config::fault::FaultName;
use linesman_lab::habit::Habit;
use linesman_lab::score::parts::{self, ScorePart};
use linesman_lab::score::{CaseReport, Perturbation, ScoreOptions, ScoreReport, Tally, run_case};
use linesman_proto::time::Span;

use super::{listener_captures, merge, on_all_processors, score_tables, seeds};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Progress};
use crate::text::quantity::count;
use crate::{amount, files, version};

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// From the first seed up to, not including, the second
    #[arg(long, value_name = "A..B", value_parser = seeds, required_unless_present = "fresh")]
    seeds: Option<Range<u64>>,
    /// So many seeds that nobody has looked at before: their range follows from the commit of this program
    #[arg(long, value_name = "COUNT", value_parser = amount::count(1, 1_000_000), conflicts_with = "seeds")]
    fresh: Option<u64>,
    /// Only this fault, one in each case
    #[arg(long, value_name = "NAME")]
    fault: Option<FaultName>,
    /// Judge recordings alone, of lines that nobody asks for registers on account of a finding
    #[arg(long)]
    capture_only: bool,
    /// Nothing is wrong in any case, but much is done that is no fault: whatever is said is a false alarm
    #[arg(long, conflicts_with_all = ["fault", "perturb"])]
    healthy: bool,
    /// With --healthy: let each line run so long, disturbed now and then, such as 2h
    #[arg(long = "for", value_name = "TIME", value_parser = amount::lasting(), requires = "healthy")]
    lasts: Option<Span>,
    /// Make the plants other than the diagnosis expects: delays, rates, forwarded, lost-reads,
    /// cleared-counters, counting or bursts
    #[arg(long, value_name = "NAME")]
    perturb: Option<Perturbation>,
    /// Let the MainDevice play a habit of others: process-data, states, links, counters, clearing or soem. Then
    /// nobody asks for registers, and who listens beside it is judged: from the start, joined during a fault, joined
    /// after it
    #[arg(long, value_name = "NAME", default_value_t)]
    habit: Habit,
    /// With --habit: write what each listener heard to this new directory, as SEED-start.pcapng, SEED-during.pcapng and
    /// SEED-after.pcapng, or SEED-late.pcapng of healthy lines, and the project as SEED.toml
    #[arg(long, value_name = "DIRECTORY")]
    record: Option<PathBuf>,
    /// Write the plant of each case to this new directory, as SEED.toml, and what was said of it, as SEED-live.json and
    /// SEED-recording.json
    #[arg(long, value_name = "DIRECTORY")]
    reports: Option<PathBuf>,
    /// Leave out the repairs: without this what a finding blames is exchanged, and where that was in vain, the line is
    /// looked at again
    #[arg(long)]
    no_repairs: bool,
    /// Play each case that a set of causes made right again with the cause that was named, and compare all frames
    #[arg(long)]
    prove_sets: bool,
    /// Write each case to this new file, schema linesman.score-part/1, for `lab merge`
    #[arg(long, value_name = "FILE.json")]
    part: Option<PathBuf>,
    /// Exit with 1 when fewer than so many of 100 single faults have cause and place right, admitted sets counted: when
    /// even the upper end of the 95 % interval lies below
    #[arg(long, value_name = "PERCENT", value_parser = clap::value_parser!(u8).range(1..=100))]
    floor: Option<u8>,
    /// Also each case that was judged wrongly, with what was said, and the false alarms in recordings of healthy lines
    #[arg(long)]
    list: bool,
    /// JSON, schema linesman.score/2
    #[arg(long)]
    pub(crate) json: bool,
}

/// Plays the cases on all processors and adds up in the order of seeds: the sum is the same for any
/// number of them.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let range = range(arguments)?;
    if let Some(directory) = &arguments.record {
        listener_captures::create(directory, arguments.habit)?;
    }
    if let Some(path) = &arguments.part {
        files::refuse_to_overwrite(path)?;
    }
    if let Some(directory) = &arguments.reports {
        std::fs::create_dir(directory).map_err(|error| files::in_file(directory, &error))?;
    }
    let mut written = Ok(());
    let options = ScoreOptions {
        fault: arguments.fault,
        capture_only: arguments.capture_only,
        healthy: arguments.healthy,
        healthy_for: arguments.lasts.unwrap_or(Span::ZERO),
        perturb: arguments.perturb,
        habit: arguments.habit,
        tries_repairs: !arguments.no_repairs,
        proves_sets: arguments.prove_sets,
        keeps_heard: arguments.record.is_some(),
        keeps_reports: arguments.reports.is_some(),
    };
    let mut tally = Tally::new(options);
    let mut cases = Vec::new();
    let mut progress = Progress::new();
    let total = range.end - range.start;
    let mut done = 0;
    on_all_processors(
        range.clone(),
        |seed| run_case(seed, &options),
        |case| {
            tally.add(&case);
            if let (Some(directory), Ok(())) = (&arguments.record, &written) {
                written = listener_captures::write(directory, &case);
            }
            if let (Some(directory), Ok(())) = (&arguments.reports, &written) {
                written = write_reports(directory, &case);
            }
            if arguments.part.is_some() {
                cases.push(case);
            }
            done += 1;
            progress.show(|| format!("{done} of {}", count(total, "seed")));
        },
    );
    progress.clear();
    written?;
    if let Some(path) = &arguments.part {
        let seeds = (range.start, range.end);
        let (schema, tool) = (parts::SCHEMA.to_owned(), version::tool());
        // What else is written of a part changes nothing in its cases.
        let options = ScoreOptions { keeps_heard: false, keeps_reports: false, ..options };
        let part = ScorePart { schema, tool, seeds, options, cases };
        files::write_new(path, "the part of the score", &merge::text_of(path, &part)?)?;
    }
    Ok(show(&tally.report(), arguments.json, arguments.list, arguments.floor, output))
}

/// The seeds that are asked for.
fn range(arguments: &Arguments) -> Result<Range<u64>, Failure> {
    let Some(number) = arguments.fresh else {
        return Ok(arguments.seeds.clone().unwrap_or_default());
    };
    let first = version::first_fresh_seed().ok_or_else(|| {
        Failure::new(
            "--fresh: this program was built outside of a clone and has no commit to draw seeds from",
            "give a range, such as `--seeds 70001..70201`",
        )
    })?;
    Ok(first..first + number)
}

/// Writes the plant of a case and what was said of it, where it was played to its end.
fn write_reports(directory: &Path, case: &CaseReport) -> Result<(), Failure> {
    let (Some(plant), Some(reports)) = (&case.plant, &case.reports) else { return Ok(()) };
    let path = directory.join(format!("{}.toml", case.seed));
    files::write_new(&path, "the plant", &plant.to_toml())?;
    for (name, report) in ["live", "recording"].into_iter().zip(reports.iter()) {
        let path = directory.join(format!("{}-{name}.json", case.seed));
        let text =
            serde_json::to_string_pretty(report).map_err(|error| files::in_file(&path, &error))?;
        files::write_new(&path, "a diagnosis", &text)?;
    }
    Ok(())
}

/// Shows a score; the status says whether it reaches its floor.
pub(super) fn show(
    report: &ScoreReport,
    json: bool,
    list: bool,
    floor: Option<u8>,
    output: &mut Output,
) -> Status {
    if json {
        output.json(report);
    } else {
        score_tables::show(report, list, output);
    }
    if report.effective_cases + report.healthy_runs == 0 {
        return Status::NotJudged;
    }
    let single = report.single.live.as_ref().unwrap_or(&report.single.capture).cause_at_1_set;
    // Without any it is not known that it reaches the floor.
    let at_most = if single.of == 0 { 0.0 } else { single.high * 100.0 };
    match floor {
        Some(floor) if at_most < f64::from(floor) => {
            output.warn(&format!(
                "cause and place are right in {:.1} % of {} single faults, at most in {at_most:.1} % (95 %), \
                 expected at least {floor} %",
                single.share * 100.0,
                single.of
            ));
            Status::Findings
        }
        Some(_) | None => Status::Good,
    }
}
