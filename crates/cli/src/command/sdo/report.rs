//! Objects as JSON and as text.

use linesman_proto::mailbox::coe::information::{Access, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectAddress, ObjectIndex, sync_parameters};
use serde::Serialize;
use serde_json::Value;

use super::dictionary::{EntryAbout, ObjectAbout};
use super::value::{hex, show};
use crate::command::service::{DeviceReport, Refusal};
use crate::output::{Output, Table};
use crate::version;

/// Objects that were read or written.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReadReport {
    /// `linesman.sdo/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Whose.
    device: DeviceReport,
    /// `read` or `write`.
    action: String,
    /// Whether it was one transfer with complete access.
    complete: bool,
    /// One entry, or all of an object.
    objects: Vec<ObjectReport>,
}

/// An entry and its value.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ObjectReport {
    /// Index.
    index: u16,
    /// Subindex.
    subindex: u8,
    /// Its name; `null` when the SubDevice does not say.
    name: Option<String>,
    /// Its data type; `null` when nobody says.
    r#type: Option<String>,
    /// The bytes in the order of the line, in hex; `null` when it was refused.
    bytes: Option<String>,
    /// The value: a number, a text, true or false; above 2^53 a text; `null` for mere bytes.
    value: Value,
    /// The value for people.
    text: String,
    /// The abort code when it was refused.
    abort_code: Option<u32>,
}

impl ReadReport {
    /// The name of the entry, or of the first of them.
    pub(super) fn name(&self) -> Option<&str> {
        self.objects.first()?.name.as_deref()
    }
}

impl ObjectReport {
    pub(super) fn of(
        object: ObjectAddress,
        entry: Option<EntryAbout>,
        data_type: Option<DataType>,
        data: &[u8],
    ) -> Self {
        let told = entry.as_ref().map(|entry| entry.data_type);
        let data_type = data_type.or(told.filter(|told| told.name().is_some()));
        let (text, value) = show(data, data_type);
        let text = match sync_parameters::in_words(object, number(data)) {
            Some(words) => format!("{text}: {words}"),
            None => text,
        };
        Self {
            index: object.index.0,
            subindex: object.subindex,
            name: entry.map(|entry| entry.name).filter(|name| !name.is_empty()),
            r#type: data_type.map(|data_type| data_type.to_string()),
            bytes: Some(hex(data)),
            value,
            text,
            abort_code: None,
        }
    }

    pub(super) fn refused(
        object: ObjectAddress,
        entry: Option<EntryAbout>,
        refusal: &Refusal,
    ) -> Self {
        let code = refusal.abort_code();
        let text =
            code.map(|code| linesman_proto::mailbox::abort_code::SdoAbortCode(code).to_string());
        Self {
            bytes: None,
            value: Value::Null,
            text: text.unwrap_or_default(),
            abort_code: code,
            ..Self::of(object, entry, None, &[])
        }
    }

    fn address(&self) -> String {
        ObjectAddress::new(self.index, self.subindex).to_string()
    }
}

/// The bytes of an entry as a number, of those that are longer the first eight.
fn number(data: &[u8]) -> u64 {
    data.iter().take(8).rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
}

impl ReadReport {
    pub(super) fn new(device: DeviceReport, complete: bool, objects: Vec<ObjectReport>) -> Self {
        Self {
            schema: "linesman.sdo/1".to_owned(),
            tool: version::tool(),
            device,
            action: "read".to_owned(),
            complete,
            objects,
        }
    }

    pub(super) fn wrote(device: DeviceReport, complete: bool, object: ObjectReport) -> Self {
        Self { action: "write".to_owned(), ..Self::new(device, complete, vec![object]) }
    }

    /// A table for people.
    pub(super) fn text(&self, output: &Output) -> String {
        let mut table = Table::new(&["object", "name", "type", "value"], output.paint());
        for object in &self.objects {
            let name = object.name.clone().unwrap_or_default();
            let data_type = object.r#type.clone().unwrap_or_default();
            table.row([object.address(), name, data_type, object.text.clone()]);
        }
        table.render()
    }

    /// A sentence for people about what was written.
    pub(super) fn wrote_text(&self, label: &str) -> String {
        let objects = self.objects.iter();
        let written: Vec<String> =
            objects.map(|object| format!("{} = {}", object.address(), object.text)).collect();
        format!("{label}: written {}", written.join(", "))
    }
}

/// The objects of a SubDevice.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ListReport {
    /// `linesman.objects/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// Whose.
    device: DeviceReport,
    /// In the order in which the SubDevice names them.
    objects: Vec<ListedObject>,
}

/// An object.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ListedObject {
    /// Index.
    index: u16,
    /// Its name; `null` when the SubDevice does not say.
    name: Option<String>,
    /// `VAR`, `ARRAY`, `RECORD`, ...
    kind: Option<String>,
    /// Its data type; of an array that of its entries.
    r#type: Option<String>,
    /// Highest subindex.
    max_subindex: Option<u8>,
    /// Its entries; empty when only objects were asked for.
    pub(super) entries: Vec<EntryReport>,
}

/// An entry.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EntryReport {
    /// Subindex.
    subindex: u8,
    /// Its name.
    name: String,
    /// Its data type.
    r#type: String,
    /// Its length in bits.
    bits: u16,
    /// States in which it can be read.
    read: Vec<String>,
    /// States in which it can be written.
    write: Vec<String>,
    /// What else holds of it: `rx-pdo`, `tx-pdo`, `backup`, `setting`, `safe-inputs`, ...
    flags: Vec<String>,
    /// Its unit.
    unit: Option<u32>,
    /// Its default value.
    default: Option<String>,
    /// The least value.
    minimum: Option<String>,
    /// The greatest value.
    maximum: Option<String>,
    /// Its value, when it was asked for and can be read.
    value: Value,
    /// The same for people.
    text: Option<String>,
    /// The abort code when reading was refused.
    abort_code: Option<u32>,
}

