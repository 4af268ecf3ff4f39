//! Causes of a silence, each with how likely it is.

use linesman_config::fault::FaultName;
use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;

use super::{PAGE, first_device, first_link, outage_location};
use crate::finding::{Condition, Evidence, LinkDirection, Place};
use crate::model::is_on_terminal_bus;
use crate::model::{NetworkModel, Seen, Silence};
use crate::rule::View;

/// Likelihood that it is the card.
const CARD: f64 = 0.1;
/// Likelihood that a first device that nobody ever saw is not there, or has a supply that failed with others'.
const NEVER_SEEN: f64 = 0.08;

/// Frames do not come back at all: the first hop, or what is behind it.
pub(super) fn cut(
    model: &NetworkModel,
    at: Instant,
    carrier: Option<bool>,
    was_searched: bool,
) -> Condition {
    // Without a carrier it is the first hop for sure; with one, something forwards nothing.
    let (open, off, dead_link) = match carrier {
        Some(false) => (0.6, 0.3, 0.0),
        // Nobody looks for the place, and each link of the line may be the one.
        Some(true) if !model.sees_all_orders && !was_searched => {
            let network = Place::Network { network: model.network };
            return Condition::new(&PAGE, network, FaultName::FalseLink, at)
                .confidence(0.5)
                .or_at(FaultName::FalseLink, first_link(model), 0.2)
                .or_at(FaultName::NicDamaged, Place::Host, CARD)
                .or_at(FaultName::LinkOpen, first_link(model), 0.1);
        }
        Some(true) => {
            return Condition::new(&PAGE, first_link(model), FaultName::FalseLink, at)
                .confidence(0.5)
                .or_at(FaultName::FalseLink, Place::Network { network: model.network }, 0.25)
                .or_at(FaultName::NicDamaged, Place::Host, CARD)
                .or(FaultName::LinkOpen, 0.05);
        }
        None => (0.45, 0.3, 0.1),
    };
    let condition =
        Condition::new(&PAGE, first_link(model), FaultName::LinkOpen, at).confidence(open);
    let condition = match first_device(model) {
        Some(id) => condition.or_at(FaultName::DeviceOff, Place::device(model.network, id), off),
        None => condition.or(FaultName::DeviceOff, off),
    };
    let condition = match carrier {
        Some(false) => condition,
        Some(true) | None => condition.or(FaultName::FalseLink, dead_link),
    };
    let condition = condition.or_at(FaultName::NicDamaged, Place::Host, CARD);
    // Who was never seen may not be there at all.
    match first_device(model)
        .filter(|_| model.tree_is_planned && model.traffic.datagrams.answered() == 0)
    {
        Some(id) => condition
            .or_at(FaultName::DeviceMissing, Place::device(model.network, id), NEVER_SEEN)
            .or_at(FaultName::SupplyOff, Place::device(model.network, id), NEVER_SEEN),
        None => condition,
    }
}

/// Both cards of a ring have lost their links at once, and `id` hangs on both.
pub(super) fn dark(model: &NetworkModel, at: Instant, id: DeviceId) -> Condition {
    Condition::new(&PAGE, Place::device(model.network, id), FaultName::DeviceOff, at)
        .confidence(0.6)
        .or(FaultName::SupplyOff, 0.15)
        .or_at(FaultName::NicDamaged, Place::Host, CARD)
        .or_at(FaultName::LinkOpen, first_link(model), 0.05)
}

/// Where frames vanish was found by closing ports.
pub(super) fn placed(model: &NetworkModel, at: Instant, found: Seen<usize>) -> Condition {
    let place = match model.links().nth(found.value) {
        Some(link) => Place::link(model.network, link, Some(LinkDirection::Both)),
        None => Place::Network { network: model.network },
    };
    let text = "with the port before this link closed for a moment frames came back, with any port behind \
                it closed they did not";
    let behind = model.links().nth(found.value).and_then(|link| link.downstream.node());
    // Nothing that shows a link by itself can be between two terminals: one of two pairs of contacts is open.
    let (cause, sure, other, less) =
        match behind.is_some_and(|id| is_on_terminal_bus(model, id.index())) {
            true => (FaultName::LinkOpen, 0.6, FaultName::FalseLink, 0.3),
            false => (FaultName::FalseLink, 0.8, FaultName::LinkOpen, 0.1),
        };
    Condition::new(&PAGE, place, cause, at)
        .confidence(sure)
        .or(other, less)
        .shown_by(Evidence::host(Some(found.at), text))
        .advise(
            "Look at what is between the two ports, such as a media converter or a switch, and at the \
             device behind: its link lives, its controller does not.",
        )
}

/// Nothing came back for a while, and nobody has lost a link: something took the frames that shows one.
pub(super) fn hole(view: &View<'_>, silence: &Silence) -> Condition {
    let model = view.model;
    let network = Place::Network { network: model.network };
    let (place, confidence) = match outage_location::place(view, silence) {
        Some((link, sure)) => (link, sure),
        None => (network, 0.5),
    };
    let condition = Condition::new(&PAGE, place, FaultName::FalseLink, silence.since.at)
        .confidence(confidence)
        .or_at(FaultName::NicDamaged, Place::Host, CARD)
        .or_at(FaultName::HostDrops, Place::Host, CARD)
        .or_at(FaultName::CableDegraded, first_link(model), CARD);
    if place != network || model.sees_all_orders {
        return condition;
    }
    // Nobody can be asked for counters: whatever spoils every frame looks so.
    condition
        .or(FaultName::DeviceInternal, CARD)
        .or(FaultName::TransmitterDamaged, CARD / 2.0)
        .or(FaultName::ReceiverDamaged, CARD / 2.0)
}

/// Frames do come back, but damaged, and no counter can be asked where.
pub(super) fn spoiling(model: &NetworkModel, at: Instant) -> Condition {
    let place = Place::Network { network: model.network };
    Condition::new(&PAGE, place, FaultName::CableDegraded, at)
        .confidence(0.4)
        .or(FaultName::TransmitterDamaged, 0.15)
        .or(FaultName::DeviceInternal, 0.15)
        .or(FaultName::EmcNoise, 0.1)
        .or_at(FaultName::NicDamaged, Place::Host, CARD)
}
