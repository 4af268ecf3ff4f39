//! Questions of the diagnosis, asked by the MainDevice beside its cycle.

use linesman_diagnosis::{Asked, Probe};
use linesman_maindevice::{MainDevice, ProbeRequest, Target};
use linesman_proto::time::Instant;

/// Asks what the diagnosis would like to know; the answer passes as a frame that the diagnosis sees. What cannot be
/// asked, an object of a SubDevice that no plan names, is left.
pub fn ask(probe: &Probe, now: Instant, main: &mut MainDevice) {
    let target = Target::Station(probe.station);
    match probe.what {
        Asked::Register { address, len } => {
            main.probe(now, ProbeRequest { target, register: address, len, write: None });
        }
        Asked::Written { address, data } => {
            let write = Some(Vec::from(data));
            main.probe(now, ProbeRequest { target, register: address, len: 2, write });
        }
        Asked::Object(object) => {
            let devices = main.plan().map(|plan| plan.devices.as_slice()).unwrap_or_default();
            let asked = devices.iter().find(|device| device.station == probe.station);
            if let Some(id) = asked.map(|device| device.id) {
                main.sdo_upload(now, id, object, false);
            }
        }
    }
}
