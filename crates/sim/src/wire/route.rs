//! Route of an undisturbed frame: the controllers that it passes, and when.

use linesman_proto::address::Path;
use linesman_proto::port::Port;
use linesman_proto::time::Span;
use linesman_proto::topology::End;

use super::change::DirectedLink;
use super::outage_history::OutageHistory;
use super::world::World;

/// No place on a route.
const NOWHERE: u32 = u32::MAX;
/// Never.
const NEVER: u64 = u64::MAX;

/// A processing unit on the way.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Visit {
    pub(super) node: u32,
    /// From the first bit's leaving the card to its entering the unit.
    pub(super) after: Span,
}

/// The way from a card.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Route {
    /// Processing units, in the order of the way.
    pub(super) visits: Vec<Visit>,
    /// Ports by which it comes in anywhere, in the order of the nodes.
    entries: Vec<(u32, Port, Span)>,
    /// The card at which it ends.
    pub(super) arrives_at: Path,
    /// From card to card.
    pub(super) takes: Span,
    /// Whether any controller sets the bit in the source address.
    pub(super) marks_source: bool,
    /// The place of each node in `visits`.
    places: Vec<u32>,
    /// When the first bit is at the receiver of each line, in ns behind its leaving the card.
    crossings: Vec<[u64; 2]>,
}

impl Route {
    /// Where a node comes on the way.
    #[inline]
    pub(super) fn place(&self, node: u32) -> Option<u32> {
        self.places.get(node as usize).copied().filter(|place| *place != NOWHERE)
    }

    /// Ports by which it comes in anywhere, and when behind its leaving the card.
    pub(super) fn entries(&self) -> impl Iterator<Item = (u32, Port, Span)> + '_ {
        self.entries.iter().copied()
    }

    /// Those of one node.
    pub(super) fn entries_of(&self, node: u32) -> impl Iterator<Item = (u32, Port, Span)> + '_ {
        let first = self.entries.partition_point(|(other, ..)| *other < node);
        self.entries[first..].iter().take_while(move |(other, ..)| *other == node).copied()
    }

    /// When the first bit is at the receiver of a line, behind its leaving the card.
    pub(super) fn crossing(&self, direction: DirectedLink) -> Option<Span> {
        let after = self.crossings[direction.link][usize::from(direction.downstream)];
        (after != NEVER).then_some(Span::ns(after))
    }
}

impl World {
    /// The way of a frame from a card as links and loops are now; `None` when it does not come to a
    /// card, or meets a controller that does something with frames of no concern to it.
    pub(super) fn find_route(&self, card: Path) -> Option<Route> {
        let mut direction = self.leaving[card.index()]?;
        let mut after = Span::ZERO;
        let mut route = Route {
            visits: Vec::with_capacity(self.nodes.len()),
            entries: Vec::with_capacity(2 * self.nodes.len()),
            arrives_at: card,
            takes: Span::ZERO,
            marks_source: false,
            places: vec![NOWHERE; self.nodes.len()],
            crossings: vec![[NEVER; 2]; self.links.len()],
        };
        // A way that comes by a line again runs in a circle.
        for _ in 0..2 * self.links.len() {
            let link = &self.links[direction.link];
            let (_, to) = link.from_to(direction.downstream);
            let side = usize::from(direction.downstream);
            let ways = [&link.contact, &link.pair[side], &link.passage[side]];
            if !ways.into_iter().all(OutageHistory::is_whole) {
                return None;
            }
            after += link.transit;
            route.crossings[direction.link][usize::from(direction.downstream)] = after.as_nanos();
            let (node, port) = match to {
                End::Controller(node, port) => (node, port),
                End::MainDevice(path) => {
                    (route.arrives_at, route.takes) = (path, after);
                    route.entries.sort_unstable();
                    return Some(route);
                }
            };
            route.entries.push((node as u32, port, after));
            (direction, after) = self.lead_on(node, port, after, &mut route)?;
        }
        None
    }

    /// Through a controller: by which line it leaves, and when.
    fn lead_on(
        &self,
        node: usize,
        port: Port,
        after: Span,
        route: &mut Route,
    ) -> Option<(DirectedLink, Span)> {
        let here = &self.nodes[node];
        let fast_path_info = &here.entry.fast_path_info;
        let is_open = |port: Port| fast_path_info.open >> port.index() & 1 != 0;
        if fast_path_info.acts_on_all_frames || !here.power.is_whole() || !is_open(port) {
            return None;
        }
        let timing = here.controller.hardware().timing;
        let mut takes = timing.forward;
        let mut stop = port;
        for _ in Port::ALL {
            if stop == Port::A {
                let place = route.visits.len() as u32;
                if route.places[node] != NOWHERE {
                    return None;
                }
                route.places[node] = place;
                route.visits.push(Visit { node: node as u32, after });
                route.marks_source |= fast_path_info.marks_source;
                takes = timing.process;
            }
            stop = stop.next();
            if is_open(stop) {
                return Some((here.leaving[stop]?, after + takes));
            }
        }
        None
    }
}
