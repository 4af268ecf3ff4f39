//! # Frames that are not EtherCAT
//!
//! Other computers' frames travel on the line.
//!
//! **How it is found.** A frame with another EtherType comes in by the card, or stands in the recording. Or
//! the processing unit of a controller counts errors (0x030C) while no port before it, on the way that frames take,
//! counts a damaged frame: as long as bit 0 of DL control (0x0100) is set, as after power-on, a controller destroys
//! what is not EtherCAT and counts it there, and only the first one on the way sees any.
//!
//! **What it means.** A switch, an office computer or the operating system's own services share the cable.
//! Single frames do no harm. Many take time on the line, so that process data come late; and whoever can
//! reach the line by a switch can disturb it.
//!
//! **What to do.** Connect the card to the first SubDevice directly, and take other protocols off this
//! interface.

use std::collections::BTreeSet;

use linesman_config::fault::{Class, FaultName};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity};
use crate::locate::{Intervals, LocateInput};
use crate::model::{CounterHistory, Device, NetworkModel, Rise};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "C333",
    name: "foreign-frames",
    severity: Severity::Warning,
    class: Class::Configuration,
    source: include_str!("foreign_frames.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// What did not come again for this long is over.
const QUIET: Span = Span::s(5);
/// Links that come and go, and rings that close, leave frames that are destroyed, too.
const AROUND: Span = Span::s(2);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let traffic = &model.traffic;
    let destroyed = destroyed(view);
    let counted = |rises: &[&Rise]| -> u64 { rises.iter().map(|rise| rise.difference.rise).sum() };
    let seen = traffic.foreign.first();
    let firsts =
        destroyed.iter().filter_map(|(_, rises)| rises.first().map(|rise| rise.after_time));
    let lasts = destroyed.iter().filter_map(|(_, rises)| rises.last().map(|rise| rise.at));
    let Some(first) = firsts.chain(seen.map(|seen| seen.at)).min() else { return };
    let last = lasts.chain(traffic.foreign.latest()).max().unwrap_or(first);
    let place = Place::Network { network: model.network };
    let mut condition = Condition::new(&PAGE, place, FaultName::ForeignFrames, first)
        .confidence(if seen.is_some() { 0.9 } else { 0.7 })
        .confirmed(seen.map_or(last, |seen| seen.at));
    if seen.is_none() {
        condition = condition.or(FaultName::SecondMainDevice, 0.1);
    }
    if let Some(seen) = seen {
        let (count, kind) = (traffic.foreign.count(), name(seen.value));
        let text = format!("{count} frames that are not EtherCAT, the first of them {kind}");
        condition = condition.shown_by(Evidence::frame(seen.at, seen.frame.unwrap_or(0), text));
    }
    for (device, rises) in &destroyed {
        let Some(rise) = rises.last() else { continue };
        let text = format!(
            "{} destroyed {} frames in its processing unit, and no port before it counted a damaged one",
            model.label(device.id),
            counted(rises)
        );
        let address = ErrorCounter::ProcessingUnit.address();
        condition = condition.shown_by(Evidence::rise(device.id, address, None, rise, text));
    }
    if destroyed.is_empty() && traffic.foreign.received() == 0 {
        // Recorded beside the line, or sent by this computer itself: nobody says that it came in.
        condition.severity = Severity::Info;
    }
    if seen.is_none() && destroyed.iter().all(|(device, _)| may_be_old(device)) {
        condition = condition.may_be_old();
    }
    if last + QUIET < view.now {
        condition = condition.ended(last);
    }
    conditions.push(
        condition
            .advise("Connect the card to the first SubDevice directly, without a switch.")
            .advise("Take IP addresses and services such as LLDP off this network interface."),
    );
}

/// Whether nobody knows what its processing unit had counted before.
fn may_be_old(device: &Device) -> bool {
    device.counters.track(ErrorCounter::ProcessingUnit).is_some_and(|track| track.may_be_old)
}

/// Who destroyed frames that were not damaged, with the rises that show it.
fn destroyed<'v>(view: &View<'v>) -> Vec<(&'v Device, Vec<&'v Rise>)> {
    let model = view.model;
    let found = |device: &'v Device| {
        let track = CounterHistory::track(&device.counters, ErrorCounter::ProcessingUnit);
        track.into_iter().flat_map(|track| &track.rises)
    };
    let counting = || model.devices.iter().filter(|device| found(device).next().is_some());
    if counting().next().is_none() {
        return Vec::new();
    }
    let wiring = LocateInput::of(model, view.has_ended);
    let all = counting().map(|device| {
        let explained = explained(model, wiring.as_ref(), device.id.index());
        let is_clean =
            |rise: &&Rise| !explained.meet((rise.after_time.before(AROUND), rise.at + AROUND));
        (device, found(device).filter(is_clean).collect::<Vec<_>>())
    });
    all.filter(|(_, rises)| !rises.is_empty()).collect()
}

/// When the processing unit of a controller finds errors for another reason: damage at a port before it, on the way that
/// frames take, or a link that comes or goes. Damage behind it cannot be what it finds.
fn explained(model: &NetworkModel, wiring: Option<&LocateInput<'_>>, node: usize) -> Intervals {
    let before: Option<BTreeSet<(usize, Port)>> = wiring.and_then(|wiring| {
        let ways = wiring.routes().iter().map(|route| {
            let after = route.processing_of(node).map(|unit| unit.after)?;
            let checks = route.checks().take_while(move |check| check.hop <= after);
            Some(checks.map(|check| (check.node, check.port)))
        });
        // Who is cut off is reached by one card of a ring alone.
        let known: Vec<_> = ways.flatten().collect();
        (!known.is_empty()).then(|| known.into_iter().flatten().collect())
    });
    let is_before = |at: usize, counter: ErrorCounter| match (counter, &before) {
        (ErrorCounter::ProcessingUnit | ErrorCounter::Pdi, _) => false,
        (
            ErrorCounter::InvalidFrame(port)
            | ErrorCounter::PhysicalLayer(port)
            | ErrorCounter::Forwarded(port),
            Some(before),
        ) => before.contains(&(at, port)),
        (_, Some(_) | None) => true,
    };
    let devices = || model.devices.iter();
    let tracks = devices().flat_map(|device| {
        let tracks = device.counters.tracks();
        tracks.filter(move |(counter, _)| is_before(device.id.index(), *counter))
    });
    let rises = tracks.flat_map(|(_, track)| &track.rises).map(|rise| (rise.after_time, rise.at));
    let links =
        devices().flat_map(|device| &device.dl.changes).map(|change| (change.at, change.at));
    rises.chain(links).collect()
}

fn name(kind: u16) -> String {
    match kind {
        0x0800 => "IPv4".to_owned(),
        0x0806 => "ARP".to_owned(),
        0x86DD => "IPv6".to_owned(),
        0x88CC => "LLDP".to_owned(),
        0x8100 => "with a VLAN tag".to_owned(),
        0..=0x05DC => "of the kind that gives its length, such as STP".to_owned(),
        other => format!("with EtherType 0x{other:04X}"),
    }
}
