//! `devices-swapped`: two devices of different type sit in each other's place. It is built in: it is
//! there from the start and cannot be healed.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, PlaceRule};

pub(super) const KIND: Kind = Kind {
    name: FaultName::DevicesSwapped,
    place: PlaceRule::Pair,
    parameters: &[],
    start: |_| Ok(ListedChanges::boxed([])),
};
