//! # SubDevice does not answer
//!
//! A SubDevice that answered before, or that should be there, does not answer.
//!
//! **How it is found.** A datagram to its address came back with working counter 0 from a register that
//! every controller has, and for a tenth of a second at least no later one was answered; or an online list says so.
//! A station address that is asked again and again and has never answered counts, too, where others answer.
//!
//! **What it means.** It is without power, cut off, or has lost its station address by starting anew.
//! When the link to it is lost, that finding stands above this one.
//!
//! **What to do.** Look at the nearest SubDevice before it that answers: the trouble is between the two,
//! or in this one.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::register::table;
use linesman_proto::time::Span;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::line::{Absence, Device};
use crate::locate::Drops;

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H102",
    name: "not-answering",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("not_answering.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Who did not answer for so long was away.
const LONG: Span = Span::ms(100);
/// An absence that has been over for so long is history.
const TOLD_FOR: Span = Span::ms(2_500);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let line = view.line;
    let away = || line.devices.iter().filter_map(|device| Some((device, absence(view, device)?)));
    if away().next().is_none() {
        return;
    }
    let down: Vec<usize> =
        Drops::all(line).iter().filter(|drops| drops.is_down).map(|drops| drops.link).collect();
    let is_cut_off = |node: usize| {
        line.tree.as_ref().filter(|tree| node < tree.len()).is_some_and(|tree| {
            let mut way = tree.path_to(node).into_iter();
            way.any(|node| tree.link_above(node).is_some_and(|link| down.contains(&link)))
        })
    };
    for (device, absence) in away() {
        let silent = absence.since;
        let place = Place::device(line.network, device.id);
        let label = line.label(device.id);
        let new = |cause| Condition::new(&PAGE, place, cause, silent.at);
        let mut condition = if is_cut_off(device.id.index()) {
            // Why is for the finding above.
            new(FaultName::LinkOpen).confidence(0.6).or(FaultName::DeviceOff, 0.3)
        } else {
            new(FaultName::DeviceOff)
                .confidence(0.5)
                .or(FaultName::LinkOpen, 0.25)
                .or(FaultName::BrownOut, 0.1)
                .advise(format!("Look at {label} and at the way to it: lamps, supply, plugs."))
        };
        let text = match absence.ended {
            None => format!("{label} does not answer"),
            Some(ended) => {
                let lasted = ended.since(silent.at);
                format!("{label} did not answer for {lasted}, then again")
            }
        };
        let address = table::AL_STATUS.address;
        condition = condition
            .confirmed(silent.at)
            .about([Symptom::Silent(device.id)])
            .explaining([
                Symptom::WorkingCounter(device.id),
                Symptom::StateLost(device.id),
                Symptom::Mailbox(device.id),
            ])
            .shown_by(Evidence::register(device.id, address, &silent, text));
        if let Some(ended) = absence.ended {
            condition = condition.ended(ended);
        }
        conditions.push(condition);
    }
}

/// The absence of a SubDevice that lasts, or was over a moment ago. While addresses are given nobody answers to them
/// for a while.
fn absence(view: &View<'_>, device: &Device) -> Option<Absence> {
    if let Some(since) = device.silent {
        return Some(Absence { since, ended: None });
    }
    let latest = device.absences.back()?;
    let ended = latest.ended?;
    let is_told = ended.since(latest.since.at) >= LONG && view.now.since(ended) <= TOLD_FOR;
    is_told.then_some(*latest)
}
