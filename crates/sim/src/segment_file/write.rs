//! Writing the file of a segment.

use std::fmt::Write as _;

use super::{FaultEntry, OneOrMany, Schedule, SegmentDevice, SegmentFile, Times, Value};
use crate::wire::Medium;

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
    if let Some(noise) = file.noise_at_link_up {
        let _ = writeln!(text, "noise_at_link_up = {}", number(noise));
    }
    for supply in &file.supplies {
        let devices: Vec<_> = supply.devices.iter().map(|name| quoted(name)).collect();
        let (name, devices) = (quoted(&supply.name), devices.join(", "));
        let _ = writeln!(text, "\n[[supply]]\nname = {name}\ndevices = [{devices}]");
    }
    for device in &file.devices {
        write_device(device, &mut text);
    }
    for wire in &file.wires {
        let _ = writeln!(text, "\n[[wire]]\nfrom = {}", quoted(&wire.from));
        if let Some(output) = wire.output {
            let _ = writeln!(text, "output = {output}");
        }
        let _ = writeln!(text, "to = {}", quoted(&wire.to));
        if let Some(input) = wire.input {
            let _ = writeln!(text, "input = {input}");
        }
    }
    if let Some(ring) = &file.ring {
        let _ = writeln!(text, "\n[ring]\ncloses_at = {}", quoted(&ring.closes_at.to_string()));
        if let Some(cable_m) = ring.cable_m {
            let _ = writeln!(text, "cable_m = {}", number(cable_m));
        }
        if let Some(medium) = ring.medium {
            let _ = writeln!(text, "medium = {}", quoted(word(medium)));
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
    if let Some(ms) = device.link_up_ms {
        line("link_up_ms", number(ms));
    }
    if let Some(group) = &device.group {
        line("group", quoted(group));
    }
    let numbers = [("serial", device.serial), ("alias", device.alias.map(u32::from))];
    for (key, number) in numbers {
        if let Some(number) = number {
            line(key, number.to_string());
        }
    }
    if let Some(id) = device.id {
        line("id", id.to_string());
    }
    if let Some(ppm) = device.clock_ppm {
        line("clock_ppm", number(ppm));
    }
    if let Some(medium) = device.medium {
        line("medium", quoted(word(medium)));
    }
    if let Some(remakes) = device.remakes_symbol_errors {
        line("remakes_symbol_errors", remakes.to_string());
    }
    if let Some(clock) = &device.clock {
        let keys = [
            ("ramp_ppm_per_s", clock.ramp_ppm_per_s.map(number)),
            ("ramp_s", clock.ramp_s.map(number)),
            ("jitter_ns", clock.jitter_ns.map(|ns| ns.to_string())),
            ("start_ns", clock.start_ns.map(|ns| ns.to_string())),
        ];
        let said = keys.into_iter().filter_map(|(key, value)| Some(format!("{key} = {}", value?)));
        line("clock", format!("{{ {} }}", said.collect::<Vec<_>>().join(", ")));
    }
    if let Some(ethernet) = &device.ethernet {
        let table = toml::Value::try_from(ethernet).map(|value| value.to_string());
        line("ethernet", table.unwrap_or_default());
    }
    if let Some(place) = device.sii {
        line("sii", quoted(place.name()));
    }
    if let Some(counts) = device.counts_forwarded {
        line("counts_forwarded", counts.to_string());
    }
    if let Some(slots) = &device.slots {
        let slots: Vec<_> = slots.iter().map(|slot| quoted(slot)).collect();
        line("slots", format!("[{}]", slots.join(", ")));
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
    if let Some(supply) = &fault.supply {
        line("supply", quoted(supply));
    }
    if let Some(from_ms) = fault.from_ms {
        line("from_ms", number(from_ms));
    }
    if let Some(to_ms) = fault.to_ms {
        line("to_ms", number(to_ms));
    }
    write_schedule(&fault.schedule, &mut line);
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

/// A medium as files write it.
const fn word(medium: Medium) -> &'static str {
    match medium {
        Medium::Direct => "direct",
        Medium::Fibre => "fibre",
        Medium::Converters => "converters",
    }
}

fn write_schedule(schedule: &Schedule, line: &mut impl FnMut(&str, String)) {
    match &schedule.at_ms {
        Some(Times::One(at)) => line("at_ms", number(*at)),
        Some(Times::Many(times)) => {
            let times: Vec<_> = times.iter().map(|at| number(*at)).collect();
            line("at_ms", format!("[{}]", times.join(", ")));
        }
        None => {}
    }
    if let Some(every) = schedule.every_ms {
        line("every_ms", number(every));
    }
    if let Some(random) = schedule.random {
        let stays = random.for_ms.map_or(String::new(), |ms| format!(", for_ms = {}", number(ms)));
        line("random", format!("{{ mean_ms = {}{stays} }}", number(random.mean_ms)));
    }
    if let Some(stays) = schedule.for_ms {
        line("for_ms", number(stays));
    }
    if let Some(times) = schedule.times {
        line("times", times.to_string());
    }
    if let Some(burst) = schedule.burst {
        let every = number(burst.every_ms);
        line("burst", format!("{{ count = {}, every_ms = {every} }}", burst.count));
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
