//! `maindevice-wrong-port`: the MainDevice is plugged into a port of the first SubDevice that is not
//! its IN port. It is built in.
//!
//! As with `ports-swapped`, for the first of the line: the frame enters behind its processing unit.
//! While nothing is plugged into its IN port the whole line is processed before it, and every frame
//! comes back with the circulating bit set.

use linesman_config::fault::FaultName;

use super::ports_swapped::OUT_PORTS;
use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};

pub(super) const KIND: Kind = Kind {
    name: FaultName::MainDeviceWrongPort,
    place: PlaceRule::Card,
    parameters: &[Parameter {
        key: "port",
        meaning: "The port that the MainDevice is plugged into; the one that leads on by cable unless said.",
        shape: Shape::Word { words: OUT_PORTS },
    }],
    start: |_| Ok(ListedChanges::boxed([])),
};
