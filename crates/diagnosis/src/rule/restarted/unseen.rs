//! SubDevices that were without a station address while others were exchanging process data, and whose fall nobody has
//! seen.

use linesman_config::fault::FaultName;
use linesman_proto::address::DeviceId;
use linesman_proto::register::table;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use super::{RESTARTED, TOGETHER, follows_from_restart};
use crate::finding::{Condition, Evidence, Place, Symptom};
use crate::model::{AlChange, Device, NetworkModel, Seen};

/// An absence that is heard for so long is more than a dip of a supply.
const LONG_HEARD: Span = Span::s(1);

/// One finding for all that have lost their addresses at about the same time.
pub(super) fn restarted(model: &NetworkModel) -> Option<Condition> {
    let has_no_fall = |device: &Device| !device.al.changes.iter().any(AlChange::is_own_fall);
    let unseen = |device: &Device| {
        let seen = device.lost_address.filter(|_| has_no_fall(device))?;
        Some((device.id, seen))
    };
    let all: Vec<(DeviceId, Seen<()>)> = model.devices.iter().filter_map(unseen).collect();
    let latest = all.iter().map(|(_, seen)| seen.at).max()?;
    let together: Vec<(DeviceId, Seen<()>)> =
        all.into_iter().filter(|(_, seen)| seen.at + TOGETHER >= latest).collect();
    let (first, seen) = *together.first()?;
    let label = model.label(first);
    let others = match together.len() {
        1 => String::new(),
        count => format!(" and {} others", count - 1),
    };
    let text = format!(
        "{label}{others} had no station address while others exchanged process data, and was given one anew: it has \
         started anew, and an open link does not do that"
    );
    let silent = model.device(first).and_then(|device| device.absences.back());
    let heard_since = silent.map_or(seen.at, |absence| absence.since.at.min(seen.at));
    let since =
        missing_since(model, together.len(), seen.at).unwrap_or(heard_since).min(heard_since);
    // Who joined late has seen the last of it: it may have lasted longer.
    let was_long = seen.at.since(since) >= LONG_HEARD;
    let (cause, others) = match (was_long, together.len() > 1) {
        (true, true) => {
            (FaultName::SupplyOff, [(FaultName::DeviceOff, 0.2), (FaultName::BrownOut, 0.15)])
        }
        (true, false) => {
            (FaultName::DeviceOff, [(FaultName::SupplyOff, 0.15), (FaultName::BrownOut, 0.15)])
        }
        (false, true) => {
            (FaultName::BrownOut, [(FaultName::SupplyOff, 0.3), (FaultName::DeviceOff, 0.1)])
        }
        (false, false) => {
            (FaultName::BrownOut, [(FaultName::DeviceOff, 0.2), (FaultName::SupplyOff, 0.1)])
        }
    };
    let place = Place::device(model.network, first);
    let ids = || together.iter().map(|(id, _)| *id);
    let mut condition = Condition::new(&RESTARTED, place, cause, since)
        .confidence(0.45)
        .or(others[0].0, others[0].1)
        .or(others[1].0, others[1].1)
        .confirmed(seen.at)
        .about([Symptom::StateLost(first)])
        .explaining(ids().flat_map(follows_from_restart))
        .shown_by(Evidence::register(first, table::STATION_ADDRESS.address, &seen, text))
        .advise("Measure the supply of this SubDevice under load, at its terminals.")
        .advise("Check plug and clamp of the supply; move them while watching the line.")
        .advise("Look what is switched on at the moments of the restarts.");
    if let Some(ended) = ended(model, ids()) {
        condition = condition.ended(ended);
    }
    Some(condition)
}

/// The time since which `count` SubDevices that came back at `back` were missing when SubDevices were counted.
fn missing_since(model: &NetworkModel, count: usize, back: Instant) -> Option<Instant> {
    let rise = model.traffic.broadcasts.rose()?;
    let is_same = usize::from(rise.more.value - rise.fewer.value) == count
        && rise.more.at.before(TOGETHER) <= back
        && back <= rise.more.at + TOGETHER;
    is_same.then_some(rise.fewer.at)
}

/// The time when the last of them was seen in OP again.
fn ended(model: &NetworkModel, ids: impl Iterator<Item = DeviceId>) -> Option<Instant> {
    let back = ids.map(|id| {
        let device = model.device(id)?;
        let is_back = device.silent.is_none()
            && !device.al.has_error()
            && device.al.state() == Some(AlState::Op);
        let status = device.al.status.filter(|_| is_back)?;
        (status.at > device.lost_address?.at).then_some(status.at)
    });
    let back: Option<Vec<Instant>> = back.collect();
    back?.into_iter().max()
}
