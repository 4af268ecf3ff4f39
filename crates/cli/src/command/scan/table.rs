//! A scan as text: the tree, a table, and what is doubtful.

use linesman_config::inventory::{FoundDevice, Inventory};
use linesman_lab::drawing::{self, Label};
use linesman_proto::address::DeviceId;
use linesman_proto::register::ErrorCounter;
use linesman_proto::topology::derive::Doubt;

use super::report::{can_be_reference, ports, state_name};
use crate::output::{Output, Paint, Table, wrapped};
use crate::text::quantity::count;

/// All of it.
pub(super) fn text(inventory: &Inventory, verbose: bool, output: &Output) -> String {
    let paint = output.paint();
    let mut text = format!("{}\n\n", count(inventory.devices.len() as u64, "SubDevice"));
    let label = |found: &FoundDevice| Label {
        name: found.profile.type_name.clone(),
        type_name: format!("{}  {}", state_text(found, paint), ports_text(found)),
    };
    let labels: Vec<Label> = inventory.devices.iter().map(label).collect();
    for row in drawing::draw(inventory.tree(), &labels) {
        text.push_str(row.text.trim_end());
        text.push('\n');
    }
    if verbose {
        text.push('\n');
        text.push_str(&details(inventory, paint));
    }
    for note in notes(inventory) {
        text.push_str(&wrapped("  ! ", &output.hint(&note), output.width()));
    }
    text
}

/// One row for each SubDevice with all its numbers.
fn details(inventory: &Inventory, paint: Paint) -> String {
    let headings = [
        "no",
        "station",
        "alias",
        "vendor",
        "product",
        "revision",
        "serial",
        "controller",
        "clock",
        "name",
    ];
    let mut table = Table::new(&headings, paint);
    for found in &inventory.devices {
        let number = |of: fn(&linesman_proto::sii::Identity) -> u32| {
            found.identity.as_ref().map_or_else(|| "?".to_owned(), |id| format!("0x{:08X}", of(id)))
        };
        table.row([
            found.id.no().to_string(),
            format!("0x{:04X}", found.station.value()),
            format!("0x{:04X}", found.alias.value()),
            number(|id| id.vendor_id),
            number(|id| id.product_code),
            number(|id| id.revision),
            number(|id| id.serial_number),
            found.information.controller.name().to_owned(),
            clock_text(found).to_owned(),
            found.profile.name.clone(),
        ]);
    }
    table.render()
}

/// Whether it has distributed clocks, and can be whom all others follow.
fn clock_text(found: &FoundDevice) -> &'static str {
    match (found.information.features.distributed_clocks(), can_be_reference(found)) {
        (false, _) => "no",
        (true, true) => "yes",
        (true, false) => "yes, not as reference",
    }
}

/// `OP`, or `PREOP, error 0x001D invalid output configuration`.
fn state_text(found: &FoundDevice, paint: Paint) -> String {
    let state = state_name(found);
    if found.al_status.error() {
        paint.bad(&format!("{state}, error {}", found.al_code))
    } else {
        state
    }
}

/// `A B - D`: ports with a link by letter, others as `-`.
fn ports_text(found: &FoundDevice) -> String {
    let letters: String = ports(found)
        .map(|port| if found.dl_status.port_state(port).link { port.letter() } else { '-' })
        .collect();
    format!("links {letters}")
}

/// What a person should know beside the table.
fn notes(inventory: &Inventory) -> Vec<String> {
    let mut notes = Vec::new();
    for found in &inventory.devices {
        notes.extend(
            found.sii_trouble.as_ref().map(|trouble| format!("{}: {trouble}", found.label())),
        );
    }
    let old: Vec<String> = inventory.devices.iter().filter_map(counters_text).collect();
    if !old.is_empty() {
        notes.push(format!(
            "error counters are not 0, which may be history: {}. Whether they grow tells `linesman \
             diagnose WHERE`",
            old.join("; ")
        ));
    }
    let overloads = inventory.ebus_groups();
    let overloads = overloads.iter().filter_map(|group| group.overload(|id| inventory.label(id)));
    notes.extend(overloads.map(|overload| format!("{}; {}", overload.text, overload.advice)));
    notes.extend(inventory.wiring.errors.iter().map(|error| format!("wiring: {error}")));
    notes.extend(inventory.wiring.doubts.iter().map(|doubt| doubt_text(inventory, doubt)));
    notes
}

/// `3 (EL1008) port A 12 frames`, for a SubDevice with counters above 0.
fn counters_text(found: &FoundDevice) -> Option<String> {
    let counted = |(counter, value): (ErrorCounter, u8)| {
        (value > 0).then(|| match counter.port() {
            Some(port) => format!("{} at port {port} {value}", counter.name()),
            None => format!("{} {value}", counter.name()),
        })
    };
    let texts: Vec<String> = found.counters.iter().filter_map(counted).collect();
    (!texts.is_empty()).then(|| format!("{}: {}", found.label(), texts.join(", ")))
}

fn doubt_text(inventory: &Inventory, doubt: &Doubt) -> String {
    let name = |node: &usize| inventory.label(DeviceId(*node as u32));
    match doubt {
        Doubt::Entry { node, taken } => format!(
            "wiring: {} has no clocks that tell its entry port; port {taken} was taken",
            name(node)
        ),
        Doubt::Place { node, port, child, candidates } => format!(
            "wiring: which branch hangs on port {port} of {} cannot be told among {candidates}; {} \
             was put there",
            name(node),
            name(child)
        ),
        Doubt::ReceiveTimes { node } => format!(
            "wiring: the receive times of {} contradict each other and were left aside",
            name(node)
        ),
    }
}
