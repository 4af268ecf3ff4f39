//! Lint of clocks in a ring, and of a port multiplier at which it hangs (RED-12).
//!
//! Source: S0 L1077-1092. TwinCAT keeps clocks in a ring only behind a CU2508 that is the reference clock; this
//! MainDevice keeps those of both halves of an open ring in step by itself.

use linesman_proto::address::DeviceId;

use super::{Doubt, Severity};
use crate::plan::Plan;
use crate::plan::time_source::PORT_MULTIPLIER;

/// Vendor of the port multiplier.
const BECKHOFF: u32 = 2;

impl Plan {
    /// Whether clocks in the ring have what the project, or another MainDevice, asks for.
    pub(super) fn ring_clocks(&self, doubts: &mut Vec<Doubt>) {
        if self.tree.closes_at().is_none() {
            return;
        }
        if let Some([primary, second]) = self.ring_clocks.port_multiplier {
            doubts.push(Doubt {
                severity: Severity::Warning,
                name: "ring-port-multiplier",
                device: None,
                text: format!("the ring hangs at ports X{primary} and X{second} of a port multiplier"),
                advice: "run this plan with a MainDevice that sends through one; for `linesman run` plug both ends of \
                         the ring into cards of the computer, and leave `port_multiplier` out"
                    .to_owned(),
            });
        }
        let Some(reference) = self.reference_clock() else { return };
        // One that is there is the reference clock: a project is refused else (DC-13).
        let (_, product) = PORT_MULTIPLIER;
        let is_there = self.devices.iter().any(|device| {
            (device.identity.vendor_id, device.identity.product_code) == (BECKHOFF, product)
        });
        if self.ring_clocks.port_multiplier.is_none() && !is_there {
            doubts.push(self.without_multiplier(reference));
        }
    }

    /// The doubt about clocks in a ring that hangs at cards.
    fn without_multiplier(&self, reference: DeviceId) -> Doubt {
        let is_needed = self.ring_clocks.need_port_multiplier;
        let advice = match is_needed {
            true => {
                "hang the ring at a CU2508 (`port_multiplier = [\"X1\", \"X2\"]`), or leave out \
                     `clocks_need_port_multiplier`: `linesman run` needs none"
            }
            false => {
                "none is needed for `linesman run`; TwinCAT asks for a CU2508 (`clocks_need_port_multiplier = true` \
                      in [ring] makes this an error)"
            }
        };
        Doubt {
            severity: if is_needed { Severity::Error } else { Severity::Info },
            name: "ring-clocks",
            device: Some(reference),
            text: format!(
                "there are clocks in a ring without a port multiplier; {} is the reference clock",
                self.name(reference)
            ),
            advice: advice.to_owned(),
        }
    }
}
