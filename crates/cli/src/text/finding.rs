//! One finding: what, where, why, how we know, what to do, what follows from it.

use std::ops::Range;

use linesman_diagnosis::report::{
    AlternativeReport, EvidenceReport, FindingReport, FindingState, Number, Severity,
};

use super::names::Names;
use super::quantity::{grouped, time};
use crate::hint;
use crate::output::{Paint, wrapped};

/// Most other causes and places that are shown; JSON has them all.
const MOST_OTHERS: usize = 12;
/// Most pieces of evidence that are shown; JSON has them all.
const MOST_EVIDENCE: usize = 6;
/// Most consequences that are shown one by one.
const MOST_CONSEQUENCES: usize = 5;

/// Registers that count.
const COUNTERS: Range<u16> = 0x0300..0x0314;

/// How a finding is written.
#[derive(Clone, Copy)]
pub(crate) struct Writer<'a> {
    /// Names of the SubDevices.
    pub(crate) names: &'a Names,
    /// Colour.
    pub(crate) paint: Paint,
    /// Columns.
    pub(crate) width: usize,
    /// Whether times mean something; an observation file has none.
    pub(crate) timed: bool,
    /// Where the line is, as the user has named it: for commands that are advised.
    pub(crate) place: &'a str,
}

impl Writer<'_> {
    /// The whole finding.
    pub(crate) fn finding(&self, finding: &FindingReport) -> String {
        let mut text = self.headline(finding);
        self.add(&mut text, "where", &self.names.place(&finding.place));
        self.add(&mut text, "cause", &cause(finding));
        for other in others(finding).take(MOST_OTHERS) {
            self.add(&mut text, "or", &self.alternative(other));
            if let Some(by) = &other.told_apart_by {
                self.add(&mut text, "", &format!("told apart by: {by}"));
            }
        }
        if let Some(more) = others_left_out(finding) {
            self.add(&mut text, "", &format!("or one of {more} more (--json has them all)"));
        }
        if self.timed {
            self.add(&mut text, "when", &when(finding));
        }
        self.evidence(&mut text, &finding.evidence);
        for (index, action) in finding.actions.iter().enumerate() {
            let heading = if index == 0 { "do" } else { "" };
            let action = hint::complete(action, self.place);
            self.add(&mut text, heading, &format!("{}. {action}", index + 1));
        }
        self.consequences(&mut text, finding);
        text
    }

    /// What, where, why, when, and the first thing to do.
    pub(crate) fn brief(&self, finding: &FindingReport) -> String {
        let mut text = self.headline(finding);
        self.add(&mut text, "where", &self.names.place(&finding.place));
        self.add(&mut text, "cause", &cause(finding));
        if self.timed {
            self.add(&mut text, "when", &when(finding));
        }
        if let Some(action) = finding.actions.first() {
            self.add(&mut text, "do", &hint::complete(action, self.place));
        }
        text
    }

    /// Severity, code and name in one line.
    pub(crate) fn headline(&self, finding: &FindingReport) -> String {
        let over = match finding.state {
            FindingState::Opened => " (not certain yet)",
            FindingState::Confirmed => "",
            FindingState::Closed => " (over)",
        };
        format!(
            "{} {} {}{}\n",
            self.severity(finding.severity),
            self.paint.bold(&finding.code),
            self.paint.bold(&finding.name),
            self.paint.faint(over)
        )
    }

    fn severity(&self, severity: Severity) -> String {
        match severity {
            Severity::Error => self.paint.bad("ERROR  "),
            Severity::Warning => self.paint.warning("WARNING"),
            Severity::Info => self.paint.faint("INFO   "),
        }
    }

    /// A heading and what stands behind it.
    fn add(&self, text: &mut String, heading: &str, words: &str) {
        let first = format!("  {}", self.paint.faint(&format!("{heading:<9}")));
        text.push_str(&wrapped(&first, words, self.width));
    }

    fn alternative(&self, other: &AlternativeReport) -> String {
        let place = match &other.place {
            Some(place) => format!(", {}", self.names.place(place)),
            None => String::new(),
        };
        format!("{} ({}){place}", other.cause, percent(other.confidence))
    }

    fn evidence(&self, text: &mut String, all: &[EvidenceReport]) {
        for (index, one) in all.iter().take(MOST_EVIDENCE).enumerate() {
            let heading = if index == 0 { "evidence" } else { "" };
            self.add(text, heading, &self.piece(one));
        }
        if let Some(more) = all.len().checked_sub(MOST_EVIDENCE).filter(|more| *more > 0) {
            self.add(text, "", &format!("and {more} more (--json has them all)"));
        }
    }

    /// `at 1.234 ms, frame 12: text (register 0x0300, 3 → 18)`.
    fn piece(&self, evidence: &EvidenceReport) -> String {
        let mut head = Vec::new();
        let at = evidence.time_ns.filter(|_| self.timed);
        head.extend(at.map(|Number(at)| format!("at {}", time(at))));
        head.extend(evidence.frame.map(|Number(frame)| format!("frame {frame}")));
        let mut tail = Vec::new();
        // Most texts name the device themselves.
        let named = |no: u32| evidence.text.contains(&self.names.device(no));
        if let Some(no) = evidence.no.filter(|no| !named(*no)) {
            let port = evidence.port.map(|port| format!(" port {port}")).unwrap_or_default();
            tail.push(format!("{}{port}", self.names.device(no)));
        }
        tail.extend(evidence.register.map(|register| format!("register 0x{register:04X}")));
        let number = |value: u64| register_value(evidence, value);
        match (evidence.before, evidence.after) {
            (Some(Number(before)), Some(Number(after))) => {
                tail.push(format!("{} → {}", number(before), number(after)));
            }
            (None, Some(Number(value))) | (Some(Number(value)), None) => {
                tail.push(format!("read {}", number(value)));
            }
            (None, None) => {}
        }
        let head = if head.is_empty() { String::new() } else { format!("{}: ", head.join(", ")) };
        let tail = if tail.is_empty() { String::new() } else { format!(" ({})", tail.join(", ")) };
        format!("{head}{}{tail}", evidence.text)
    }

    fn consequences(&self, text: &mut String, cause: &FindingReport) {
        // The same trouble, come and gone before, is no consequence to a reader.
        let is_same = |one: &&FindingReport| one.code == cause.code && one.place == cause.place;
        let (before, flat): (Vec<_>, Vec<_>) =
            flattened(&cause.consequences).into_iter().partition(is_same);
        for one in before.iter().filter(|_| self.timed).take(MOST_CONSEQUENCES) {
            self.add(text, "before", &format!("the same, {}", when(one)));
        }
        for (index, one) in flat.iter().take(MOST_CONSEQUENCES).enumerate() {
            let heading = if index == 0 { "so also" } else { "" };
            let place = self.names.place(&one.place);
            self.add(text, heading, &format!("{} {}: {place}", one.code, one.name));
        }
        if let Some(more) = flat.len().checked_sub(MOST_CONSEQUENCES).filter(|more| *more > 0) {
            self.add(text, "", &format!("and {more} more that follow from it"));
        }
    }
}

