//! Reporter of a run while it lasts, and at its end.

use std::collections::HashMap;
use std::sync::Arc;

use linesman_config::plan::TimeSource;
use linesman_diagnosis::report::{Diagnosis, PlaceReport, Severity, Verdict};
use linesman_diagnosis::{Event as FindingEvent, EventKind};
use linesman_link::unix_time::UnixTime;
use linesman_maindevice::watch::{EntryKind, LogEntry, Severity as EntrySeverity};
use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::event_log::{EventLogWriter, LoggedFinding, WriterReport};
use linesman_runtime::online::OnlineState;
use linesman_runtime::part::PartFailure;
use linesman_runtime::run::Note;
use linesman_runtime::run::bring_up::BringUpReport;
use linesman_runtime::run::report::{Counts, RunReport};
use linesman_runtime::system_log::SystemLog;

use crate::command::diagnose::follow::{Follower, event_word};
use crate::failure::Failure;
use crate::output::{Output, Paint, Table};
use crate::text::finding::{Writer, percent, tally};
use crate::text::group::group_time;
use crate::text::names::Names;
use crate::text::quantity::{count, grouped, time};

/// Tells what happens.
pub(super) struct RunReporter {
    json: bool,
    /// The line.
    on: String,
    /// Prefix of each line for people: the line's name, where there are several.
    prefix: String,
    names: Names,
    follower: Follower,
    online: OnlineState,
    /// When the run began, by the wall clock.
    began: UnixTime,
    logs: Logs,
    /// Whose error counters people were told of.
    counted: HashMap<DeviceId, Counted>,
    /// What was said to have failed, each once.
    failures: Vec<String>,
}

/// Rising error counters of a SubDevice are told no more often than this: under steady noise they rise with every reading.
const COUNTERS_EVERY: Span = Span::s(10);

/// What people were told of the error counters of a SubDevice.
#[derive(Default)]
struct Counted {
    /// Nothing more before that.
    until: Option<Instant>,
    /// How often they rose and it was not told.
    left_out: u32,
}

/// Where what happens is kept.
#[derive(Default)]
pub(super) struct Logs {
    /// A file of its own.
    pub(super) file: Option<EventLogWriter>,
    /// The log of the system.
    pub(super) system: Option<SystemLog>,
    /// Kinds of which nothing is kept, nor told.
    pub(super) without: Vec<EntryKind>,
}

impl RunReporter {
    pub(super) fn new(
        json: bool,
        on: &str,
        several: bool,
        began: UnixTime,
        logs: Logs,
        online: OnlineState,
    ) -> Self {
        let prefix = if several { format!("{on}: ") } else { String::new() };
        let follower = Follower::with_prefix(prefix.clone());
        let (counted, failures) = (HashMap::new(), Vec::new());
        let (on, names) = (on.to_owned(), Names::default());
        Self { json, on, prefix, names, follower, online, began, logs, counted, failures }
    }

    /// The line, as it was named.
    pub(super) fn on(&self) -> &str {
        &self.on
    }

    /// What the SubDevices are called.
    pub(super) const fn names(&self) -> &Names {
        &self.names
    }

    /// Whether people are not to be told.
    pub(super) fn is_json(&self) -> bool {
        self.json
    }

    /// A line for people.
    pub(super) fn line(&self, text: &str, output: &mut Output) {
        if !self.json {
            output.line(&format!("{}{text}", self.prefix));
        }
    }

    /// Something that happened.
    pub(super) fn note(&mut self, note: &Note, output: &mut Output) {
        match note {
            Note::Scanned(_) => {}
            Note::Planned(plan) => {
                self.online.begin(Arc::clone(plan));
                self.names = Names::new(
                    plan.devices.iter().map(|one| (one.name.clone(), one.type_name.clone())),
                );
                for task in &plan.tasks {
                    let frames = count(task.frames.len() as u64, "frame");
                    let cycle = time(task.cycle.as_nanos());
                    self.line(&format!("Task {}: {frames} every {cycle}.", task.name), output);
                }
            }
            Note::Event(at, event) => {
                self.follower.tell_until(*at, &self.names, output);
                let entries = self.online.event(*at, event);
                self.entries(entries, output);
            }
            Note::Host(observation) => {
                let entries = self.online.host(observation);
                self.entries(entries, output);
            }
            Note::Finding(event) => self.finding(event, output),
            Note::Missed(at, left_out) => self.missed(*at, *left_out, output),
            Note::Failed(failure) => self.failed(failure, output),
            Note::AwaitsTime(at, until, source) => {
                let whose = match source {
                    TimeSource::UpperNetwork => "the upper network",
                    TimeSource::Program
                    | TimeSource::ReferenceClock
                    | TimeSource::Host
                    | TimeSource::Device(_) => "the program",
                };
                let most = time(until.since(*at).as_nanos());
                let text = format!("waits for the time of {whose} to begin in it, {most} at most");
                self.said(*at, &text, output);
            }
            Note::Leaving(at) => self.said(*at, "stopping: outputs to zero", output),
        }
    }

