//! `device-extra`: a device is there that was not planned. It is built in: it is there from the start
//! and cannot be healed. What hung at its place hangs behind it.

use linesman_config::attachment::Attachment;
use linesman_config::fault::FaultName;

use super::error::FaultError;
use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape, parameter};
use crate::segment_file::FaultEntry;

pub(super) const KIND: Kind = Kind {
    name: FaultName::DeviceExtra,
    place: PlaceRule::Device,
    parameters: &[
        Parameter {
            key: "type",
            meaning: "Its type; `device` is what it is called.",
            shape: Shape::Text,
        },
        Parameter {
            key: "on",
            meaning: "Whose port it hangs on, such as `K1.B`; what was there hangs behind it.",
            shape: Shape::Text,
        },
        Parameter {
            key: "serial",
            meaning: "Its serial number; counted on from those of the line unless said.",
            shape: Shape::Whole { low: 1, high: u32::MAX, default: None },
        },
    ],
    start: |_| Ok(ListedChanges::boxed([])),
};

/// A device that was not planned.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Extra {
    pub(crate) name: String,
    pub(crate) type_name: String,
    pub(crate) on: Attachment,
    pub(crate) serial: Option<u32>,
}

/// The device that an entry adds; `None` for entries of another kind.
pub(crate) fn extra(label: &str, entry: &FaultEntry) -> Result<Option<Extra>, FaultError> {
    if entry.kind != KIND.name.name() {
        return Ok(None);
    }
    let values = parameter::read(label, &KIND, &entry.parameters)?;
    let missing = |key: &str| FaultError::Combination {
        entry: label.to_owned(),
        kind: KIND.name,
        what: format!(
            "give `{key}`: what the device is called, its `type`, and `on` which port it hangs"
        ),
    };
    let name = entry.device.clone().ok_or_else(|| missing("device"))?;
    let type_name = values.text("type").ok_or_else(|| missing("type"))?.to_owned();
    let on = values.text("on").ok_or_else(|| missing("on"))?;
    let on = on.parse().map_err(|_| FaultError::Value {
        entry: label.to_owned(),
        key: "on".to_owned(),
        given: format!("`{on}`"),
        allowed: "a port such as `K1.B`, or `maindevice`".to_owned(),
    })?;
    let serial = values.whole("serial");
    Ok(Some(Extra { name, type_name, on, serial }))
}
