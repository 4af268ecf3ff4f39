//! Hot connect groups and cables of a plan as JSON.

use linesman_config::attachment::Attachment;
use linesman_config::plan::Plan;
use linesman_proto::address::DeviceId;
use linesman_proto::topology::End;
use serde::Serialize;

/// A hot connect group.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct HotConnectReport {
    name: String,
    /// Numbers of its SubDevices, that of the first one first.
    members: Vec<u32>,
    /// Where the number of the first one is read.
    source: Option<String>,
    /// The number by which the group is known.
    number: Option<u32>,
    /// Ports at which it may be plugged in; empty: any free port.
    places: Vec<String>,
    /// It may be absent.
    optional: bool,
}

/// A cable.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CableReport {
    /// Its ends, that nearer to the MainDevice first.
    from: String,
    to: String,
    /// All SubDevices are still reached when it breaks.
    may_break: bool,
    /// Numbers of the SubDevices that are lost when it breaks.
    lost: Vec<u32>,
}

pub(super) fn groups(plan: &Plan) -> Vec<HotConnectReport> {
    let groups = plan.groups.iter().map(|group| {
        let first = plan.device(group.first());
        let check = first.and_then(|device| device.settings.identification);
        HotConnectReport {
            name: group.name.clone(),
            members: group.members.iter().map(|id| id.no()).collect(),
            source: check.map(|check| check.source.to_string()),
            number: check.map(|check| check.value),
            places: group.places.iter().map(|place| written(plan, *place)).collect(),
            optional: group.optional,
        }
    });
    groups.collect()
}

pub(super) fn cables(plan: &Plan) -> Vec<CableReport> {
    let cables = plan.cables().into_iter().map(|cable| CableReport {
        from: written(plan, cable.link.upstream),
        to: written(plan, cable.link.downstream),
        may_break: cable.may_break,
        lost: cable.lost.iter().map(|id| id.no()).collect(),
    });
    cables.collect()
}

/// An end of a cable as projects write it.
pub(in crate::command::plan) fn written(plan: &Plan, end: End) -> String {
    match end {
        End::MainDevice(path) => Attachment::MainDevice(path).to_string(),
        End::Controller(node, port) => {
            let device = plan.device(DeviceId(node as u32));
            let name = device.map(|device| device.name.clone()).unwrap_or_default();
            Attachment::Device { name, port }.to_string()
        }
    }
}
