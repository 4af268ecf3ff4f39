//! What happened, in the words that engineers know from the vendor's message window.
//!
//! Reference: the message texts of the sources (`facts` 3.2): state change aborted, abnormal state
//! change, communication interrupted and re-established, SDO abort, frames missed.

use linesman_config::identity;
use linesman_config::plan::Plan;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::register::AlStatus;
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::Instant;

use super::{EntryKind, LogEntry, Severity, Watch};
use crate::event::Event;

/// The entries for an event; `watch` still stands as it was before it.
#[allow(clippy::wildcard_enum_match_arm, reason = "answers are told by whoever asked")]
pub(super) fn of(at: Instant, event: &Event, watch: &Watch) -> Vec<LogEntry> {
    let plan = &watch.plan;
    let about = |id: DeviceId, severity, kind, text: String| LogEntry {
        at,
        severity,
        kind,
        device: Some(id),
        text: format!("{}{text}", name(plan, id)),
    };
    let line = |severity, kind, text: String| LogEntry { at, severity, kind, device: None, text };
    match event {
        Event::AbnormalState { id, from, status, code } => {
            let reason = match *code {
                AlStatusCode::NO_ERROR => String::new(),
                code => format!(" with code 0x{:02x} ({})", code.value(), code.explain().name),
            };
            let text =
                format!(": abnormal state change (from '{from}' to '{}'){reason}", status.state());
            vec![about(*id, Severity::Error, EntryKind::AbnormalState, text)]
        }
        Event::TargetReached { id, state } => {
            vec![about(*id, Severity::Info, EntryKind::State, format!(" is in '{state}'"))]
        }
        Event::AllReached => vec![line(
            Severity::Info,
            EntryKind::State,
            format!("all {} SubDevices have reached their states", plan.devices.len()),
        )],
        Event::Refused { id, from, to, status, code } => {
            let details = failed(*from, *to, *status, Some(*code));
            [aborted(*to, *status), details]
                .map(|text| about(*id, Severity::Error, EntryKind::StateAborted, text))
                .into()
        }
        Event::StepTimedOut { id, from, to, status } => {
            let details = failed(*from, *to, *status, None);
            [aborted(*to, *status), details]
                .map(|text| about(*id, Severity::Error, EntryKind::StateAborted, text))
                .into()
        }
        Event::StartUpFailed { id, to, status, command, error } => {
            let what = match command.comment.as_str() {
                "" => String::new(),
                comment => format!(" ({comment})"),
            };
            let details = format!(": start-up command{what}: {error}");
            [aborted(*to, *status), details]
                .map(|text| about(*id, Severity::Error, EntryKind::StateAborted, text))
                .into()
        }
        Event::DeviceBack { id, restarted } => {
            let how = if *restarted { ", after a restart" } else { "" };
            let text = format!(" Communication re-established{how}");
            vec![about(*id, Severity::Info, EntryKind::Communication, text)]
        }
        Event::WrongDevice { id, mismatch, expected, found } => {
            let text = format!(
                ": another {mismatch}: expected {}, found {}",
                identity::text(expected),
                identity::text(found)
            );
            vec![about(*id, Severity::Error, EntryKind::Identity, text)]
        }
        Event::UnplannedDevice { position, found } => vec![line(
            Severity::Warning,
            EntryKind::Identity,
            format!(
                "a SubDevice that the plan does not have at position {position}: {}",
                identity::text(found)
            ),
        )],
        Event::Responding { before, now } => {
            let severity = if now < before { Severity::Warning } else { Severity::Info };
            let text = format!("{now} SubDevices answer, {before} did before");
            vec![line(severity, EntryKind::Communication, text)]
        }
        Event::Ring { intact: true } => {
            vec![line(Severity::Info, EntryKind::Ring, "the ring is closed".into())]
        }
        Event::Ring { intact: false } => vec![line(
            Severity::Warning,
            EntryKind::Ring,
            "the ring is open: frames come back to the card that sent them".into(),
        )],
        Event::Links { id, status } => {
            let Some(before) = watch.device(*id).and_then(super::WatchedDevice::links) else {
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
                Some(about(*id, severity, EntryKind::Link, format!(": port {port} {word}")))
            };
            Port::ALL.into_iter().filter_map(change).collect()
        }
        Event::Counters { id, counters } => {
            let rises = watch.device(*id).map_or_else(Vec::new, |device| device.rises(counters));
            let texts = rises.iter().map(|(counter, rise)| format!("{counter} +{rise}"));
            let texts: Vec<_> = texts.collect();
            if texts.is_empty() {
                return Vec::new();
            }
            let text = format!(": error counters rose: {}", texts.join("; "));
            vec![about(*id, Severity::Warning, EntryKind::Counter, text)]
        }
        Event::WorkingCounter { task, frame, datagram, expected, received } => vec![line(
            Severity::Warning,
            EntryKind::WorkingCounter,
            format!(
                "working counter of task {task}, frame {frame}, datagram {datagram}: {received} received and {expected} expected"
            ),
        )],
        Event::WorkingCounterGood { task, frame, datagram } => vec![line(
            Severity::Info,
            EntryKind::WorkingCounter,
            format!(
                "working counter of task {task}, frame {frame}, datagram {datagram} is right again"
            ),
        )],
        Event::CyclicFramesLost { task } => vec![line(
            Severity::Error,
            EntryKind::Frames,
            format!("frames of task {task} do not come back"),
        )],
        Event::CyclicFramesBack { task, lost } => vec![line(
            Severity::Info,
            EntryKind::Frames,
            format!("frames of task {task} come back; missed {lost} times"),
        )],
        Event::OutputsWithheld { task } => vec![line(
            Severity::Error,
            EntryKind::Host,
            format!(
                "the application is late: outputs of task {task} are withheld, so that watchdogs can expire"
            ),
        )],
        Event::OutputsResumed { task } => vec![line(
            Severity::Info,
            EntryKind::Host,
            format!("the application is back: outputs of task {task} are sent again"),
        )],
        Event::Emergency { id, emergency } => {
            let text = format!(
                ": emergency 0x{:04X} ({}), error register 0x{:02X}",
                emergency.code,
                emergency.class().text(),
                emergency.register.0
            );
            vec![about(*id, Severity::Error, EntryKind::Emergency, text)]
        }
        Event::SdoUploaded { id, result: Err(error), .. }
        | Event::SdoDownloaded { id, result: Err(error), .. } => {
            vec![about(*id, Severity::Warning, EntryKind::Mailbox, format!(": CoE: {error}"))]
        }
        _ => Vec::new(),
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

/// The window of the clocks.
pub(super) fn clocks(at: Instant, apart: bool) -> LogEntry {
    let (severity, text) = match apart {
        true => (Severity::Warning, "the clocks of the SubDevices have left the sync window"),
        false => (Severity::Info, "the clocks of the SubDevices are within the sync window"),
    };
    LogEntry { at, severity, kind: EntryKind::Clock, device: None, text: text.into() }
}

/// Where a SubDevice is left after a step that came to nothing.
fn aborted(to: AlState, status: AlStatus) -> String {
    format!(": state change aborted (requested '{to}', back to '{}').", status.state())
}

/// What was asked and what was read.
fn failed(
    from: Option<AlState>,
    to: AlState,
    status: AlStatus,
    code: Option<AlStatusCode>,
) -> String {
    let from = from.map_or_else(|| status.state().to_string(), |from| from.to_string());
    let code = match code {
        Some(code) => {
            format!(" AL Status Code '0x{:04x} - {}'", code.value(), code.explain().name)
        }
        None => " It did not answer in time, and gives no code.".into(),
    };
    format!(
        ": '{from} to {to}' failed! Error: 'check device state for {to}'. AL Status '0x{:04x}' read and \
         '0x{:04x}' expected.{code}",
        status.0,
        AlStatus::new(to).0
    )
}

/// `'Term 5 (EL3154)' (1005)`.
fn name(plan: &Plan, id: DeviceId) -> String {
    let Some(device) = plan.device(id) else { return format!("SubDevice {}", id.no()) };
    let label = match device.type_name.as_str() {
        "" => device.name.clone(),
        kind if device.name.contains(kind) => device.name.clone(),
        kind => format!("{} ({kind})", device.name),
    };
    format!("'{label}' ({:04x})", device.station.0)
}
