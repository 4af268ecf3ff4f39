//! Wiring that was found, held against the plan.
//!
//! Where it is another one than planned, positions and station addresses mean other controllers than the plan
//! says. Rules that rely on positions ask here first; those that tell of the wiring itself take from here what
//! was found.

mod compared;
mod ring_half;

use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;

pub(crate) use compared::{FoundWiring, wanted};
pub(crate) use ring_half::{ReversedInRing, exchanged_cards, planned_ring};

use crate::finding::Symptom;
use crate::model::NetworkModel;

/// True if the trees can be compared, and differ: the comparison speaks of devices missing, extra and wrong, too.
pub(crate) fn is_wired_otherwise(model: &NetworkModel) -> bool {
    FoundWiring::of(model).is_some_and(|found| found.tells(&found.compare()))
}

/// True if somebody in a ring is plugged in the wrong way round, so that positions mean others than planned.
pub(crate) fn is_reversed_in_ring(model: &NetworkModel) -> bool {
    ReversedInRing::of(model).is_some()
}

/// Signs of SubDevices whose answers are taken for those of others, since they stand elsewhere than planned:
/// ports without a link where one belongs, working counters too low, states never reached, silence.
pub(crate) fn displaced(all: impl Iterator<Item = DeviceId>) -> impl Iterator<Item = Symptom> {
    all.flat_map(|id| {
        let of_port = move |port| [Symptom::LinkDown(id, port), Symptom::LinkCounted(id, port)];
        let own = [Symptom::Silent(id), Symptom::WorkingCounter(id), Symptom::StateLost(id)];
        Port::ALL.into_iter().flat_map(of_port).chain(own)
    })
}
