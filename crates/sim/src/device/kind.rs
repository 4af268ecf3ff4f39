//! Kind of a device of a segment: a type of the library, or one that is made from data.

use std::sync::Arc;

use linesman_proto::port::PortMap;

use super::described::DescribedType;
use super::library::{Built, InnerLink, LibraryType};
use super::signal::Signals;
use crate::hardware::PortKind;

/// A type of device.
#[derive(Clone, Debug)]
pub enum DeviceKind {
    /// One that is built in.
    Library(&'static LibraryType),
    /// One that is made from data.
    Described(Arc<DescribedType>),
}

impl PartialEq for DeviceKind {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Library(one), Self::Library(other)) => one.name() == other.name(),
            (Self::Described(one), Self::Described(other)) => one == other,
            (Self::Library(_), Self::Described(_)) | (Self::Described(_), Self::Library(_)) => {
                false
            }
        }
    }
}

impl DeviceKind {
    /// Order designation.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Library(library) => library.name(),
            Self::Described(described) => &described.name,
        }
    }

    /// The group it is sold under.
    #[must_use]
    pub fn group(&self) -> &str {
        match self {
            Self::Library(library) => library.group(),
            Self::Described(described) => &described.group,
        }
    }

    /// The ports of each of its controllers.
    #[must_use]
    pub fn ports(&self) -> Vec<PortMap<PortKind>> {
        match self {
            Self::Library(library) => library.ports().collect(),
            Self::Described(described) => {
                described.controllers().map(DescribedType::ports).collect()
            }
        }
    }

    /// How its controllers hang together.
    #[must_use]
    pub fn inner_links(&self) -> Vec<InnerLink> {
        match self {
            Self::Library(library) => library.inner_links().to_vec(),
            Self::Described(described) => described.inner_links(),
        }
    }

    /// Whether its cables have Fast Hot Connect.
    #[must_use]
    pub fn fast_hot_connect(&self) -> bool {
        match self {
            Self::Library(library) => library.fast_hot_connect(),
            // Its data do not say so of a controller.
            Self::Described(_) => false,
        }
    }

    /// Current from the E-bus in mA; negative is supplied.
    #[must_use]
    pub fn ebus_current_ma(&self) -> i16 {
        match self {
            Self::Library(library) => library.ebus_current_ma(),
            Self::Described(described) => {
                described.controllers().map(DescribedType::ebus_current_ma).sum()
            }
        }
    }

    /// Makes a device: one [`Built`] for each of its controllers.
    #[must_use]
    pub fn build(&self, serial: u32, signals: &mut Signals) -> Vec<Built> {
        match self {
            Self::Library(library) => library.build(None, serial, signals),
            Self::Described(described) => {
                described.controllers().map(|one| one.build(None, serial, signals)).collect()
            }
        }
    }
}
