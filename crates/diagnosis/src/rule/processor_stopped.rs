//! # The processor of a SubDevice has stopped
//!
//! Nobody serves the process data interface of a controller any more.
//!
//! **How it is found.** A controller watches its processor: when that has not used the process data interface
//! for the time in 0x0410, bit 1 of DL status (0x0110) falls (and 0x0443 counts one). Controllers without a
//! processor, and those whose watchdog is switched off, never change the bit; only a fall from 1 to 0 counts.
//!
//! **What it means.** The firmware hangs, or the processor is halted or without supply, while its controller
//! goes on: frames pass, working counters and AL status stay as they were, outputs are still taken and
//! inputs stay at their last values. When it stopped while it held a buffer of its process data, its share of the
//! working counter is missing, too; that is listed beneath. Requests for a state or to the mailbox stay unanswered. Where it is in
//! step with SYNC signals it may report an error of synchronisation first: that follows.
//!
//! **What to do.** Do not trust its inputs. Power it off and on; note its firmware version, and ask its maker
//! with a capture. Where it comes again, read its diagnosis history (0x10F3) before.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::register::table;
use linesman_proto::time::{Instant, Span};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::{Device, DlChange, NetworkModel, Seen};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "S206",
    name: "processor-stopped",
    severity: Severity::Error,
    class: Class::Software,
    source: include_str!("processor_stopped.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    for device in &view.model.devices {
        let changes = &device.dl.changes;
        let stopped = changes.iter().rposition(|change| has_stopped(device, change));
        if let Some((at, change)) = stopped.and_then(|at| Some((at, changes.get(at)?))) {
            let back = changes.iter().skip(at + 1).find(|later| later.to.pdi_watchdog_ok());
            conditions.push(condition(view.model, device, change, back.map(|back| back.at)));
        }
    }
}

/// Whether the processor of a SubDevice stood still at some moment between two.
pub(super) fn stood_within(device: &Device, from: Instant, to: Instant) -> bool {
    let changes = &device.dl.changes;
    let (mut stops, backs) =
        (changes.iter().enumerate(), |change: &&DlChange| change.to.pdi_watchdog_ok());
    stops.any(|(at, change)| {
        let back = changes.iter().skip(at + 1).find(backs);
        has_stopped(device, change) && change.at <= to && back.is_none_or(|back| back.at >= from)
    })
}

/// Whether the bit fell, and not because the whole device started anew.
fn has_stopped(device: &Device, change: &DlChange) -> bool {
    let fell = change.from.pdi_watchdog_ok() && !change.to.pdi_watchdog_ok();
    let was_gone = device.absences.iter().any(|absence| {
        absence.since.at <= change.at && absence.ended.is_none_or(|ended| change.at <= ended + NEAR)
    });
    fell && !was_gone
}

/// After an absence the first reading of DL status comes within this time.
const NEAR: Span = Span::ms(500);

fn condition(
    model: &NetworkModel,
    device: &Device,
    change: &DlChange,
    back: Option<Instant>,
) -> Condition {
    let id = device.id;
    let label = model.label(id);
    let seen = Seen::new((), change.at, change.frame);
    let text = format!(
        "DL status of {label}: its processor does not serve the process data interface any more"
    );
    let condition = Condition::new(
        &PAGE,
        Place::device(model.network, id),
        FaultName::FirmwareFault,
        change.at,
    )
    .confidence(0.85)
    .or(FaultName::BrownOut, 0.05)
    .confirmed(change.at)
    .shown_by(
        Evidence::register(id, table::DL_STATUS.address, &seen, text)
            .values(Some(u64::from(change.from.value())), Some(u64::from(change.to.value()))),
    )
    .explaining([
        Symptom::Silent(id),
        Symptom::StateLost(id),
        Symptom::WorkingCounter(id),
        Symptom::Emergency(id),
        Symptom::InputsStill(id),
    ])
    .advise(format!("Take no input of {label} for fresh."))
    .advise("Power it off and on; note its firmware version and ask its maker, with a capture.")
    .advise("Read its diagnosis history (object 0x10F3) when it answers again.");
    match back {
        Some(at) => condition.ended(at),
        None => condition,
    }
}
