//! States as evidence: AL status of each SubDevice, as it was read.

use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use super::{Assessment, Basis, Extent, Gap, InputKind, Reason, Subject};
use crate::finding::Place;
use crate::main_device::MainDeviceKind;
use crate::model::{Device, NetworkModel, Seen, StateRequest};

/// A reading that is older says nothing of the end.
const OLD: Span = Span::s(10);

/// A state that was asked for so shortly before the end may still be reached.
const SETTLES: Span = Span::ms(500);

/// A MainDevice that starts anew sends all of them back within this time.
const TOGETHER: Span = Span::s(1);

/// Whether the state of every SubDevice is known by a reading of AL status, and none signals an error.
pub(super) fn all_read(model: &NetworkModel) -> bool {
    let count = model.devices.len();
    count > 0
        && count >= model.device_count()
        && model.devices.iter().all(|one| one.al.state().is_some() && !one.al.has_own_error())
}

/// Assesses what is known of the states.
pub(super) fn assess(basis: &Basis<'_>) -> Assessment {
    let model = basis.model;
    let mut all = Assessment::judged(Subject::States);
    let unread: Vec<&Device> = model.devices.iter().filter(|one| one.al.status.is_none()).collect();
    let is_none_read = unread.len() == model.devices.len();
    let are_few = model.devices.is_empty() || model.devices.len() < model.device_count();
    if !unread.is_empty() || are_few {
        let extent = if is_none_read { Extent::NotJudged } else { Extent::InPart };
        let text = if is_none_read {
            "the state of no SubDevice was read".to_owned()
        } else {
            let labels: Vec<String> = unread.iter().map(|one| model.label(one.id)).collect();
            format!("the state of {} was not read", labels.join(", "))
        };
        let places = unread.iter().map(|one| Place::device(model.network, one.id));
        let places = if is_none_read { Vec::new() } else { places.collect() };
        let step = match basis.input {
            InputKind::Typed => "give the `state` of each SubDevice",
            InputKind::Driven | InputKind::ReadOut => "read the states: `linesman state WHERE`",
            InputKind::Listened | InputKind::Recorded => {
                "read AL status (0x0130) of all SubDevices with the MainDevice's own tool"
            }
        };
        let gap = Gap::new(Reason::StatesNotRead, text)
            .essential_if(!basis.expectations_known)
            .at(places)
            .step(step);
        all.lacks(extent, gap);
    }
    let is_old = |one: &&Device| one.al.latest_reading.is_some_and(|at| model.now.since(at) > OLD);
    let old: Vec<&Device> = model.devices.iter().filter(is_old).collect();
    if !old.is_empty() {
        let places = old.iter().map(|one| Place::device(model.network, one.id)).collect();
        let text = format!("the states of {} SubDevices were read long before the end", old.len());
        let gap =
            Gap::new(Reason::StatesOld, text).essential_if(!basis.expectations_known).at(places);
        all.lacks(Extent::InPart, gap);
    }
    unsettled(basis, &mut all);
    echoed(basis, &mut all);
    all
}

/// Error bits that are taken for the acknowledgement that the MainDevice writes with each request.
fn echoed(basis: &Basis<'_>, all: &mut Assessment) {
    let model = basis.model;
    let is_echo = |one: &&Device| {
        one.al
            .errors
            .back()
            .is_some_and(|error| error.ended.is_none() && error.may_be_echo() && !error.has_no_code)
    };
    let echoing: Vec<&Device> = model.devices.iter().filter(is_echo).collect();
    if echoing.is_empty() {
        return;
    }
    let labels: Vec<String> = echoing.iter().map(|one| model.label(one.id)).collect();
    let text = format!(
        "AL status of {} has the error bit in OP, and nobody has read a code: taken for the acknowledgement that the \
         MainDevice writes with each request",
        labels.join(", ")
    );
    let places = echoing.iter().map(|one| Place::device(model.network, one.id)).collect();
    let gap = Gap::new(Reason::StatesNotRead, text)
        .essential_if(basis.model.main_device_kind() != MainDeviceKind::Kickcat)
        .at(places)
        .step("read AL status code (0x0134) of these SubDevices with the MainDevice's own tool");
    all.lacks(Extent::InPart, gap);
}

/// Requests without an end, and what a MainDevice did about an error that nobody saw.
fn unsettled(basis: &Basis<'_>, all: &mut Assessment) {
    let model = basis.model;
    for device in &model.devices {
        let label = model.label(device.id);
        let open = device.al.requests.back().filter(|one| one.ended.is_none());
        let text = if let Some(untaken) = device.al.untaken {
            format!("{label} did not take the request for {}, working counter 0", untaken.value)
        } else if let Some(open) = open.filter(|one| is_unsettled(model, device, one)) {
            let waited = model.now.since(open.asked.at);
            format!(
                "{label} was asked for {} {waited} before the end, and was still in {}",
                open.to, open.from
            )
        } else if is_alone(model, device, |one| one.al.sent_back) {
            format!("the MainDevice sent {label} alone back to INIT: why was not seen")
        } else if is_alone(model, device, |one| one.al.acknowledged) {
            format!("the MainDevice acknowledged an error of {label} that was not read here")
        } else {
            continue;
        };
        let gap = Gap::new(Reason::StateUnsettled, text)
            .essential()
            .at(vec![Place::device(model.network, device.id)])
            .step(basis.look_longer());
        all.lacks(Extent::InPart, gap);
    }
}

/// Whether a SubDevice has not gone where it was last asked to go, for some time.
fn is_unsettled(model: &NetworkModel, device: &Device, open: &StateRequest) -> bool {
    let asked = device.al.requested.and_then(|requested| requested.value.state());
    asked == Some(open.to) && model.now.since(open.asked.at) >= SETTLES
}

/// Whether a SubDevice was given an order and others were not, as they are when a MainDevice starts anew.
fn is_alone(
    model: &NetworkModel,
    device: &Device,
    order: impl Fn(&Device) -> Option<Seen<()>>,
) -> bool {
    let Some(given) = order(device) else { return false };
    let is_near = |other: Instant| other.since(given.at).max(given.at.since(other)) <= TOGETHER;
    let others = model.devices.iter().filter(|other| other.id != device.id);
    let mut stayed = others.filter(|other| !order(other).is_some_and(|one| is_near(one.at)));
    stayed.any(|other| other.al.state().is_some_and(AlState::has_mailbox))
}
