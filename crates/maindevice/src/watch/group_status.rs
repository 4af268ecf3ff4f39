//! Status of a hot connect group.

use linesman_config::plan::HotConnectGroup;
use linesman_proto::address::DeviceId;

use crate::supervisor::GroupPlace;

/// How a hot connect group stands.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct GroupStatus {
    name: String,
    members: Vec<DeviceId>,
    pub(super) joined: bool,
    pub(super) place: Option<GroupPlace>,
}

impl GroupStatus {
    pub(super) fn new(group: &HotConnectGroup) -> Self {
        let (name, members) = (group.name.clone(), group.members.clone());
        Self { name, members, joined: false, place: None }
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

    /// The port that it hangs at; `None` while it is absent, and where that is not known.
    #[must_use]
    pub fn place(&self) -> Option<GroupPlace> {
        self.place
    }
}
