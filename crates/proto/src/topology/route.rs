//! A frame's way through the line, hop by hop, and the order in which it is checked.
//!
//! A controller checks a frame where it is received from outside, so each [`Hop`] that ends at a
//! controller is one check: at the entry port on the way out, at the other ports on the way back.
//! A frame that was spoiled on a hop is found at that hop's receiving port first, and the
//! processing units it had passed before have executed it.
//! Reference: S1 chapters 3 and 6; facts on redundancy in [`tree`](super::tree).

use super::tree::Tree;
use super::wiring::{End, Link};
use crate::address::Path;
use crate::port::{Port, PortMap};

/// Which way a hop crosses its link.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Direction {
    /// From the upstream to the downstream end, away from card A.
    Downstream,
    /// From the downstream to the upstream end, towards card A.
    Upstream,
}

/// Whether a hop is a frame's first or second over its link.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Leg {
    /// The frame has not been on this link before.
    Out,
    /// The frame returns over a link it left by.
    Back,
}

/// One link crossed in one direction.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Hop {
    /// The end that sends.
    pub from: End,
    /// The end that receives, and checks if it is a controller's.
    pub to: End,
    /// Index in [`Tree::links`].
    pub link: usize,
    /// Which way.
    pub direction: Direction,
}

/// A frame check: the port `port` of `node` receives the frame by hop `hop`.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Check {
    /// Index in [`Route::hops`].
    pub hop: usize,
    /// The controller that checks.
    pub node: usize,
    /// Its receiving port.
    pub port: Port,
}

/// A processing unit passed: `node` executes the frame after hop `after` and before the next.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Processing {
    /// The controller whose unit is passed.
    pub node: usize,
    /// Index in [`Route::hops`] of the hop by which the frame came in before.
    pub after: usize,
    /// Whether the frame came to the unit over the closed loop of port A. The unit then marks it
    /// as circulating, and destroys it if it is marked already.
    pub over_closed_loop: bool,
}

/// The way of a frame from the card that sends it to the card it arrives at.
///
/// It is the way of a frame that nothing happens to; see [`Route::destroyed_by`] for wiring on
/// which no frame gets home. Controllers and links are indices into the [`Tree`] it was made for.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Route {
    path: Path,
    hops: Vec<Hop>,
    processing: Vec<Processing>,
    /// By node and port: the hop that arrives there.
    received: Vec<PortMap<Option<usize>>>,
    /// By node and port: the hop that leaves there.
    sent: Vec<PortMap<Option<usize>>>,
    /// By node: index in `processing`.
    processed: Vec<Option<usize>>,
}

impl Route {
    /// The way of a frame of card A with all links whole.
    #[must_use]
    pub fn intact(tree: &Tree) -> Self {
        Self::of(tree, Path::A, &[])
    }

    /// The way of a frame of card `path` while the links `broken` (indices in [`Tree::links`]) are
    /// down and the loops at both their ends closed.
    ///
    /// There are no hops when nothing is plugged into the card, or its own link is down. Links that
    /// the tree does not have are ignored.
    #[must_use]
    pub fn of(tree: &Tree, path: Path, broken: &[usize]) -> Self {
        let mut whole = vec![true; tree.links().len()];
        for &link in broken {
            if let Some(whole) = whole.get_mut(link) {
                *whole = false;
            }
        }
        let link_at = |end: End| tree.link_at(end).filter(|&link| whole[link]);
        let mut route = Self {
            path,
            hops: Vec::with_capacity(2 * tree.links().len()),
            processing: Vec::with_capacity(tree.len()),
            received: vec![PortMap::default(); tree.len()],
            sent: vec![PortMap::default(); tree.len()],
            processed: vec![None; tree.len()],
        };
        let mut from = End::MainDevice(path);
        while let Some(link) = link_at(from) {
            let to = route.cross(from, link, tree.links()[link]);
            let End::Controller(node, port) = to else { break };
            from = End::Controller(node, route.pass(node, port, link_at));
        }
        route
    }

    /// Crosses `link` from the end `from`, and says where that leads.
    fn cross(&mut self, from: End, link: usize, ends: Link) -> End {
        let (to, direction) = if ends.upstream == from {
            (ends.downstream, Direction::Downstream)
        } else {
            (ends.upstream, Direction::Upstream)
        };
        let hop = self.hops.len();
        if let End::Controller(node, port) = from {
            self.sent[node][port] = Some(hop);
        }
        if let End::Controller(node, port) = to {
            self.received[node][port] = Some(hop);
        }
        self.hops.push(Hop { from, to, link, direction });
        to
    }

    /// Passes through `node` from reception at `received` to the next open port, which it returns.
    fn pass(
        &mut self,
        node: usize,
        received: Port,
        link_at: impl Fn(End) -> Option<usize>,
    ) -> Port {
        let mut port = received;
        loop {
            if port == Port::A {
                self.processed[node] = Some(self.processing.len());
                self.processing.push(Processing {
                    node,
                    after: self.hops.len() - 1,
                    over_closed_loop: received != Port::A,
                });
            }
            port = port.next();
            // The port it came in at is open, so this ends after one round at the latest.
            if link_at(End::Controller(node, port)).is_some() {
                return port;
            }
        }
    }

