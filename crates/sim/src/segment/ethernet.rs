//! Ethernet sides of devices that speak EoE.

use linesman_proto::address::DeviceId;

use super::build::BuildError;
use crate::device::firmware::Firmware;
use crate::segment_file::SegmentDevice;

/// Tells a device what is at its Ethernet side. Each that speaks EoE has one, whatever the file says.
pub(super) fn connect(
    firmware: &mut dyn Firmware,
    device: &SegmentDevice,
    name: &str,
    id: DeviceId,
) -> Result<(), BuildError> {
    let refused = |why: String| BuildError::Ethernet { device: name.to_owned(), why };
    let said = device.ethernet.as_ref();
    let setup = said.cloned().unwrap_or_default().setup(name, id).map_err(refused)?;
    if firmware.connect_ethernet(&setup) || said.is_none() {
        return Ok(());
    }
    Err(refused(format!(
        "a {} has no such Ethernet side: `hosts` needs a switch terminal with such ports (EL6601: 1, EL6614: 1 to 4), \
         `ip` and `dhcp` any other device that speaks EoE",
        device.type_name
    )))
}
