//! `transmitter-damaged`: the output stage of a port is damaged.
//!
//! It is analogue: the port codes a good frame and sends poor symbols, always, whatever is moved or
//! switched. The neighbour sees symbol errors; the way back is clean. The place is the line that
//! leaves the port, `K1.C>B3.A` for the transmitter of K1's port C.

use linesman_config::fault::FaultName;

use super::source::{PORT_CIRCUIT, steady};
use super::{Kind, PlaceRule};

pub(super) const KIND: Kind = Kind {
    name: FaultName::TransmitterDamaged,
    place: PlaceRule::Direction,
    parameters: PORT_CIRCUIT,
    start: |start| {
        let directions = start.target.directions.clone();
        Ok(steady(&start, directions))
    },
};
