//! # Trouble of a SubDevice, as another tool reports it
//!
//! Another tool says in words or counts of its own that a SubDevice has trouble.
//!
//! **How it is found.** A list has `INIT_ERR` (a start-up command failed), the flag `E` (its configuration failed),
//! `LNK_ERR` (a link without communication), `LNK_ADD` or `LNK_MIS` at a port that is not in the plan, counts of states that it left unasked, or of times at which it was
//! gone; or a broadcast read of AL status shows several states, or the error bit, and nobody says whose. A MainDevice
//! says that its ring is open, or gets a higher working counter than it expects.
//!
//! **What it means.** `S208`: with a failed configuration the device refuses what it is told: the messages of
//! the tool say which object. A SubDevice that left its state unasked has lost outputs, its clock or its supply for
//! a moment; one that was gone has a contact that opens or a supply that dips. A link without communication has
//! something at its far end that is no EtherCAT, or that does not run yet.
//!
//! **What to do.** Read AL status and its code (0x0130, 0x0134) of the named SubDevice, and the messages of the tool
//! around that time.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::DeviceId;
use linesman_proto::state::AlState;
use linesman_proto::topology::End;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{Cyclic, Device, NetworkModel, ReportedTrouble, Seen};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "S208",
    name: "trouble-reported",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("reported_trouble.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    for device in &model.devices {
        for trouble in &device.reported_trouble {
            conditions.extend(of_device(model, device, *trouble));
        }
    }
    conditions.extend(mixed_states(model, conditions));
    conditions.extend(ring_open(model));
    conditions.extend(high_counters(model));
}

// Long for its number of troubles: one arm each, which is a whole condition.
fn of_device(
    model: &NetworkModel,
    device: &Device,
    trouble: Seen<ReportedTrouble>,
) -> Option<Condition> {
    let label = model.label(device.id);
    let place = Place::device(model.network, device.id);
    let new = |cause, confidence| {
        Condition::new(&PAGE, place, cause, trouble.at).confidence(confidence).confirmed(trouble.at)
    };
    let shown = |text: String| Evidence::host(Some(trouble.at), text);
    let condition = match trouble.value {
        // What it signals itself says more.
        ReportedTrouble::Configuration if !device.al.errors.is_empty() => return None,
        ReportedTrouble::Configuration => {
            let mut condition = new(FaultName::ConfigMismatch, 0.5)
                .or(FaultName::MailboxError, 0.2)
                .or(FaultName::DeviceWrong, 0.1)
                .about([Symptom::StateLost(device.id)])
                .explaining([Symptom::WorkingCounter(device.id)])
                .shown_by(shown(format!("the configuration of {label} failed")))
                .advise("Look into the messages of the tool for the object or step that was refused.")
                .advise(format!("Read AL status and its code (0x0130, 0x0134) of {label}."));
            condition.severity = Severity::Error;
            condition
        }
        ReportedTrouble::StateChanges(count) => new(FaultName::FirmwareFault, 0.3)
            .or(FaultName::WatchdogStarved, 0.25)
            .or(FaultName::SyncLost, 0.2)
            .or(FaultName::BrownOut, 0.1)
            .about([Symptom::StateLost(device.id)])
            .shown_by(shown(format!("{label} left its state {count} times unasked")))
            .advise("Look into the messages of the tool for the code that it gave each time."),
        ReportedTrouble::Absences(count) => new(FaultName::LinkFlapping, 0.4)
            .or(FaultName::BrownOut, 0.25)
            .or(FaultName::DeviceOff, 0.1)
            .about([Symptom::Silent(device.id)])
            .explaining([Symptom::WorkingCounter(device.id), Symptom::StateLost(device.id)])
            .shown_by(shown(format!("{label} was gone {count} times")))
            .advise(format!("Look at the plugs and the supply of {label} and of those before it.")),
        ReportedTrouble::Clock => new(FaultName::ClockDrift, 0.35)
            .or(FaultName::HostJitter, 0.2)
            .or(FaultName::ConfigMismatch, 0.15)
            .explaining([Symptom::StateLost(device.id)])
            .shown_by(shown(format!("the clock of {label} did not get in step in time")))
            .advise("Check that the application gives its time in each cycle, evenly, before it waits for OP.")
            .advise("Check which SubDevice is the reference clock, and that its time is handed round."),
        ReportedTrouble::AdditionalLink(port) => {
            let text = format!("port {port} of {label} has a link, and none is planned there");
            new(FaultName::PortsSwapped, 0.4)
                .or(FaultName::DeviceExtra, 0.4)
                .about(device.reported_wrong.map(|_| Symptom::StateLost(device.id)))
                .shown_by(shown(text).port(port))
                .advise(format!(
                    "Look what is plugged in at port {port} of {label}: is it in another socket than planned?"
                ))
        }
        ReportedTrouble::MissingLink(port) => {
            let text = format!("port {port} of {label} has no link, and one is planned there");
            let end = End::Controller(device.id, port);
            let place = Place::Link { network: model.network, a: end, b: None, direction: None };
            let mut condition = new(FaultName::LinkOpen, 0.5)
                .or(FaultName::DeviceOff, 0.3)
                .or(FaultName::PortsSwapped, 0.1)
                .shown_by(shown(text).port(port))
                .advise(format!(
                    "Look at port {port} of {label}: the plug, the cable, and the lamps of the device behind."
                ));
            (condition.place, condition.severity) = (place, Severity::Error);
            condition
        }
        ReportedTrouble::LinkError(port) => {
            let text = format!("port {port} of {label} has a link and no communication");
            let behind = model.opposite(device.id, port).and_then(|end| end.node());
            let mut follows = vec![Symptom::LinkDown(device.id, port)];
            follows.extend(behind.into_iter().flat_map(|id| subtree(model, id)).map(Symptom::Silent));
            new(FaultName::FalseLink, 0.4)
                .or(FaultName::DeviceOff, 0.2)
                .or(FaultName::CableDegraded, 0.2)
                .about([Symptom::LinkDown(device.id, port)])
                .explaining(follows)
                .shown_by(shown(text).port(port))
                .advise(format!(
                    "Look what is plugged in at port {port} of {label}: it shows a link, and no EtherCAT answers."
                ))
        }
    };
    Some(condition)
}

