//! The link of the MainDevice's card, where a listener on its computer does not know how the line is wired: the card alone
//! tells of it.

use linesman_config::fault::FaultName::{BrownOut, DeviceOff, LinkFlapping, LinkOpen, SupplyOff};
use linesman_proto::address::Path;
use linesman_proto::topology::End;

use super::{AGAIN, PAGE, SHORT, View};
use crate::finding::{Condition, Evidence, LinkDirection, Place, Symptom};

/// The links of both cards, as far as they were lost.
pub(super) fn lost<'v>(view: &'v View<'_>) -> impl Iterator<Item = Condition> + 'v {
    // Whoever drives the line says more of a link that it never had.
    let paths = Path::ALL.into_iter().filter(|_| !view.model.sees_all_orders);
    paths.filter_map(|path| of(view, path))
}

fn of(view: &View<'_>, path: Path) -> Option<Condition> {
    let model = view.model;
    let card = model.host.card(path);
    let (since, carrier) = (card.carrier_lost?, card.carrier?);
    let back = carrier.value.then_some(carrier.at);
    // It went, and it came.
    let is_repeated = card.carrier_changes.div_ceil(2) >= AGAIN;
    let place = Place::Link {
        network: model.network,
        a: End::MainDevice(path),
        b: None,
        direction: Some(LinkDirection::Both),
    };
    let begin = |cause| Condition::new(&PAGE, place, cause, since).confirmed(since);
    let mut condition = match back {
        _ if is_repeated => begin(LinkFlapping).confidence(0.6).or(BrownOut, 0.1),
        None => begin(LinkOpen).confidence(0.5).or(DeviceOff, 0.25).or(SupplyOff, 0.1),
        Some(back) if back.since(since) < SHORT => {
            begin(LinkOpen).confidence(0.45).or(LinkFlapping, 0.35).or(BrownOut, 0.1)
        }
        Some(_) => begin(LinkOpen).confidence(0.6).or(LinkFlapping, 0.15).or(DeviceOff, 0.15),
    };
    let text = match back {
        Some(back) => format!("card {path} had no link from {since} to {back}"),
        None => format!("card {path} has no link since {since}"),
    };
    condition = condition
        .shown_by(Evidence::host(Some(since), text))
        .about([Symptom::NoCarrier])
        .explaining([Symptom::FramesLost, Symptom::CardErrors, Symptom::NobodyAnswers])
        .explaining(model.devices.iter().flat_map(|device| {
            let id = device.id;
            [
                Symptom::Silent(id),
                Symptom::WorkingCounter(id),
                Symptom::StateLost(id),
                Symptom::Emergency(id),
            ]
        }))
        .advise("Look at the first SubDevice: if no lamp is lit, measure its supply first.")
        .advise("Seat the plugs at both ends of the first cable; then exchange it.");
    Some(match back {
        Some(back) => condition.ended(back),
        None => condition,
    })
}