    /// The card that sends.
    #[must_use]
    pub fn path(&self) -> Path {
        self.path
    }

    /// All hops in order, the first from the MainDevice and the last back to it.
    #[must_use]
    pub fn hops(&self) -> &[Hop] {
        &self.hops
    }

    /// The card where the frame arrives: in an intact ring the other one. `None` if it never
    /// leaves.
    #[must_use]
    pub fn arrives_at(&self) -> Option<Path> {
        self.hops.last().and_then(|hop| match hop.to {
            End::MainDevice(card) => Some(card),
            End::Controller(..) => None,
        })
    }

    /// The frame checks in order: all hops but the last, which only the card checks.
    pub fn checks(&self) -> impl Iterator<Item = Check> {
        self.checks_from(0)
    }

    /// The checks that see what happened to a frame on `hop`: the one at its receiving end and all
    /// later ones. Checks of hops before it saw the frame as it was.
    pub fn checks_from(&self, hop: usize) -> impl Iterator<Item = Check> {
        self.hops.iter().enumerate().skip(hop).filter_map(|(hop, &Hop { to, .. })| match to {
            End::MainDevice(_) => None,
            End::Controller(node, port) => Some(Check { hop, node, port }),
        })
    }

    /// The hop that is checked at `port` of `node`; `None` if this frame is not received there.
    #[must_use]
    pub fn hop_to(&self, node: usize, port: Port) -> Option<usize> {
        self.received.get(node)?[port]
    }

    /// The hop that `node` sends from `port`; `None` if this frame does not leave there.
    #[must_use]
    pub fn hop_from(&self, node: usize, port: Port) -> Option<usize> {
        self.sent.get(node)?[port]
    }

    /// The hop by which the frame first reaches `node`.
    #[must_use]
    pub fn first_hop_to(&self, node: usize) -> Option<usize> {
        self.received.get(node)?.0.into_iter().flatten().min()
    }

    /// The hop by which the frame leaves `node` for good.
    #[must_use]
    pub fn last_hop_from(&self, node: usize) -> Option<usize> {
        self.sent.get(node)?.0.into_iter().flatten().max()
    }

    /// The hop over the same link in the other direction; `None` where the frame passes only once.
    #[must_use]
    pub fn opposite(&self, hop: usize) -> Option<usize> {
        match self.hops.get(hop)?.from {
            End::Controller(node, port) => self.hop_to(node, port),
            End::MainDevice(card) => {
                let last = self.hops.len() - 1;
                (hop != last && self.hops[last].to == End::MainDevice(card)).then_some(last)
            }
        }
    }

    /// Whether `hop` is on the way out or on the way back; `None` if there is no such hop.
    #[must_use]
    pub fn leg(&self, hop: usize) -> Option<Leg> {
        self.hops.get(hop)?;
        let is_back = self.opposite(hop).is_some_and(|other| other < hop);
        Some(if is_back { Leg::Back } else { Leg::Out })
    }

    /// The processing units passed, in order.
    #[must_use]
    pub fn processing(&self) -> &[Processing] {
        &self.processing
    }

    /// The controllers in the order in which they process the frame.
    pub fn order(&self) -> impl Iterator<Item = usize> {
        self.processing.iter().map(|passed| passed.node)
    }

    /// When `node` processes the frame; `None` if it does not.
    #[must_use]
    pub fn processing_of(&self, node: usize) -> Option<Processing> {
        self.processed.get(node)?.map(|index| self.processing[index])
    }

    /// The units that have executed a frame which is spoiled or lost on `hop`.
    #[must_use]
    pub fn executed_before(&self, hop: usize) -> &[Processing] {
        &self.processing[..self.processing.partition_point(|passed| passed.after < hop)]
    }

    /// The units that have not executed a frame which is spoiled or lost on `hop`.
    #[must_use]
    pub fn not_executed_before(&self, hop: usize) -> &[Processing] {
        &self.processing[self.executed_before(hop).len()..]
    }

    /// Controllers of the tree that do not process this frame: cut off, in the other card's half,
    /// or behind the point where a ring must not be closed.
    pub fn unprocessed(&self) -> impl Iterator<Item = usize> {
        (0..self.processed.len()).filter(|&node| self.processed[node].is_none())
    }

    /// The unit that destroys the frame as circulating: the second that is reached over the closed
    /// loop of port A (with loop control of port A left on automatic).
    ///
    /// One such controller is normal where a cable is plugged into the wrong socket or a ring is
    /// cut; with two of them no frame comes home. Reference: S1, circulating frames.
    #[must_use]
    pub fn destroyed_by(&self) -> Option<Processing> {
        self.processing.iter().copied().filter(|passed| passed.over_closed_loop).nth(1)
    }
}

#[cfg(test)]
mod tests;
