//! `device-off`: a device is without power, or its controller is dead: it alone. Terminals that a
//! coupler feeds keep their supply, unlike with `supply-off` and `brown-out`.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, PlaceRule};
use crate::wire::Change;

pub(super) const KIND: Kind = Kind {
    name: FaultName::DeviceOff,
    place: PlaceRule::Device,
    parameters: &[],
    start: |start| {
        let from = start.from;
        Ok(ListedChanges::boxed(
            start.target.nodes.into_iter().map(|node| (from, Change::Off { node })),
        ))
    },
};
