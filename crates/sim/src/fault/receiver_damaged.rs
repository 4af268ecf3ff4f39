//! `receiver-damaged`: the input stage of a port is damaged.
//!
//! The port itself sees symbol errors in whatever comes in. The place is the line that ends at the
//! port, `K1.C>B3.A` for the receiver of B3's port A. Seen from the frames it is the same as a
//! damaged transmitter at the other end: only exchanging parts tells them apart.

use linesman_config::fault::FaultName;

use super::source::{PORT_CIRCUIT, steady};
use super::{Kind, PlaceRule};

pub(super) const KIND: Kind = Kind {
    name: FaultName::ReceiverDamaged,
    place: PlaceRule::Direction,
    parameters: PORT_CIRCUIT,
    start: |start| {
        let directions = start.target.directions.clone();
        Ok(steady(&start, directions))
    },
};