    /// The diagnosis does not keep up.
    fn missed(&mut self, at: Instant, left_out: u64, output: &Output) {
        let text =
            format!("the diagnosis does not keep up: {} left out so far", count(left_out, "frame"));
        self.keep(of_host(at, &text), None);
        output.warn(&format!("{text}; its verdict says so"));
    }

    /// A part of this program has failed.
    pub(super) fn failed(&mut self, failure: &PartFailure, output: &Output) {
        self.complain(&failure.to_string(), output);
    }

    /// Looks whether the logs are still written, and says at once if they are not.
    pub(super) fn look_at_logs(&mut self, output: &Output) {
        if let Some(why) = self.logs.file.as_ref().and_then(|log| log.report().failure) {
            self.complain(&why, output);
        }
        if self.logs.system.as_ref().is_some_and(|log| log.lost().is_some()) {
            let text = "--system-log: journald does not take what happens. Do: look at `systemctl status \
                        systemd-journald`, or keep a log of its own: `--log FILE`";
            self.complain(text, output);
        }
    }

    /// Says once that something has failed.
    pub(super) fn complain(&mut self, why: &str, output: &Output) {
        if !self.failures.iter().any(|said| said == why) {
            self.failures.push(why.to_owned());
            output.fail(&Failure::from_text(why));
        }
    }

    /// Nothing has come for a while, or nothing more will: what was waited with is told.
    pub(super) fn flush(&mut self, output: &mut Output) {
        self.follower.flush(&self.names, output);
        let entries = self.online.flush();
        self.entries(entries, output);
    }

    /// Something happened to a finding: the logs have it at once, people a little later, when it is neither
    /// explained by another one nor taken back.
    fn finding(&mut self, event: &FindingEvent, output: &mut Output) {
        if self.logs.without.contains(&EntryKind::Finding) {
            return;
        }
        let (entry, logged) = logged(event, &self.names);
        self.keep(entry, Some(logged));
        if !self.json && event.finding.severity != Severity::Info {
            self.follower.tell(event.clone(), &self.names, output);
        }
    }

    fn entries(&mut self, entries: Vec<LogEntry>, output: &mut Output) {
        for entry in entries {
            if !self.logs.without.contains(&entry.kind) {
                self.tell(&entry, output);
                self.keep(entry, None);
            }
        }
    }

    /// Hands an entry to the logs.
    fn keep(&mut self, entry: LogEntry, finding: Option<LoggedFinding>) {
        let name = entry.device.map(|id| self.names.plain(id.no()).to_owned());
        if let Some(log) = &mut self.logs.system {
            log.write(&entry, name.as_deref());
        }
        if let Some(log) = &self.logs.file {
            let at = self.began + entry.at.since(Instant::ZERO);
            log.write(at, entry, name.as_deref(), finding);
        }
    }

    /// Tells people of an entry, unless it says too little to stand between the others; the log has each.
    fn tell(&mut self, entry: &LogEntry, output: &mut Output) {
        let Some(id) = entry.device else { return self.said(entry.at, &entry.text, output) };
        match entry.kind {
            // That each is there is told once, of all.
            EntryKind::State => {}
            EntryKind::Counter => {
                // Counters that pass on what another one has counted.
                if entry.severity == EntrySeverity::Info {
                    return;
                }
                let told = self.counted.entry(id).or_default();
                if told.until.is_some_and(|until| entry.at < until) {
                    told.left_out += 1;
                    return;
                }
                let left_out = std::mem::take(&mut told.left_out);
                told.until = Some(entry.at + COUNTERS_EVERY);
                let more = match left_out {
                    0 => String::new(),
                    left_out => format!(" (and {left_out} times since it was told last)"),
                };
                self.said(entry.at, &format!("{}{more}", entry.text), output);
            }
            EntryKind::AbnormalState
            | EntryKind::StateAborted
            | EntryKind::Communication
            | EntryKind::Identity
            | EntryKind::Link
            | EntryKind::WorkingCounter
            | EntryKind::Frames
            | EntryKind::Ring
            | EntryKind::Emergency
            | EntryKind::Mailbox
            | EntryKind::Host
            | EntryKind::Clock
            | EntryKind::Finding => self.said(entry.at, &entry.text, output),
        }
    }

    /// Ends the log; gives how the writing went.
    pub(super) fn finish(&mut self, ended: Span) -> Option<WriterReport> {
        let log = self.logs.file.take()?;
        Some(log.finish(self.began + ended))
    }

    /// How many entries the system's log did not take, and why.
    pub(super) fn lost(&self) -> Option<(u64, String)> {
        let (lost, why) = self.logs.system.as_ref()?.lost()?;
        Some((lost, why.to_string()))
    }

    fn said(&self, at: Instant, words: &str, output: &mut Output) {
        self.line(&format!("{:>12}  {words}", time(at.as_nanos())), output);
    }
}

