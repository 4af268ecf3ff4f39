//! Weighs causes anew by what was exchanged to find a fault, and what the errors did then.
//!
//! Errors that go with a cable blame the cable; errors that stay clear it, and blame what stayed. It has no
//! finding of its own: it changes those of the rules before it.

use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::topology::{End, Link};

use super::{Rule, View};
use crate::finding::{Alternative, Condition, Evidence, LinkDirection, Place};
use crate::model::NetworkModel;
use crate::model::reported::{ExchangeOutcome, ExchangePlace, Part, PartExchange};

/// The rule.
pub const RULE: Rule = Rule { pages: &[], judge };

/// How much more likely a cause is once the errors went with its part, and how much less once they did not.
const FACTOR: f64 = 10.0;
/// All causes together are at most so sure: somebody may have exchanged more than one part.
const MOST: f64 = 0.95;

#[expect(clippy::ptr_arg, reason = "all rules have this form")]
fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    for exchange in &view.model.reported.exchanges {
        for condition in conditions.iter_mut().filter(|one| is_about(view.model, exchange, one)) {
            weigh(view, exchange, condition);
        }
    }
}

/// Whether an exchange says something of a condition.
fn is_about(model: &NetworkModel, exchange: &PartExchange, condition: &Condition) -> bool {
    // What stayed did so where the part had been.
    let to = exchange.to.filter(|_| exchange.outcome == ExchangeOutcome::Moved);
    let places = std::iter::once(condition.place)
        .chain(condition.alternatives.iter().filter_map(|other| other.place));
    let mut places = places;
    places.any(|place| {
        let here = |at: ExchangePlace| touches(model, at, &place);
        here(exchange.at) || to.is_some_and(here)
    })
}

fn touches(model: &NetworkModel, at: ExchangePlace, place: &Place) -> bool {
    match (at, place) {
        (ExchangePlace::Link(link), Place::Link { a, b, .. }) => {
            let known = model.links().nth(link);
            known.is_some_and(|known| known.upstream == *a && Some(known.downstream) == *b)
        }
        (ExchangePlace::Ends(one, other), Place::Link { a, b, .. }) => {
            one == *a && Some(other) == *b
        }
        (ExchangePlace::Device(id), Place::Link { a, b, .. }) => {
            a.node() == Some(id) || b.is_some_and(|b| b.node() == Some(id))
        }
        (ExchangePlace::Device(id), Place::Device { device, .. }) => id == *device,
        (ExchangePlace::Host, Place::Host) => true,
        (ExchangePlace::Host, Place::Link { a, .. }) => *a == End::MainDevice(Path::A),
        (
            ExchangePlace::Link(_) | ExchangePlace::Ends(..),
            Place::Device { .. } | Place::Network { .. } | Place::Host,
        )
        | (ExchangePlace::Device(_), Place::Network { .. } | Place::Host)
        | (ExchangePlace::Host, Place::Device { .. } | Place::Network { .. }) => false,
    }
}

/// How far a cause at a place is one of the part that was exchanged: 0 not at all, 1 fully.
fn share(model: &NetworkModel, exchange: &PartExchange, cause: FaultName, place: &Place) -> f64 {
    use FaultName::{
        CableDegraded, DeviceInternal, DeviceOff, FirmwareFault, HostDrops, LinkFlapping, LinkOpen,
        NicDamaged, ReceiverDamaged, RingOpen, TransmitterDamaged,
    };
    let whole = |is: bool| if is { 1.0 } else { 0.0 };
    match exchange.part {
        Part::Cable => {
            // A cable elsewhere is another one.
            let mut places = [Some(exchange.at), exchange.to].into_iter().flatten();
            let is_it = places.any(|at| touches(model, at, place));
            let is_cable = matches!(cause, CableDegraded | LinkFlapping | LinkOpen | RingOpen);
            whole(is_it && is_cable)
        }
        Part::Card => whole(matches!(cause, NicDamaged | HostDrops)),
        Part::Device => {
            let mut ids = [Some(exchange.at), exchange.to].into_iter().flatten();
            let is_it = |id: Option<DeviceId>| {
                ids.any(|at| matches!(at, ExchangePlace::Device(device) if Some(device) == id))
            };
            match (cause, place) {
                (
                    DeviceInternal | DeviceOff | FirmwareFault | TransmitterDamaged
                    | ReceiverDamaged,
                    Place::Device { device, .. },
                ) => whole([Some(*device)].into_iter().any(is_it)),
                (TransmitterDamaged | ReceiverDamaged, Place::Link { a, b, direction, .. }) => {
                    let far = b.and_then(|b| b.node());
                    let end = match (direction, cause) {
                        (Some(LinkDirection::AToB), TransmitterDamaged)
                        | (Some(LinkDirection::BToA), ReceiverDamaged) => a.node(),
                        (Some(LinkDirection::AToB | LinkDirection::BToA), _) => far,
                        (Some(LinkDirection::Both) | None, _) => return 0.5,
                    };
                    whole([end].into_iter().any(is_it))
                }
                (DeviceOff, Place::Link { b, .. }) => {
                    whole([b.and_then(|b| b.node())].into_iter().any(is_it))
                }
                _ => 0.0,
            }
        }
    }
}

