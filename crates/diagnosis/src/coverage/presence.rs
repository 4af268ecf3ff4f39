//! Presence of the SubDevices as evidence: how many there are, and whether all of them answer.

use super::{Assessment, Basis, Extent, Gap, InputKind, Reason, Subject};
use crate::finding::Place;
use crate::model::{Device, NetworkModel};

/// So many station addresses are named at most.
const STATIONS_NAMED: usize = 8;

/// Assesses who is there.
pub(super) fn assess(basis: &Basis<'_>) -> Assessment {
    let mut all = Assessment::judged(Subject::Presence);
    compare_number(basis, &mut all);
    list_unanswered(basis, &mut all);
    compare_broadcasts(basis, &mut all);
    list_stillness(basis, &mut all);
    all
}

/// Number of SubDevices that answer, against the number that should.
fn compare_number(basis: &Basis<'_>, all: &mut Assessment) {
    let model = basis.model;
    let traffic = &model.traffic;
    let is_counted = traffic.broadcasts.most() > 0 || traffic.broadcasts.positions() > 0;
    if model.device_count() == 0 {
        let text = "no SubDevice was seen to answer";
        let gap = Gap::new(Reason::NumberUnknown, text).essential().step(basis.look_longer());
        all.lacks(Extent::NotJudged, gap);
    } else if !is_counted && !model.tree_is_planned {
        let text = format!(
            "{} SubDevices answered; how many there should be was not seen",
            model.device_count()
        );
        // Who asks each of them for its state asks all that it knows.
        let gap = Gap::new(Reason::NumberUnknown, text)
            .essential_if(!basis.states_read && !basis.expectations_known)
            .step("name the project, `--project machine.toml` or an ENI, or record from the start of the MainDevice");
        all.lacks(Extent::InPart, gap);
    }
    let planned = model.devices.iter().filter(|one| one.planned.is_some()).count();
    if planned > 0 && usize::from(traffic.broadcasts.most()) > planned {
        let text = format!(
            "{} SubDevices answered a broadcast, {planned} are planned",
            traffic.broadcasts.most()
        );
        let gap = Gap::new(Reason::NumberUnknown, text)
            .essential()
            .step("compare the line with what was planned: `linesman scan WHERE --against FILE`");
        all.lacks(Extent::InPart, gap);
    }
}

/// SubDevices, station addresses and datagrams that nobody answered.
fn list_unanswered(basis: &Basis<'_>, all: &mut Assessment) {
    let model = basis.model;
    let silent: Vec<&Device> = model.devices.iter().filter(|one| is_missed(model, one)).collect();
    if !silent.is_empty() {
        let places = silent.iter().map(|one| Place::device(model.network, one.id)).collect();
        let labels: Vec<String> = silent.iter().map(|one| model.label(one.id)).collect();
        let text = format!("no answer from {}", labels.join(", "));
        let gap = Gap::new(Reason::NoAnswer, text)
            .essential()
            .at(places)
            .step("look at these SubDevices: supply, lamps, the cable before the first of them");
        all.lacks(Extent::InPart, gap);
    }
    if !model.asked_in_vain.is_empty() {
        let stations: Vec<String> =
            model.asked_in_vain.iter().take(STATIONS_NAMED).map(ToString::to_string).collect();
        let rest = model.asked_in_vain.len() - stations.len();
        let more = if rest > 0 { format!(", and {rest} more") } else { String::new() };
        let text = format!("nobody answered at station address {}{more}", stations.join(", "));
        let gap = Gap::new(Reason::NoAnswer, text).essential().step(basis.look_longer());
        all.lacks(Extent::InPart, gap);
    }
    // Those of lost frames are told with these. Who brings a line up asks for what is not there.
    let unanswered = model.traffic.datagrams.unanswered_alone();
    if basis.input != InputKind::Driven && unanswered > 0 && silent.is_empty() {
        let text =
            format!("{unanswered} datagrams came back without an answer, and nothing tells why");
        let gap = Gap::new(Reason::NoAnswer, text).essential().step(basis.look_longer());
        all.lacks(Extent::InPart, gap);
    }
}

/// Numbers of SubDevices that answered broadcasts at different times.
fn compare_broadcasts(basis: &Basis<'_>, all: &mut Assessment) {
    let model = basis.model;
    let traffic = &model.traffic;
    let now = traffic.broadcasts.now().map_or(traffic.broadcasts.most(), |now| now.value);
    if now < traffic.broadcasts.most() {
        let text = format!(
            "{now} SubDevices answered the last broadcast, {} an earlier one",
            traffic.broadcasts.most()
        );
        let gap = Gap::new(Reason::NoAnswer, text).essential().step(basis.look_longer());
        all.lacks(Extent::InPart, gap);
    }
    if let Some(rose) = traffic.broadcasts.rose().filter(|_| !model.sees_all_orders) {
        let text = format!(
            "{} SubDevices answered a broadcast at first, and {} from {} on, while process data were exchanged: where the \
             others had been was not seen",
            rose.fewer.value, rose.more.value, rose.more.at
        );
        let gap = Gap::new(Reason::NumberUnknown, text).essential().step(basis.look_longer());
        all.lacks(Extent::InPart, gap);
    }
}

/// The time at the end in which nobody was asked any more.
fn list_stillness(basis: &Basis<'_>, all: &mut Assessment) {
    // Who drives the line itself ends when it was told to.
    let Some(still) = basis.model.stillness().filter(|_| basis.input != InputKind::Driven) else {
        return;
    };
    let text = format!(
        "nothing was sent in the last {}, although process data had been exchanged every {} up to then",
        still.lasted, still.cycle
    );
    let gap = Gap::new(Reason::EndsStill, text).essential().step(
        "look at the link lamp of the MainDevice's card and at the MainDevice's own log: the card has lost its link, or the \
         program has ended or stands still",
    );
    all.lacks(Extent::InPart, gap);
}

/// Whether a SubDevice was asked in vain, or is planned and nothing was seen of it.
fn is_missed(model: &NetworkModel, device: &Device) -> bool {
    let is_unseen = device.answered.is_none()
        && device.planned.is_some()
        && model.device_count() < model.devices.len();
    device.silent.is_some() || is_unseen
}
