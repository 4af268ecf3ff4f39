//! Ethernet sides of devices that speak EoE.

use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};

use super::Segment;
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

/// An Ethernet port that cannot be led out of a segment.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum EthernetPortError {
    /// No such device.
    #[error(
        "`{place}`: the segment has no device `{device}`: expected a switch terminal with its port, such as S4.1"
    )]
    NoDevice {
        /// The port that was asked for.
        place: String,
        /// The device of it.
        device: String,
    },
    /// No such port, or one that is in use.
    #[error(
        "`{place}`: expected a free port of a switch terminal (EL6601: 1, EL6614: 1 to 4), at which the segment has no computer \
         (`hosts`) and which was not named before, such as S4.1"
    )]
    NoPort {
        /// The port that was asked for.
        place: String,
    },
}

impl Segment {
    /// The Ethernet port that is written so (`S4.1`) leads out of the segment from now on: what comes to it is asked for by
    /// [`Segment::poll_ethernet_frame`], what comes from it goes to [`Segment::handle_ethernet_frame`].
    ///
    /// # Errors
    /// [`EthernetPortError`].
    pub fn open_ethernet_port(&mut self, place: &str) -> Result<(DeviceId, u8), EthernetPortError> {
        let no_port = || EthernetPortError::NoPort { place: place.to_owned() };
        let (name, port) = place.rsplit_once('.').unwrap_or((place, ""));
        let device = self.devices().find(|id| self.name(*id) == name);
        let node = device.and_then(|device| Some((device, self.node(device)?)));
        let Some((device, node)) = node else {
            let device = name.to_owned();
            return Err(EthernetPortError::NoDevice { place: place.to_owned(), device });
        };
        let port: u8 = port.parse().map_err(|_| no_port())?;
        let firmware = self.world.nodes[node].controller.firmware_mut();
        let is_open = firmware.ethernet_mut().is_some_and(|side| side.bridge(port));
        is_open.then_some((device, port)).ok_or_else(no_port)
    }

    /// A frame comes from outside to an Ethernet port that was opened. It is there just after `now`, behind all that has been
    /// worked out already.
    pub fn handle_ethernet_frame(
        &mut self,
        now: Instant,
        device: DeviceId,
        port: u8,
        frame: &[u8],
    ) {
        self.now = self.now.max(now);
        let at = self.now.max(self.world.horizon) + Span::ns(1);
        if let Some(node) = self.node(device) {
            self.world.nodes[node].controller.handle_ethernet_frame(at, port, frame.to_vec());
        }
    }

    /// The next frame that leaves by an Ethernet port of a device, and by which.
    pub fn poll_ethernet_frame(&mut self, device: DeviceId) -> Option<(u8, Vec<u8>)> {
        let waits = self.controller(device)?.firmware().ethernet()?.has_outside();
        let node = self.node(device).filter(|_| waits)?;
        self.world.nodes[node].controller.poll_ethernet_frame()
    }
}
