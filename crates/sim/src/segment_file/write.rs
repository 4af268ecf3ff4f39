//! From a segment to its file.

use std::fmt::Write as _;

use super::{FaultEntry, OneOrMany, SegmentDevice, SegmentFile, Value};

pub(super) fn to_toml(file: &SegmentFile) -> String {
    let mut text = format!("name = {}\n", quoted(&file.name));
    if let Some(seed) = file.seed {
        let _ = writeln!(text, "seed = {seed}");
    }
    if file.old_counters {
        text.push_str("old_counters = true\n");
    }
    if let Some(counts) = file.counts_forwarded {
        let _ = writeln!(text, "counts_forwarded = {counts}");
    }
    for device in &file.devices {
        write_device(device, &mut text);
    }
    if let Some(ring) = &file.ring {
        let _ = writeln!(text, "\n[ring]\ncloses_at = {}", quoted(&ring.closes_at.to_string()));
        if let Some(cable_m) = ring.cable_m {
            let _ = writeln!(text, "cable_m = {}", number(cable_m));
        }
    }
    for fault in &file.faults {
        write_fault(fault, &mut text);
    }
    text
}

fn write_device(device: &SegmentDevice, text: &mut String) {
    let mut line = |key: &str, value: String| {
        let _ = writeln!(text, "{key} = {value}");
    };
    line("\n[[device]]\nname", quoted(&device.name));
    if let Some(repeat) = device.repeat {
        line("repeat", repeat.to_string());
    }
    line("type", quoted(&device.type_name));
    line("on", quoted(&device.on.to_string()));
    if let Some(entry) = &device.entry {
        line("entry", quoted(entry));
    }
    if let Some(cable_m) = device.cable_m {
        line("cable_m", number(cable_m));
    }
    if let Some(serial) = device.serial {
        line("serial", serial.to_string());
    }
    if let Some(ppm) = device.clock_ppm {
        line("clock_ppm", number(ppm));
    }
    if let Some(counts) = device.counts_forwarded {
        line("counts_forwarded", counts.to_string());
    }
    if !device.counters.is_empty() {
        let counters = device.counters.iter();
        let counters: Vec<_> =
            counters.map(|(key, value)| format!("{} = {value}", quoted(key))).collect();
        line("counters", format!("{{ {} }}", counters.join(", ")));
    }
}

fn write_fault(fault: &FaultEntry, text: &mut String) {
    let mut line = |key: &str, value: String| {
        let _ = writeln!(text, "{key} = {value}");
    };
    let list = |texts: &[String]| {
        let texts: Vec<_> = texts.iter().map(|text| quoted(text)).collect();
        format!("[{}]", texts.join(", "))
    };
    line("\n[[fault]]\nkind", quoted(&fault.kind));
    match &fault.at {
        Some(OneOrMany::One(at)) => line("at", quoted(at)),
        Some(OneOrMany::Many(at)) => line("at", list(at)),
        None => {}
    }
    if let Some(device) = &fault.device {
        line("device", quoted(device));
    }
    if let Some(devices) = &fault.devices {
        line("devices", list(devices));
    }
    if let Some(from_ms) = fault.from_ms {
        line("from_ms", number(from_ms));
    }
    if let Some(to_ms) = fault.to_ms {
        line("to_ms", number(to_ms));
    }
    for (key, value) in &fault.parameters {
        let value = match value {
            Value::Flag(flag) => flag.to_string(),
            Value::Integer(whole) => whole.to_string(),
            Value::Number(value) => number(*value),
            Value::Text(text) => quoted(text),
        };
        line(&key_of(key), value);
    }
}

fn number(number: f64) -> String {
    toml::Value::from(number).to_string()
}

/// A TOML string.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// A TOML key: bare where that is allowed.
fn key_of(key: &str) -> String {
    let bare = |letter: char| letter.is_ascii_alphanumeric() || letter == '_' || letter == '-';
    if !key.is_empty() && key.chars().all(bare) { key.to_owned() } else { quoted(key) }
}
