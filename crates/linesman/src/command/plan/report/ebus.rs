//! The budget of the E-bus as JSON.

use linesman_config::plan::Plan;
use linesman_proto::address::DeviceId;
use serde::Serialize;

/// A feeder of the E-bus and those it feeds.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct EbusReport {
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
pub(super) fn of(plan: &Plan) -> Vec<EbusReport> {
    let name = |id: DeviceId| plan.device(id).map_or("", |device| device.name.as_str());
    let groups = plan.ebus_groups().into_iter();
    groups
        .map(|group| {
            let first = group.first_negative();
            EbusReport {
                feeder: group.feeder.no(),
                supply_ma: group.supply_ma,
                first_negative: first.map(DeviceId::no),
                advice: first
                    .map(|id| format!("insert a power feed terminal (EL94xx) before {}", name(id))),
                members: group
                    .members
                    .iter()
                    .map(|member| EbusMemberReport {
                        no: member.device.no(),
                        name: name(member.device).to_owned(),
                        current_ma: member.current_ma,
                        remaining_ma: member.remaining_ma,
                    })
                    .collect(),
            }
        })
        .collect()
}
