//! Silences after which the first SubDevice had lost its station address: it had no supply.

use linesman_config::fault::FaultName;
use linesman_proto::register::table;

use super::{PAGE, first_device};
use crate::finding::{Condition, Evidence, Place};
use crate::model::{Device, NetworkModel, Seen, Silence};

/// SubDevices, the first of the line among them, that were given their station addresses anew after a silence: they
/// had lost them, and their supply.
pub(super) fn others_with(model: &NetworkModel, silence: &Silence) -> Option<(usize, Seen<()>)> {
    let ended = silence.ended?;
    let lost = |device: &Device| device.lost_address.filter(|seen| seen.at >= ended);
    let first = first_device(model).unwrap_or_default();
    let seen = model.device(first).and_then(lost)?;
    Some((model.devices.iter().filter_map(lost).count(), seen))
}

/// Nothing came back while the first SubDevice had no supply.
pub(super) fn without_supply(
    model: &NetworkModel,
    silence: &Silence,
    count: usize,
    seen: Seen<()>,
) -> Condition {
    let first = first_device(model).unwrap_or_default();
    let place = Place::device(model.network, first);
    let text = format!(
        "{count} SubDevices, {} the first of them, were given their station addresses anew after it: they had started \
         anew",
        model.label(first)
    );
    Condition::new(&PAGE, place, FaultName::BrownOut, silence.since.at)
        .confidence(0.5)
        .or(FaultName::DeviceOff, 0.2)
        .or(FaultName::SupplyOff, 0.2)
        .shown_by(Evidence::register(first, table::STATION_ADDRESS.address, &seen, text))
        .advise(format!("Measure the supply of {} under load.", model.label(first)))
}
