//! Wording of log entries, in the words that engineers know from the vendor's message window.
//!
//! Reference: the message texts of the sources (`facts` 3.2): state change aborted, abnormal state
//! change, communication interrupted and re-established, SDO abort, frames missed.

use linesman_config::inventory::label;
use linesman_config::plan::Plan;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::soe::{
    CommandProgress, CommandState, DATA_STATE, Idn, Message, Operation, elements_in_words,
};
use linesman_proto::port::Port;
use linesman_proto::register::{DlStatus, ErrorCounters};
use linesman_proto::time::{Instant, Span};

use super::{EntryKind, LogEntry, NetworkStatus, Severity};
use crate::event::Event;
use crate::supervisor::GroupPlace;

/// The entries for an event; `network_status` is that before it.
// Long for its number of events: one short arm each; longer wordings are methods of `EntryWords`.
#[allow(clippy::wildcard_enum_match_arm, reason = "answers are told by whoever asked")]
pub(super) fn of(
    at: Instant,
    event: &Event,
    plan: &Plan,
    network_status: &NetworkStatus,
) -> Vec<LogEntry> {
    let words = EntryWords { at, plan, network_status };
    match event {
        Event::AbnormalState { id, .. } => {
            words.states(event, Some(*id), Severity::Error, EntryKind::AbnormalState)
        }
        Event::Refused { id, .. }
        | Event::StepTimedOut { id, .. }
        | Event::StartUpFailed { id, .. }
        | Event::WrongModule { id, .. }
        | Event::CycleTooShort { id, .. }
        | Event::ModulesUnread { id, .. } => {
            words.states(event, Some(*id), Severity::Error, EntryKind::StateAborted)
        }
        Event::TargetReached { id, .. } => {
            words.states(event, Some(*id), Severity::Info, EntryKind::State)
        }
        Event::WrongDevice { id, .. }
        | Event::AliasShared { id, .. }
        | Event::WrongIdentification { id, .. }
        | Event::IdentificationShared { id, .. } => {
            words.states(event, Some(*id), Severity::Error, EntryKind::Identity)
        }
        Event::UnplannedDevice { .. } => {
            words.states(event, None, Severity::Warning, EntryKind::Identity)
        }
        Event::AllReached => vec![words.line(
            Severity::Info,
            EntryKind::State,
            match (words.plan.devices.len(), network_status.excused()) {
                (1, _) => "the SubDevice has reached its state".to_owned(),
                (count, 0) => format!("all {count} SubDevices have reached their states"),
                (count, absent) => format!(
                    "{} SubDevices have reached their states; {absent} of hot connect groups are not plugged in",
                    count.saturating_sub(absent)
                ),
            },
        )],
        Event::DeviceBack { id, restarted } => {
            let how = if *restarted { ", after a restart" } else { "" };
            let text = format!(" Communication re-established{how}");
            vec![words.about(*id, Severity::Info, EntryKind::Communication, text)]
        }
        Event::GroupJoined { .. } | Event::GroupLeft { .. } | Event::GroupMisplaced { .. } => {
            words.group(event)
        }
        Event::Responding { before, now } => {
            let severity = if now < before { Severity::Warning } else { Severity::Info };
            let text = match now.0 {
                1 => format!("1 SubDevice answers, {before} did before"),
                _ => format!("{now} SubDevices answer, {before} did before"),
            };
            vec![words.line(severity, EntryKind::Communication, text)]
        }
        Event::Ring { intact: true } => {
            vec![words.line(Severity::Info, EntryKind::Ring, "the ring is closed".into())]
        }
        Event::Ring { intact: false } => vec![words.line(
            Severity::Warning,
            EntryKind::Ring,
            "the ring is open: frames come back to the card that sent them".into(),
        )],
        Event::Links { id, status } => words.links(*id, *status),
        Event::PortOpened { id, port } => {
            let text = format!(": port {port} has its link again and was ordered to open");
            vec![words.about(*id, Severity::Info, EntryKind::Link, text)]
        }
        Event::Counters { id, counters } | Event::CountersCleared { id, counters } => {
            words.counters(*id, counters)
        }
        Event::ClockDifference { id, difference, window, apart } => {
            words.clock(*id, *difference, *window, *apart)
        }
        Event::WorkingCounter { .. }
        | Event::WorkingCounterGood { .. }
        | Event::CyclicFramesLost { .. }
        | Event::CyclicFramesBack { .. }
        | Event::OutputsWithheld { .. }
        | Event::OutputsResumed { .. } => words.task(event),
        Event::OutputsLocked => vec![words.line(
            Severity::Error,
            EntryKind::Host,
            "the line has lost its link: outputs are locked until the network is reset. Do: look at \
             the cable, then `linesman online SOCKET --reset`"
                .into(),
        )],
        Event::ResetBegun => vec![words.line(
            Severity::Info,
            EntryKind::Host,
            "the network is being reset: outputs are sent again".into(),
        )],
        Event::Emergency { id, emergency } => {
            let text = format!(
                ": emergency 0x{:04X} ({}), error register 0x{:02X}",
                emergency.code,
                emergency.class().text(),
                emergency.register.0
            );
            vec![words.about(*id, Severity::Error, EntryKind::Emergency, text)]
        }
        Event::Mailbox { id, kind: MailboxType::Soe, data } => {
            Message::parse(data).map_or_else(Vec::new, |message| words.drive(*id, &message))
        }
        Event::SdoUploaded { id, result: Err(error), .. }
        | Event::SdoDownloaded { id, result: Err(error), .. } => {
            vec![words.about(*id, Severity::Warning, EntryKind::Mailbox, format!(": CoE: {error}"))]
        }
        _ => Vec::new(),
    }
}

