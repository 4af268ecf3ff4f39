//! Places as truth and verdict both name them.

use std::fmt;

use linesman_proto::address::DeviceId;
use linesman_proto::topology::{End, Tree};

/// One direction of a link, seen from its ends `a` (nearer the MainDevice) and `b`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Way {
    /// Away from the MainDevice.
    AToB,
    /// Towards the MainDevice.
    BToA,
}

/// A place on a line.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Site {
    /// A link.
    Link {
        /// The end nearer the MainDevice.
        a: End<DeviceId>,
        /// The other end, if it was ever seen.
        b: Option<End<DeviceId>>,
        /// The direction; `None` for both, or when it is not said.
        way: Option<Way>,
    },
    /// A SubDevice.
    Device(DeviceId),
    /// The MainDevice's computer or card.
    Host,
    /// The line as a whole.
    Network,
}

impl Site {
    /// The link between `from` and `to` as `tree` orders its ends, in the direction from `from` to
    /// `to`; without a direction if the tree has no such link.
    #[must_use]
    pub fn hop(tree: &Tree, from: End<DeviceId>, to: End<DeviceId>) -> Self {
        match is_upstream(tree, from, to) {
            true => Self::Link { a: from, b: Some(to), way: Some(Way::AToB) },
            false => Self::Link { a: to, b: Some(from), way: Some(Way::BToA) },
        }
    }

    /// The link between two ends, both directions.
    #[must_use]
    pub fn link(tree: &Tree, one: End<DeviceId>, other: End<DeviceId>) -> Self {
        match Self::hop(tree, one, other) {
            Self::Link { a, b, .. } => Self::Link { a, b, way: None },
            site @ (Self::Device(_) | Self::Host | Self::Network) => site,
        }
    }

    /// The link above `device`, both directions.
    #[must_use]
    pub fn above(tree: &Tree, device: DeviceId) -> Option<Self> {
        let a = named(tree.upstream(device.index())?);
        let b = End::Controller(device, tree.entry(device.index()));
        Some(Self::Link { a, b: Some(b), way: None })
    }

    /// Whether a claim of `claimed` is a claim of this place.
    ///
    /// A link of which one end was never seen is the link at the end that was: in a claim, the first. A claimed direction must be
    /// the one of this place; a claim without direction is as wide as the link. Where this place is
    /// a whole link, either direction of it is on it.
    #[must_use]
    pub fn covers(self, claimed: Self) -> bool {
        match (self, claimed) {
            (Self::Link { a, b, way }, Self::Link { a: a2, b: b2, way: way2 }) => {
                let ends = match b2 {
                    Some(_) => a == a2 && b == b2,
                    None => a == a2 || b == Some(a2),
                };
                let ways = match (way, way2) {
                    (Some(way), Some(claimed)) => way == claimed,
                    (None, _) | (Some(_), None) => true,
                };
                ends && ways
            }
            (Self::Device(_) | Self::Host | Self::Network, _) | (Self::Link { .. }, _) => {
                self == claimed
            }
        }
    }

    /// The place in words, with devices by `name`.
    pub fn describe(self, name: impl Fn(DeviceId) -> String) -> String {
        let end = |end: End<DeviceId>| match end {
            End::MainDevice(path) => format!("MainDevice.{path}"),
            End::Controller(id, port) => format!("{}.{port}", name(id)),
        };
        match self {
            Self::Link { a, b, way } => {
                let far = b.map_or_else(|| "?".to_owned(), end);
                match way {
                    None => format!("{}-{far}", end(a)),
                    Some(Way::AToB) => format!("{}>{far}", end(a)),
                    Some(Way::BToA) => format!("{far}>{}", end(a)),
                }
            }
            Self::Device(id) => name(id),
            Self::Host => "host".to_owned(),
            Self::Network => "network".to_owned(),
        }
    }
}

impl fmt::Display for Site {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.describe(|id| id.no().to_string()))
    }
}

/// Nodes of a tree in order of identity, named by it.
pub(crate) fn named(end: End) -> End<DeviceId> {
    end.map(|node| DeviceId(node as u32))
}

/// Whether `from` is the upstream end of the link `from`-`to`.
fn is_upstream(tree: &Tree, from: End<DeviceId>, to: End<DeviceId>) -> bool {
    let link = tree.links().iter().map(|link| link.map(|node| DeviceId(node as u32)));
    let upstream = link.into_iter().find(|link| {
        (link.upstream, link.downstream) == (from, to)
            || (link.upstream, link.downstream) == (to, from)
    });
    upstream.is_none_or(|link| link.upstream == from)
}
