//! Distance of a cut: links behind which the path is as long as the transit time has become shorter.
//!
//! How long frames are away behind a port the controller before it has measured itself, where receive times were latched
//! (0x0900): a cut there shortens the way by that.

use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use crate::finding::Evidence;
use crate::model::{NetworkModel, PathDelayStep};

/// The step by which the way became shorter at a moment, where the times of frames show one.
#[must_use]
pub fn shortened(model: &NetworkModel, at: Instant) -> Option<PathDelayStep> {
    model.round_trips.path_delays.step(at).filter(|step| step.shorter() > Span::ZERO)
}

/// Keeps those nodes behind whose links the way is as long as it became shorter at a moment, where it is known of any:
/// they come first, then those of which it is not known.
pub fn keep_fitting(model: &NetworkModel, tree: &Tree, heads: &mut Vec<usize>, at: Instant) {
    let Some(step) = shortened(model, at) else { return };
    let fits = |head: &usize| {
        let behind = tree.link_above(*head).and_then(|link| length_behind(model, tree, link));
        behind.map(|behind| step.is(behind))
    };
    if heads.iter().any(|head| fits(head) == Some(true)) {
        heads.retain(|head| fits(head) != Some(false));
        heads.sort_by_key(|head| fits(head).is_none());
    }
}

/// The step in words, as evidence.
#[must_use]
pub fn evidence(model: &NetworkModel, at: Instant) -> Option<Evidence> {
    let step = shortened(model, at)?;
    let text = format!(
        "frames of {} bytes come back {} sooner since, within {}: their way is shorter by what lies behind the cut",
        step.len,
        step.shorter(),
        step.doubt
    );
    let (before, after) = (step.before.as_nanos(), step.after.as_nanos());
    Some(Evidence::host(Some(at), text).values(Some(before), Some(after)))
}

/// How long a frame is away behind a link, there and back, as the controller before it has measured.
fn length_behind(model: &NetworkModel, tree: &Tree, link: usize) -> Option<Span> {
    let End::Controller(near, port) = tree.links().get(link)?.upstream else { return None };
    let times = model.devices.get(near)?.received?;
    let ports: Vec<_> = tree.open_ports(near).collect();
    let at = ports.iter().position(|one| *one == port)?;
    let before = ports.get(at.checked_sub(1)?)?;
    let away = times[port]?.0.wrapping_sub(times[*before]?.0);
    (away > 0).then(|| Span::ns(away.into()))
}
