//! Time line: what happened on a line, in order of time.

use linesman_diagnosis::report::{Diagnosis, FindingReport, Number, PlaceReport};
use serde::{Deserialize, Serialize};

use crate::dialogue::{TransferOutcome, TransferReport};
use crate::network::report::CaptureReport;
use crate::network::states::{StateEvent, code_name};

/// Name and version of the format.
pub const SCHEMA: &str = "linesman.capture-timeline/1";

/// Events in order of time.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TimelineReport {
    /// `linesman.capture-timeline/1`.
    pub schema: String,
    /// Name and version of the program.
    pub tool: String,
    /// The file.
    pub source: String,
    /// When the first frame was recorded, RFC 3339; `null` when no clock says.
    pub start: Option<String>,
    /// From the first frame to the last.
    pub lasts_ns: Number,
    /// The events.
    pub events: Vec<TimelineEvent>,
}

/// Something that happened.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TimelineEvent {
    /// When it began.
    pub at_ns: Number,
    /// When it was over; `null` for a moment, and for what was not over.
    pub to_ns: Option<Number>,
    /// The frame that shows it.
    pub frame: Option<Number>,
    /// Its kind.
    pub kind: TimelineEventKind,
    /// Number of the SubDevice; `null` for the network, and where it is not known.
    pub no: Option<u32>,
    /// Place of a finding.
    pub place: Option<PlaceReport>,
    /// True if it is trouble.
    pub trouble: bool,
    /// The event in words.
    pub text: String,
}

/// Kinds of events.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TimelineEventKind {
    /// A state was asked for.
    StateAsked,
    /// A SubDevice was read in another state, or with another AL status code.
    State,
    /// A finding of the diagnosis.
    Finding,
    /// A working counter was too low.
    WorkingCounter,
    /// A mailbox transfer.
    Mailbox,
    /// An error counter was read higher than before, for the last time.
    Counter,
    /// Process data came for the first time.
    Cyclic,
    /// No frame came.
    Gap,
}

impl TimelineEventKind {
    /// As a word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::StateAsked => "asked",
            Self::State => "state",
            Self::Finding => "finding",
            Self::WorkingCounter => "WKC",
            Self::Mailbox => "mailbox",
            Self::Counter => "counter",
            Self::Cyclic => "cyclic",
            Self::Gap => "gap",
        }
    }
}

/// The time line of a capture and its diagnosis.
#[must_use]
pub fn timeline(capture: &CaptureReport, diagnosis: &Diagnosis) -> TimelineReport {
    let mut events = Vec::new();
    states(capture, &mut events);
    transfers(capture, &mut events);
    working_counters(capture, &mut events);
    counters(capture, &mut events);
    for gap in &capture.timing.gaps {
        let text = "no frame was recorded".to_owned();
        let event = event(gap.from_ns, TimelineEventKind::Gap, None, text);
        events.push(TimelineEvent { to_ns: Some(gap.to_ns), trouble: true, ..event });
    }
    diagnosis.findings.iter().for_each(|finding| add_finding(finding, &mut events));
    events.sort_by_key(|event| (event.at_ns, event.kind));
    TimelineReport {
        schema: SCHEMA.to_owned(),
        tool: capture.tool.clone(),
        source: capture.source.clone(),
        start: capture.start.clone(),
        lasts_ns: capture.recording.lasts_ns,
        events,
    }
}

const fn event(
    at_ns: Number,
    kind: TimelineEventKind,
    no: Option<u32>,
    text: String,
) -> TimelineEvent {
    let (to_ns, frame, place, trouble) = (None, None, None, false);
    TimelineEvent { at_ns, to_ns, frame, kind, no, place, trouble, text }
}

fn states(capture: &CaptureReport, events: &mut Vec<TimelineEvent>) {
    for one in &capture.states {
        let state = one.state.clone().unwrap_or_default();
        let (kind, text, trouble) = match (one.what, one.wkc) {
            (StateEvent::Asked, None) => {
                (TimelineEventKind::StateAsked, format!("{state} asked, did not come back"), true)
            }
            (StateEvent::Asked, Some(0)) => {
                (TimelineEventKind::StateAsked, format!("{state} asked, nobody has taken it"), true)
            }
            (StateEvent::Asked, Some(_)) => {
                let also = if one.error { ", error acknowledged" } else { "" };
                (TimelineEventKind::StateAsked, format!("{state} asked{also}"), false)
            }
            (StateEvent::Read, _) => {
                let also = if one.error { " with error" } else { "" };
                (TimelineEventKind::State, format!("{state}{also}"), one.error)
            }
            (StateEvent::Code, _) => {
                let (code, name) = (one.value, code_name(one.value));
                (TimelineEventKind::State, format!("AL status code 0x{code:04X} {name}"), code != 0)
            }
        };
        let event = event(one.at_ns, kind, one.no, text);
        events.push(TimelineEvent { frame: Some(one.frame), trouble, ..event });
    }
}

