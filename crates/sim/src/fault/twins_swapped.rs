//! `twins-swapped`: two equal devices sit in each other's place, and what is wired to them has come
//! along: only serial numbers and aliases tell, and process data that answer at the wrong place. It is
//! built in: it is there from the start and cannot be healed.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, PlaceRule};

pub(super) const KIND: Kind = Kind {
    name: FaultName::TwinsSwapped,
    place: PlaceRule::Pair,
    parameters: &[],
    start: |_| Ok(ListedChanges::boxed([])),
};
