//! Clocks as SOEM sets them (`ecx_configdc`): one latch of all, then of each clock its times, its offset and its
//! delay, one after another.

use linesman_maindevice::Target;
use linesman_proto::address::Path;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{
    RECEIVE_TIME, RECEIVE_TIME_PROCESSING_UNIT, SYSTEM_TIME_DELAY, SYSTEM_TIME_OFFSET,
};
use linesman_proto::time::{DcTime32, Span};
use linesman_proto::topology::{Delays, Reconstruction, SeenController};

use super::bus::{Bus, RETURN};
use super::device::Device;

/// How much longer a frame takes through a controller whose processing unit it passes.
const THROUGH_UNIT: Span = Span::ns(20);

/// Sets all clocks. Gives the first one, which leads.
pub(super) async fn configure(bus: &Bus, devices: &[Device]) -> Option<Target> {
    bus.write(Target::All, RECEIVE_TIME.address.0, &[0; 4], RETURN).await;
    let time = bus.now().as_nanos();
    let mut seen: Vec<SeenController> = Vec::with_capacity(devices.len());
    let mut leads = None;
    for device in devices {
        let open = PortMap::from_fn(|port| device.dl_status.port_state(port).is_active());
        seen.push(SeenController { open, received: PortMap::from_fn(|_| None) });
        if !device.has_clock {
            continue;
        }
        let received = set_offset(bus, device, time).await;
        if let Some(last) = seen.last_mut() {
            last.received = PortMap::from_fn(|port| received[port].filter(|_| open[port]));
        }
        if leads.is_none() {
            leads = Some(device.target());
        } else {
            let delay = delay(&seen).to_le_bytes();
            bus.write(device.target(), SYSTEM_TIME_DELAY.address.0, &delay, RETURN).await;
        }
    }
    leads
}

/// Reads at which time the latch came to each port, and has the clock show the time of the computer.
async fn set_offset(bus: &Bus, device: &Device, time: u64) -> PortMap<Option<DcTime32>> {
    let target = device.target();
    let mut times = [None; 4];
    for (port, entry) in times.iter_mut().enumerate() {
        let reply = bus.read(target, RECEIVE_TIME.address.0 + 4 * port as u16, 4, RETURN).await;
        if reply.answered() {
            *entry = Some(DcTime32(u32::from_le_bytes(reply.bytes(0))));
        }
        if port == 0 {
            let unit = RECEIVE_TIME_PROCESSING_UNIT.address.0;
            let latched = bus.read(target, unit, 8, RETURN).await;
            let offset = time.wrapping_sub(u64::from_le_bytes(latched.bytes(0)));
            let at = SYSTEM_TIME_OFFSET.address.0;
            bus.write(target, at, &offset.to_le_bytes(), RETURN).await;
        }
    }
    PortMap::from_fn(|port: Port| times[port.index()])
}

/// How much later than the first one the last of these saw the latch, in ns; 0 when its times do not fit.
fn delay(seen: &[SeenController]) -> u32 {
    let received: Vec<_> = seen.iter().map(|seen| seen.received).collect();
    let tree = Reconstruction::of(Path::A, seen).tree;
    let delays = Delays::measure(&tree, Path::A, &received, THROUGH_UNIT).ok();
    let last = delays.and_then(|delays| delays.of(seen.len() - 1));
    last.map_or(0, |delay| u32::try_from(delay.from_reference.as_nanos()).unwrap_or(u32::MAX))
}
