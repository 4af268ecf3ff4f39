//! What a run tells while it lasts, and at its end.

use linesman_diagnosis::report::Severity;
use linesman_maindevice::Event;
use linesman_proto::time::Instant;
use linesman_runtime::run::Note;
use linesman_runtime::run::report::{Counts, RunReport};

use crate::command::diagnose::follow::Follower;
use crate::output::Output;
use crate::text::event::words;
use crate::text::names::Names;
use crate::text::quantity::{count, grouped, time};

/// Tells what happens.
pub(super) struct Teller {
    json: bool,
    names: Names,
    follower: Follower,
    up: bool,
}

impl Teller {
    pub(super) fn new(json: bool) -> Self {
        Self { json, names: Names::default(), follower: Follower::new(false), up: false }
    }

    /// A line for people.
    pub(super) fn line(&self, text: &str, output: &mut Output) {
        if !self.json {
            output.line(text);
        }
    }

    /// Something that happened.
    pub(super) fn note(&mut self, note: &Note, output: &mut Output) {
        match note {
            Note::Scanned(_) => {}
            Note::Planned(plan) => {
                self.names = Names::new(plan.devices.iter().map(|device| device.name.clone()));
                for task in &plan.tasks {
                    let frames = count(task.frames.len() as u64, "frame");
                    let cycle = time(task.cycle.as_nanos());
                    self.line(&format!("Task {}: {frames} every {cycle}.", task.name), output);
                }
            }
            Note::Event(at, event) => self.event(*at, event, output),
            Note::Finding(event) if !self.json => {
                if event.finding.severity != Severity::Info {
                    self.follower.tell((**event).clone(), &self.names, output);
                }
            }
            Note::Finding(_) => {}
            Note::Leaving(at) => self.said(*at, "stopping: outputs to zero", output),
        }
    }

    fn event(&mut self, at: Instant, event: &Event, output: &mut Output) {
        let state = matches!(event, Event::DeviceState { status, .. } if !status.error());
        // Until all are up each would be told of four times.
        if state && !self.up {
            return;
        }
        self.up |= matches!(event, Event::AllReached);
        if let Some(words) = words(event, &self.names) {
            self.said(at, &words, output);
        }
    }

    fn said(&self, at: Instant, words: &str, output: &mut Output) {
        self.line(&format!("{:>12}  {words}", time(at.as_nanos())), output);
    }
}

/// How it went.
pub(super) fn summary(report: &RunReport) -> String {
    let RunReport { counts, lateness, host, .. } = report;
    let mut text = format!("\n{} ran for {}: ", report.on, time(report.time_ns));
    text.push_str(&match report.reached_ns {
        Some(reached) => format!("up after {}, ", time(reached)),
        None => "not all SubDevices came up, ".to_owned(),
    });
    text.push_str(&count(counts.cycles, "cycle"));
    if counts.cycles_missed > 0 {
        text.push_str(&format!(
            " and {} left out because the host was late",
            grouped(counts.cycles_missed)
        ));
    }
    text.push_str(".\n");
    text.push_str(&frames(counts));
    let bad = report.devices.iter().filter(|device| !device.valid).count();
    text.push_str(&match bad {
        0 => format!(
            "Process data of all {} valid at the end.\n",
            count(report.devices.len() as u64, "SubDevice")
        ),
        bad => {
            format!("Process data of {} not valid at the end.\n", count(bad as u64, "SubDevice"))
        }
    });
    if lateness.frames > 0 && lateness.max_ns > 0 {
        let at = |nanos| time(nanos);
        text.push_str(&format!(
            "Cycles began {} late (99 %: {}, 99.9 %: {}, at most {}).\n",
            at(lateness.p50_ns),
            at(lateness.p99_ns),
            at(lateness.p999_ns),
            at(lateness.max_ns)
        ));
    }
    for refused in &host.refused {
        text.push_str(&format!("Not granted: {refused}\n"));
    }
    text
}

/// What was counted; what is zero is not told.
fn frames(counts: &Counts) -> String {
    let mut parts = vec![format!("{} sent", count(counts.frames_sent, "frame"))];
    let told = [
        (counts.frames_lost, "lost"),
        (counts.frames_late, "of them late"),
        (counts.frames_truncated, "truncated"),
        (counts.frames_duplicate, "doubled"),
        (counts.frames_stray, "stray"),
        (counts.frames_foreign, "from others"),
        (counts.working_counter_errors, "wrong working counters"),
        (counts.cyclic_unsent, "not sent"),
        (counts.deadlines_missed, "cycles without new outputs"),
        (counts.undiagnosed, "not seen by the diagnosis"),
    ];
    for (number, what) in told {
        if number > 0 {
            parts.push(format!("{} {what}", grouped(number)));
        }
    }
    if parts.len() == 1 {
        parts.push("none lost, none wrong".to_owned());
    }
    format!("{}.\n", parts.join(", "))
}
