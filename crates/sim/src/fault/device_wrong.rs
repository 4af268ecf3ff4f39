//! `device-wrong`: another type or revision of device sits at a place than was planned. It is built
//! in: it is there from the start and cannot be healed.

use linesman_config::fault::FaultName;

use super::error::FaultError;
use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape, parameter};
use crate::segment_file::FaultEntry;

pub(super) const KIND: Kind = Kind {
    name: FaultName::DeviceWrong,
    place: PlaceRule::Device,
    parameters: &[
        Parameter {
            key: "type",
            meaning: "The library type that sits there instead.",
            shape: Shape::Text,
        },
        Parameter {
            key: "revision",
            meaning: "The revision number it has instead of its type's.",
            shape: Shape::Whole { low: 0, high: u32::MAX, default: None },
        },
    ],
    start: |_| Ok(ListedChanges::boxed([])),
};

/// What sits there instead.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Replacement {
    pub(crate) device: String,
    pub(crate) type_name: Option<String>,
    pub(crate) revision: Option<u32>,
}

/// The replacement that an entry asks for; `None` for entries of another kind.
pub(crate) fn replacement(
    label: &str,
    entry: &FaultEntry,
) -> Result<Option<Replacement>, FaultError> {
    if entry.kind != KIND.name.name() {
        return Ok(None);
    }
    let values = parameter::read(label, &KIND, &entry.parameters)?;
    let type_name = values.text("type").map(str::to_owned);
    let revision = values.whole("revision");
    if type_name.is_none() && revision.is_none() {
        return Err(FaultError::Combination {
            entry: label.to_owned(),
            kind: KIND.name,
            what: "give the `type` or the `revision` of what sits there instead".to_owned(),
        });
    }
    Ok(entry.device.clone().map(|device| Replacement { device, type_name, revision }))
}
