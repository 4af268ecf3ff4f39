//! `linesman plan --timing`: whether each SubDevice with SYNC0 gets its outputs in time and has its inputs ready in
//! time, as text.

use std::path::PathBuf;

use linesman_config::plan::timing::{
    DeviceTiming, InputsEstimate, PlanTiming, RuleTiming, TimingOptions, TimingVerdict,
};
use linesman_config::plan::{Plan, ShiftReference};
use linesman_proto::time::Span;

use crate::amount;
use crate::drawing::CyclePlot;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, Table, wrapped};
use crate::text::quantity::count;

/// A short time on the command line: microseconds unless said.
fn short() -> impl Fn(&str) -> Result<Span, String> + Clone + Send + Sync + 'static {
    amount::duration(Span::us(1), Span::ZERO, Span::s(10))
}

/// What can be asked of the timing.
#[derive(clap::Args, Debug)]
pub(super) struct TimingArguments {
    /// Prove the timing: does each SubDevice with SYNC0 get its outputs in time and have its inputs ready in time?
    #[arg(long)]
    pub(super) timing: bool,
    /// How early and late the MainDevice sends at the most (20us); a tenth of the cycle is assumed unless said
    #[arg(long, value_name = "US", value_parser = short(), requires = "timing")]
    jitter: Option<Span>,
    /// By how much the first task ends earlier or later, where its frames wait for that (`task-end`)
    #[arg(long, value_name = "US", value_parser = short(), requires = "timing")]
    task_jitter: Option<Span>,
    /// How long the program of a task takes at the most (fast=120us); may be given for each task
    #[arg(long, value_name = "TASK=US", requires = "timing")]
    execution: Vec<String>,
    /// Metres of copper cable behind the reference clock; 100 m for each cable are assumed unless said
    #[arg(long, value_name = "M", requires = "timing")]
    cable_m: Option<u32>,
    /// What has to be left over before and after SYNC0
    #[arg(long, value_name = "US", value_parser = short(), requires = "timing")]
    margin: Option<Span>,
    /// Draw the timing of one cycle into this file
    #[arg(long, value_name = "FILE.svg", requires = "timing")]
    pub(super) svg: Option<PathBuf>,
}

impl TimingArguments {
    /// The same for the calculation.
    ///
    /// # Errors
    /// A task that the plan does not have, or a time that cannot be read.
    pub(super) fn options(&self, plan: &Plan) -> Result<TimingOptions, Failure> {
        let execution = self.execution.iter().map(|text| execution(text, plan));
        Ok(TimingOptions {
            jitter: self.jitter,
            task_jitter: self.task_jitter,
            execution: execution.collect::<Result<_, _>>()?,
            cable_m: self.cable_m,
            margin: self.margin.unwrap_or_default(),
        })
    }
}

fn execution(text: &str, plan: &Plan) -> Result<(String, Span), Failure> {
    let names: Vec<_> = plan.tasks.iter().map(|task| format!("`{}`", task.name)).collect();
    let wrong = |reason: String| {
        let tasks = match names.is_empty() {
            true => "none".to_owned(),
            false => names.join(", "),
        };
        Failure::new(
            format!("--execution {text}: {reason}"),
            format!("write a task and how long it takes, such as `cyclic=120us`; tasks: {tasks}"),
        )
    };
    let (name, takes) =
        text.rsplit_once('=').ok_or_else(|| wrong("expected TASK=TIME".to_owned()))?;
    if !plan.tasks.iter().any(|task| task.name == name) {
        return Err(wrong(format!("there is no task `{name}`")));
    }
    let takes = short()(takes).map_err(wrong)?;
    Ok((name.to_owned(), takes))
}

/// The status: what is not judged is neither good nor bad.
pub(super) fn status(timing: &PlanTiming) -> Status {
    match timing.verdict() {
        TimingVerdict::Pass => Status::Good,
        TimingVerdict::Fail => Status::Findings,
        TimingVerdict::NotJudged => Status::Inconclusive,
    }
}

fn us(ns: i64) -> String {
    format!("{:.1}", ns as f64 / 1e3)
}

fn span_us(span: Span) -> String {
    format!("{:.1}", span.as_nanos() as f64 / 1e3)
}

/// The timing as text.
pub(super) fn text(plan: &Plan, timing: &PlanTiming, plot: &CyclePlot, output: &Output) -> String {
    let mut text = format!("\n{}: {}\n", output.paint().bold("Timing"), verdict(timing, output));
    text.push_str(&estimates(plan, timing, output));
    if !timing.devices.is_empty() {
        text.push('\n');
        text.push_str(&table(plan, timing, output));
    }
    let told: String = timing.devices.iter().map(|device| advice(plan, device, output)).collect();
    text.push_str(&told);
    text.push_str(&network_advice(timing, output));
    if !timing.devices.is_empty() {
        text.push_str("\nOne cycle, from its begin at the reference clock:\n");
        text.push_str(&plot.text(output.width()));
    }
    for assumed in &timing.assumed {
        text.push('\n');
        text.push_str(&wrapped("assumed: ", assumed, output.width()));
    }
    text.push_str(&assumed_of_devices(plan, timing, output));
    text
}

