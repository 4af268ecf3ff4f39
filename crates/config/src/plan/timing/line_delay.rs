//! Delay of a frame between the reference clock and each SubDevice, from above.
//!
//! A SubDevice behind the reference clock gets the frame later by what those before it delay it, out and back: that
//! of a whole branch where the frame has gone round it, and more than it can be where it has not. One before the
//! reference clock gets it earlier by as much. Reference: SYN-17, S0 L401-423.

use linesman_proto::address::DeviceId;
use linesman_proto::sii::PortKind;
use linesman_proto::time::Span;
use linesman_proto::topology::End;

use super::super::Plan;
use super::super::shift::signed;
use super::assumption::Assumed;

/// Delay of copper, in ns per 10 m.
const CABLE_NS_PER_10_M: u64 = 53;

/// What cables delay a frame, out and back.
pub(super) fn cable_delay(metres: u64) -> Span {
    Span::ns(metres * CABLE_NS_PER_10_M * 2 / 10)
}

/// True if a cable leads to a SubDevice from the one before: neither end is known to be E-bus.
pub(super) fn cable_links(plan: &Plan, node: usize) -> bool {
    let Some(link) = plan.tree.link_above(node).and_then(|link| plan.tree.links().get(link)) else {
        return false;
    };
    let is_ebus = |end: End| match end {
        End::MainDevice(_) => false,
        End::Controller(node, port) => {
            let ports = plan.devices.get(node).and_then(|device| device.ports);
            ports.is_some_and(|ports| ports[port] == PortKind::EBus)
        }
    };
    !is_ebus(link.upstream) && !is_ebus(link.downstream)
}

/// How much earlier and how much later than at the reference clock a frame may be at each SubDevice, in ns.
pub(super) fn line_delays(plan: &Plan, assumed: &Assumed) -> Vec<(i64, i64)> {
    let reference = plan.reference_clock().map_or(0, DeviceId::index);
    let mut sum = 0_i64;
    let mut sums = vec![0];
    for device in &plan.devices {
        sum = sum.saturating_add(signed(device.least_delay()));
        sums.push(sum);
    }
    let mut links = 0;
    (0..plan.devices.len())
        .map(|node| {
            let between = (sums[node].saturating_sub(sums[reference])).abs();
            let is_behind = node > reference;
            links += usize::from(is_behind && cable_links(plan, node));
            match is_behind {
                true => (0, between + signed(cable_delay(assumed.cable_m(links)))),
                false => {
                    // No lengths are asked for before the reference clock: as if its cables were the longest.
                    let cables = (node + 1..=reference).filter(|node| cable_links(plan, *node));
                    (-between - signed(cable_delay(cables.count() as u64 * 100)), 0)
                }
            }
        })
        .collect()
}
