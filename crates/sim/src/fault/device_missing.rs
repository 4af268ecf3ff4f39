//! `device-missing`: a device that was planned is not there. It is built in: the line is made
//! without it, and what hung behind it on the same kind of wire moves up.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, PlaceRule};
use crate::segment_file::FaultEntry;

pub(super) const KIND: Kind = Kind {
    name: FaultName::DeviceMissing,
    place: PlaceRule::Device,
    parameters: &[],
    start: |_| Ok(ListedChanges::boxed([])),
};

/// The device that an entry leaves out; `None` for entries of another kind.
pub(crate) fn missing_device(entry: &FaultEntry) -> Option<&str> {
    if entry.kind == KIND.name.name() { entry.device.as_deref() } else { None }
}