fn verdict(timing: &PlanTiming, output: &Output) -> String {
    let paint = output.paint();
    let of = |verdict| timing.devices.iter().filter(|device| device.verdict == verdict).count();
    let all = timing.devices.len();
    let failing = of(TimingVerdict::Fail);
    match timing.verdict() {
        TimingVerdict::NotJudged if all == 0 => {
            "no SubDevice has SYNC0: nothing to prove".to_owned()
        }
        TimingVerdict::Pass => {
            format!("{}, {} in step with SYNC0", paint.good("pass"), count(all as u64, "SubDevice"))
        }
        TimingVerdict::Fail => format!("{}, {failing} of {all} are not in time", paint.bad("fail")),
        TimingVerdict::NotJudged => {
            let unknown = of(TimingVerdict::NotJudged);
            format!("{}, {unknown} of {all} are not known well enough", paint.warning("not judged"))
        }
    }
}

fn estimates(plan: &Plan, timing: &PlanTiming, output: &Output) -> String {
    if timing.devices.is_empty() {
        return String::new();
    }
    let outputs = &timing.outputs;
    let first = timing.devices.first().and_then(|device| plan.task_of(device.device));
    let has = first.map_or_else(String::new, |task| {
        format!("; the plan has {} µs", span_us(plan.outputs_shift(task)))
    });
    let sum = format!(
        "{} µs by rule of thumb: devices {} ({} on cables, {} on E-bus), cables {}, jitter {}, jitter of the first \
         task {}, programs {}, margin {}{has}.",
        span_us(outputs.total()),
        span_us(outputs.devices),
        outputs.cabled,
        outputs.terminals,
        span_us(outputs.cables),
        span_us(outputs.jitter),
        span_us(outputs.task_jitter),
        span_us(outputs.execution),
        span_us(outputs.margin),
    );
    let mut text = wrapped("Shift of the outputs at least ", &sum, output.width());
    if let Some(inputs) = &timing.inputs {
        let has = first.map_or_else(String::new, |task| {
            format!("; the plan has {} µs after them", us(plan.inputs_shift_ns(task)))
        });
        let sum = inputs_sum(inputs) + &has + ".";
        text.push_str(&wrapped("Shift of the inputs at least ", &sum, output.width()));
    }
    text
}

fn inputs_sum(inputs: &InputsEstimate) -> String {
    let unknown = match inputs.unknown.len() {
        0 => String::new(),
        some => format!(" (of {some} not known)"),
    };
    format!(
        "{} µs before the frames by rule of thumb: jitter {}, shortest cycle {}{unknown}, earlier fetch {}, jitter \
         of the first task {}, margin {}",
        span_us(inputs.total()),
        span_us(inputs.jitter),
        span_us(inputs.min_cycle),
        span_us(inputs.ahead),
        span_us(inputs.task_jitter),
        span_us(inputs.margin),
    )
}

fn table(plan: &Plan, timing: &PlanTiming, output: &Output) -> String {
    let paint = output.paint();
    let headings = [
        "No",
        "Name",
        "Shift of",
        "SYNC0 (µs)",
        "against outputs shift",
        "after frames (µs)",
        "before next (µs)",
        "Verdict",
    ];
    let mut table = Table::new(&headings, paint);
    for device in &timing.devices {
        let Some(planned) = plan.device(device.device) else { continue };
        let margin = |rule: &RuleTiming| match (rule.verdict, rule.margin_ns) {
            (TimingVerdict::NotJudged, _) | (_, None) => "?".to_owned(),
            (TimingVerdict::Fail, Some(margin)) => paint.bad(&format!("{} !", us(margin))),
            (TimingVerdict::Pass, Some(margin)) => us(margin),
        };
        table.row([
            device.device.no().to_string(),
            planned.name.clone(),
            match device.reference {
                ShiftReference::Outputs => "outputs".to_owned(),
                ShiftReference::Inputs => "inputs".to_owned(),
            },
            us(plan.sync0_shift_ns(planned)),
            us(plan.sync0_after_outputs_shift_ns(planned)),
            margin(&device.after_frames),
            margin(&device.before_next),
            match device.verdict {
                TimingVerdict::Pass => paint.good("pass"),
                TimingVerdict::Fail => paint.bad("fail"),
                TimingVerdict::NotJudged => paint.warning("not judged"),
            },
        ]);
    }
    table.render()
}

