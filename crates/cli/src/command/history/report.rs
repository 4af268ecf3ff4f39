//! A diagnosis history as JSON, as a table and as CSV.

use linesman_proto::mailbox::coe::diagnosis::DiagnosisMessage;
use serde::Serialize;

use super::message::{Value, fill, system_time, values};
use crate::command::sdo::value::hex;
use crate::command::service::DeviceReport;
use crate::output::{Output, Table};
use crate::text::quantity::{count as counted, date};
use crate::version;

/// A diagnosis history.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.history/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Whose.
    device: DeviceReport,
    /// How many messages fit.
    maximum: u16,
    /// Whether there were messages that nobody had acknowledged.
    new: bool,
    /// What is set: `emergencies`, `no-information`, `no-warnings`, `no-errors`, `keep-unread`,
    /// `lost`.
    flags: Vec<String>,
    /// The messages, oldest first.
    messages: Vec<MessageReport>,
    /// Up to which subindex was acknowledged by this command; 0 when all was cleared; `null` when
    /// nothing was.
    acknowledged: Option<u8>,
}

/// A message.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct MessageReport {
    /// Where it stands in the object.
    subindex: u8,
    /// Whether nobody had acknowledged it.
    new: bool,
    /// `information`, `warning`, `error`, or `message` for a kind without a name.
    severity: String,
    /// Its code; of an emergency the low word is 0xE800 and the high word that of the emergency.
    code: u32,
    /// Number of its text.
    text_id: u16,
    /// Its text; `null` without a device description that has it.
    text: Option<String>,
    /// Its parameters, for people.
    parameters: Vec<String>,
    /// When it was, in ns since 2000 or since the SubDevice was switched on; a text, as it may be
    /// above 2^53; `null` when the SubDevice has no clock.
    time_ns: Option<String>,
    /// The same, RFC 3339; `null` for a local clock.
    time: Option<String>,
    /// Whether the time is that of the SubDevice's own clock.
    local_time: bool,
    /// The bytes in the order of the line, in hex.
    raw: String,
}

impl Report {
    pub(super) fn new(device: DeviceReport, maximum: u16, new: bool, flags: u16) -> Self {
        let names =
            ["emergencies", "no-information", "no-warnings", "no-errors", "keep-unread", "lost"];
        let set = names.into_iter().enumerate().filter(|(bit, _)| flags >> bit & 1 != 0);
        Self {
            schema: "linesman.history/1".to_owned(),
            tool: version::tool(),
            device,
            maximum,
            new,
            flags: set.map(|(_, name)| name.to_owned()).collect(),
            messages: Vec::new(),
            acknowledged: None,
        }
    }

    pub(super) fn has_new(&self) -> bool {
        self.new
    }

    pub(super) fn acknowledged_to(&mut self, subindex: u8) {
        self.acknowledged = Some(subindex);
    }

    pub(super) fn cleared(&mut self) {
        self.acknowledged = Some(0);
    }

    pub(super) fn push(&mut self, subindex: u8, new: bool, bytes: &[u8], texts: &[(u16, String)]) {
        let raw = hex(bytes);
        let Some(message) = DiagnosisMessage::parse(bytes) else {
            // Too short for a message: shown as it is, rather than not at all.
            self.messages.push(MessageReport {
                subindex,
                new,
                severity: "message".to_owned(),
                code: 0,
                text_id: 0,
                text: Some("no diagnosis message: shorter than 16 bytes".to_owned()),
                parameters: Vec::new(),
                time_ns: None,
                time: None,
                local_time: false,
                raw,
            });
            return;
        };
        let values = values(&message, texts);
        let pattern = texts.iter().find(|(id, _)| *id == message.text);
        let has_time = message.time_ns != 0;
        let time = system_time(message.time_ns);
        self.messages.push(MessageReport {
            subindex,
            new,
            severity: message.severity.name().to_owned(),
            code: message.code,
            text_id: message.text,
            text: pattern.map(|(_, pattern)| fill(pattern, &values)),
            parameters: values.iter().map(Value::text).collect(),
            time_ns: has_time.then(|| message.time_ns.to_string()),
            time: time.filter(|_| has_time && !message.local_time),
            local_time: message.local_time,
            raw,
        });
    }

    pub(super) fn json_text(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    pub(super) fn csv(&self) -> String {
        let mut text =
            "subindex,new,severity,code,text_id,time,time_ns,local_time,text,parameters,raw\n"
                .to_owned();
        for message in &self.messages {
            let cells = [
                message.subindex.to_string(),
                message.new.to_string(),
                message.severity.clone(),
                format!("0x{:08X}", message.code),
                format!("0x{:04X}", message.text_id),
                message.time.clone().unwrap_or_default(),
                message.time_ns.clone().unwrap_or_default(),
                message.local_time.to_string(),
                message.text.clone().unwrap_or_default(),
                message.parameters.join(" "),
                message.raw.clone(),
            ];
            text.push_str(&cells.map(|cell| quoted(&cell)).join(","));
            text.push('\n');
        }
        text
    }

    pub(super) fn text(&self, label: &str, output: &Output) -> String {
        let paint = output.paint();
        let mut text = match (self.messages.len(), self.new) {
            (0, _) => format!("{label}: no messages (room for {})\n", self.maximum),
            (count, new) => {
                let new = if new { ", some of them new" } else { "" };
                format!(
                    "{label}: {}{new} (room for {})\n",
                    counted(count as u64, "message"),
                    self.maximum
                )
            }
        };
        if !self.flags.is_empty() {
            text.push_str(&format!("flags: {}\n", self.flags.join(", ")));
        }
        if !self.messages.is_empty() {
            let mut table = Table::new(&["", "when", "what", "code", "text"], paint);
            for message in &self.messages {
                table.row([
                    if message.new { "new".to_owned() } else { String::new() },
                    message.when(),
                    match message.severity.as_str() {
                        "error" => paint.bad("error"),
                        "warning" => paint.warning("warning"),
                        severity => severity.to_owned(),
                    },
                    format!("0x{:08X}", message.code),
                    message.words(),
                ]);
            }
            text.push_str(&table.render());
        }
        match self.acknowledged {
            None => {}
            Some(0) => text.push_str("all messages cleared\n"),
            Some(to) => text.push_str(&format!("acknowledged up to 0x10F3:{to:02X}\n")),
        }
        text
    }
}

impl MessageReport {
    fn when(&self) -> String {
        match (&self.time, &self.time_ns) {
            (Some(time), _) => date(time),
            (None, Some(ns)) => {
                let ns: u64 = ns.parse().unwrap_or(0);
                format!("{:.6} s local", std::time::Duration::from_nanos(ns).as_secs_f64())
            }
            (None, None) => "-".to_owned(),
        }
    }

    fn words(&self) -> String {
        match (&self.text, self.parameters.is_empty()) {
            (Some(text), _) => text.clone(),
            (None, true) => format!("text 0x{:04X}", self.text_id),
            (None, false) => {
                format!("text 0x{:04X} ({})", self.text_id, self.parameters.join(", "))
            }
        }
    }
}

/// A cell of CSV (RFC 4180).
fn quoted(cell: &str) -> String {
    match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell.to_owned(),
    }
}
