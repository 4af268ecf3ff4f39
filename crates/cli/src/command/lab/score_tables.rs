//! Tables of a score.

use linesman_lab::score::report::{GroupReport, SideReport, WrongReport};
use linesman_lab::score::{Rate, ScoreReport};

use super::listener_tables;
use crate::output::{Output, Table};
use crate::text::quantity::count;

/// Shows a score.
pub(super) fn show(report: &ScoreReport, list: bool, output: &mut Output) {
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
    singles(report, output);
    sets(report, list, output);
    output.line("");
    healthy(report, output);
    doubles(report, output);
    output.line("");
    groups(report, output);
    left_out(report, output);
    output.line("");
    certainty(report, output);
    for alarm in &report.healthy.alarms {
        output.line(&format!("false alarm, {alarm}"));
    }
    for why in &report.unplayable {
        output.line(&format!("not played, {why}"));
    }
    if list {
        for alarm in &report.healthy.alarms_capture {
            output.line(&format!("false alarm in the recording, {alarm}"));
        }
        for wrong in &report.wrong {
            one_wrong(wrong, output);
        }
    }
}

/// Single faults, ours beside what others would find.
fn singles(report: &ScoreReport, output: &mut Output) {
    let mut table = Table::new(
        &["single faults", "place", "cause", "place, set", "cause, set", "95 %, set", "repair"],
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
            share(side.repair_at_1),
        ]);
    }
    table.row([
        "the method of a course".to_owned(),
        share(report.single.baseline),
        "-".to_owned(),
        "-".to_owned(),
        "-".to_owned(),
        interval(report.single.baseline),
        "-".to_owned(),
    ]);
    table.row(["no diagnosis", "0.0 %", "-", "-", "-", "-", "-"].map(str::to_owned));
    output.text(&table.render());
    if let Some(tried) = report.single.repairs_tried {
        output.line("");
        output.line(&format!(
            "Repairs tried in {}: mended by the first exchange {} {}, by the second at most {}, by the third {}.",
            count(tried.mended_by_first.of, "case"),
            share(tried.mended_by_first),
            interval(tried.mended_by_first),
            share(tried.by_second),
            share(tried.by_third),
        ));
    }
}

/// Sets that made answers right, and whether the causes that were named leave the same frames.
fn sets(report: &ScoreReport, list: bool, output: &mut Output) {
    if report.sets.is_empty() {
        return;
    }
    let mut table = Table::new(&["set", "same frames", "parted", "not tried"], output.paint());
    for (name, set) in &report.sets {
        let [parted, not_tried] = [&set.parted, &set.not_tried].map(|all| all.len().to_string());
        table.row([name.clone(), set.same.to_string(), parted, not_tried]);
    }
    output.line("");
    output.text(&table.render());
    if list {
        for line in report.sets.values().flat_map(|set| set.parted.iter().chain(&set.not_tried)) {
            output.line(&format!("  {line}"));
        }
    }
}

/// Lines on which nothing was wrong.
fn healthy(report: &ScoreReport, output: &mut Output) {
    let (healthy, capture) = (report.healthy.silent, report.healthy.silent_capture);
    output.line(&format!(
        "Nothing wrong: {}, {} false alarms ({} in the recordings).",
        count(healthy.of, "run"),
        healthy.of - healthy.right,
        capture.of - capture.right
    ));
    let healthy = &report.healthy;
    if let (Some(rate), Some(most)) = (healthy.per_1000_hours, healthy.per_1000_hours_at_most) {
        output.line(&format!(
            "{:.1} hours of line time: {} ({} in the recordings), {rate:.1} in 1,000 hours, at most {most:.1} \
             (95 %).",
            healthy.line_hours,
            count(healthy.findings, "finding"),
            healthy.findings_capture,
        ));
    }
}

/// Two faults in one case.
fn doubles(report: &ScoreReport, output: &mut Output) {
    let double = &report.double;
    if double.faults.faults == 0 {
        return;
    }
    output.line(&format!(
        "Two faults, each with a finding of its own: {}; both places {} {}, both causes {}; in the recordings {} \
         and {}.",
        count(double.both_places.of.max(double.both_places_capture.of), "case"),
        share(double.both_places),
        interval(double.both_places),
        share(double.both_causes),
        share(double.both_places_capture),
        share(double.both_causes_capture)
    ));
    let kinds = [
        ("one behind the other", double.in_line),
        ("on different branches", double.on_branches),
        ("at one moment", double.at_one_moment),
        ("one after the other", double.one_after_the_other),
    ];
    for (name, pair) in kinds {
        output.line(&format!(
            "  {name:<22} {} of {}, causes {}",
            share(pair.both_places),
            pair.both_places.of,
            share(pair.both_causes)
        ));
    }
}

/// Faults that are in none of the figures.
fn left_out(report: &ScoreReport, output: &mut Output) {
    if report.left_out.is_empty() {
        return;
    }
    output.line("");
    let mut table = Table::new(
        &[
            "left out",
            "no effect",
            "nothing to see",
            "alone of two",
            "no place",
            "line did not come up",
        ],
        output.paint(),
    );
    for (name, one) in &report.left_out {
        let counts = [one.no_effect, one.unseen, one.alone_of_two, one.no_place, one.not_up];
        let [no_effect, unseen, alone, no_place, not_up] = counts.map(|count| count.to_string());
        table.row([name.clone(), no_effect, unseen, alone, no_place, not_up]);
    }
    output.text(&table.render());
}

/// Calibration of the findings, and hard faults that were named soon.
fn certainty(report: &ScoreReport, output: &mut Output) {
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
    if report.named_in_100_ms.is_empty() {
        return;
    }
    let fast = report.named_in_100_ms.iter();
    let fast = fast.map(|(name, rate)| format!("{name} {} of {}", rate.right, rate.of));
    let fast: Vec<String> = fast.collect();
    output.line("");
    output.line(&format!(
        "Named within 100 ms of virtual time, at a cycle of 1 ms: {}.",
        fast.join(", ")
    ));
}

/// A case that was judged wrongly.
fn one_wrong(wrong: &WrongReport, output: &mut Output) {
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

fn groups(report: &ScoreReport, output: &mut Output) {
    let mut table = Table::new(
        &[
            "",
            "faults",
            "place",
            "cause",
            "place, set",
            "cause, set",
            "repair",
            "2nd",
            "course",
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
            share(side.repair_at_1),
            group.repairs_tried.map_or_else(|| "-".to_owned(), |tried| share(tried.by_second)),
            share(group.baseline),
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
    add("beside rare errors elsewhere", &report.beside_background);
    add("with a hot connect group", &report.with_hot_connect);
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
