//! Answers of the listeners beside the MainDevice of a score, as tables.

use linesman_lab::score::Rate;
use linesman_lab::score::listen::report::{
    HealthyRates, ListenedReport, ListenerPair, ListenerReport, ListenersReport,
};

use crate::output::{Output, Table};
use crate::text::quantity::count;

/// The tables of a score.
pub(super) fn show(report: &ListenedReport, list: bool, output: &mut Output) {
    summary(report, output);
    for (title, of) in JOINED {
        output.line("");
        output.line(title);
        faults(report, of, output);
    }
    output.line("");
    healthy(report, output);
    output.line("");
    output.line(
        "placed: link-open, device-off, supply-off, brown-out, paused, host-drops, late-frames. silent: no frame that was \
         heard shows anything, and nothing was reported; the shares are of the others. place, cause: with admitted sets; \
         named: the first finding names the fault, or has it among the others that it may be; open: inconclusive, or a \
         place left open that holds the right one; missed: healthy beside a trace; +: with the project.",
    );
    for alarm in &report.healthy.alarms {
        output.line(&format!("false alarm, {alarm}"));
    }
    for wrong in report.wrong.iter().filter(|_| list) {
        let project = if wrong.with_project { ", project" } else { "" };
        output.line(&format!(
            "seed {}: {} ({}); {} {}{project}: {}",
            wrong.seed,
            wrong.fault,
            count(wrong.devices, "SubDevice"),
            wrong.outcome,
            wrong.joined,
            wrong.said
        ));
    }
    output.line("");
}

/// Which of the listeners of a group.
type Of = fn(&ListenersReport) -> &ListenerPair;

const JOINED: [(&str, Of); 3] = [
    ("Listening from the start:", |listeners| &listeners.start),
    ("Joined while the fault acts:", |listeners| &listeners.during),
    ("Joined after it:", |listeners| &listeners.after),
];

const COLUMNS: [&str; 11] = [
    "", "faults", "silent", "place", "cause", "named", "open", "missed", "wrong", "+place",
    "+wrong",
];

fn summary(report: &ListenedReport, output: &mut Output) {
    let mut table = Table::new(&COLUMNS, output.paint());
    let names = ["start", "during", "after"];
    let groups = [("all", &report.single), ("placed", &report.placed), ("noise", &report.noise)];
    for (group, listeners) in groups {
        for (name, (_, of)) in names.iter().zip(JOINED) {
            row(&mut table, &format!("{group}, {name}"), of(listeners));
        }
    }
    output.text(&table.render());
}

fn faults(report: &ListenedReport, of: Of, output: &mut Output) {
    let mut table = Table::new(&COLUMNS, output.paint());
    for (name, listeners) in &report.per_fault {
        row(&mut table, name, of(listeners));
    }
    output.text(&table.render());
}

fn row(table: &mut Table, name: &str, pair: &ListenerPair) {
    let ListenerPair { alone, with_project } = pair;
    if alone.no_trace.of == 0 {
        return;
    }
    let ListenerReport { place_at_1_set, cause_at_1_set, named, open, missed, wrong, .. } = alone;
    let rates = [
        place_at_1_set,
        cause_at_1_set,
        named,
        open,
        missed,
        wrong,
        &with_project.place_at_1_set,
        &with_project.wrong,
    ];
    let head = [name, &alone.no_trace.of.to_string(), &alone.no_trace.right.to_string()];
    let head = head.map(str::to_owned);
    table.row(head.into_iter().chain(rates.map(|rate| share(*rate))));
}

fn healthy(report: &ListenedReport, output: &mut Output) {
    let healthy = &report.healthy;
    let text = |rates: HealthyRates| {
        format!(
            "{} of {} with an alarm, {} called healthy",
            rates.silent.of - rates.silent.right,
            rates.silent.of,
            share(rates.healthy)
        )
    };
    output.line("Nothing wrong:");
    for (name, pair) in [("from the start", &healthy.start), ("joined late", &healthy.late)] {
        output.line(&format!("  {name:<15} {}", text(pair.alone)));
        output.line(&format!("  {:<15} {}", "  with project", text(pair.with_project)));
    }
}

fn share(rate: Rate) -> String {
    if rate.of == 0 { "-".to_owned() } else { format!("{:.0} %", rate.share * 100.0) }
}
