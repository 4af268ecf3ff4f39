//! Deviations from the plan that are built into a segment: extra devices, swapped devices, aliases
//! that two share.

use std::collections::BTreeMap;

use linesman_config::attachment::Attachment;
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::topology::wiring::ports_after;

use super::DeviceInfo;
use super::build::{BuildError, Placed, label, used_ports};
use crate::fault::{self, FaultError};
use crate::segment_file::{FaultEntry, SegmentDevice, SegmentFile};

/// The file with the devices that nobody planned, behind all others in number.
pub(super) fn with_extras(file: &SegmentFile) -> Result<SegmentFile, BuildError> {
    let mut file = file.clone();
    let planned = file.devices.len();
    for (index, entry) in file.faults.clone().iter().enumerate() {
        let label = label(index);
        let Some(extra) = fault::extra(&label, entry)? else { continue };
        let kind = file.kind(&extra.type_name, None).map_err(|source| BuildError::Replacement {
            entry: label.clone(),
            source: Box::new(source),
        })?;
        let misfit = |why: &str| BuildError::Misfit {
            entry: label.clone(),
            device: extra.name.clone(),
            type_name: kind.name().to_owned(),
            why: why.to_owned(),
        };
        if file.devices.iter().any(|known| known.name == extra.name) {
            return Err(misfit("a planned device is called so; give it another name"));
        }
        let behind = file.devices.iter().position(|known| known.on == extra.on);
        let closes = file.ring.as_ref().is_some_and(|ring| ring.closes_at == extra.on);
        if behind.is_some() || closes {
            let [ports] = kind.ports()[..] else {
                return Err(misfit("a device with several controllers cannot be put in between"));
            };
            let ways = ports_after(Port::A).into_iter();
            let Some(port) = ways.into_iter().find(|port| ports[*port] == ports[Port::A]) else {
                return Err(misfit("it has no way on for what hangs there"));
            };
            let way_on = Attachment::Device { name: extra.name.clone(), port };
            if let Some(behind) = behind {
                file.devices[behind].on = way_on;
            } else if let Some(ring) = &mut file.ring {
                ring.closes_at = way_on;
            }
        }
        let device = SegmentDevice::new(extra.name, extra.type_name, extra.on);
        file.devices.push(SegmentDevice { serial: extra.serial, ..device });
    }
    if file.devices.len() > planned {
        file.check()?;
    }
    Ok(file)
}

/// Puts two devices in each other's place, if the entry is about that.
pub(super) fn swap(
    label: &str,
    placed: &mut [Placed],
    entry: &FaultEntry,
) -> Result<(), BuildError> {
    let Some(twins) = fault::swaps(entry) else { return Ok(()) };
    let names = entry.devices.as_deref().unwrap_or(&[]);
    let place = |name: &String| placed.iter().position(|one| one.planned.name == *name);
    let [Some(one), Some(other)] = [names.first().and_then(place), names.get(1).and_then(place)]
    else {
        // The fault itself says what is wrong with its places.
        return Ok(());
    };
    let same = placed[one].planned.kind.name() == placed[other].planned.kind.name();
    if same != twins {
        let what = if twins {
            "they are of different types: that is `devices-swapped`"
        } else {
            "they are of the same type: that is `twins-swapped`"
        };
        let (entry, what) = (label.to_owned(), what.to_owned());
        let kind = if twins { fault::TWINS } else { fault::DEVICES };
        return Err(FaultError::Combination { entry, kind, what }.into());
    }
    for (at, by) in [(one, other), (other, one)] {
        let (device, kind) = (&placed[at].planned, &placed[by].planned);
        let misfit = |why: String| BuildError::Misfit {
            entry: label.to_owned(),
            device: device.name.clone(),
            type_name: kind.kind.name().to_owned(),
            why,
        };
        if kind.kind.ports().len() != 1 {
            return Err(misfit("devices with several controllers cannot be exchanged".to_owned()));
        }
        for port in used_ports(placed, at) {
            let (was, is) = (device.ports[port], kind.ports[port]);
            if was != is {
                return Err(misfit(format!("its port {port} is {is:?}, expected {was:?}")));
            }
        }
    }
    // The device is exchanged, with all that is its own; its place in the wiring stays.
    let mut parts = [placed[one].planned.clone(), placed[other].planned.clone()];
    parts.swap(0, 1);
    for (at, from) in [one, other].into_iter().zip(parts) {
        let planned = &mut placed[at].planned;
        (planned.device, planned.copy) = (from.device, from.copy);
        planned.kind = from.kind;
        planned.ports = from.ports;
        planned.serial = from.serial;
    }
    if twins {
        (placed[one].wiring_of, placed[other].wiring_of) =
            (Some(placed[other].id), Some(placed[one].id));
    }
    Ok(())
}

/// Gives devices the same alias.
pub(super) fn share_alias(placed: &mut [Placed], alias: u16, devices: &[String]) {
    for one in placed.iter_mut().filter(|one| devices.contains(&one.planned.name)) {
        one.alias = Some(alias);
    }
}

/// Devices that were exchanged with what is wired to them keep their wiring.
pub(super) fn move_wiring(placed: &[Placed], devices: &mut [DeviceInfo]) {
    if placed.iter().all(|one| one.wiring_of.is_none()) {
        return;
    }
    let before = devices.to_vec();
    for (at, one) in placed.iter().enumerate() {
        let from = one.wiring_of.and_then(|id| placed.iter().position(|other| other.id == id));
        if let Some(from) = from {
            devices[at] = before[from].clone();
        }
    }
}

/// The hot connect groups of a file, and who belongs to them.
pub(super) fn groups(file: &SegmentFile, placed: &[Placed]) -> BTreeMap<String, Vec<DeviceId>> {
    let mut groups: BTreeMap<String, Vec<DeviceId>> = BTreeMap::new();
    for one in placed {
        if let Some(name) = &file.devices[one.planned.device].group {
            groups.entry(format!("group:{name}")).or_default().push(one.id);
        }
    }
    groups
}
