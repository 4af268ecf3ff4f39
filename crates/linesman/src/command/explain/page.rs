//! One page of explanation.

use linesman_config::fault::{Class, FaultName};
use linesman_diagnosis::rule::RulePage;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::register::{Description, Field, Form, Unit};
use linesman_proto::state::{AlState, AlStatusCode};

use crate::output::{Paint, wrapped};
use crate::text::finding::severity_word;

/// A title and its paragraphs.
pub(super) struct Page {
    title: String,
    parts: Vec<Part>,
}

enum Part {
    /// A paragraph.
    Text(String),
    /// A line that stays as it is: an empty one, a heading, one of a table or of code.
    Line(String),
    /// A point of a list: its mark and its words.
    Point(String, String),
    /// A heading with one thing behind it.
    Fact(&'static str, String),
    /// A heading with a list beneath.
    List(&'static str, Vec<String>),
}

impl Page {
    fn new(title: String) -> Self {
        Self { title, parts: Vec::new() }
    }

    fn text(mut self, text: impl Into<String>) -> Self {
        self.parts.push(Part::Text(text.into()));
        self
    }

    fn fact(mut self, name: &'static str, text: impl Into<String>) -> Self {
        let text = text.into();
        if !text.is_empty() {
            self.parts.push(Part::Fact(name, text));
        }
        self
    }

    fn list(mut self, name: &'static str, items: Vec<String>) -> Self {
        if !items.is_empty() {
            self.parts.push(Part::List(name, items));
        }
        self
    }

    /// The title.
    #[cfg(test)]
    pub(super) fn title(&self) -> &str {
        &self.title
    }

    /// As text.
    pub(super) fn render(&self, paint: Paint, width: usize) -> String {
        let mut text = format!("{}\n", paint.bold(&self.title));
        for part in &self.parts {
            match part {
                Part::Line(words) if words.starts_with('#') => {
                    text.push_str(&format!(
                        "  {}\n",
                        paint.bold(words.trim_start_matches(['#', ' ']))
                    ));
                }
                Part::Line(words) => {
                    text.push_str(format!("  {words}").trim_end());
                    text.push('\n');
                }
                Part::Point(mark, words) => {
                    text.push_str(&wrapped(&format!("  {mark} "), words, width))
                }
                Part::Text(words) => text.push_str(&wrapped("  ", words, width)),
                Part::Fact(name, words) => {
                    let head = format!("  {:<11}", format!("{name}:"));
                    text.push_str(&wrapped(&paint.faint(&head), words, width));
                }
                Part::List(name, items) => {
                    text.push_str(&format!("  {}\n", paint.faint(&format!("{name}:"))));
                    for item in items {
                        text.push_str(&wrapped("    - ", item, width));
                    }
                }
            }
        }
        text
    }
}

/// A page about a finding: the manual page of its rule.
pub(super) fn finding(page: &RulePage) -> Page {
    let severity = severity_word(page.severity);
    let class = class(page.class);
    let title = format!("Finding {} {} ({severity}, {class})", page.code, page.name);
    let mut result = Page::new(title);
    result.parts = parts(page.manual().trim());
    result
}

/// A page about a topic of the guide.
pub(super) fn topic(text: &str) -> Page {
    let (title, rest) = text.split_once('\n').unwrap_or((text, ""));
    let mut page = Page::new(title.trim_start_matches("# ").to_owned());
    page.parts = parts(rest.trim());
    page
}

/// The paragraphs, points and lines of a page in Markdown, whose own line ends fit no terminal.
fn parts(markdown: &str) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut is_code = false;
    for line in markdown.lines() {
        let words = line.trim();
        let is_fence = words.starts_with("```");
        is_code ^= is_fence;
        if is_code || is_fence || words.is_empty() || words.starts_with(['#', '|']) {
            parts.push(Part::Line(line.to_owned()));
            continue;
        }
        let point = words.split_once(' ').filter(|(mark, _)| is_mark(mark));
        match (point, parts.last_mut()) {
            (Some((mark, words)), _) => parts.push(Part::Point(mark.to_owned(), words.to_owned())),
            (None, Some(Part::Text(text) | Part::Point(_, text))) => {
                text.push(' ');
                text.push_str(words);
            }
            (None, _) => parts.push(Part::Text(words.to_owned())),
        }
    }
    parts
}

/// Whether a word begins a point of a list: `*`, `-` or `1.`.
fn is_mark(word: &str) -> bool {
    let number = word.strip_suffix('.').unwrap_or_default();
    matches!(word, "*" | "-")
        || (!number.is_empty() && number.bytes().all(|digit| digit.is_ascii_digit()))
}

/// A page about an AL status code.
pub(super) fn status(code: AlStatusCode) -> Page {
    let entry = code.explain();
    Page::new(format!("AL status code 0x{:04X}: {}", code.value(), entry.name))
        .text(entry.cause)
        .fact("class", entry.class.name())
        .fact("occurs", entry.occurs)
        .list("do", entry.actions.iter().map(|action| (*action).to_owned()).collect())
        .fact("see", entry.reference)
}

/// A page about an abort code.
pub(super) fn abort(code: SdoAbortCode) -> Page {
    let entry = code.explain();
    let known = if entry.known { "" } else { " (not in the specifications; this is its class)" };
    Page::new(format!("CoE abort code 0x{:08X}: {}{known}", code.value(), entry.text))
        .text(entry.cause)
        .fact("do", entry.action)
        .fact("see", entry.reference)
}

/// A page about a register.
pub(super) fn register(found: &Description) -> Page {
    let entry = found.register;
    let bytes = if entry.len == 1 { "byte" } else { "bytes" };
    let mut page = Page::new(format!("Register {}: {}", found.start(), found.title()))
        .text(entry.meaning)
        .fact("length", format!("{} {bytes}", entry.len))
        .fact(
            "rights",
            format!("EtherCAT {}, PDI {}", entry.ecat.notation(), entry.pdi.notation()),
        );
    if let Some(repeat) = entry.repeat {
        let unit = match repeat.unit {
            Unit::Port => "port",
            Unit::Fmmu => "FMMU",
            Unit::SyncManager => "SyncManager",
        };
        let text = format!(
            "{} of them, one for each {unit}, from {} every {} bytes",
            repeat.count, entry.address, repeat.stride
        );
        page = page.fact("family", text);
    }
    page.fact("only", entry.only.unwrap_or_default())
        .fact("reading", entry.read_effect.unwrap_or_default())
        .list("bits", entry.fields.iter().map(field).collect())
        .fact("see", entry.reference)
}

fn field(field: &Field) -> String {
    let bits = match field.high - field.low {
        0 => format!("{}", field.low),
        _ => format!("{}-{}", field.low, field.high),
    };
    let unit = if field.unit.is_empty() { String::new() } else { format!(" ({})", field.unit) };
    let values: Vec<String> =
        field.values.iter().map(|(value, name)| value_text(field.form, *value, name)).collect();
    let values = match values.is_empty() {
        true => String::new(),
        false => format!(" [{}]", values.join("; ")),
    };
    format!("{bits}: {}{unit}. {}{values}", field.name, field.meaning)
}

fn value_text(form: Form, value: u32, name: &str) -> String {
    match form {
        Form::Hex | Form::Bytes => format!("0x{value:X} {name}"),
        Form::Flag | Form::Choice | Form::Decimal | Form::Signed | Form::SignMagnitude => {
            format!("{value} {name}")
        }
    }
}

/// A page about a state.
pub(super) fn state(state: AlState) -> Page {
    let (text, entered) = match state {
        AlState::Init => (
            "No communication on the application layer: neither mailbox nor process data. The \
             MainDevice has access to the registers of the controller only.",
            "After power-on, and whenever the MainDevice asks for it.",
        ),
        AlState::Boot => (
            "Firmware update: the mailbox works with its boot settings, for FoE only.",
            "From INIT only, on devices that have it; the only way out leads to INIT.",
        ),
        AlState::PreOp => (
            "The mailbox works, process data do not. SyncManagers and FMMUs for the process data \
             are set up here, and SDOs of the start-up list are written.",
            "From INIT, once the mailbox SyncManagers 0 and 1 fit.",
        ),
        AlState::SafeOp => (
            "The mailbox works and inputs are valid, while outputs stay in their safe state.",
            "From PREOP, once SyncManagers and FMMUs of the process data fit; or out of OP, when \
             outputs stop coming (AL status code 0x001B) or the device finds a fault.",
        ),
        AlState::Op => {
            ("Normal work: inputs and outputs are valid.", "From SAFEOP, once outputs come.")
        }
    };
    let yes = |on: bool| if on { "yes" } else { "no" };
    Page::new(format!("State {}", state.name()))
        .text(text)
        .fact("entered", entered)
        .fact(
            "works",
            format!(
                "mailbox {}, inputs {}, outputs {}",
                yes(state.has_mailbox()),
                yes(state.has_inputs()),
                yes(state.has_outputs())
            ),
        )
        .fact(
            "AL status",
            format!("{} in register 0x0130, bits 0-3; bit 4 is the error bit", state.bits()),
        )
}

/// A page about a fault name.
pub(super) fn fault(fault: FaultName) -> Page {
    Page::new(format!("Fault {fault}")).text(fault.meaning()).fact("class", class(fault.class()))
}

const fn class(class: Class) -> &'static str {
    match class {
        Class::Hardware => "hardware",
        Class::Software => "software",
        Class::Configuration => "configuration",
        Class::Timing => "timing",
        Class::Host => "host",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_fit_the_terminal_and_keep_their_points() {
        let text = "One paragraph that goes\non.\n\n* a point\n  of two lines\n* another\n\n| a | table stays |\n\n\
                    ```sh\nso does code\n```\n1. first";
        let mut page = Page::new("T".to_owned());
        page.parts = parts(text);
        let shown = page.render(Paint::PLAIN, 22);
        let expected = "T\n  One paragraph that\n  goes on.\n\n  * a point of two\n    lines\n  * another\n\n\
                        \x20 | a | table stays |\n\n  ```sh\n  so does code\n  ```\n  1. first\n";
        assert_eq!(shown, expected);
    }
}
