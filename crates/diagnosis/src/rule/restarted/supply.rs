//! How long the supply of a SubDevice that started anew was away, as its own clock tells.
//!
//! An outage on the line lasts until the links are up again, which takes them up to five seconds. The clock of the
//! controller begins when the supply is back, and does not wait for them.

use linesman_proto::register::SYSTEM_TIME;
use linesman_proto::time::{Instant, Span};

use super::{Fall, TOGETHER};
use crate::finding::Evidence;
use crate::model::{NetworkModel, Seen};

/// That a supply is gone is noticed so much later at the most.
const NOTICED_LATE: Span = Span::ms(500);

/// Time at which it was back; `None` where the clock does not tell.
fn back_at(fall: &Fall<'_>) -> Option<Instant> {
    let (since, until) = (fall.began(), fall.gone?.1);
    fall.device.up_time?.began_within(since.before(NOTICED_LATE), until)
}

/// How long it was away; `None` where the clock does not tell.
pub(super) fn away(fall: &Fall<'_>) -> Option<Span> {
    Some(back_at(fall)?.since(fall.began()))
}

/// True if one of two was back on the line long before the other one had its supply again: then it was not the same supply,
/// whichever was missed first. Who starts anew again and again proves nothing by its latest start.
///
/// A SubDevice without a clock came back with the one before it, where both were seen on their way up at the same time.
pub(super) fn are_apart(model: &NetworkModel, falls: &[Fall<'_>], pair: [&Fall<'_>; 2]) -> bool {
    let is_single = |fall: &Fall<'_>| {
        fall.device.al.changes.iter().filter(|change| change.is_own_fall()).count() == 1
    };
    let before = |fall: &Fall<'_>| {
        let node = fall.device.id.index();
        let tree = model.tree.as_ref().filter(|tree| node < tree.len())?;
        let upstream = tree.upstream(node)?.node()?;
        let upstream = falls.iter().find(|other| other.device.id.index() == upstream)?;
        let (one, other) = (fall.change.at, upstream.change.at);
        (one.since(other).max(other.since(one)) <= TOGETHER).then_some(upstream)
    };
    let powered = |fall: &Fall<'_>| back_at(fall).or_else(|| back_at(before(fall)?));
    let is_up_before = |up: &Fall<'_>, other: &Fall<'_>| {
        powered(other).is_some_and(|at| up.change.at + TOGETHER < at)
    };
    let [one, other] = pair;
    is_single(one) && is_single(other) && (is_up_before(one, other) || is_up_before(other, one))
}

/// What shows that.
pub(super) fn evidence(model: &NetworkModel, fall: &Fall<'_>) -> Option<Evidence> {
    let (since, until, away) = (fall.began(), fall.gone?.1, away(fall)?);
    let text = format!(
        "the clock of {} began {:.0} ms after it was gone: its supply was back by then, and the rest of {:.0} ms its links \
         took to come up",
        model.label(fall.device.id),
        away.as_secs_f64() * 1e3,
        until.since(since).as_secs_f64() * 1e3,
    );
    let seen = Seen::new((), fall.device.up_time?.read_at(), None);
    Some(Evidence::register(fall.device.id, SYSTEM_TIME.address, &seen, text))
}
