//! The budget of the E-bus as JSON.

use linesman_config::ebus::{EbusGroup, EbusMember};
use linesman_proto::address::DeviceId;
use serde::Serialize;

/// A feeder of the E-bus and those it feeds.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EbusReport {
    /// Number of the feeder.
    feeder: u32,
    supply_ma: i32,
    members: Vec<EbusMemberReport>,
    /// The first for whom too little is left.
    first_negative: Option<u32>,
    /// What to do about that.
    advice: Option<String>,
}

/// A SubDevice that is fed.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct EbusMemberReport {
    no: u32,
    name: String,
    current_ma: i32,
    remaining_ma: i32,
}

/// Who is fed by whom, and how much is left.
pub(crate) fn of(groups: Vec<EbusGroup>, name: impl Fn(DeviceId) -> String) -> Vec<EbusReport> {
    let report = |group: EbusGroup| {
        let first = group.first_negative();
        let advice = group.overload(&name).map(|overload| overload.advice);
        let member = |member: &EbusMember| EbusMemberReport {
            no: member.device.no(),
            name: name(member.device),
            current_ma: member.current_ma,
            remaining_ma: member.remaining_ma,
        };
        EbusReport {
            feeder: group.feeder.no(),
            supply_ma: group.supply_ma,
            first_negative: first.map(DeviceId::no),
            advice,
            members: group.members.iter().map(member).collect(),
        }
    };
    groups.into_iter().map(report).collect()
}