/// Transfers of one SubDevice that follow each other without trouble are told together.
fn transfers(capture: &CaptureReport, events: &mut Vec<TimelineEvent>) {
    let is_good =
        |one: &TransferReport| matches!(one.outcome, TransferOutcome::Done | TransferOutcome::Told);
    let alike = |one: &TransferReport, other: &TransferReport| {
        is_good(one) && is_good(other) && (one.no, &one.protocol) == (other.no, &other.protocol)
    };
    for group in capture.transfers.chunk_by(alike) {
        let [first, ..] = group else { continue };
        let Some(at) = first.asked_ns.or(first.answered_ns) else { continue };
        let name = first.protocol.name();
        let text = match group.len() {
            1 => format!("{name} {}{}: {}", first.what, object(first), first.outcome.name()),
            count => format!("{name}: {count} transfers"),
        };
        let to_ns = group.iter().filter_map(|one| one.answered_ns).max();
        let frame = first.asked_frame.or(first.answered_frame);
        let event = event(at, TimelineEventKind::Mailbox, first.no, text);
        events.push(TimelineEvent { to_ns, frame, trouble: !is_good(first), ..event });
    }
}

fn object(one: &TransferReport) -> String {
    match (one.index, one.subindex) {
        (Some(index), Some(subindex)) => format!(" 0x{index:04X}:{subindex:02X}"),
        (_, _) => String::new(),
    }
}

fn working_counters(capture: &CaptureReport, events: &mut Vec<TimelineEvent>) {
    let mut told = Vec::new();
    for datagram in capture.cyclic.iter().flat_map(|frame| &frame.datagrams) {
        let Some(logical) = datagram.logical else { continue };
        let name = format!("{} 0x{logical:08X}, {} bytes", datagram.command, datagram.len);
        // One datagram may be in several kinds of frames.
        if told.contains(&name) {
            continue;
        }
        for miss in &datagram.misses {
            let text = format!(
                "{name}: {} instead of {}, {} times",
                miss.lowest, miss.expected, miss.count.0
            );
            let event = event(miss.from_ns, TimelineEventKind::WorkingCounter, None, text);
            let (to_ns, frame) = (miss.to_ns, miss.frame);
            events.push(TimelineEvent { to_ns, frame, trouble: true, ..event });
        }
        told.push(name);
    }
    if let Some(first) = capture.first_process_data_ns {
        let text = "process data for the first time".to_owned();
        events.push(event(first, TimelineEventKind::Cyclic, None, text));
    }
}

fn counters(capture: &CaptureReport, events: &mut Vec<TimelineEvent>) {
    for device in &capture.counters {
        for one in &device.counters {
            let Some(at) = one.last_rise_ns else { continue };
            let port = one.port.as_ref().map_or_else(String::new, |port| format!(", port {port}"));
            let text = format!("{}{port}: rose by {} so far", one.name, one.rose.0);
            let event = event(at, TimelineEventKind::Counter, Some(device.no), text);
            events.push(TimelineEvent { trouble: true, ..event });
        }
    }
}

fn add_finding(finding: &FindingReport, events: &mut Vec<TimelineEvent>) {
    let text = format!("{} {}, {}", finding.code, finding.name, finding.cause);
    let no = match &finding.place {
        PlaceReport::Device { no, .. } => Some(*no),
        PlaceReport::Link { .. } | PlaceReport::Network { .. } | PlaceReport::Host => None,
    };
    let event = event(finding.opened_ns, TimelineEventKind::Finding, no, text);
    let (to_ns, place) = (finding.closed_ns, Some(finding.place.clone()));
    events.push(TimelineEvent { to_ns, place, trouble: true, ..event });
    finding.consequences.iter().for_each(|one| add_finding(one, events));
}
