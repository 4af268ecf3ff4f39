//! Pages about registers of a controller, and about values read from them.

use linesman_proto::register::describe::decode_at;
use linesman_proto::register::{self, Description, Field, Form, Reading, Unit};
use linesman_proto::state::AlStatusCode;

use super::codes;
use super::found::Found;
use super::page::{Kind, Page};

/// A page about a register.
pub(super) fn register(found: &Description) -> Page {
    let entry = found.register;
    let bytes = if entry.len == 1 { "byte" } else { "bytes" };
    let title = format!("Register {}: {}", found.start(), found.title());
    let mut page = Page::new(Kind::Register, title)
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
        .list("bits", entry.fields.iter().map(field))
        .fact("see", entry.reference)
}

/// A page about what a register read.
pub(super) fn value(found: &Description, value: u64) -> Page {
    let entry = found.register;
    let room = usize::from(entry.len - found.offset).min(8);
    let data = &value.to_le_bytes()[..room];
    let digits = room * 2;
    let name = found.title();
    let title = format!("{name} ({}) = 0x{value:0digits$X}", found.start());
    let read = decode_at(entry, found.offset, data);
    Page::new(Kind::Value, title)
        .text(format!("It says: {}.", register::describe::summary_at(entry, found.offset, data)))
        .list("bits", readings(&read))
        .fact("register", entry.meaning)
        .fact("see", entry.reference)
}

/// Adds what a value of a register says; of an AL status code the code, too.
pub(super) fn add_value(register: &Description, value: u64, likelihood: u8, found: &mut Found) {
    found.add(likelihood, self::value(register, value));
    if register.start() == register::AL_STATUS_CODE.address {
        found.add(likelihood + 1, codes::status(AlStatusCode(value as u16)));
    }
}

/// Values of fields, one line each; flags that are not set share the last line.
pub(super) fn readings(readings: &[Reading]) -> Vec<String> {
    let is_clear = |reading: &&Reading| reading.field.form == Form::Flag && reading.value == 0;
    let set = readings.iter().filter(|reading| !is_clear(reading));
    let mut lines: Vec<String> = set
        .map(|reading| match reading.field.form {
            Form::Flag => format!("{}: {}", bits(reading.field), reading.field.name),
            Form::Choice
            | Form::Decimal
            | Form::Hex
            | Form::Signed
            | Form::SignMagnitude
            | Form::Bytes => {
                format!("{}: {} = {}", bits(reading.field), reading.field.name, reading.text)
            }
        })
        .collect();
    let clear: Vec<&str> =
        readings.iter().filter(is_clear).map(|reading| reading.field.name).collect();
    if !clear.is_empty() {
        lines.push(format!("not set: {}", clear.join(", ")));
    }
    lines
}

/// The meaning of a field, in one line.
pub(super) fn field(field: &Field) -> String {
    let unit = if field.unit.is_empty() { String::new() } else { format!(" ({})", field.unit) };
    let values: Vec<String> =
        field.values.iter().map(|(value, name)| value_text(field.form, *value, name)).collect();
    let values = match values.is_empty() {
        true => String::new(),
        false => format!(" [{}]", values.join("; ")),
    };
    format!("{}: {}{unit}. {}{values}", bits(field), field.name, field.meaning)
}

fn bits(field: &Field) -> String {
    match field.high - field.low {
        0 => format!("{}", field.low),
        _ => format!("{}-{}", field.low, field.high),
    }
}

fn value_text(form: Form, value: u32, name: &str) -> String {
    match form {
        Form::Hex | Form::Bytes => format!("0x{value:X} {name}"),
        Form::Flag | Form::Choice | Form::Decimal | Form::Signed | Form::SignMagnitude => {
            format!("{value} {name}")
        }
    }
}
