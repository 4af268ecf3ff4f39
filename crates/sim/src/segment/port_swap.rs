//! Device that is plugged in the wrong way round.

use linesman_config::attachment::Attachment;
use linesman_config::project::Ring;
use linesman_proto::address::Path;
use linesman_proto::topology::wiring::ports_after;

use super::build::{BuildError, Placed};
use crate::fault::{FaultError, SwappedPorts};
use crate::hardware::PortKind;

/// Plugs the incoming cable of a device into another port, and what was there into the first.
pub(super) fn swap_ports(
    label: &str,
    placed: &mut [Placed],
    swapped_ports: &SwappedPorts,
    ring: &mut Option<Ring>,
) -> Result<(), BuildError> {
    let is_meant = |one: &Placed| match &swapped_ports.device {
        Some(name) => one.planned.name == *name,
        None => one.planned.on == Attachment::MainDevice(Path::A),
    };
    // The fault itself says what is wrong with its place.
    let Some(index) = placed.iter().position(is_meant) else { return Ok(()) };
    let (name, entry) = (placed[index].planned.name.clone(), placed[index].planned.entry);
    let ports = placed[index].planned.ports;
    let wrong = |what: String| {
        BuildError::Fault(FaultError::Combination {
            entry: label.to_owned(),
            kind: swapped_ports.kind,
            what,
        })
    };
    let device = placed[index].planned.device;
    if placed.iter().filter(|one| one.planned.device == device).count() > 1 {
        return Err(wrong(format!("`{name}` has several controllers: it cannot be turned")));
    }
    if ports[entry] != PortKind::Mii {
        return Err(wrong(format!("`{name}` is not entered by a cable: it cannot be turned")));
    }
    let at = |port| Attachment::Device { name: name.clone(), port };
    let fits = |port: &_| ports[*port] == PortKind::Mii;
    let leads_on = |port: &_| {
        let here = at(*port);
        placed.iter().any(|one| one.planned.on == here)
            || ring.as_ref().is_some_and(|ring| ring.closes_at == here)
    };
    let ways = || ports_after(entry).into_iter().filter(fits);
    let chosen = match swapped_ports.port {
        Some(port) => ways().find(|way| *way == port),
        None => ways().find(leads_on).or_else(|| ways().next()),
    };
    let Some(port) = chosen else {
        return Err(wrong(format!("`{name}` has no other port that takes this cable")));
    };
    let (from, to) = (at(port), at(entry));
    placed[index].planned.entry = port;
    for one in placed.iter_mut().filter(|one| one.planned.on == from) {
        one.planned.on = to.clone();
    }
    if let Some(ring) = ring.as_mut().filter(|ring| ring.closes_at == from) {
        ring.closes_at = to;
    }
    Ok(())
}