/// A value of the register that a piece of evidence is about: counters are read as numbers, all else
/// as bits and codes.
pub(crate) fn register_value(evidence: &EvidenceReport, value: u64) -> String {
    let largest = evidence.before.max(evidence.after).map_or(0, |Number(value)| value);
    let is_code = evidence.register.is_some_and(|register| !COUNTERS.contains(&register));
    if is_code && largest > 9 { format!("0x{value:04X}") } else { grouped(value) }
}

fn flattened(all: &[FindingReport]) -> Vec<&FindingReport> {
    let mut flat = Vec::new();
    for finding in all {
        flat.push(finding);
        flat.extend(flattened(&finding.consequences));
    }
    flat
}

fn cause(finding: &FindingReport) -> String {
    let percent = percent(finding.confidence);
    format!("{} ({percent}): {}", finding.cause, finding.cause.meaning())
}

/// What else it may be, as far as that is worth a person's time: below half a percent it is not.
pub(crate) fn others(finding: &FindingReport) -> impl Iterator<Item = &AlternativeReport> {
    finding.alternatives.iter().filter(|other| other.confidence >= 0.005)
}

/// Number of other causes and places that are not shown, where that is worth a word: there are many, or each of them is
/// as likely as the first.
fn others_left_out(finding: &FindingReport) -> Option<usize> {
    let shown = others(finding).take(MOST_OTHERS).count();
    let is_open = finding.confidence < 0.5;
    let is_told = others(finding).count() > shown || shown == 0 && is_open;
    finding.alternatives.len().checked_sub(shown).filter(|more| is_told && *more > 0)
}

/// A severity in plain text.
pub(crate) const fn severity_word(severity: Severity) -> &'static str {
    match severity {
        Severity::Info => "info",
        Severity::Warning => "warning",
        Severity::Error => "error",
    }
}

/// `70 %`.
pub(crate) fn percent(confidence: f64) -> String {
    format!("{:.0} %", confidence * 100.0)
}

/// From when to when a finding was there.
pub(crate) fn when(finding: &FindingReport) -> String {
    when_by(finding, time)
}

/// From when to when a finding was there, each time as `at` writes it.
pub(crate) fn when_by(finding: &FindingReport, at: impl Fn(u64) -> String) -> String {
    let mut text = format!("from {}", at(finding.opened_ns.0));
    if let Some(Number(closed)) = finding.closed_ns {
        let lasted = closed.saturating_sub(finding.opened_ns.0);
        text = format!("{text} to {}, for {}", at(closed), time(lasted));
    }
    text
}

/// How many findings of each severity there are: `1 error, 2 warnings`.
pub(crate) fn tally(findings: &[FindingReport]) -> String {
    let of = |severity| findings.iter().filter(|finding| finding.severity == severity).count();
    let parts =
        [(Severity::Error, "error"), (Severity::Warning, "warning"), (Severity::Info, "note")];
    let words: Vec<String> = parts
        .into_iter()
        .map(|(severity, word)| (of(severity), word))
        .filter(|(count, _)| *count > 0)
        .map(|(count, word)| {
            let plural = if count == 1 { "" } else { "s" };
            format!("{} {word}{plural}", grouped(count as u64))
        })
        .collect();
    words.join(", ")
}
