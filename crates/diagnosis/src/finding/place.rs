//! Places of findings: link, SubDevice, network, this computer.

use std::fmt;

use linesman_proto::address::{DeviceId, Network, Path};
use linesman_proto::port::Port;
use linesman_proto::topology::{End, Link};

/// A place of a network.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Place {
    /// A link, or one direction of it.
    Link {
        /// The network.
        network: Network,
        /// The end nearer the MainDevice (in a ring: nearer card A while it is intact); the far end where that alone is
        /// known, by which frames come in.
        a: LinkEnd,
        /// The far end; `None` when the other end was never seen.
        b: Option<LinkEnd>,
        /// The direction in trouble; `None` when it is not known.
        direction: Option<LinkDirection>,
    },
    /// A controller.
    Device {
        /// The network.
        network: Network,
        /// Which.
        device: DeviceId,
    },
    /// The network as a whole.
    Network {
        /// Which.
        network: Network,
    },
    /// The computer that runs the MainDevice.
    Host,
}

/// An end of a link, of controllers by identity.
pub type LinkEnd = End<DeviceId>;

/// A direction of a link.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum LinkDirection {
    /// Away from the MainDevice.
    AToB,
    /// Towards the MainDevice.
    BToA,
    /// Both.
    Both,
}

impl Place {
    /// A link of the tree.
    #[must_use]
    pub const fn link(
        network: Network,
        link: Link<DeviceId>,
        direction: Option<LinkDirection>,
    ) -> Self {
        Self::Link { network, a: link.upstream, b: Some(link.downstream), direction }
    }

    /// A controller.
    #[must_use]
    pub const fn device(network: Network, device: DeviceId) -> Self {
        Self::Device { network, device }
    }

    /// Whether it is the same place, whichever direction of a link.
    #[must_use]
    pub fn is_same_spot(&self, other: &Self) -> bool {
        match (self, other) {
            (
                Self::Link { network, a, b, direction: _ },
                Self::Link { network: other_network, a: other_a, b: other_b, direction: _ },
            ) => network == other_network && a == other_a && b == other_b,
            (Self::Link { .. } | Self::Device { .. } | Self::Network { .. } | Self::Host, _) => {
                self == other
            }
        }
    }
}

impl fmt::Display for Place {
    /// `link 6.C - 14.A, a to b`, `device 7`, `network 0`, `host`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Link { network: _, a, b, direction } => {
                write!(f, "link {} - ", EndText(*a))?;
                match b {
                    Some(b) => write!(f, "{}", EndText(*b))?,
                    None => f.write_str("unknown")?,
                }
                match direction {
                    Some(LinkDirection::AToB) => f.write_str(", away from the MainDevice"),
                    Some(LinkDirection::BToA) => f.write_str(", towards the MainDevice"),
                    Some(LinkDirection::Both) | None => Ok(()),
                }
            }
            Self::Device { network: _, device } => write!(f, "device {}", device.no()),
            Self::Network { network } => write!(f, "network {network}"),
            Self::Host => f.write_str("host"),
        }
    }
}

/// An end as people write it: `6.C`, `MainDevice.A`.
struct EndText(LinkEnd);

impl fmt::Display for EndText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            End::MainDevice(path @ (Path::A | Path::B)) => write!(f, "MainDevice.{path}"),
            End::Controller(id, port) => write!(f, "{}.{}", id.no(), letter(port)),
        }
    }
}

const fn letter(port: Port) -> char {
    port.letter()
}
