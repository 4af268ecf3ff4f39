//! `linesman lab capture-probe`: what the recording of a capture probe is said to show, held against the truth.

use std::collections::BTreeMap;
use std::ops::Range;

use linesman_lab::score::capture_probe::{
    ProbeCaseReport, ProbeKind, ProbeOutcome, run_probe_case,
};

use super::{on_all_processors, seeds};
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
    /// Record by the cards of a tap, of which the links are told: no records, and damaged frames are dropped
    #[arg(long)]
    tap: bool,
    /// Also each case with what was said, those that are wrong in any case
    #[arg(long)]
    list: bool,
}

/// Cases of one kind of fault.
#[derive(Clone, Copy, Default)]
struct FaultCount {
    right: u64,
    wrong: u64,
    not_seen: u64,
    not_played: u64,
    places: usize,
}

impl FaultCount {
    fn add(&mut self, outcome: &ProbeOutcome) {
        match outcome {
            ProbeOutcome::Right(places) => {
                self.right += 1;
                self.places += places;
            }
            ProbeOutcome::Quiet => self.right += 1,
            ProbeOutcome::Wrong(_) | ProbeOutcome::FalseAlarm => self.wrong += 1,
            ProbeOutcome::NotSeen => self.not_seen += 1,
            ProbeOutcome::NotPlayed(_) => self.not_played += 1,
        }
    }

    fn cells(&self) -> [String; 6] {
        let seen = self.right + self.wrong;
        let share = |of: u64| 100.0 * self.right as f64 / of as f64;
        let share = if seen == 0 { String::new() } else { format!("{:.1} %", share(seen)) };
        let mean = self.places as f64 / self.right.max(1) as f64;
        let numbers = [self.right, self.wrong, self.not_seen, self.not_played];
        let [right, wrong, not_seen, not_played] = numbers.map(|number| number.to_string());
        [share, right, wrong, not_seen, not_played, format!("{mean:.1}")]
    }
}

/// Plays the seeds.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let mut progress = Progress::new();
    let total = arguments.seeds.end - arguments.seeds.start;
    let (mut done, mut all) = (0, FaultCount::default());
    let mut rows: BTreeMap<&str, FaultCount> = BTreeMap::new();
    let kind = if arguments.tap { ProbeKind::Tap } else { ProbeKind::Recording };
    let play = move |seed| run_probe_case(seed, kind);
    on_all_processors(arguments.seeds.clone(), play, |report| {
        done += 1;
        progress.show(|| format!("{done} of {}", count(total, "seed")));
        let name = report.fault.map_or("healthy lines", |fault| fault.name());
        rows.entry(name).or_default().add(&report.outcome);
        if report.fault.is_some() {
            all.add(&report.outcome);
        }
        let is_wrong = matches!(report.outcome, ProbeOutcome::Wrong(_) | ProbeOutcome::FalseAlarm);
        if arguments.list || is_wrong {
            list(&report, output);
        }
    });
    progress.clear();
    let headings = ["fault", "place", "right", "wrong", "not seen", "not played", "places"];
    let mut table = Table::new(&headings, output.paint());
    for (name, row) in &rows {
        table.row([(*name).to_owned()].into_iter().chain(row.cells()));
    }
    table.row(["all faults".to_owned()].into_iter().chain(all.cells()));
    output.text(&table.render());
    output.line(
        "\nplace: the true place is in the range that is named, and the range is as narrow as the ports of the probe \
         allow; places: how many a range has on average. No error counter was read.",
    );
    let alarms = rows.get("healthy lines").map_or(0, |row| row.wrong);
    Ok(if all.wrong + alarms == 0 { Status::Good } else { Status::Findings })
}

fn list(report: &ProbeCaseReport, output: &mut Output) {
    let ProbeCaseReport { seed, fault, entry, devices, places, copies, outcome, said } = report;
    let fault = fault.map_or("none", |fault| fault.name());
    output.line(&format!(
        "{seed} {outcome:?}: {fault} ({entry}), {devices} SubDevices, probe at {}, {} copies, {} damaged",
        places.join(", "),
        copies[0],
        copies[1]
    ));
    for said in said {
        output.line(&format!("    {said}"));
    }
}
