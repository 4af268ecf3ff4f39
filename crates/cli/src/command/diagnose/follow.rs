//! Findings as they happen.

use std::collections::BTreeSet;

use linesman_diagnosis::report::{Diagnosis, FindingReport, Number};
use linesman_diagnosis::{Event, EventKind};
use linesman_proto::time::{Instant, Span};
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
    /// The finding that explains it, by its id; `null` for one that stands for itself.
    follows_from: Option<String>,
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

/// What happened to a finding, in a word.
pub(crate) const fn event_word(kind: EventKind) -> &'static str {
    EventName::of(kind).word()
}

/// For so long people are not told of a finding: what is explained or taken back by then has told nobody anything.
const HELD: Span = Span::ms(50);

/// Tells what happens to findings.
pub(crate) struct Follower {
    json: bool,
    /// Prefix of each line for people: the line's name, where there are several.
    prefix: String,
    /// What people have not been told yet, oldest first.
    held: Vec<Event>,
    /// Findings that people were told of, by their ids.
    told: BTreeSet<String>,
}

impl Follower {
    /// One that writes text or JSON lines.
    pub(crate) const fn new(json: bool) -> Self {
        Self { json, prefix: String::new(), held: Vec::new(), told: BTreeSet::new() }
    }

    /// One that writes text, each line with this before it.
    pub(crate) const fn with_prefix(prefix: String) -> Self {
        Self { json: false, prefix, held: Vec::new(), told: BTreeSet::new() }
    }

    /// Tells what happened to a finding: a program at once, people a moment later.
    pub(crate) fn tell(&mut self, event: Event, names: &Names, output: &mut Output) {
        let at = event.at;
        if self.json {
            let Event { at, kind, finding, follows_from } = event;
            self.write(at, EventName::of(kind), Some((finding, follows_from)), None, output);
            return;
        }
        self.held.push(event);
        self.tell_until(at, names, output);
    }

    /// Tells people all that is held.
    pub(crate) fn flush(&mut self, names: &Names, output: &mut Output) {
        self.tell_until(Instant::MAX, names, output);
    }

    /// Tells people what has been held for long enough.
    pub(crate) fn tell_until(&mut self, now: Instant, names: &Names, output: &mut Output) {
        while let Some(first) = self.held.first().filter(|first| first.at + HELD <= now) {
            let (id, opened) = (first.finding.id.clone(), first.kind == EventKind::Opened);
            let first = self.held.remove(0);
            let mut news = first;
            if opened {
                let (mine, others) = self.held.drain(..).partition(|event| event.finding.id == id);
                self.held = others;
                let mine: Vec<Event> = mine;
                if mine.iter().any(|event| event.kind == EventKind::Withdrawn) {
                    continue;
                }
                // It opened, it was certain, it was over: the last of it says the most.
                if let Some(last) = mine.into_iter().next_back() {
                    news = Event { at: news.at, ..last };
                }
            }
            self.tell_people(&news, names, output);
        }
    }

    fn tell_people(&mut self, event: &Event, names: &Names, output: &mut Output) {
        let Event { at, kind, finding, follows_from } = event;
        // What follows from another finding stands beneath it in the report.
        let is_known = self.told.contains(&finding.id);
        if !is_known && (follows_from.is_some() || *kind == EventKind::Withdrawn) {
            return;
        }
        self.told.insert(finding.id.clone());
        let line = format!(
            "{}{:>12}  {:<9}  {} {} at {}: {}",
            self.prefix,
            time(at.as_nanos()),
            EventName::of(*kind).word(),
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
        finding: Option<(FindingReport, Option<String>)>,
        diagnosis: Option<&Diagnosis>,
        output: &mut Output,
    ) {
        let at_ns = Number(at.as_nanos());
        let schema = "linesman.event/1";
        let (finding, follows_from) = finding.unzip();
        let follows_from = follows_from.flatten();
        output.json_line(&EventReport { schema, at_ns, event, finding, follows_from, diagnosis });
    }
}
