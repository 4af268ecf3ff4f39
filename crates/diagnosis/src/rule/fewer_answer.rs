//! # Fewer SubDevices answer than there are
//!
//! A MainDevice hears fewer SubDevices than there are, or than it heard before.
//!
//! **How it is found.** Another tool told how many SubDevices answer a broadcast (`Slaves:` of `ethercat master`,
//! `slave(s) responding` in a kernel log, `answering` in an observation file), and more are known: from a list,
//! from a project, or from an earlier count. On a line without branches those answer that are nearest, so the
//! break lies behind the last of them.
//!
//! **What it means.** A link is open, or a device is without power; all behind it is gone with it. On a line with
//! branches the number alone does not say which.
//!
//! **What to do.** Go to the place that is named, and look at the lamps on both sides of it. Where none is named,
//! `linesman scan --against` with the project says who is missing.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::topology::{End, Tree};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::line::{Line, Seen};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H104",
    name: "fewer-answer",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("fewer_answer.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let line = view.line;
    let reported = &line.reported;
    // Without a link nobody answers; where the wiring is known, the link itself is told.
    let carrier = line.host.card(Path::A).carrier.filter(|carrier| !carrier.value);
    let unlinked = carrier.filter(|_| line.devices.is_empty() && line.traffic.frames == 0);
    let told = reported.answering.or_else(|| Some(Seen::new(0, unlinked?.at, None)));
    let Some(answering) = told else { return };
    let known = line.devices.len().max(usize::from(reported.answering_most));
    let count = usize::from(answering.value);
    if count >= known && count > 0 {
        return;
    }
    // A link that is known to be lost says more.
    let is_placed = conditions.iter().any(|one| matches!(one.page.code, "H100" | "H101"));
    let at = place(line, count);
    let network = Place::Network { network: line.network };
    let text = match (count, known, unlinked) {
        (_, _, Some(_)) => "the card has no link".to_owned(),
        (0, 0, None) => "no SubDevice answers a broadcast".to_owned(),
        (count, known, None) => {
            format!("{count} SubDevices answer a broadcast, and {known} are known")
        }
    };
    let mut condition = Condition::new(&PAGE, at, FaultName::LinkOpen, answering.at)
        .confidence(if at == network { 0.4 } else { 0.5 })
        .or(FaultName::DeviceOff, 0.25)
        .or(FaultName::SupplyOff, 0.1)
        .confirmed(answering.at)
        .shown_by(Evidence::host(Some(answering.at), text));
    if count == 0 {
        condition = condition.or_at(FaultName::NicDamaged, Place::Host, 0.05);
    }
    condition = match count {
        0 => condition
            .advise("Look at the cable from the card to the first SubDevice, and at the lamps at both ends.")
            .advise("Check the supply of the first SubDevice."),
        _ if at == network => condition.advise(
            "Compare the SubDevices that answer with the drawing: `linesman scan --against` says who is \
             missing.",
        ),
        _ => condition.advise(format!("Look at {at}: the lamps on both sides, the plugs, the supply behind.")),
    };
    let gone = line.devices.iter().map(|device| device.id);
    let follows = gone
        .flat_map(|id| [Symptom::Silent(id), Symptom::WorkingCounter(id), Symptom::StateLost(id)]);
    condition =
        condition.explaining(follows).explaining([Symptom::FramesLost, Symptom::FramesLate]);
    if is_placed {
        let first_gone = line.devices.iter().find(|device| device.silent.is_some());
        let symptom = match (count, first_gone) {
            (0, _) => Some(Symptom::NobodyAnswers),
            (_, Some(device)) => Some(Symptom::Silent(device.id)),
            (_, None) => None,
        };
        condition.symptoms.extend(symptom);
        condition.explains.clear();
    }
    conditions.push(condition);
}

/// Behind the last that answers, where nothing branches.
fn place(line: &Line, count: usize) -> Place {
    let network = Place::Network { network: line.network };
    if count == 0 {
        let first = line.links().find(|link| link.upstream == End::MainDevice(Path::A));
        return Place::Link {
            network: line.network,
            a: End::MainDevice(Path::A),
            b: first.map(|link| link.downstream),
            direction: None,
        };
    }
    let Some(tree) = line.tree.as_ref().filter(|tree| count < tree.len() && is_chain(tree)) else {
        return network;
    };
    let lost = tree.order().get(count).and_then(|node| tree.link_above(*node));
    let link = lost.and_then(|link| tree.links().get(link));
    link.map_or(network, |link| {
        let named = link.map(|node| DeviceId(node as u32));
        Place::link(line.network, named, Some(LinkDirection::Both))
    })
}

fn is_chain(tree: &Tree) -> bool {
    tree.closes_at().is_none() && (0..tree.len()).all(|node| tree.children(node).count() <= 1)
}
