//! Working counters as evidence: whether it is known which one belongs to each cyclic datagram.

use super::{Assessment, Basis, Extent, Gap, Reason, Subject};
use crate::model::{Cyclic, NetworkModel};

/// A datagram that came back less often is not yet cyclic.
const FEW: u64 = 10;
/// Datagrams that are named one by one.
const NAMED: usize = 3;

/// Whether process data are exchanged, and the working counter that belongs to each datagram is known.
pub(super) fn all_known(model: &NetworkModel) -> bool {
    !model.cyclic.is_empty() && model.cyclic.iter().all(|cyclic| is_known(model, cyclic))
}

/// Whether it was seen how a datagram came to its working counter: FMMUs that were set up for it, or a working
/// counter that rose while SubDevices came to SAFEOP and OP.
fn is_known(model: &NetworkModel, cyclic: &Cyclic) -> bool {
    let has_risen = cyclic.wkc.has_risen() && !rose_unseen(model, cyclic);
    let is_planned = cyclic.wkc.is_as_planned();
    cyclic.wkc.highest().value > 0
        && (is_planned || has_risen || model.owners(cyclic).next().is_some())
}

/// Tells whether a working counter rose from the first one on while nobody read a state: the line may have come up then, or
/// was broken before.
fn rose_unseen(model: &NetworkModel, cyclic: &Cyclic) -> bool {
    cyclic.wkc.low_before().is_some()
        && model.devices.iter().all(|device| device.al.status.is_none())
}

/// Assesses what is known of the working counters.
pub(super) fn assess(basis: &Basis<'_>) -> Assessment {
    let model = basis.model;
    let mut all = Assessment::judged(Subject::ProcessData);
    let cyclic = || model.cyclic.iter().filter(|cyclic| cyclic.wkc.count() >= FEW);
    if cyclic().next().is_none() {
        let text = "no process data were exchanged";
        all.lacks(Extent::NotJudged, Gap::new(Reason::NoProcessData, text));
        return all;
    }
    let unanswered: Vec<&Cyclic> = cyclic().filter(|one| one.wkc.highest().value == 0).collect();
    if !unanswered.is_empty() {
        let text = format!("no SubDevice answered {}", names(&unanswered));
        let gap = Gap::new(Reason::NoAnswer, text).essential().step(step());
        all.lacks(Extent::NotJudged, gap);
    }
    let unseen: Vec<&Cyclic> = cyclic().filter(|one| one.wkc.may_be_ordered()).collect();
    if !unseen.is_empty() {
        let text = format!(
            "the working counter of {} fell when an order to leave OP may have been missed",
            names(&unseen)
        );
        let gap = Gap::new(Reason::NoBringUp, text).essential().step(step());
        all.lacks(Extent::InPart, gap);
    }
    let is_unknown = |one: &&Cyclic| one.wkc.highest().value > 0 && !is_known(model, one);
    let unknown: Vec<&Cyclic> = cyclic().filter(is_unknown).collect();
    if !unknown.is_empty() {
        let how = match unknown.iter().any(|one| rose_unseen(model, one)) {
            true => {
                "it has risen, and nobody has read a state: the line came up then, or was broken before"
            }
            false => "it was the same all the time",
        };
        let text =
            format!("the working counter that belongs to {} is not known; {how}", names(&unknown));
        let gap = Gap::new(Reason::ExpectedWorkingCounterUnknown, text)
            .essential_if(!basis.states_read)
            .step(step());
        all.lacks(Extent::InPart, gap);
    }
    all
}

fn step() -> &'static str {
    "name the ENI of the MainDevice, `--project FILE.xml`, or record from its start"
}

/// `LRW at 0x00010000, 7 bytes (working counter 4)`.
fn names(all: &[&Cyclic]) -> String {
    let name = |one: &&Cyclic| {
        format!("{} at {}, {} bytes (now {})", one.command, one.start, one.len, one.wkc.now().value)
    };
    let mut words: Vec<String> = all.iter().take(NAMED).map(name).collect();
    if let Some(more) = all.len().checked_sub(NAMED).filter(|more| *more > 0) {
        words.push(format!("{more} more"));
    }
    words.join(", ")
}