fn subtree(model: &NetworkModel, id: DeviceId) -> Vec<DeviceId> {
    let tree = model.tree.as_ref().filter(|tree| id.index() < tree.len());
    let nodes = tree.map(|tree| tree.subtree(id.index())).unwrap_or_default();
    nodes.iter().map(|node| DeviceId(*node as u32)).collect()
}

/// A ring that its MainDevice needs from both ends.
fn ring_open(model: &NetworkModel) -> Option<Condition> {
    let open = model.reported.ring_open.filter(|open| open.value)?;
    let place = Place::Network { network: model.network };
    let condition = Condition::new(&PAGE, place, FaultName::RingOpen, open.at)
        .confidence(0.7)
        .or(FaultName::LinkFlapping, 0.1)
        .confirmed(open.at)
        .shown_by(Evidence::host(
            Some(open.at),
            "the MainDevice needs the frames of its second card",
        ))
        .advise(
            "Look for the port without a link: two SubDevices beside each other have lost theirs.",
        );
    Some(condition)
}

/// Working counters that are higher than expected.
fn high_counters(model: &NetworkModel) -> Option<Condition> {
    let is_high = |cyclic: &&Cyclic| {
        let told = model.reported.expected.get(&cyclic.label());
        told.is_some_and(|expected| cyclic.wkc.highest().value > *expected)
    };
    let cyclic = model.cyclic.iter().find(is_high)?;
    let expected = model.reported.expected.get(&cyclic.label())?;
    let text = format!(
        "{}: working counter {}, and {expected} is expected",
        cyclic.label(),
        cyclic.wkc.highest().value
    );
    let place = Place::Network { network: model.network };
    let at = cyclic.wkc.highest().at;
    let condition = Condition::new(&PAGE, place, FaultName::ConfigMismatch, at)
        .confidence(0.5)
        .or(FaultName::DuplicateAddress, 0.1)
        .or(FaultName::DeviceExtra, 0.1)
        .confirmed(at)
        .shown_by(Evidence::host(Some(at), text))
        .advise("Compare what is expected with who shares in the datagram: inputs count 1, outputs 1, in an LRW 2.");
    Some(condition)
}

/// Several states at once, or the error bit, of nobody knows whom.
fn mixed_states(model: &NetworkModel, conditions: &[Condition]) -> Option<Condition> {
    let states = model.reported.states?;
    let bits = states.value.0 & 0x0F;
    let is_told = conditions
        .iter()
        .any(|one| one.symptoms.iter().any(|symptom| matches!(symptom, Symptom::StateLost(_))));
    let is_mixed = bits.count_ones() > 1 && model.devices.len() != 1;
    if is_told || !(is_mixed || states.value.error()) {
        return None;
    }
    let names = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op];
    let seen: Vec<&str> = names
        .into_iter()
        .filter(|state| bits & u16::from(state.bits()) != 0)
        .map(AlState::name)
        .collect();
    let error = if states.value.error() { ", with the error bit" } else { "" };
    let text = format!("the SubDevices together are in {}{error}", seen.join(" and "));
    let place = Place::Network { network: model.network };
    let mut condition = Condition::new(&PAGE, place, FaultName::InitRefused, states.at)
        .confidence(0.3)
        .or(FaultName::FirmwareFault, 0.2)
        .or(FaultName::ConfigMismatch, 0.2)
        .confirmed(states.at)
        .shown_by(Evidence::host(Some(states.at), text))
        .advise("Read AL status and its code (0x0130, 0x0134) of each SubDevice: which is not where the others are?");
    if states.value.error() {
        condition.severity = Severity::Error;
    }
    Some(condition)
}