/// The cause that an exchanged part has by itself.
const fn own_cause(part: Part) -> FaultName {
    match part {
        Part::Cable => FaultName::CableDegraded,
        Part::Device => FaultName::DeviceInternal,
        Part::Card => FaultName::NicDamaged,
    }
}

fn weigh(view: &View<'_>, exchange: &PartExchange, condition: &mut Condition) {
    let mut causes: Vec<(FaultName, Place, f64)> =
        vec![(condition.cause, condition.place, condition.confidence)];
    causes.extend(
        condition
            .alternatives
            .iter()
            .map(|other| (other.cause, other.place.unwrap_or(condition.place), other.confidence)),
    );
    let total: f64 = causes.iter().map(|(.., confidence)| confidence).sum();
    let moved = exchange.outcome == ExchangeOutcome::Moved;
    let is_known =
        causes.iter().any(|(cause, place, _)| share(view.model, exchange, *cause, place) > 0.0);
    if moved && !is_known {
        // Nobody had thought of the part with which the errors went.
        let place = match (exchange.part, exchange.at) {
            (Part::Device, ExchangePlace::Device(id)) => Place::device(view.model.network, id),
            (Part::Card, _) => Place::Host,
            (Part::Cable | Part::Device, _) => condition.place,
        };
        causes.push((own_cause(exchange.part), place, 0.2));
    }
    for (cause, place, confidence) in &mut causes {
        let share = share(view.model, exchange, *cause, place);
        *confidence *= match moved {
            true => share * FACTOR + (1.0 - share) / FACTOR,
            false => share / FACTOR + (1.0 - share),
        };
    }
    let sum: f64 = causes.iter().map(|(.., confidence)| confidence).sum();
    let wanted = if moved { total.max(0.9) } else { total }.min(MOST);
    causes.iter_mut().for_each(|(.., confidence)| *confidence *= wanted / sum.max(1e-9));
    causes.sort_by(|one, other| other.2.total_cmp(&one.2));
    let mut causes = causes.into_iter();
    let Some((cause, place, confidence)) = causes.next() else { return };
    (condition.cause, condition.place, condition.confidence) = (cause, place, confidence);
    condition.alternatives = causes
        .map(|(cause, other, confidence)| Alternative {
            cause,
            place: (other != place).then_some(other),
            confidence,
        })
        .collect();
    say(view, exchange, condition);
}

fn say(view: &View<'_>, exchange: &PartExchange, condition: &mut Condition) {
    let model = view.model;
    let name = |at: ExchangePlace| match at {
        ExchangePlace::Link(link) => match model.links().nth(link) {
            Some(known) => Place::link(model.network, known, None).to_string(),
            None => "a link".to_owned(),
        },
        ExchangePlace::Ends(upstream, downstream) => {
            Place::link(model.network, Link { upstream, downstream }, None).to_string()
        }
        ExchangePlace::Device(id) => model.label(id),
        ExchangePlace::Host => "the computer".to_owned(),
    };
    let what = match exchange.part {
        Part::Cable => format!("the cable of {}", name(exchange.at)),
        Part::Device => name(exchange.at),
        Part::Card => "the network card".to_owned(),
    };
    let with = match (exchange.part, exchange.to) {
        (Part::Cable, Some(to)) => format!(" with that of {}", name(to)),
        (Part::Device | Part::Card, Some(to)) => format!(" with {}", name(to)),
        (_, None) => String::new(),
    };
    let (then, action) = match (exchange.outcome, exchange.part) {
        (ExchangeOutcome::Moved, Part::Cable) => {
            ("went with it", "Replace that cable, and look at what it rubbed on or was bent over.")
        }
        (ExchangeOutcome::Moved, Part::Device) => ("went with it", "Replace that SubDevice."),
        (ExchangeOutcome::Moved, Part::Card) => ("went with it", "Replace that network card."),
        (ExchangeOutcome::Stayed, Part::Cable) => (
            "stayed",
            "The cable is not it: exchange one of the two devices next, and look for sources of noise.",
        ),
        (ExchangeOutcome::Stayed, Part::Device) => (
            "stayed",
            "That SubDevice is not it: exchange the cable, then the device at the other end.",
        ),
        (ExchangeOutcome::Stayed, Part::Card) => {
            ("stayed", "The network card is not it: exchange the cable to the first SubDevice.")
        }
    };
    let text = format!("{what} was exchanged{with}, and the errors {then}");
    condition.evidence.push(Evidence::host(None, text));
    if exchange.outcome == ExchangeOutcome::Stayed && exchange.part == Part::Cable {
        condition.actions.retain(|action| !action.starts_with("Exchange the cable"));
    }
    condition.actions.insert(0, action.to_owned());
}
