//! What connects two devices: copper, fibre, the contacts of the terminal bus, and what may stand in
//! the middle of a cable.

use serde::{Deserialize, Serialize};

use crate::hardware::PortKind;
use crate::wire::CABLE_NS_PER_M;

/// Signal delay of a fibre: glass of a refractive index of 1.47, plastic of 1.49.
const FIBRE_NS_PER_M: f64 = 4.9;

/// What a link is made of.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cable {
    /// Twisted pairs of copper, 5 ns a metre.
    Copper,
    /// Glass or plastic fibre, 4.9 ns a metre.
    Fibre,
    /// Contacts between two neighbours: no length.
    Ebus,
}

impl Cable {
    /// Its name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Copper => "copper",
            Self::Fibre => "fibre",
            Self::Ebus => "ebus",
        }
    }

    /// Whether it fits a port.
    #[must_use]
    pub const fn fits(self, port: PortKind) -> bool {
        match self {
            Self::Copper | Self::Fibre => matches!(port, PortKind::Mii),
            Self::Ebus => matches!(port, PortKind::Ebus),
        }
    }

    const fn ns_per_m(self) -> f64 {
        match self {
            Self::Copper | Self::Ebus => CABLE_NS_PER_M,
            Self::Fibre => FIBRE_NS_PER_M,
        }
    }
}

/// What stands in the middle of a cable. Delays are typical ones; a switch is one that cuts through.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Via {
    /// A pair of converters with fibre between them.
    MediaConverter,
    /// An Ethernet switch.
    Switch,
}

impl Via {
    /// Its name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::MediaConverter => "media-converter",
            Self::Switch => "switch",
        }
    }

    const fn delay_ns(self) -> f64 {
        match self {
            Self::MediaConverter => 600.0,
            Self::Switch => 3_000.0,
        }
    }
}

/// The copper cable of the same delay, in metres.
pub(super) fn as_copper_m(length_m: f64, cable: Cable, via: Option<Via>) -> f64 {
    let delay_ns = length_m * cable.ns_per_m() + via.map_or(0.0, Via::delay_ns);
    delay_ns / CABLE_NS_PER_M
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_count_as_those_of_copper() {
        assert_eq!(as_copper_m(20.0, Cable::Copper, None), 20.0);
        assert!((as_copper_m(1_000.0, Cable::Fibre, None) - 980.0).abs() < 1e-9);
        assert_eq!(as_copper_m(0.0, Cable::Copper, Some(Via::Switch)), 600.0);
    }
}
