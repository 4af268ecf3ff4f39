//! # Errors at a SubDevice, of all its ports together
//!
//! A tool counts damaged frames of a SubDevice and does not say at which of its ports.
//!
//! **How it is found.** An observation file or a pasted list has one total of a SubDevice (`crc` outside of
//! `ports`), and it rose, or is not 0. A frame that is damaged once is counted by the SubDevices behind, too, so
//! the first of them in the order of the frames is nearest to the damage. The same is told of frames
//! that were bad before (0x0308 to 0x030B) where no port explains them.
//!
//! **What it means.** One of the links of the named SubDevice damages frames, or one shortly before it. A total
//! that nobody read before may be old: links that come up while the power is switched on count some errors.
//!
//! **What to do.** Read the counters of each port (0x0300 to 0x0307): they name the link and its direction. Clear
//! the totals, wait, and look which of them rise.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity};
use crate::model::{Device, ErrorSum};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H115",
    name: "errors-at-device",
    severity: Severity::Warning,
    class: Class::Hardware,
    source: include_str!("errors_at_device.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// So few errors of an unknown time are those of a start.
const FEW: u64 = 3;
/// So many SubDevices are named.
const NAMED: usize = 6;

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let is_placed = conditions.iter().any(|one| matches!(one.page.code, "H110" | "H111" | "H112"));
    let order: Vec<usize> = match &model.tree {
        Some(tree) => tree.order().to_vec(),
        None => (0..model.devices.len()).collect(),
    };
    let risen = order.iter().filter_map(|node| model.devices.get(*node)).filter_map(|device| {
        // Counters of ports say more.
        let sum = device.error_sum.filter(|sum| sum.rise > 0 && !device.counters.is_known());
        let sum = sum.map(|sum| (sum, "damaged frames"));
        let is_placed = is_placed || model.traffic.recording.frames() > 0;
        let (sum, what) = sum.or_else(|| unplaced(device).filter(|_| !is_placed))?;
        Some((device, sum, what))
    });
    let risen: Vec<(&Device, ErrorSum, &str)> = risen.collect();
    let Some((first, sum, _)) = risen.first() else { return };
    let since = risen.iter().filter_map(|(_, sum, _)| sum.first_rise).min().unwrap_or(view.now);
    let place = Place::device(model.network, first.id);
    let mut condition = Condition::new(&PAGE, place, FaultName::CableDegraded, since)
        .confidence(0.35)
        .or(FaultName::EmcNoise, 0.25)
        .or(FaultName::ReceiverDamaged, 0.1)
        .or(FaultName::DeviceInternal, 0.1)
        .confirmed(since)
        .advise(format!(
            "Read the error counters of each port (0x0300 to 0x0307) of {} and its neighbours.",
            model.label(first.id)
        ))
        .advise(
            "Clear the totals, wait some minutes, and look which of them rise, and which first.",
        );
    let is_old = risen.iter().all(|(_, sum, _)| sum.may_be_old);
    if is_old {
        condition = condition.may_be_old();
    }
    if is_old && risen.iter().all(|(_, sum, _)| sum.rise <= FEW) {
        condition.severity = Severity::Info;
    }
    for (device, sum, what) in risen.iter().take(NAMED) {
        let label = model.label(device.id);
        let text = match sum.may_be_old {
            true => {
                format!("{label} counts {} {what}, of whatever time", sum.rise)
            }
            false => format!("{label} counted {} {what} meanwhile", sum.rise),
        };
        condition = condition.shown_by(Evidence::host(sum.last_rise, text));
    }
    if let Some(more) = risen.len().checked_sub(NAMED).filter(|more| *more > 0) {
        condition = condition.shown_by(Evidence::host(None, format!("and {more} others behind")));
    }
    if sum.last_rise.is_some_and(|last| last < model.now)
        && let Some(last) = risen.iter().filter_map(|(_, sum, _)| sum.last_rise).max()
        && last < model.now
    {
        condition = condition.ended(last);
    }
    conditions.push(condition);
}

/// Errors that a device counts and that no port of it, or before it, explains.
fn unplaced(device: &Device) -> Option<(ErrorSum, &'static str)> {
    let forwarded = Port::ALL.into_iter().map(ErrorCounter::Forwarded);
    let sums = forwarded.filter_map(|counter| {
        let track = device.counters.track(counter)?;
        let mut sum = ErrorSum::first(track.last);
        sum.rise = track.total.rise();
        sum.first_rise = track.first_rise().map(|rise| rise.at);
        sum.last_rise = track.last_rise().map(|rise| rise.at);
        sum.may_be_old = track.may_be_old;
        Some((sum, "frames that were bad before")).filter(|(sum, _)| sum.rise > 0)
    });
    sums.max_by_key(|(sum, _)| sum.rise)
}