/// An entry of the log on this computer.
fn of_host(at: Instant, text: &str) -> LogEntry {
    let (severity, kind) = (EntrySeverity::Warning, EntryKind::Host);
    LogEntry { at, severity, kind, device: None, text: text.to_owned() }
}

/// An entry of the log on a finding.
fn logged(event: &FindingEvent, names: &Names) -> (LogEntry, LoggedFinding) {
    let FindingEvent { at, kind, finding, follows_from } = event;
    let (place, cause) = (names.place(&finding.place), finding.cause);
    let what = event_word(*kind);
    let behind = follows_from.as_ref().map(|id| format!(", follows from {id}")).unwrap_or_default();
    let text = format!(
        "{} {} {} {what}: {place}, {cause} ({}){behind}",
        finding.id,
        finding.code,
        finding.name,
        percent(finding.confidence)
    );
    let severity = match (kind, finding.severity) {
        // That it is over is no error.
        (EventKind::Closed | EventKind::Withdrawn, _) => EntrySeverity::Info,
        (EventKind::Opened | EventKind::Confirmed, Severity::Info) => EntrySeverity::Info,
        (EventKind::Opened | EventKind::Confirmed, Severity::Warning) => EntrySeverity::Warning,
        (EventKind::Opened | EventKind::Confirmed, Severity::Error) => EntrySeverity::Error,
    };
    let device = device(&finding.place);
    let entry = LogEntry { at: *at, severity, kind: EntryKind::Finding, device, text };
    let logged = LoggedFinding {
        id: finding.id.clone(),
        event: what.to_owned(),
        code: finding.code.clone(),
        name: finding.name.clone(),
        place,
        cause: cause.to_string(),
        follows_from: follows_from.clone(),
    };
    (entry, logged)
}

/// Whom a finding concerns; of a link the SubDevice behind it.
fn device(place: &PlaceReport) -> Option<DeviceId> {
    match place {
        PlaceReport::Device { no, .. } => DeviceId::from_no(*no),
        PlaceReport::Link { a, b, .. } => {
            b.and_then(|b| DeviceId::from_no(b.no)).or(DeviceId::from_no(a.no))
        }
        PlaceReport::Network { .. } | PlaceReport::Host => None,
    }
}

/// What was wrong with the line, each in a few lines.
pub(super) fn findings(diagnosis: &Diagnosis, names: &Names, output: &Output) -> String {
    let paint = output.paint();
    let (verdict, tally) = (diagnosis.verdict, tally(&diagnosis.findings));
    let mut text = match (verdict, tally.is_empty()) {
        (Verdict::Healthy, true) => "\nNo findings.\n".to_owned(),
        (Verdict::Inconclusive, true) => {
            "\nNo findings, but too little was seen to call the line healthy.\n".to_owned()
        }
        (Verdict::Healthy | Verdict::Inconclusive | Verdict::Faulty, _) => {
            format!("\nFindings: {tally}.\n")
        }
    };
    let writer =
        Writer { names, paint, width: output.width(), timed: true, place: &diagnosis.source };
    for finding in &diagnosis.findings {
        text.push('\n');
        text.push_str(&writer.brief(finding));
    }
    if let Some(first) = diagnosis.findings.first() {
        let hint = format!("\n`linesman explain {}` says more of such a finding.\n", first.code);
        text.push_str(&paint.faint(&hint));
    }
    text
}

/// How it went.
pub(super) fn summary(report: &RunReport, paint: Paint) -> String {
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
    if let Some(bring_up) = &report.bring_up {
        text.push_str(&steps(bring_up, paint));
    }
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
    if let Some(group) = &report.group {
        text.push_str(&format!("{}\n", group_time(group)));
    }
    for not_taken in &report.not_taken {
        text.push_str(&format!("Not taken: {not_taken}\n"));
    }
    for refused in &host.refused {
        text.push_str(&format!("Not granted: {refused}\n"));
    }
    if let Some(gateway) = &report.gateway {
        text.push_str(&super::gateway::summary(gateway));
    }
    if let Some(ads) = &report.ads {
        text.push_str(&super::ads::summary(ads));
    }
    if let Some(ethernet) = &report.ethernet {
        text.push_str(&super::ethernet::summary(ethernet));
    }
    text
}

/// What bringing up took, step by step.
fn steps(bring_up: &BringUpReport, paint: Paint) -> String {
    let whole = bring_up.took_ns.map_or_else(
        || "Bringing up was not done".to_owned(),
        |took| format!("Bringing up took {}", time(took)),
    );
    let mut text = format!("{whole}; step by step:\n");
    let mut table = Table::new(&["  step", "took", ""], paint);
    for phase in &bring_up.network {
        table.row([format!("  {}", phase.phase), time(phase.took_ns), String::new()]);
    }
    // They are brought up side by side: the slowest counts.
    let several = bring_up.devices.len() > 1;
    for (phase, device, took) in bring_up.slowest() {
        let who = if several { format!("at most, {}", device.name) } else { String::new() };
        table.row([format!("  {phase}"), time(took), who]);
    }
    text.push_str(&table.render());
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
        (counts.untold, "events not told"),
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
