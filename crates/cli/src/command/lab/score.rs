//! `linesman lab score`: how often the diagnosis is right.

use std::ops::Range;
use std::path::PathBuf;

use linesman_config::fault::FaultName;
use linesman_lab::habit::Habit;
use linesman_lab::score::report::{GroupReport, SideReport};
use linesman_lab::score::{Perturbation, Rate, ScoreOptions, ScoreReport, Tally, run_case};

use super::{listener_captures, listener_tables, on_all_processors, seeds};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Progress, Table};
use crate::text::quantity::count;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// From the first seed up to, not including, the second
    #[arg(long, value_name = "A..B", value_parser = seeds)]
    seeds: Range<u64>,
    /// Only this fault, one in each case
    #[arg(long, value_name = "NAME")]
    fault: Option<FaultName>,
    /// Judge recordings alone, of lines that nobody asks for registers on account of a finding
    #[arg(long)]
    capture_only: bool,
    /// Nothing is wrong in any case, but much is done that is no fault: whatever is said is a false alarm
    #[arg(long, conflicts_with_all = ["fault", "perturb"])]
    healthy: bool,
    /// Make the plants other than the diagnosis expects: delays, rates, forwarded, lost-reads or
    /// cleared-counters
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
    /// Also each case that was judged wrongly, with what was said
    #[arg(long)]
    list: bool,
    /// JSON, schema linesman.score/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// Plays the cases on all processors and adds up in the order of seeds: the sum is the same for any
/// number of them.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    if let Some(directory) = &arguments.record {
        listener_captures::create(directory, arguments.habit)?;
    }
    let mut written = Ok(());
    let options = ScoreOptions {
        fault: arguments.fault,
        capture_only: arguments.capture_only,
        healthy: arguments.healthy,
        perturb: arguments.perturb,
        habit: arguments.habit,
        keeps_heard: arguments.record.is_some(),
    };
    let mut tally = Tally::new(options);
    let mut progress = Progress::new();
    let total = arguments.seeds.end - arguments.seeds.start;
    let mut done = 0;
    on_all_processors(
        arguments.seeds.clone(),
        |seed| run_case(seed, &options),
        |case| {
            tally.add(&case);
            if let (Some(directory), Ok(())) = (&arguments.record, &written) {
                written = listener_captures::write(directory, &case);
            }
            done += 1;
            progress.show(|| format!("{done} of {}", count(total, "seed")));
        },
    );
    progress.clear();
    written?;
    let report = tally.report();
    if arguments.json {
        output.json(&report);
    } else {
        show(&report, arguments.list, output);
    }
    let is_judged = report.effective_cases + report.healthy_runs > 0;
    Ok(if is_judged { Status::Good } else { Status::NotJudged })
}

