//! A half of a ring that falls silent, though the link that was lost would leave it reached.

use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::Tree;

use super::ANSWERS_LATE;
use crate::locate::LinkLosses;
use crate::model::NetworkModel;

/// Who answers is asked by then, after a link was lost.
const ALL_ASKED: Span = Span::ms(500);

/// In a ring, the end that still shows a link where the other one has lost it: it closes no port, so that frames
/// of its card vanish there, and nobody on the way to it answers any more though that card has a link. At a cable
/// that is out frames would turn back, and broadcasts be answered in both halves.
pub(super) fn near_end(model: &NetworkModel, tree: &Tree, drops: &LinkLosses) -> Option<usize> {
    let is_split = model.traffic.broadcasts.split().is_some_and(|split| split.at >= drops.first);
    if !drops.is_down || !tree.is_on_ring(drops.link) || is_split {
        return None;
    }
    let link = tree.links()[drops.link];
    let ring = tree.ring_nodes();
    let halves =
        [(Path::A, link.upstream, link.downstream), (Path::B, link.downstream, link.upstream)];
    halves.into_iter().find_map(|(card, near, far)| {
        let near = near.node()?;
        let at = ring.iter().position(|node| *node == near)?;
        let half = if card == Path::A { &ring[..=at] } else { &ring[at..] };
        let since = |node: usize, at: Instant| {
            model.devices[node].answered.is_some_and(|answered| answered.at > at)
        };
        let asked = drops.first + ALL_ASKED;
        let is_far_alive = far.node().map_or(model.now > asked, |node| since(node, asked));
        let is_near_heard = half.iter().any(|node| since(*node, drops.first + ANSWERS_LATE));
        let has_carrier = model.host.card(card).carrier.is_some_and(|carrier| carrier.value);
        (has_carrier && is_far_alive && !is_near_heard).then_some(near)
    })
}
