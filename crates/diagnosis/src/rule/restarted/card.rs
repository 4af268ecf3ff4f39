//! The MainDevice's card as a neighbour: the first SubDevice, and the last one of a ring, have no other that would tell
//! since when they were gone.

use linesman_proto::time::Instant;
use linesman_proto::topology::End;

use super::BEFORE;
use crate::model::{AlChange, Device, NetworkModel};

/// When the card that is plugged to a SubDevice lost its link, if it was back shortly before the SubDevice was seen in INIT.
///
/// For how long it was without link tells nothing of the supply: a card needs its time for the link to come up, too.
pub(super) fn lost(model: &NetworkModel, device: &Device, change: &AlChange) -> Option<Instant> {
    let tree = model.tree.as_ref().filter(|tree| device.id.index() < tree.len())?;
    let ends = tree.links().iter().map(|link| [link.upstream, link.downstream]);
    let its = ends.filter(|ends| ends.iter().any(|end| end.node() == Some(device.id.index())));
    let cards = its.flatten().filter_map(|end| match end {
        End::MainDevice(path) => Some(model.host.card(path)),
        End::Controller(..) => None,
    });
    let lost = cards.filter_map(|card| {
        let (lost, carrier) = (card.carrier_lost?, card.carrier?);
        let back = if carrier.value { carrier.at } else { change.at };
        (lost <= change.at && back + BEFORE >= change.at).then_some(lost)
    });
    lost.min()
}