fn show(report: &ScoreReport, list: bool, output: &mut Output) {
    let (from, to) = report.seeds;
    output.line(&format!(
        "Seeds {from}..{to}: {}, in {} a fault had an effect{}{}.",
        count(report.cases, "case"),
        report.effective_cases,
        report.perturbed.as_ref().map_or_else(String::new, |name| format!("; perturbed: {name}")),
        report.listened.as_ref().map_or_else(String::new, |_| format!("; habit: {}", report.habit)),
    ));
    if let Some(report) = &report.listened {
        output.line("");
        listener_tables::show(report, list, output);
    }
    output.line("");
    let mut table = Table::new(
        &["single faults", "place", "cause", "place, set", "cause, set", "95 %"],
        output.paint(),
    );
    for (name, side) in
        [("live", report.single.live.as_ref()), ("recording", Some(&report.single.capture))]
    {
        let Some(side) = side else { continue };
        table.row([
            name.to_owned(),
            share(side.place_at_1),
            share(side.cause_at_1),
            share(side.place_at_1_set),
            share(side.cause_at_1_set),
            format!("{} / {}", interval(side.place_at_1_set), interval(side.cause_at_1_set)),
        ]);
    }
    table.row([
        "first counter above zero".to_owned(),
        share(report.single.baseline),
        "-".to_owned(),
        "-".to_owned(),
        "-".to_owned(),
        interval(report.single.baseline),
    ]);
    table.row(["no diagnosis", "0.0 %", "-", "-", "-", "-"].map(str::to_owned));
    output.text(&table.render());
    output.line("");
    let (healthy, capture) = (report.healthy.silent, report.healthy.silent_capture);
    output.line(&format!(
        "Nothing wrong: {}, {} false alarms ({} in the recordings).",
        count(healthy.of, "run"),
        healthy.of - healthy.right,
        capture.of - capture.right
    ));
    let double = &report.double;
    output.line(&format!(
        "Two faults: {}; both places {} {}, both causes {}; in the recordings {} and {}.",
        count(double.both_places.of.max(double.both_places_capture.of), "case"),
        share(double.both_places),
        interval(double.both_places),
        share(double.both_causes),
        share(double.both_places_capture),
        share(double.both_causes_capture)
    ));
    output.line("");
    groups(report, output);
    output.line("");
    output.line("How sure, and how often cause and place were just that:");
    for bin in &report.calibration {
        let right = bin.right;
        output.line(&format!(
            "  {:>3.0} %   {} of {}",
            bin.confidence * 100.0,
            share(right),
            count(right.of, "finding")
        ));
    }
    output.line(&format!(
        "  calibration error {:.1} % (how far the two are apart, on average)",
        report.calibration_error * 100.0
    ));
    if !report.named_in_100_ms.is_empty() {
        let fast = report.named_in_100_ms.iter();
        let fast = fast.map(|(name, rate)| format!("{name} {} of {}", rate.right, rate.of));
        let fast: Vec<String> = fast.collect();
        output.line("");
        output.line(&format!(
            "Named within 100 ms of virtual time, at a cycle of 1 ms: {}.",
            fast.join(", ")
        ));
    }
    for alarm in &report.healthy.alarms {
        output.line(&format!("false alarm, {alarm}"));
    }
    for why in &report.unplayable {
        output.line(&format!("not played, {why}"));
    }
    if !list {
        return;
    }
    for wrong in &report.wrong {
        let ring = if wrong.ring { ", ring" } else { "" };
        output.line(&format!(
            "seed {}: {} ({}, {}{ring})",
            wrong.seed,
            wrong.fault,
            count(wrong.effects, "effect"),
            count(wrong.devices, "SubDevice")
        ));
        if let Some(live) = &wrong.live {
            output.line(&format!("    live       {live}"));
        }
        output.line(&format!("    recording  {}", wrong.capture));
        if wrong.findings.len() > 1 {
            output.line(&format!("    in all     {}", wrong.findings.join("; ")));
        }
    }
}

fn groups(report: &ScoreReport, output: &mut Output) {
    let mut table = Table::new(
        &[
            "",
            "faults",
            "place",
            "cause",
            "place, set",
            "cause, set",
            "recording",
            "others",
            "cycles",
        ],
        output.paint(),
    );
    let mut add = |name: &str, group: &GroupReport| {
        if group.faults == 0 {
            return;
        }
        let side = group.live.as_ref().unwrap_or(&group.capture);
        let recording = &group.capture;
        table.row([
            name.to_owned(),
            group.faults.to_string(),
            share(side.place_at_1),
            share(side.cause_at_1),
            share(side.place_at_1_set),
            share(side.cause_at_1_set),
            format!("{} / {}", share(recording.place_at_1_set), share(recording.cause_at_1_set)),
            side.other_findings.to_string(),
            cycles(side),
        ]);
    };
    for (name, group) in &report.per_fault {
        add(name, group);
    }
    for bucket in &report.by_effects {
        let name = match bucket.to {
            Some(to) if to == bucket.from => format!("{to} effect"),
            Some(to) => format!("{} to {to} effects", bucket.from),
            None => format!("from {} effects", bucket.from),
        };
        add(&name, &bucket.group);
    }
    add("among old counters", &report.masked);
    add("without forwarded counters", &report.without_forwarded);
    add("without the card's counters", &report.without_card_counters);
    add("in rings", &report.rings);
    add("each of two", &report.double.faults);
    output.text(&table.render());
}

fn share(rate: Rate) -> String {
    if rate.of == 0 { "-".to_owned() } else { format!("{:.1} %", rate.share * 100.0) }
}

fn interval(rate: Rate) -> String {
    format!("[{:.1}, {:.1}]", rate.low * 100.0, rate.high * 100.0)
}

fn cycles(side: &SideReport) -> String {
    match (side.cycles_median, side.cycles_95) {
        (Some(median), Some(late)) => format!("{median} ({late})"),
        (_, _) => "-".to_owned(),
    }
}