impl EntryReport {
    pub(super) fn new(object: ObjectAddress, entry: &EntryAbout) -> Self {
        let value = |bytes: &Option<Vec<u8>>| {
            bytes.as_ref().map(|bytes| show(bytes, Some(entry.data_type)).0)
        };
        let states = |bits: [u16; 3]| {
            let named = bits.into_iter().zip(["PREOP", "SAFEOP", "OP"]);
            named
                .filter(|(bit, _)| entry.access.has(*bit))
                .map(|(_, name)| name.to_owned())
                .collect()
        };
        Self {
            subindex: object.subindex,
            name: entry.name.clone(),
            r#type: entry.data_type.to_string(),
            bits: entry.bits,
            read: states([Access::READ_PRE_OP, Access::READ_SAFE_OP, Access::READ_OP]),
            write: states([Access::WRITE_PRE_OP, Access::WRITE_SAFE_OP, Access::WRITE_OP]),
            flags: flags(entry.access),
            unit: entry.unit,
            default: value(&entry.default),
            minimum: value(&entry.minimum),
            maximum: value(&entry.maximum),
            value: Value::Null,
            text: None,
            abort_code: None,
        }
    }

    pub(super) fn holds(&mut self, data: &[u8], entry: &EntryAbout) {
        let (text, value) = show(data, Some(entry.data_type).filter(|told| told.name().is_some()));
        (self.text, self.value) = (Some(text), value);
    }

    pub(super) fn refused(&mut self, refusal: &Refusal) {
        self.abort_code = refusal.abort_code();
    }

    /// `RO`, `RW`, `RW (write: PREOP)`, and flags.
    fn rights(&self) -> String {
        let mut text = match (self.read.is_empty(), self.write.is_empty()) {
            (true, true) => "-".to_owned(),
            (false, true) => "RO".to_owned(),
            (true, false) => "WO".to_owned(),
            (false, false) => "RW".to_owned(),
        };
        if (1..3).contains(&self.write.len()) {
            text.push_str(&format!(" in {}", self.write.join(", ")));
        }
        for flag in &self.flags {
            text.push(' ');
            text.push_str(flag);
        }
        text
    }

    fn value_text(&self) -> String {
        let mut text = match (&self.text, self.abort_code) {
            (Some(text), _) => text.clone(),
            (None, Some(code)) => format!("refused, 0x{code:08X}"),
            (None, None) => String::new(),
        };
        let limits =
            [("default", &self.default), ("least", &self.minimum), ("most", &self.maximum)];
        let limits: Vec<String> = limits
            .into_iter()
            .filter_map(|(name, value)| value.as_ref().map(|value| format!("{name} {value}")))
            .collect();
        if !limits.is_empty() {
            text.push_str(&format!("  ({})", limits.join(", ")));
        }
        text
    }
}

fn flags(access: Access) -> Vec<String> {
    let named = [
        (Access::RX_PDO, "rx-pdo"),
        (Access::TX_PDO, "tx-pdo"),
        (Access::BACKUP, "backup"),
        (Access::SETTING, "setting"),
        (Access::SAFE_INPUTS, "safe-inputs"),
        (Access::SAFE_OUTPUTS, "safe-outputs"),
        (Access::SAFE_PARAMETER, "safe-parameter"),
    ];
    named.into_iter().filter(|(bit, _)| access.has(*bit)).map(|(_, name)| name.to_owned()).collect()
}

fn kind(code: ObjectCode) -> String {
    match code {
        ObjectCode::Domain => "DOMAIN".to_owned(),
        ObjectCode::DataType => "DEFTYPE".to_owned(),
        ObjectCode::Structure => "DEFSTRUCT".to_owned(),
        ObjectCode::Variable => "VAR".to_owned(),
        ObjectCode::Array => "ARRAY".to_owned(),
        ObjectCode::Record => "RECORD".to_owned(),
        ObjectCode::Other(code) => format!("code {code}"),
    }
}

impl ListedObject {
    pub(super) fn new(index: ObjectIndex, about: Option<&ObjectAbout>) -> Self {
        Self {
            index: index.0,
            name: about.map(|about| about.name.clone()).filter(|name| !name.is_empty()),
            kind: about.map(|about| kind(about.object_code)),
            r#type: about.map(|about| about.data_type.to_string()),
            max_subindex: about.map(|about| about.max_subindex),
            entries: Vec::new(),
        }
    }
}

impl ListReport {
    pub(super) fn new(device: DeviceReport, objects: Vec<ListedObject>) -> Self {
        let (schema, tool) = ("linesman.objects/1".to_owned(), version::tool());
        Self { schema, tool, device, objects }
    }

    /// A table for people.
    pub(super) fn text(&self, output: &Output) -> String {
        let mut table = Table::new(&["object", "name", "type", "rights", "value"], output.paint());
        for object in &self.objects {
            let of_kind = [object.kind.clone(), object.r#type.clone()];
            let of_kind = of_kind.into_iter().flatten().collect::<Vec<_>>().join(" ");
            let name = object.name.clone().unwrap_or_default();
            let index = ObjectIndex(object.index).to_string();
            table.row([index, name, of_kind, String::new(), String::new()]);
            for entry in &object.entries {
                let name = format!("  {}", entry.name);
                let address = format!("    :{:02X}", entry.subindex);
                let rights = entry.rights();
                table.row([address, name, entry.r#type.clone(), rights, entry.value_text()]);
            }
        }
        table.render()
    }
}
