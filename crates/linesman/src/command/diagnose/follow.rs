//! Findings as they happen.

use linesman_diagnosis::report::{Diagnosis, FindingReport, Number};
use linesman_diagnosis::{Event, EventKind};
use linesman_proto::time::Instant;
use serde::Serialize;

use crate::output::Output;
use crate::text::names::Names;
use crate::text::quantity::time;

/// Something that happened, one line of `--follow --json`.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EventReport<'a> {
    /// `linesman.event/1`.
    schema: &'a str,
    /// When, in ns since the start of the run.
    at_ns: Number,
    /// What.
    event: EventName,
    /// The finding, without what follows from it; `null` at the end.
    finding: Option<FindingReport>,
    /// The whole answer, at the end.
    diagnosis: Option<&'a Diagnosis>,
}

/// What happened.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum EventName {
    /// A finding is new.
    Opened,
    /// It is certain now.
    Confirmed,
    /// It is over.
    Closed,
    /// Later evidence says that it never was.
    Withdrawn,
    /// The input ended; the diagnosis is with it.
    Ended,
}

impl EventName {
    const fn of(kind: EventKind) -> Self {
        match kind {
            EventKind::Opened => Self::Opened,
            EventKind::Confirmed => Self::Confirmed,
            EventKind::Closed => Self::Closed,
            EventKind::Withdrawn => Self::Withdrawn,
        }
    }

    const fn word(self) -> &'static str {
        match self {
            Self::Opened => "opened",
            Self::Confirmed => "confirmed",
            Self::Closed => "closed",
            Self::Withdrawn => "withdrawn",
            Self::Ended => "ended",
        }
    }
}

/// Tells what happens to findings.
pub(crate) struct Follower {
    json: bool,
}

impl Follower {
    /// One that writes text or JSON lines.
    pub(crate) const fn new(json: bool) -> Self {
        Self { json }
    }

    /// Tells what happened to a finding.
    pub(crate) fn tell(&self, event: Event, names: &Names, output: &mut Output) {
        let Event { at, kind, finding } = event;
        let event = EventName::of(kind);
        if self.json {
            self.write(at, event, Some(finding), None, output);
            return;
        }
        let line = format!(
            "{:>12}  {:<9}  {} {} at {}: {}",
            time(at.as_nanos()),
            event.word(),
            finding.code,
            finding.name,
            names.place(&finding.place),
            finding.cause,
        );
        output.line(&line);
    }

    /// Tells the whole answer at the end.
    pub(crate) fn end(&self, at: Instant, diagnosis: &Diagnosis, output: &mut Output) {
        self.write(at, EventName::Ended, None, Some(diagnosis), output);
    }

    fn write(
        &self,
        at: Instant,
        event: EventName,
        finding: Option<FindingReport>,
        diagnosis: Option<&Diagnosis>,
        output: &mut Output,
    ) {
        let at_ns = Number(at.as_nanos());
        let schema = "linesman.event/1";
        output.json_line(&EventReport { schema, at_ns, event, finding, diagnosis });
    }
}
