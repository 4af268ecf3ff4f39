//! # A watchdog is shorter than the cycle
//!
//! The process data watchdog of a SubDevice is set so short that it expires though all is well.
//!
//! **How it is found.** Divider and time of the watchdog (0x0400, 0x0420) are seen being written, or read: live,
//! the diagnosis reads them by turns. Their product is less than four cycles of the process data. Shorter
//! than one it expires in each cycle; up to four, whenever a few frames are lost or late.
//!
//! **What it means.** The SubDevice leaves OP with 0x001B, or will. No frame has to be lost for that. Settings
//! of a machine with a shorter cycle were taken over, or somebody wrote the register with a tool.
//!
//! **What to do.** Set the watchdog to several cycles, at least to what the machine may safely go on for
//! without control; 100 ms is usual. Look who writes 0x0400 and 0x0420: start-up commands, a tool.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::RegisterAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::model::device::WatchdogSetting;
use crate::model::{Device, NetworkModel};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "S203",
    name: "watchdog-too-short",
    severity: Severity::Warning,
    class: Class::Software,
    source: include_str!("watchdog_short.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

const WATCHDOG_TIME: RegisterAddress = RegisterAddress(0x0420);
/// A watchdog that holds for fewer cycles does not outlive a few lost frames.
const CYCLES: u64 = 4;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let cycles = || model.cyclic.iter().filter_map(|cyclic| cyclic.sent.cycle());
    let (Some(usual), Some(longest)) = (cycles().min(), cycles().max()) else { return };
    for device in &model.devices {
        // Whose outputs come with which datagram takes long to find out: only where it matters.
        let settings = [device.watchdog.setting, device.watchdog.former];
        let is_held_long = settings
            .into_iter()
            .flatten()
            .all(|setting| setting.span.is_none_or(|span| span >= longest * CYCLES));
        if device.al.highest < Some(AlState::SafeOp) || is_held_long {
            continue;
        }
        let cycle = own_cycle(model, device).unwrap_or(usual);
        let is_short =
            |setting: &WatchdogSetting| setting.span.is_some_and(|span| span < cycle * CYCLES);
        // The present one, else the one before: it is history then.
        let (present, former) = (device.watchdog.setting, device.watchdog.former);
        let (setting, ended) = match (present.filter(is_short), former.filter(is_short)) {
            (Some(setting), _) => (setting, None),
            (None, Some(former)) => (former, present.map(|present| present.seen.at)),
            (None, None) => continue,
        };
        let Some(span) = setting.span else { continue };
        conditions.push(condition(model, device, &setting, (span, cycle)));
        if let (Some(ended), Some(condition)) = (ended, conditions.last_mut()) {
            condition.ended = Some(ended);
        }
    }
}

/// The cycle of the datagram that brings its outputs.
fn own_cycle(model: &NetworkModel, device: &Device) -> Option<Span> {
    let brings = model.cyclic.iter().filter(|cyclic| {
        model.owners(cyclic).any(|owner| owner.device == device.id && owner.writes)
    });
    brings.filter_map(|cyclic| cyclic.sent.cycle()).min()
}

fn condition(
    model: &NetworkModel,
    device: &Device,
    setting: &WatchdogSetting,
    (span, cycle): (Span, Span),
) -> Condition {
    let ms = |span: Span| span.as_nanos() as f64 / 1e6;
    let text = format!(
        "the process data watchdog of {} holds for {:.3} ms, and a cycle takes {:.3} ms",
        model.label(device.id),
        ms(span),
        ms(cycle)
    );
    let place = Place::device(model.network, device.id);
    let at = setting.seen.at;
    let mut condition = Condition::new(&PAGE, place, FaultName::WatchdogStarved, at)
        .confidence(0.9)
        .confirmed(at)
        .shown_by(Evidence::register(device.id, WATCHDOG_TIME, &setting.seen, text))
        .explaining([Symptom::StateLost(device.id), Symptom::WorkingCounter(device.id)])
        .advise("Set the watchdog to several cycles; 100 ms is usual.")
        .advise("Look who writes 0x0400 and 0x0420: start-up commands, or a tool.");
    if span <= cycle {
        condition.severity = Severity::Error;
    }
    condition
}