/// What the words of an entry need beside the event.
struct EntryWords<'a> {
    at: Instant,
    plan: &'a Plan,
    network_status: &'a NetworkStatus,
}

impl EntryWords<'_> {
    /// A hot connect group came, went, or is where it may not be.
    #[allow(clippy::wildcard_enum_match_arm, reason = "the others are of no group")]
    fn group(&self, event: &Event) -> Vec<LogEntry> {
        let at = |place: &Option<GroupPlace>| match place {
            None => "an unknown port".to_owned(),
            Some((id, port)) => format!("port {port} of {}", name(self.plan, *id)),
        };
        let group = |at: &usize| self.plan.groups.get(*at);
        let (group, severity, text) = match event {
            Event::GroupJoined { group: at_index, place } => {
                (group(at_index), Severity::Info, format!("joined at {}", at(place)))
            }
            Event::GroupLeft { group: at_index } => {
                let group = group(at_index);
                let optional = group.is_some_and(|group| group.optional);
                let severity = if optional { Severity::Info } else { Severity::Error };
                (group, severity, "left: its data are not valid any more".to_owned())
            }
            Event::GroupMisplaced { group: at_index, place } => {
                let text = format!(
                    "is plugged in at {}, where it may not be: it is kept in INIT. Do: plug it in at one of its \
                     `places`, or add that port to them",
                    at(place)
                );
                (group(at_index), Severity::Error, text)
            }
            _ => return Vec::new(),
        };
        let Some(group) = group else { return Vec::new() };
        let text = format!("hot connect group {} {text}", group.name);
        let entry = self.line(severity, EntryKind::Communication, text);
        vec![LogEntry { device: Some(group.first()), ..entry }]
    }

    /// An entry about a SubDevice.
    fn about(&self, id: DeviceId, severity: Severity, kind: EntryKind, text: String) -> LogEntry {
        let text = format!("{}{text}", name(self.plan, id));
        LogEntry { at: self.at, severity, kind, device: Some(id), text }
    }

    /// An entry about the network.
    fn line(&self, severity: Severity, kind: EntryKind, text: String) -> LogEntry {
        LogEntry { at: self.at, severity, kind, device: None, text }
    }

    /// What [`Event::state_lines`] has words for.
    fn states(
        &self,
        event: &Event,
        device: Option<DeviceId>,
        severity: Severity,
        kind: EntryKind,
    ) -> Vec<LogEntry> {
        let lines = event.state_lines(|id| name(self.plan, id));
        let entry = |text| LogEntry { at: self.at, severity, kind, device, text };
        lines.into_iter().map(entry).collect()
    }

    fn links(&self, id: DeviceId, status: DlStatus) -> Vec<LogEntry> {
        let Some(before) = self.network_status.device(id).and_then(super::WatchedDevice::links)
        else {
            return Vec::new();
        };
        let change = |port| {
            let (then, now) = (before.port_state(port), status.port_state(port));
            let word = match (then.communication, now.communication) {
                (true, false) => "lost its neighbour",
                (false, true) => "has a neighbour",
                (true, true) | (false, false) => return None,
            };
            let severity = if now.communication { Severity::Info } else { Severity::Warning };
            Some(self.about(id, severity, EntryKind::Link, format!(": port {port} {word}")))
        };
        Port::ALL.into_iter().filter_map(change).collect()
    }

    fn counters(&self, id: DeviceId, counters: &ErrorCounters) -> Vec<LogEntry> {
        let rises = self.network_status.counters(id).map(|known| known.rises(counters));
        let rises = rises.unwrap_or_default();
        let texts = rises.iter().map(|(counter, rise)| format!("{counter} +{rise}"));
        let texts: Vec<_> = texts.collect();
        if texts.is_empty() {
            return Vec::new();
        }
        let text = format!(": error counters rose: {}", texts.join("; "));
        // Whoever only saw marks of another one has no trouble of its own.
        let is_own = rises.iter().any(|(counter, _)| counter.counts_own());
        let severity = if is_own { Severity::Warning } else { Severity::Info };
        vec![self.about(id, severity, EntryKind::Counter, text)]
    }

    fn clock(&self, id: DeviceId, difference: Span, window: Span, apart: bool) -> Vec<LogEntry> {
        let before =
            self.network_status.device(id).is_some_and(super::WatchedDevice::is_clock_apart);
        let (severity, how) = match (before, apart) {
            (false, true) => (Severity::Warning, "has left the sync window"),
            (true, false) => (Severity::Info, "is within the sync window again"),
            (false, false) | (true, true) => return Vec::new(),
        };
        let text =
            format!(": its clock {how}: {difference} off the reference clock, {window} allowed");
        vec![self.about(id, severity, EntryKind::Clock, text)]
    }

    /// Notifications and emergencies of a drive. Answers are told by whoever asked.
    fn drive(&self, id: DeviceId, message: &Message<'_>) -> Vec<LogEntry> {
        let drive = message.drive;
        let bytes: Vec<String> = message.data.iter().map(|byte| format!("{byte:02X}")).collect();
        let data = bytes.join(" ");
        let (severity, kind, text) = match message.operation {
            Operation::Emergency => {
                let text = format!(": SoE: emergency of drive {drive}: {data}");
                (Severity::Error, EntryKind::Emergency, text)
            }
            Operation::Notification => {
                let (idn, of) = (Idn(message.number), format!(": SoE: drive {drive} notifies"));
                let state = CommandState::parse(message.data);
                match state.filter(|_| message.elements == DATA_STATE).map(CommandState::progress) {
                    Some(progress) => {
                        let severity = match progress {
                            CommandProgress::Failed => Severity::Warning,
                            CommandProgress::NotSet
                            | CommandProgress::Set
                            | CommandProgress::Running
                            | CommandProgress::Interrupted
                            | CommandProgress::Done => Severity::Info,
                        };
                        let text = format!("{of}: procedure command {idn}: {}", progress.text());
                        (severity, EntryKind::Mailbox, text)
                    }
                    None => {
                        let elements = elements_in_words(message.elements);
                        let text = format!("{of}: {elements} of {idn}: {data}");
                        (Severity::Info, EntryKind::Mailbox, text)
                    }
                }
            }
            Operation::ReadRequest
            | Operation::ReadResponse
            | Operation::WriteRequest
            | Operation::WriteResponse
            | Operation::Reserved(_) => return Vec::new(),
        };
        vec![self.about(id, severity, kind, text)]
    }

    /// Frames, working counters and outputs of a task.
    #[allow(clippy::wildcard_enum_match_arm, reason = "the others are not of a task")]
    fn task(&self, event: &Event) -> Vec<LogEntry> {
        match event {
            Event::WorkingCounter { task, frame, datagram, expected, received } => vec![self.line(
                Severity::Warning,
                EntryKind::WorkingCounter,
                format!(
                    "working counter of {}, frame {frame}, datagram {datagram}: {received} received and {expected} expected",
                    named(self.plan, *task)
                ),
            )],
            Event::WorkingCounterGood { task, frame, datagram } => vec![self.line(
                Severity::Info,
                EntryKind::WorkingCounter,
                format!(
                    "working counter of {}, frame {frame}, datagram {datagram} is right again",
                    named(self.plan, *task)
                ),
            )],
            Event::CyclicFramesLost { task } => vec![self.line(
                Severity::Error,
                EntryKind::Frames,
                format!("frames of {} do not come back", named(self.plan, *task)),
            )],
            Event::CyclicFramesBack { task, lost } => vec![self.line(
                Severity::Info,
                EntryKind::Frames,
                format!("frames of {} come back; missed {lost} times", named(self.plan, *task)),
            )],
            Event::OutputsWithheld { task } => vec![self.line(
                Severity::Error,
                EntryKind::Host,
                format!(
                    "the application is late: outputs of {} are withheld, so that watchdogs can expire",
                    named(self.plan, *task)
                ),
            )],
            Event::OutputsResumed { task } => vec![self.line(
                Severity::Info,
                EntryKind::Host,
                format!("the application is back: outputs of {} are sent again", named(self.plan, *task)),
            )],
            _ => Vec::new(),
        }
    }
}

