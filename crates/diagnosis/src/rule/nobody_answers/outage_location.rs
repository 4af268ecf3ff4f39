//! Location of an outage that is over: from the outputs that were missed, and from a search that was cut off.

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::Span;
use linesman_proto::topology::Route;
use linesman_proto::topology::route::Direction;

use crate::finding::{LinkDirection, Place};
use crate::model::is_on_terminal_bus;
use crate::model::{Device, NetworkModel, Silence};
use crate::rule::View;

/// States are read in turn: so long after a silence they tell of it.
const STARVED_WITHIN: Span = Span::s(1);
/// Without a sign of whose outputs were missed, a search must have left so few cables.
const MOST_CABLES: usize = 2;

/// The link that is most likely, and how sure: the nearest to the card first, cables before contacts.
pub(super) fn place(view: &View<'_>, silence: &Silence) -> Option<(Place, f64)> {
    let model = view.model;
    let tree = model.tree.as_ref().filter(|tree| tree.closes_at().is_none())?;
    let route = Route::of(tree, Path::A, &[]);
    let all = 0..tree.links().len();
    let was_searched = model.hole.is_some_and(|hole| hole.since == silence.since);
    let is_left = |link: &usize| !was_searched || model.hole_left.contains(link);
    // Who searched has kept frames from some of them.
    let fits = if was_searched { None } else { fed_until(view, silence, &route) };
    if fits.is_none() && all.clone().all(|link| is_left(&link)) {
        return None;
    }
    let (from, to) = fits.unwrap_or((0, route.hops().len()));
    let may_be = |link: &usize, way: Option<Direction>| {
        let mut hops = route.hops().get(from..to).into_iter().flatten();
        hops.any(|hop| hop.link == *link && way.is_none_or(|way| hop.direction == way))
    };
    let mut left: Vec<usize> = all.filter(|link| is_left(link) && may_be(link, None)).collect();
    let is_contact = |link: &usize| {
        tree.links()[*link].downstream.node().is_some_and(|node| is_on_terminal_bus(model, node))
    };
    // What takes the frames of both directions takes them on their way out.
    left.sort_by_key(|link| (is_contact(link), !may_be(link, Some(Direction::Downstream)), *link));
    let cables = left.iter().filter(|link| !is_contact(link)).count().max(1);
    if fits.is_none() && cables > MOST_CABLES {
        return None;
    }
    let link = tree.links()[*left.first()?].map(|node| DeviceId(node as u32));
    let place = Place::link(model.network, link, Some(LinkDirection::Both));
    Some((place, 0.6 / cables as f64))
}

/// Frames reach all that lie before a hole, in the order in which they are processed: those whose outputs'
/// watchdog expired lie behind it, those whose did not, though the silence was longer, before it. Gives the hops
/// between, from and up to; `None` where nobody tells.
fn fed_until(view: &View<'_>, silence: &Silence, route: &Route) -> Option<(usize, usize)> {
    let model = view.model;
    let (from, to) = (silence.since.at, silence.ended? + STARVED_WITHIN);
    let lasted = silence.last.at.since(from);
    let is_starved = |device: &Device| {
        device.al.errors.iter().any(|error| {
            error.may_be_watchdog() && from <= error.status.at && error.status.at <= to
        })
    };
    let takes_outputs = |device: &&Device| {
        let is_short = device.watchdog.span().is_some_and(|span| span * 5 < lasted * 4);
        is_short && owns_outputs(model, device.id)
    };
    let (starved, fed): (Vec<&Device>, Vec<&Device>) =
        model.devices.iter().filter(takes_outputs).partition(|device| is_starved(device));
    let came = |device: &&Device| Some(route.processing_of(device.id.index())?.after);
    let first_starved = starved.iter().filter_map(came).min();
    let last_fed = fed.iter().filter_map(came).max();
    // That nobody missed outputs is known when all were asked since.
    if first_starved.is_none() && (last_fed.is_none() || view.now < to) {
        return None;
    }
    let begin = last_fed.map_or(0, |hop| hop + 1);
    let end = first_starved.map_or(route.hops().len(), |hop| hop + 1);
    (begin < end).then_some((begin, end))
}

fn owns_outputs(model: &NetworkModel, id: DeviceId) -> bool {
    let mut owned = model.cyclic.iter().flat_map(|cyclic| model.owners(cyclic));
    owned.any(|owner| owner.device == id && owner.writes)
}