/// What is wrong with a SubDevice, or not known of it, and what to do.
fn advice(plan: &Plan, device: &DeviceTiming, output: &Output) -> String {
    let paint = output.paint();
    let name = plan.device(device.device).map_or("", |planned| planned.name.as_str());
    let mut wrong = Vec::new();
    let missing = |rule: &RuleTiming| match (rule.verdict, rule.margin_ns, rule.frame) {
        (TimingVerdict::Fail, Some(margin), Some(frame)) => Some((us(margin), frame)),
        _ => None,
    };
    if let Some((margin, frame)) = missing(&device.after_frames) {
        wrong.push(format!(
            "SYNC0 comes before a late frame {frame} is there and its data are ready: margin {margin} µs"
        ));
    }
    if let Some((margin, frame)) = missing(&device.before_next) {
        wrong.push(format!(
            "its work is not over when an early frame {frame} of the next cycle comes: margin {margin} µs"
        ));
    }
    let sync0 = device.times.as_ref().map_or(Span::ZERO, |times| times.sync0_cycle);
    if let Some(least) = device.too_fast {
        wrong.push(format!("SYNC0 comes every {sync0}, it needs {least} (0x1C32:05, 0x1C33:05)"));
    }
    let mut text = String::new();
    if !wrong.is_empty() {
        text.push('\n');
        let what = format!("{name}: {}", wrong.join("; "));
        text.push_str(&wrapped(&format!("{}: ", paint.bad("error")), &what, output.width()));
    }
    let mut what = Vec::new();
    if let Some(shift) = device.own_shift_ns {
        what.push(format!(
            "a shift of its own mends it: `sync0_shift_ns = {shift}` in its `clock`"
        ));
    }
    if let Some(slower) = &device.slower {
        what.push(match &slower.task {
            Some(task) => format!("put it into the slower task `{task}` (`task = \"{task}\"`)"),
            None => format!(
                "put it into a slower task, of {} at least (`[[task]]`, `cycle_us = {}`)",
                slower.cycle,
                slower.cycle.as_nanos().div_ceil(1_000)
            ),
        });
    }
    if !what.is_empty() {
        text.push_str(&wrapped("  do: ", &what.join("; "), output.width()));
    }
    let lacks = [&device.after_frames, &device.before_next];
    if let Some(rule) = lacks.into_iter().find(|rule| rule.verdict == TimingVerdict::NotJudged) {
        text.push('\n');
        let what = format!("{name} is not judged: {}", rule.lacks);
        text.push_str(&wrapped(&format!("{}: ", paint.warning("unknown")), &what, output.width()));
        if device.times.is_some() {
            let todo = format!(
                "read 0x1C32 and 0x1C33 of it with `linesman sdo`, and write them as `sync_times` of `{name}` into \
                 the project"
            );
            text.push_str(&wrapped("  do: ", &todo, output.width()));
        }
    }
    text
}

/// The shifts of the network that mend all.
fn network_advice(timing: &PlanTiming, output: &Output) -> String {
    let mut text = String::new();
    let outputs = timing.outputs_shift.map(|shift| {
        let us = shift.as_nanos() / 1_000;
        format!("`outputs_shift_us = {us}` in `[network]` lets all pass that refer to it")
    });
    let inputs = timing.inputs_shift_ns.map(|shift| {
        format!(
            "`inputs_shift_us = {}` in `[network]` lets all pass that refer to it",
            shift / 1_000
        )
    });
    for advice in outputs.into_iter().chain(inputs) {
        text.push('\n');
        text.push_str(&wrapped("do: ", &advice, output.width()));
    }
    text
}

/// What is assumed of SubDevices, each sentence once with all it is true of.
fn assumed_of_devices(plan: &Plan, timing: &PlanTiming, output: &Output) -> String {
    let mut told: Vec<(&str, Vec<&str>)> = Vec::new();
    for device in &timing.devices {
        let name = plan.device(device.device).map_or("", |planned| planned.name.as_str());
        for sentence in &device.assumed {
            match told.iter_mut().find(|(known, _)| *known == sentence.as_str()) {
                Some((_, names)) => names.push(name),
                None => told.push((sentence, vec![name])),
            }
        }
    }
    let mut text = String::new();
    for (sentence, names) in told {
        text.push('\n');
        let (shown, more) = names.split_at(names.len().min(8));
        let more =
            if more.is_empty() { String::new() } else { format!(" and {} more", more.len()) };
        let what = format!("of {}{more}: {sentence}", shown.join(", "));
        text.push_str(&wrapped("assumed ", &what, output.width()));
    }
    text
}