/// The SubDevices that stopped answering together, in runs of neighbours.
pub(super) fn lost(at: Instant, lost: &[DeviceId], plan: &Plan) -> Vec<LogEntry> {
    let mut entries: Vec<LogEntry> = Vec::new();
    for run in lost.chunk_by(|one, next| next.index() == one.index() + 1) {
        let (Some(first), Some(last)) = (run.first(), run.last()) else { continue };
        let who = match run.len() {
            1 => name(plan, *first),
            _ => format!("{} - {}", name(plan, *first), name(plan, *last)),
        };
        entries.push(LogEntry {
            at,
            severity: Severity::Error,
            kind: EntryKind::Communication,
            device: Some(*first),
            text: format!("{who} Communication interrupted"),
        });
    }
    entries
}

/// A card's carrier.
pub(super) fn carrier(at: Instant, card: Path, carrier: bool) -> LogEntry {
    let (severity, word) = match carrier {
        true => (Severity::Info, "has a link again"),
        false => (Severity::Error, "has lost its link"),
    };
    let text = format!("card {card} {word}");
    LogEntry { at, severity, kind: EntryKind::Host, device: None, text }
}

/// `task 'motion'`.
fn named(plan: &Plan, task: usize) -> String {
    match plan.tasks.get(task).map(|task| task.name.as_str()) {
        Some(name) if !name.is_empty() => format!("task '{name}'"),
        Some(_) | None => format!("task {}", task + 1),
    }
}

/// `'Term 5 (EL3154)' (1005)`.
fn name(plan: &Plan, id: DeviceId) -> String {
    let Some(device) = plan.device(id) else { return label(id, "", "") };
    let label = label(id, &device.name, &device.type_name);
    format!("'{label}' ({:04x})", device.station.0)
}
