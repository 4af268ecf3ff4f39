//! Ring of a project: where a second card closes it, and what it says of a port multiplier.
//!
//! Source: S0 L1077-1092 (clocks in a ring, pairs of ports of a CU2508).

use serde::{Deserialize, Serialize};

use crate::attachment::Attachment;
use crate::plan::RingClocks;

/// The far end of a ring.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Ring {
    /// The port that is wired to the second card, such as `B9.B`.
    pub closes_at: Attachment,
    /// The ports of a port multiplier (CU2508) at which the ring begins and ends, such as `["X1", "X2"]`, where it
    /// hangs at one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port_multiplier: Option<[String; 2]>,
    /// Clocks in the ring without a port multiplier are an error of the plan, as they are to TwinCAT. `linesman run`
    /// needs none.
    #[serde(default, skip_serializing_if = "is_no")]
    pub clocks_need_port_multiplier: bool,
}

fn is_no(value: &bool) -> bool {
    !*value
}

/// Ports of a port multiplier for SubDevices: X1 to X8 (S0 L1083).
const PORTS: u8 = 8;

impl Ring {
    /// A ring that closes there, with nothing special.
    #[must_use]
    pub const fn closing_at(closes_at: Attachment) -> Self {
        Self { closes_at, port_multiplier: None, clocks_need_port_multiplier: false }
    }

    /// What it says of clocks; ports of a port multiplier that are no pair are left out, having been refused.
    pub(super) fn clocks(&self) -> RingClocks {
        RingClocks {
            port_multiplier: self.pair().ok().flatten(),
            need_port_multiplier: self.clocks_need_port_multiplier,
        }
    }

    /// The ports of the port multiplier, counted from 1: the one of the first card, and the next.
    ///
    /// # Errors
    /// Ports that are no pair, in words with what was expected.
    pub(super) fn pair(&self) -> Result<Option<[u8; 2]>, String> {
        let Some(names) = &self.port_multiplier else { return Ok(None) };
        let number = |name: &String| {
            let number = name.strip_prefix('X').and_then(|number| number.parse::<u8>().ok());
            number.filter(|number| (1..=PORTS).contains(number)).ok_or_else(|| {
                format!(
                    "port_multiplier: `{name}` is no port of a CU2508 for SubDevices: expected X1 to X{PORTS}"
                )
            })
        };
        let [primary, second] = names;
        let ports = [number(primary)?, number(second)?];
        if ports[0].is_multiple_of(2) || ports[1] != ports[0] + 1 {
            return Err(format!(
                "port_multiplier: {primary} and {second} are no pair: expected X1 and X2, X3 and X4, X5 and X6, or X7 \
                 and X8, the first one for the first card"
            ));
        }
        Ok(Some(ports))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Project;
    use crate::plan::{Doubt, Plan, Severity};

    const REFERENCE: &str = "clock = { assign_activate = 0, reference = true }";

    /// A multiplier, unless left out, and two drives with clocks; the second one closes the ring.
    fn project(ring: &str, multiplier: &str) -> String {
        let on = if multiplier.is_empty() { "maindevice" } else { "CU.B" };
        let drive = |name: &str, on: &str| {
            format!(
                "[[device]]\nname = \"{name}\"\non = \"{on}\"\nclock = {{ assign_activate = 0x0300, sync0_cycle_us = 1000 }}\n\
                 description = {{ ports = \"YY--\", inputs_bits = 8 }}\n"
            )
        };
        let (one, other) = (drive("D1", on), drive("D2", "D1.B"));
        format!("[ring]\ncloses_at = \"D2.B\"\n{ring}\n{multiplier}\n{one}{other}")
    }

    fn multiplier(more: &str) -> String {
        format!(
            "[[device]]\nname = \"CU\"\non = \"maindevice\"\nvendor_id = 2\nproduct_code = 0x09CC5432\n{more}\n\
             description = {{ ports = \"YY--\", inputs_bits = 8 }}"
        )
    }

    fn plan(text: &str) -> Plan {
        Project::parse(text).unwrap().plan(&mut |_| Ok(None)).unwrap()
    }

    fn doubts(text: &str) -> Vec<(Severity, Doubt)> {
        let all = plan(text).doubts().into_iter();
        all.filter(|one| one.name.starts_with("ring-")).map(|one| (one.severity, one)).collect()
    }

    // proves: RED-12
    #[test]
    fn clocks_in_a_ring_without_a_port_multiplier_or_with_ports_that_are_no_pair_are_refused() {
        for (pair, expected) in [
            ("\"X1\", \"X2\"", None),
            ("\"X3\", \"X4\"", None),
            ("\"X5\", \"X6\"", None),
            ("\"X7\", \"X8\"", None),
            ("\"X2\", \"X3\"", Some("[ring]: port_multiplier: X2 and X3 are no pair")),
            ("\"X2\", \"X1\"", Some("are no pair: expected X1 and X2, X3 and X4")),
            ("\"X1\", \"X4\"", Some("are no pair")),
            (
                "\"X7\", \"X9\"",
                Some("`X9` is no port of a CU2508 for SubDevices: expected X1 to X8"),
            ),
            ("\"1\", \"2\"", Some("`1` is no port")),
        ] {
            let text = project(&format!("port_multiplier = [{pair}]"), &multiplier(REFERENCE));
            match (Project::parse(&text), expected) {
                (Ok(project), None) => {
                    assert_eq!(Project::parse(&project.to_toml()), Ok(project), "{pair}");
                }
                (Err(error), Some(expected)) => {
                    assert!(error.to_string().contains(expected), "{pair}: {error}");
                }
                (parsed, expected) => panic!("{pair}: {parsed:?}, expected {expected:?}"),
            }
        }
        let needed = doubts(&project("clocks_need_port_multiplier = true", ""));
        assert!(matches!(needed[..], [(Severity::Error, _)]), "{needed:?}");
        assert!(
            needed[0].1.text.contains("clocks in a ring without a port multiplier"),
            "{needed:?}"
        );
        let told = doubts(&project("", ""));
        assert!(matches!(told[..], [(Severity::Info, _)]), "{told:?}");
        assert!(told[0].1.advice.contains("TwinCAT"), "{told:?}");
    }

    #[test]
    fn a_port_multiplier_in_a_ring_is_its_reference_clock_or_that_is_told() {
        let ring = "port_multiplier = [\"X1\", \"X2\"]";
        let right = doubts(&project(ring, &multiplier(REFERENCE)));
        assert!(
            matches!(&right[..], [(Severity::Warning, one)] if one.name == "ring-port-multiplier"),
            "{right:?}"
        );
        let wrong = Project::parse(&project(ring, &multiplier(""))).unwrap_err();
        assert!(wrong.to_string().contains("that of `CU` is not here"), "{wrong}");
    }

    #[test]
    fn a_ring_without_clocks_has_no_such_doubt() {
        let text = project("clocks_need_port_multiplier = true", "");
        let text =
            text.replace("clock = { assign_activate = 0x0300, sync0_cycle_us = 1000 }\n", "");
        assert!(doubts(&text).is_empty());
    }
}
