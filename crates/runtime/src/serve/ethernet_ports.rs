//! Ethernet ports of switch terminals in a segment, each bridged to a TAP interface of this computer.
//!
//! Reference: S0 L2883-2897 (EOE-05, EOE-07). What this computer, or whoever is connected to that interface, sends by it goes into
//! the port of the terminal, and through the mailbox to the MainDevice.

use std::io;

use linesman_link::error::LinkError;
use linesman_link::socket::{TapError, TapInterface, Waitable};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;
use linesman_sim::segment::{EthernetPortError, Segment};

/// Frames of an interface that are taken before others have their turn.
const PER_TURN: usize = 32;
/// The longest frame, in bytes: with a VLAN tag, and one more that tells that it was longer.
const BUFFER: usize = 1_519;

/// Why a port cannot be bridged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PortBridgeError {
    /// The segment has no such port, or a computer of its own there.
    #[error(transparent)]
    Port(#[from] EthernetPortError),
    /// No interface can be made.
    #[error(transparent)]
    Interface(#[from] TapError),
}

/// A port and its interface.
#[derive(Debug)]
struct PortBridge {
    device: DeviceId,
    port: u8,
    tap: TapInterface,
}

/// The ports. Their interfaces are removed with this.
#[derive(Debug, Default)]
pub struct EthernetPorts(Vec<PortBridge>);

impl EthernetPorts {
    /// Opens a port (`S4.1`), and makes an interface for it that is switched on.
    ///
    /// # Errors
    /// When there is no such port, or the interface cannot be made.
    pub fn open(
        &mut self,
        segment: &mut Segment,
        place: &str,
        name: &str,
    ) -> Result<(), PortBridgeError> {
        let (device, port) = segment.open_ethernet_port(place)?;
        let tap = TapInterface::open(name)?;
        tap.bring_up()?;
        self.0.push(PortBridge { device, port, tap });
        Ok(())
    }

    /// True if no port was opened.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The interfaces, to wait for frames of them.
    pub(super) fn waitable(&self) -> impl Iterator<Item = &dyn Waitable> {
        self.0.iter().map(|bridge| &bridge.tap as &dyn Waitable)
    }

    /// Carries frames both ways; gives how many came from the interfaces.
    pub(super) fn carry(&self, now: Instant, segment: &mut Segment) -> Result<usize, LinkError> {
        if self.0.is_empty() {
            return Ok(0);
        }
        let mut came = 0;
        let mut buffer = [0; BUFFER];
        for PortBridge { device, port, tap } in &self.0 {
            let failed = |doing, source: io::Error| LinkError::System {
                interface: tap.name().to_owned(),
                doing,
                source,
            };
            for _ in 0..PER_TURN {
                let received = tap.receive(&mut buffer);
                let received = received.map_err(|error| failed("receiving frames", error))?;
                let Some(frame) = received.and_then(|len| buffer.get(..len)) else { break };
                came += 1;
                // Longer ones are no Ethernet frames.
                if frame.len() < BUFFER {
                    segment.handle_ethernet_frame(now, *device, *port, frame);
                }
            }
        }
        for PortBridge { device, .. } in &self.0 {
            while let Some((port, frame)) = segment.poll_ethernet_frame(*device) {
                let is_it = |bridge: &&PortBridge| bridge.device == *device && bridge.port == port;
                let Some(PortBridge { tap, .. }) = self.0.iter().find(is_it) else { continue };
                // What it does not take is lost, as on any Ethernet.
                tap.send(&frame).map_err(|source| LinkError::System {
                    interface: tap.name().to_owned(),
                    doing: "sending a frame",
                    source,
                })?;
            }
        }
        Ok(came)
    }
}
