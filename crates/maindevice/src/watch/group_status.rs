//! Status of a hot connect group.

use linesman_config::plan::{HotConnectGroup, IdentificationCheck};
use linesman_proto::address::DeviceId;

use crate::supervisor::GroupPlace;

/// Why a group, or what was plugged in for it, is kept in INIT.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum GroupRefusal {
    /// It tells another number than the planned one, or none.
    Number {
        /// What it must tell.
        check: IdentificationCheck,
        /// What it tells; `None`: it tells none.
        found: Option<u32>,
    },
    /// Several tell its number.
    Shared {
        /// The number.
        check: IdentificationCheck,
        /// How many tell it.
        count: u16,
    },
    /// It is plugged in where it may not be; `None` where that is not known.
    Place(Option<GroupPlace>),
}

/// How a hot connect group stands.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct GroupStatus {
    name: String,
    members: Vec<DeviceId>,
    pub(super) joined: bool,
    pub(super) place: Option<GroupPlace>,
    pub(super) refusal: Option<GroupRefusal>,
}

impl GroupStatus {
    pub(super) fn new(group: &HotConnectGroup) -> Self {
        let (name, members) = (group.name.clone(), group.members.clone());
        Self { name, members, joined: false, place: None, refusal: None }
    }

    /// Name for people.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its SubDevices, the first one first.
    #[must_use]
    pub fn members(&self) -> &[DeviceId] {
        &self.members
    }

    /// True if it is plugged in and all of it have reached their targets.
    #[must_use]
    pub fn has_joined(&self) -> bool {
        self.joined
    }

    /// Why it was not taken the last time that it, or another one in its stead, was plugged in; `None` since it has joined.
    #[must_use]
    pub fn refusal(&self) -> Option<GroupRefusal> {
        self.refusal
    }

    /// The port that it hangs at; `None` while it is absent, and where that is not known.
    #[must_use]
    pub fn place(&self) -> Option<GroupPlace> {
        self.place
    }
}
