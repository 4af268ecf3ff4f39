//! Networks of one run that keep one time: the first of them that has clocks leads, the others follow (DC-12).

use std::sync::Arc;

use linesman_maindevice::{MainDevice, NetworkGroup};
use serde::{Deserialize, Serialize};

/// Place of a network among those of a run.
#[derive(Clone, Debug)]
pub struct NetworkPlace {
    network: NetworkGroup,
    /// Names of the lines, in their order.
    lines: Arc<[String]>,
}

impl NetworkPlace {
    /// Places of networks on lines that are called so: the first leads. Time has to be counted from the same moment on all.
    #[must_use]
    pub fn of(lines: &[String]) -> Vec<Self> {
        let called: Arc<[String]> = lines.into();
        let networks = NetworkGroup::in_order(lines.len()).into_iter();
        networks.map(|network| Self { network, lines: Arc::clone(&called) }).collect()
    }

    pub(super) fn network(&self) -> NetworkGroup {
        self.network.clone()
    }

    pub(super) fn report(&self, main: &MainDevice) -> GroupTime {
        self.time(main.leads_group(), main.ahead_of_group())
    }

    pub(crate) fn time(&self, leads: bool, ahead_ns: Option<i64>) -> GroupTime {
        let lead = self.network.leader().and_then(|rank| self.lines.get(rank)).cloned();
        GroupTime { leads, lead, ahead_ns }
    }
}

/// Time of a network against that of the one that leads.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct GroupTime {
    /// True if this network leads: its reference clock is left to itself.
    pub leads: bool,
    /// The line of the network that leads; `null`: none has begun, or none has clocks.
    pub lead: Option<String>,
    /// By how many ns the reference clock of this network is ahead of that of the one that leads, as the cyclic frames of both
    /// have it; negative: it is behind. `null`: it leads or follows nobody, or a time is not known yet.
    pub ahead_ns: Option<i64>,
}
