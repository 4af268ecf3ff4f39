//! `ring-open`: a ring is open at one place.
//!
//! Everything still runs: each card's frames turn at the break and come back to the card that sent
//! them, each with the working counters of its half, and both together are full. The two ends of the
//! break count a lost link. The next break will not be survived.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, PlaceRule};
use crate::wire::Change;

pub(super) const KIND: Kind = Kind {
    name: FaultName::RingOpen,
    place: PlaceRule::RingLink,
    parameters: &[],
    start: |start| {
        let from = start.from;
        Ok(ListedChanges::boxed(
            start.target.links.into_iter().map(|link| (from, Change::Open { link })),
        ))
    },
};
