//! Hot connect groups that come and go: that is no trouble.
//!
//! A group that is unplugged is to the rules a link that was lost with all behind it, and one that is plugged in
//! has been without power. What a project allows to be absent is not reported as gone. Damage within a group,
//! errors at its ports, wrong states, and SubDevices that start anew while the first one of their group goes on stay
//! findings.

use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;
use linesman_proto::topology::End;

use crate::finding::{Condition, Place, Symptom};
use crate::model::NetworkModel;

/// Links without contact, controllers that do not answer, restarts, missing working counters.
const OF_ABSENCE: [&str; 7] = ["H101", "H102", "H105", "H150", "S205", "S210", "H104"];

/// Of these the ones that tell that power was away.
const RESTARTS: [&str; 2] = ["H150", "S205"];

/// A group that was plugged in is seen to have started anew so long after its first SubDevice answers: addresses are given
/// and states read only after a search.
const AFTER: Span = Span::s(3);

/// Takes out what tells only that groups are absent, or have come.
pub(super) fn excuse(model: &NetworkModel, conditions: &mut Vec<Condition>) {
    if !model.optional.is_empty() {
        conditions.retain(|condition| !is_of_absence(model, condition));
    }
}

fn is_of_absence(model: &NetworkModel, condition: &Condition) -> bool {
    if !OF_ABSENCE.contains(&condition.page.code) {
        return false;
    }
    match condition.place {
        Place::Link { a, b, .. } => leads_to_group(model, a, b),
        Place::Device { device, .. } if RESTARTS.contains(&condition.page.code) => {
            restarted_with_group(model, device)
        }
        Place::Device { device, .. } => goes_with_group(model, device),
        // Of the network as a whole: whose shares are missing tells; nobody knows those of a group that has not been
        // set up yet.
        Place::Network { .. } => {
            let mut ids = condition.symptoms.iter().filter_map(controller).peekable();
            match ids.peek() {
                None => model.optional.values().any(|first| is_absent(model, *first)),
                Some(_) => ids.all(|id| goes_with_group(model, id)),
            }
        }
        Place::Host => false,
    }
}

/// Whether a link is the one by which a group is plugged in, where it was planned or at another port.
fn leads_to_group(model: &NetworkModel, a: End<DeviceId>, b: Option<End<DeviceId>>) -> bool {
    let is_first = |id: DeviceId| model.optional.get(&id) == Some(&id);
    let is_in_group =
        |end: End<DeviceId>| end.node().is_some_and(|id| model.optional.contains_key(&id));
    match b {
        Some(b) => !is_in_group(a) && b.node().is_some_and(is_first),
        // Nothing is planned there.
        None => model.tree.as_ref().zip(a.node()).is_some_and(|(tree, id)| match a {
            End::Controller(_, port) => !tree.is_open(id.index(), port),
            End::MainDevice(_) => false,
        }),
    }
}

/// Whether a controller is of a group that is absent, or just came: its first one is silent, or it is that.
fn goes_with_group(model: &NetworkModel, id: DeviceId) -> bool {
    let Some(first) = model.optional.get(&id) else { return false };
    is_absent(model, *first)
        || id == *first
        || model.device(id).is_some_and(|one| one.silent.is_none())
}

/// True if a controller started anew with its group, as when that was plugged in: its first one had gone by then, and
/// had not been back for long.
fn restarted_with_group(model: &NetworkModel, id: DeviceId) -> bool {
    let Some(first) = model.optional.get(&id) else { return false };
    if id == *first || is_absent(model, *first) {
        return true;
    }
    let fell = model.device(id).and_then(|one| {
        one.al
            .changes
            .iter()
            .filter(|change| change.is_own_fall())
            .map(|change| change.at)
            .next_back()
    });
    let (Some(fell), Some(first)) = (fell, model.device(*first)) else {
        return goes_with_group(model, id);
    };
    first.joined_absences().iter().any(|absence| {
        absence.since.at <= fell && absence.ended.is_none_or(|ended| ended + AFTER >= fell)
    })
}

/// Whether a controller does not answer, or never did.
fn is_absent(model: &NetworkModel, id: DeviceId) -> bool {
    model.device(id).is_none_or(|one| one.silent.is_some() || one.answered.is_none())
}

/// The controller that a symptom is of.
fn controller(symptom: &Symptom) -> Option<DeviceId> {
    match symptom {
        Symptom::Silent(id)
        | Symptom::WorkingCounter(id)
        | Symptom::StateLost(id)
        | Symptom::Emergency(id)
        | Symptom::Mailbox(id)
        | Symptom::InputsStill(id)
        | Symptom::PortErrors(id, _)
        | Symptom::LinkDown(id, _)
        | Symptom::LinkCounted(id, _) => Some(*id),
        Symptom::FramesLost
        | Symptom::FramesLate
        | Symptom::CardErrors
        | Symptom::NoCarrier
        | Symptom::NobodyAnswers
        | Symptom::CountersCleared => None,
    }
}
