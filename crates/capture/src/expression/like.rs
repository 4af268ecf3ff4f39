//! Expression that describes a frame of a capture: one of its fields, or its datagrams.

use super::evaluate;
use super::field::FieldReference;
use crate::knowledge::DeviceIndex;
use crate::row::{CaptureRow, DatagramRow};

/// The expression that frames like this one meet in a field; `None` when the frame does not have it.
#[must_use]
pub fn like(
    row: &CaptureRow<'_>,
    reference: FieldReference,
    devices: Option<&DeviceIndex>,
) -> Option<String> {
    let field = reference.field;
    let mut values = evaluate::values(row, reference, devices);
    values.sort_unstable();
    values.dedup();
    let name = match reference.datagram {
        Some(index) => field.name.replacen("ecat.", &format!("ecat.sub{}.", index + 1), 1),
        None => field.name.to_owned(),
    };
    let written: Vec<String> = values.iter().map(|value| field.kind.write(*value)).collect();
    match written.as_slice() {
        [] => None,
        [_] if field.kind == super::value::ValueKind::Presence => Some(name),
        [one] => Some(format!("{name} == {one}")),
        several => Some(format!("{name} in {{{}}}", several.join(", "))),
    }
}

/// The expression that frames with the same datagrams meet: commands and addresses; `None` for a frame without any.
///
/// Positions and broadcasts are described by their register alone, since their address changes on the way.
#[must_use]
pub fn like_datagrams(row: &CaptureRow<'_>) -> Option<String> {
    let mut all: Vec<String> = Vec::new();
    for datagram in &row.datagrams {
        let one = describe(datagram);
        if !all.contains(&one) {
            all.push(one);
        }
    }
    (!all.is_empty()).then(|| all.join(" && "))
}

fn describe(row: &DatagramRow<'_>) -> String {
    use linesman_proto::command::{Addressing, Command};
    let datagram = &row.datagram;
    let command = match datagram.command() {
        Some(command) => format!("ecat.cmd == \"{}\"", command.name()),
        None => format!("ecat.cmd == {}", datagram.code()),
    };
    let (adp, ado) = (datagram.adp(), datagram.ado().0);
    match datagram.command().map_or(Addressing::None, Command::addressing) {
        Addressing::None => format!("datagram({command})"),
        Addressing::Logical => {
            format!("datagram({command} && ecat.lad == {:#010x})", datagram.logical().0)
        }
        Addressing::Station => {
            format!("datagram({command} && ecat.adp == {adp:#06x} && ecat.ado == {ado:#06x})")
        }
        Addressing::Position | Addressing::Broadcast => {
            format!("datagram({command} && ecat.ado == {ado:#06x})")
        }
    }
}
