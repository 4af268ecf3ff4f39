//! IDNs as JSON and as text.

use linesman_proto::mailbox::soe::{CommandProgress, Idn, SoeAttribute, SoeError};
use serde::Serialize;
use serde_json::Value;

use super::value::show;
use crate::command::sdo::value::hex;
use crate::command::service::DeviceReport;
use crate::output::{Output, Table};
use crate::text::quantity::count;
use crate::version;

/// Identification numbers of a drive.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.soe/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Whose.
    device: DeviceReport,
    /// `list`, `read`, `write` or `execute`.
    action: String,
    /// Drive of the SubDevice, 0 to 7.
    drive: u8,
    /// One, or those of the list.
    pub(super) idns: Vec<IdnReport>,
    /// Progress of a procedure command: `done`, `error`, `interrupted`, `still running`, `set, not enabled`,
    /// `not set`; `null` unless one was executed.
    pub(super) progress: Option<String>,
}

/// An identification number; `null` for what was not asked for, or what it has not.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct IdnReport {
    /// Its name in full: `S-0-0036`.
    idn: String,
    /// The same as a number of 16 bits.
    number: u16,
    /// Its name in the drive.
    pub(super) name: Option<String>,
    /// Unit of the value.
    pub(super) unit: Option<String>,
    /// Kind of its value.
    pub(super) attribute: Option<AttributeReport>,
    /// The element that was read or written: `value` unless another was asked for.
    pub(super) element: String,
    /// Its bytes in the order of the line, in hex; `null` when it was refused.
    pub(super) bytes: Option<String>,
    /// It as the attribute says: a number, a text, a list; above 2^53 a text; `null` for mere bytes.
    pub(super) value: Value,
    /// It for people.
    pub(super) text: String,
    /// Least value.
    pub(super) minimum: Value,
    /// Greatest value.
    pub(super) maximum: Value,
    /// Code by which the drive refuses the value.
    pub(super) soe_error: Option<u16>,
    #[serde(skip)]
    pub(super) limits: [Option<String>; 2],
}

/// Letters of a value that a table shows.
const SHOWN: usize = 40;

/// A value as a table shows it.
fn cut(text: &str) -> String {
    match text.char_indices().nth(SHOWN) {
        Some((at, _)) => format!("{} …", text[..at].trim_end()),
        None => text.to_owned(),
    }
}

/// Kind of value of an IDN.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct AttributeReport {
    /// All its bits.
    bits: u32,
    /// `4 bytes`, `list of 2 bytes each`, `reserved length`.
    length: String,
    /// `binary`, `unsigned`, `signed`, `hexadecimal`, `text`, `IDN`, `float`, `reserved`.
    format: String,
    /// Decimal places, which `value` has.
    decimals: u8,
    /// Factor that gives a value in its unit; `value` is without it.
    conversion_factor: u16,
    /// True for a procedure command.
    command: bool,
    /// States in which it can be written: `PREOP, SAFEOP, OP`, `no state`.
    writable: String,
}

impl From<SoeAttribute> for AttributeReport {
    fn from(attribute: SoeAttribute) -> Self {
        Self {
            bits: attribute.0,
            length: attribute.length().to_string(),
            format: attribute.format().name().to_owned(),
            decimals: attribute.decimals(),
            conversion_factor: attribute.conversion_factor(),
            command: attribute.is_command(),
            writable: attribute.writable_in(),
        }
    }
}

impl AttributeReport {
    /// As the drive has it.
    pub(super) const fn attribute(&self) -> SoeAttribute {
        SoeAttribute(self.bits)
    }

    /// In one line.
    pub(super) fn text(&self) -> String {
        let mut parts = vec![self.length.clone(), self.format.clone()];
        if self.decimals > 0 {
            parts.push(count(self.decimals.into(), "decimal place"));
        }
        if self.conversion_factor != 1 {
            parts.push(format!("conversion factor {}", self.conversion_factor));
        }
        if self.command {
            parts.push("procedure command".to_owned());
        }
        parts.push(format!("writable in {}", self.writable));
        format!("0x{:08X}: {}", self.bits, parts.join("; "))
    }
}

impl IdnReport {
    pub(super) fn new(idn: Idn) -> Self {
        Self {
            idn: idn.to_string(),
            number: idn.0,
            name: None,
            unit: None,
            attribute: None,
            element: "value".to_owned(),
            bytes: None,
            value: Value::Null,
            text: String::new(),
            minimum: Value::Null,
            maximum: Value::Null,
            soe_error: None,
            limits: [None, None],
        }
    }

    /// Takes the bytes of the element, shown by the attribute.
    pub(super) fn holds(&mut self, data: &[u8], attribute: Option<SoeAttribute>) {
        (self.text, self.value) = show(data, attribute);
        self.bytes = Some(hex(data));
    }

    /// The drive refuses the value.
    pub(super) fn refused(&mut self, error: SoeError) {
        self.text = error.to_string();
        self.soe_error = Some(error.0);
    }

    /// Value and unit.
    pub(super) fn value_text(&self) -> String {
        match &self.unit {
            Some(unit) if self.soe_error.is_none() => format!("{} {unit}", self.text),
            Some(_) | None => self.text.clone(),
        }
    }

    /// IDN and name.
    pub(super) fn title(&self) -> String {
        match &self.name {
            Some(name) => format!("{} {name}", self.idn),
            None => self.idn.clone(),
        }
    }

    /// For people, in a few lines.
    pub(super) fn lines(&self) -> String {
        let mut lines = vec![self.title()];
        let mut line = |heading: &str, text: &str| lines.push(format!("  {heading:<10} {text}"));
        line(&self.element, &self.value_text());
        for (heading, limit) in ["minimum", "maximum"].into_iter().zip(&self.limits) {
            if let Some(limit) = limit {
                line(heading, limit);
            }
        }
        if let Some(attribute) = &self.attribute {
            line("attribute", &attribute.text());
        }
        lines.join("\n")
    }

    fn is_command(&self) -> bool {
        self.attribute.as_ref().is_some_and(|attribute| attribute.command)
    }
}

impl Report {
    pub(super) fn new(device: DeviceReport, action: &str, drive: u8, idns: Vec<IdnReport>) -> Self {
        Self {
            schema: "linesman.soe/1".to_owned(),
            tool: version::tool(),
            device,
            action: action.to_owned(),
            drive,
            idns,
            progress: None,
        }
    }

    /// The same with how far a procedure command has come.
    pub(super) fn with(self, progress: CommandProgress) -> Self {
        Self { progress: Some(progress.text().to_owned()), ..self }
    }

    /// The list as a table.
    pub(super) fn table(&self, all: bool, commands: &[Idn], output: &Output) -> String {
        let headings = ["IDN", "name", "value", "unit", "minimum", "maximum", "writable"];
        let headings = if all { &headings[..] } else { &headings[..2] };
        let mut table = Table::new(headings, output.paint());
        for one in &self.idns {
            let name = one.name.clone().unwrap_or_default();
            let is_command = one.is_command() || commands.contains(&Idn(one.number));
            let name = if is_command { format!("{name} (command)") } else { name };
            let [minimum, maximum] = one.limits.clone().map(Option::unwrap_or_default);
            let unit = one.unit.clone().unwrap_or_default();
            let writable = one.attribute.as_ref().map(|attribute| attribute.writable.clone());
            let cells = [
                one.idn.clone(),
                name,
                cut(&one.text),
                unit,
                minimum,
                maximum,
                writable.unwrap_or_default(),
            ];
            table.row(cells.into_iter().take(headings.len()));
        }
        table.render()
    }
}
