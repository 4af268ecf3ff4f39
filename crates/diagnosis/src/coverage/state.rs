//! States as evidence: AL status of each SubDevice, as it was read.

use linesman_proto::time::Span;

use super::{Assessment, Basis, Extent, Gap, InputKind, Reason, Subject};
use crate::finding::Place;
use crate::line::{Device, Line};

/// A reading that is older says nothing of the end.
const OLD: Span = Span::s(10);

/// Whether the state of every SubDevice is known by a reading of AL status, and none signals an error.
pub(super) fn all_read(line: &Line) -> bool {
    let count = line.devices.len();
    count > 0
        && count >= line.device_count()
        && line.devices.iter().all(|one| one.al.state().is_some() && !one.al.has_error())
}

/// Assesses what is known of the states.
pub(super) fn assess(basis: &Basis<'_>) -> Assessment {
    let line = basis.line;
    let mut all = Assessment::judged(Subject::States);
    let unread: Vec<&Device> = line.devices.iter().filter(|one| one.al.status.is_none()).collect();
    let is_none_read = unread.len() == line.devices.len();
    if !unread.is_empty() || line.devices.len() < line.device_count() {
        let extent = if is_none_read { Extent::NotJudged } else { Extent::InPart };
        let text = if is_none_read {
            "the state of no SubDevice was read".to_owned()
        } else {
            let labels: Vec<String> = unread.iter().map(|one| line.label(one.id)).collect();
            format!("the state of {} was not read", labels.join(", "))
        };
        let places = unread.iter().map(|one| Place::device(line.network, one.id));
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
    let is_old = |one: &&Device| one.al.latest_reading.is_some_and(|at| line.now.since(at) > OLD);
    let old: Vec<&Device> = line.devices.iter().filter(is_old).collect();
    if !old.is_empty() {
        let places = old.iter().map(|one| Place::device(line.network, one.id)).collect();
        let text = format!("the states of {} SubDevices were read long before the end", old.len());
        let gap =
            Gap::new(Reason::StatesOld, text).essential_if(!basis.expectations_known).at(places);
        all.lacks(Extent::InPart, gap);
    }
    all
}
