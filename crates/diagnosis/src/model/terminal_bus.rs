//! Terminal bus: devices that are plugged to one another without a cable.

use linesman_proto::port::Port;
use linesman_proto::sii::PortKind;
use linesman_proto::topology::End;

use super::NetworkModel;

/// True if a device hangs on the terminal bus, as far as its EEPROM, its type and the one before it tell: there a contact and the device
/// behind it fail alike.
#[must_use]
pub fn is_on_terminal_bus(model: &NetworkModel, node: usize) -> bool {
    let tree = model.tree.as_ref().filter(|tree| node < tree.len());
    // What its EEPROM says of the port by which frames come in.
    match tree.and_then(|tree| Some(model.devices[node].sii.power()?.ports[tree.entry(node)])) {
        Some(PortKind::EBus) => return true,
        Some(PortKind::Mii | PortKind::FastHotConnect) => return false,
        Some(PortKind::None | PortKind::Other(_)) | None => {}
    }
    let type_of = |node: usize| model.devices[node].type_name.as_deref().unwrap_or_default();
    let is_of = |node: usize, families: &[&str]| {
        families.iter().any(|family| type_of(node).starts_with(family))
    };
    // Junctions and extensions are called like couplers; but port B of a coupler is the bus, whoever is there.
    let above = tree.and_then(|tree| tree.upstream(node));
    let is_behind_coupler =
        matches!(above, Some(End::Controller(near, Port::B)) if is_of(near, &["EK"]));
    is_of(node, &["EL", "ES", "EJ", "EM", "KM"]) || is_behind_coupler
}
