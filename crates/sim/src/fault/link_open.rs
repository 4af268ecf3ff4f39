//! `link-open`: a cable or contact is interrupted, from one instant to another.
//!
//! With both directions gone (`K1.C-K2.A`) each end finds its signal lost after its detection time,
//! counts a lost link and closes its loop; what is on the cable at that moment, and what is sent into
//! the open end until then, is lost. Behind it nobody answers: working counters are short by all who
//! hang there.
//!
//! With one direction gone (`K1.C>K2.A`, one pair of wires) the receiver finds out first. On copper
//! it starts the negotiation anew, so that the sender loses its link, too, a detection time later.
//! On fibre and on the E-bus there is no negotiation: the sender keeps its link, its loop stays open,
//! and every frame that it sends there vanishes. Between media converters neither end finds out.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, PlaceRule};

pub(super) const KIND: Kind = Kind {
    name: FaultName::LinkOpen,
    place: PlaceRule::Directions,
    parameters: &[],
    start: |start| {
        let from = start.from;
        Ok(ListedChanges::boxed(start.target.breaks().map(|(open, _)| (from, open))))
    },
};
