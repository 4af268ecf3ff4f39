//! `ports-swapped`: IN and OUT of a SubDevice are swapped. It is built in.
//!
//! The cable that comes from the MainDevice is plugged into the OUT port, and what was there into IN.
//! The frame enters behind the processing unit: it goes on through the other ports first and is
//! processed on its way back, so that everybody behind has a smaller position than before. With
//! nothing at IN its loop is closed, the frame turns there and gets the circulating bit on its way
//! through; two such SubDevices in one line let no frame home.

use linesman_config::fault::FaultName;
use linesman_proto::port::Port;

use super::error::FaultError;
use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape, parameter};
use crate::segment_file::FaultEntry;

/// Letters of the ports that can be an OUT.
pub(super) const OUT_PORTS: &[&str] = &["auto", "B", "C", "D"];

pub(super) const KIND: Kind = Kind {
    name: FaultName::PortsSwapped,
    place: PlaceRule::Device,
    parameters: &[Parameter {
        key: "port",
        meaning: "The port that the incoming cable is plugged into; the one that leads on by cable unless said.",
        shape: Shape::Word { words: OUT_PORTS },
    }],
    start: |_| Ok(ListedChanges::boxed([])),
};

/// A device that is entered by another port than planned.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct SwappedPorts {
    /// The device; `None` for the first of the line.
    pub(crate) device: Option<String>,
    /// The port it is entered by, if that was said.
    pub(crate) port: Option<Port>,
    /// For errors.
    pub(crate) kind: FaultName,
}

/// What an entry turns round; `None` for entries of another kind.
pub(crate) fn swapped_ports(
    label: &str,
    entry: &FaultEntry,
) -> Result<Option<SwappedPorts>, FaultError> {
    let kinds = [&KIND, &super::maindevice_wrong_port::KIND];
    let Some(kind) = kinds.into_iter().find(|kind| kind.name.name() == entry.kind) else {
        return Ok(None);
    };
    let values = parameter::read(label, kind, &entry.parameters)?;
    let port = values.text("port").filter(|text| *text != OUT_PORTS[0]);
    let port = port.and_then(|text| Port::from_letter(text.chars().next()?));
    Ok(Some(SwappedPorts { device: entry.device.clone(), port, kind: kind.name }))
}
