//! The line as a tree: which controller hangs on which port of which other.
//!
//! A [`Tree`] is built from a description ([`Tree::from_wiring`]) or found from what was seen
//! ([`derive`](super::derive())); equal lines give equal trees. Its controllers are indices from 0,
//! in the order of whoever built it; the order in which a frame is processed is
//! [`Tree::order`]. Rings and their halves are in `tree/ring.rs`.
//! Reference: S1 chapter 3; read [`wiring`](super::wiring) first.

mod ring;
mod row;

use super::wiring::{End, Link, ports_after};
use crate::address::Path;
use crate::port::{Port, PortMap};

/// How one controller is wired: the end it hangs on, and its own port at that link.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Wired {
    /// The end nearer the MainDevice, to which the entry port is wired.
    pub on: End,
    /// The port through which frames come in: A unless the cable is plugged in the wrong way.
    pub entry: Port,
}

/// Why a description is not a line. Controllers are named by their index in the description.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum WiringError {
    /// An end names a controller that the description does not have.
    #[error("{end}: no controller {end} among the {len} described (counted from 0)")]
    NoSuchController {
        /// The end that was named.
        end: End,
        /// How many controllers there are.
        len: usize,
    },
    /// Two links are plugged into one port.
    #[error("{end} is wired twice, to controllers {first} and {second}: move one of them")]
    WiredTwice {
        /// The port or card.
        end: End,
        /// Who is wired to it first.
        first: usize,
        /// Who is wired to it, too.
        second: usize,
    },
    /// A controller hangs on the port through which frames come in.
    #[error("controller {child} is wired to {node}.{port}, the port where frames enter {node}")]
    OnEntry {
        /// The controller with the port.
        node: usize,
        /// Its entry port.
        port: Port,
        /// Who is wired to it.
        child: usize,
    },
    /// Following the upstream ends never leads to the MainDevice.
    #[error(
        "controller {node} is not connected to the MainDevice: its wiring runs in a circle, or its \
         place was never found"
    )]
    Detached {
        /// A controller on or behind the circle.
        node: usize,
    },
    /// The port that should close the ring is in use, or card B is.
    #[error("the ring cannot close at {node}.{port}: {taken} is wired already")]
    RingTaken {
        /// The controller that should close the ring.
        node: usize,
        /// Its port.
        port: Port,
        /// The end that is not free.
        taken: End,
    },
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Node {
    /// `None` when the controller could not be placed.
    pub(super) on: Option<End>,
    pub(super) entry: Port,
    pub(super) children: PortMap<Option<usize>>,
}

/// Where a node lies in the walk: how deep, which stretch of `reached` is its subtree, and when it
/// is processed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct Place {
    depth: usize,
    reached_from: usize,
    reached_to: usize,
    position: Option<usize>,
}

/// A line, or as much of it as could be put together.
///
/// A controller beyond the tree, such as one that answers although nobody planned it, is treated as detached:
/// it hangs on nothing, nothing hangs on it, and it has no link and no position.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Tree {
    nodes: Vec<Node>,
    first: [Option<usize>; 2],
    closes_at: Option<(usize, Port)>,
    links: Vec<Link>,
    link_above: Vec<Option<usize>>,
    reached: Vec<usize>,
    order: Vec<usize>,
    places: Vec<Place>,
}

impl Tree {
    /// Builds the tree from a description in any order: controller `i` is `wired[i]`.
    ///
    /// `closes_at` is the port wired to card B, if the line is a ring. A controller on
    /// [`Path::B`] without a ring is the first of a half that hangs on card B alone.
    ///
    /// # Errors
    /// [`WiringError`] when the description is not one line.
    pub fn from_wiring(
        wired: &[Wired],
        closes_at: Option<(usize, Port)>,
    ) -> Result<Self, WiringError> {
        let mut nodes: Vec<Node> = wired
            .iter()
            .map(|w| Node { on: Some(w.on), entry: w.entry, children: PortMap::default() })
            .collect();
        let mut first = [None; 2];
        for (index, wired) in wired.iter().enumerate() {
            let slot = match wired.on {
                End::MainDevice(path) => &mut first[path.index()],
                End::Controller(on, port) => match nodes.get_mut(on) {
                    Some(node) => &mut node.children[port],
                    None => {
                        return Err(WiringError::NoSuchController {
                            end: wired.on,
                            len: nodes.len(),
                        });
                    }
                },
            };
            if let Some(first) = slot.replace(index) {
                return Err(WiringError::WiredTwice { end: wired.on, first, second: index });
            }
        }
        for (index, node) in nodes.iter().enumerate() {
            if let Some(child) = node.children[node.entry] {
                return Err(WiringError::OnEntry { node: index, port: node.entry, child });
            }
        }
        let tree = Self::assemble(nodes, None);
        if let Some(node) = tree.detached().next() {
            return Err(WiringError::Detached { node });
        }
        match closes_at {
            Some((node, port)) => tree.closed_at(node, port),
            None => Ok(tree),
        }
    }

    /// Puts nodes together whose `on` and `children` agree; those that lead nowhere are detached.
    pub(super) fn assemble(nodes: Vec<Node>, closes_at: Option<(usize, Port)>) -> Self {
        let len = nodes.len();
        let mut tree = Self {
            nodes,
            first: [None; 2],
            closes_at,
            links: Vec::with_capacity(len + 1),
            link_above: vec![None; len],
            reached: Vec::with_capacity(len),
            order: Vec::with_capacity(len),
            places: vec![Place::default(); len],
        };
        for (index, node) in tree.nodes.iter().enumerate() {
            if let Some(End::MainDevice(path)) = node.on {
                tree.first[path.index()] = Some(index);
            }
        }
        for path in Path::ALL {
            if let Some(first) = tree.first[path.index()] {
                tree.walk_from(first);
            }
        }
        for index in 0..len {
            if let (Some(upstream), true) = (tree.nodes[index].on, tree.is_attached(index)) {
                let downstream = End::Controller(index, tree.nodes[index].entry);
                tree.link_above[index] = Some(tree.links.len());
                tree.links.push(Link { upstream, downstream });
            }
        }
        if let Some((node, port)) = closes_at {
            let upstream = End::Controller(node, port);
            tree.links.push(Link { upstream, downstream: End::MainDevice(Path::B) });
        }
        tree
    }

    /// Walks the half that begins at `first` port by port, as a frame does while no ring is closed.
    fn walk_from(&mut self, first: usize) {
        let mut node = first;
        let mut port = self.enter(first, 1);
        loop {
            if port == Port::A {
                self.places[node].position = Some(self.order.len());
                self.order.push(node);
            }
            port = port.next();
            if port == self.nodes[node].entry {
                self.places[node].reached_to = self.reached.len();
                match self.nodes[node].on {
                    Some(End::Controller(parent, at)) => (node, port) = (parent, at),
                    Some(End::MainDevice(_)) | None => return,
                }
            } else if let Some(child) = self.nodes[node].children[port] {
                port = self.enter(child, self.places[node].depth + 1);
                node = child;
            }
        }
    }

    fn enter(&mut self, node: usize, depth: usize) -> Port {
        self.places[node].depth = depth;
        self.places[node].reached_from = self.reached.len();
        self.reached.push(node);
        self.nodes[node].entry
    }

    /// How many controllers there are, detached ones included.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there is no controller.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The controller on a card of the MainDevice, as the tree hangs: card B has one only in a tree
    /// of two halves ([`Tree::beside`]), not in a ring.
    #[must_use]
    pub fn first(&self, card: Path) -> Option<usize> {
        self.first[card.index()]
    }

    /// The end that `node` hangs on, `None` if it is detached from all others.
    #[must_use]
    pub fn upstream(&self, node: usize) -> Option<End> {
        self.nodes.get(node)?.on
    }

    /// The controller that `node` hangs on, `None` if that is the MainDevice.
    #[must_use]
    pub fn parent(&self, node: usize) -> Option<usize> {
        self.upstream(node).and_then(End::node)
    }

    /// The port through which frames come in to `node`; A, as planned everywhere, for one beyond the tree.
    #[must_use]
    pub fn entry(&self, node: usize) -> Port {
        self.nodes.get(node).map_or(Port::A, |node| node.entry)
    }

    /// Whether frames come in to `node` at another port than A: the cable to it is plugged into the
    /// wrong socket, so its processing unit is met after what hangs behind port A.
    #[must_use]
    pub fn is_reversed(&self, node: usize) -> bool {
        self.entry(node) != Port::A
    }

    /// The controller that hangs on `port` of `node`.
    #[must_use]
    pub fn child(&self, node: usize, port: Port) -> Option<usize> {
        self.nodes.get(node)?.children[port]
    }

    /// What hangs on `node`, with the port it hangs on, in the order a frame gets there.
    pub fn children(&self, node: usize) -> impl Iterator<Item = (Port, usize)> {
        ports_after(self.entry(node))
            .into_iter()
            .filter_map(move |port| self.child(node, port).map(|child| (port, child)))
    }

    /// Whether `port` of `node` has a link: entry, child, or the one that closes the ring.
    #[must_use]
    pub fn is_open(&self, node: usize, port: Port) -> bool {
        let entry = self.upstream(node).is_some() && self.entry(node) == port;
        entry || self.child(node, port).is_some() || self.closes_at == Some((node, port))
    }

    /// Ports of `node` that have a link, in the order a frame gets there: entry first.
    pub fn open_ports(&self, node: usize) -> impl Iterator<Item = Port> {
        let entry = self.entry(node);
        let all = std::iter::once(entry).chain(ports_after(entry));
        all.filter(move |port| self.is_open(node, *port))
    }

    /// All links. The link above controller `i` is link `i`, unless controllers are detached (see
    /// [`Tree::link_above`]); the link that closes a ring is the last.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// The index in [`Tree::links`] of the link between `node` and what it hangs on.
    #[must_use]
    pub fn link_above(&self, node: usize) -> Option<usize> {
        self.link_above.get(node).copied().flatten()
    }

    /// The index in [`Tree::links`] of the link that is plugged in at `end`.
    #[must_use]
    pub fn link_at(&self, end: End) -> Option<usize> {
        match end {
            End::MainDevice(path) => match (self.first(path), path) {
                (Some(first), _) => self.link_above(first),
                (None, Path::A) => None,
                (None, Path::B) => self.ring_link(),
            },
            End::Controller(node, port) => {
                if self.closes_at == Some((node, port)) {
                    self.ring_link()
                } else if self.entry(node) == port {
                    self.link_above(node)
                } else {
                    self.child(node, port).and_then(|child| self.link_above(child))
                }
            }
        }
    }

    /// The other end of the link that is plugged in at `end`.
    #[must_use]
    pub fn opposite(&self, end: End) -> Option<End> {
        let link = self.links[self.link_at(end)?];
        Some(if link.upstream == end { link.downstream } else { link.upstream })
    }

    /// Controllers in the order in which a frame of card A is processed while no ring is closed,
    /// then those of a half that hangs on card B in the order in which a frame of card B is.
    /// Detached ones are left out.
    #[must_use]
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// Where `node` comes in [`Tree::order`], counted from 0.
    #[must_use]
    pub fn position(&self, node: usize) -> Option<usize> {
        self.place(node).position
    }

    /// Where `node` lies in the walk; nowhere, for one beyond the tree.
    fn place(&self, node: usize) -> Place {
        self.places.get(node).copied().unwrap_or_default()
    }

    /// Controllers in the order in which a frame first reaches them: each before all that hangs on
    /// it. The same as [`Tree::order`] unless one is reversed.
    #[must_use]
    pub fn reached(&self) -> &[usize] {
        &self.reached
    }

    /// `node` and all that hangs on it, in the order a frame first gets there.
    #[must_use]
    pub fn subtree(&self, node: usize) -> &[usize] {
        let place = self.place(node);
        &self.reached[place.reached_from..place.reached_to]
    }

    /// All that lies behind `port` of `node`, seen from card A; nothing for the entry port.
    #[must_use]
    pub fn behind(&self, node: usize, port: Port) -> &[usize] {
        self.child(node, port).map_or(&[], |child| self.subtree(child))
    }

    /// How many controllers a frame enters on its way to `node`, itself included: 1 for the one on
    /// the MainDevice, 0 for a detached one.
    #[must_use]
    pub fn depth(&self, node: usize) -> usize {
        self.place(node).depth
    }

    /// The controllers from the MainDevice's to `node` itself.
    #[must_use]
    pub fn path_to(&self, node: usize) -> Vec<usize> {
        let mut path: Vec<usize> =
            std::iter::successors(Some(node), |&node| self.parent(node)).collect();
        path.reverse();
        path
    }

    /// Whether `node` hangs on `other`, directly or further down; a node is not downstream of
    /// itself.
    #[must_use]
    pub fn is_downstream_of(&self, node: usize, other: usize) -> bool {
        let (inner, outer) = (self.place(node), self.place(other));
        node != other
            && self.is_attached(node)
            && (outer.reached_from..outer.reached_to).contains(&inner.reached_from)
    }

    /// Whether `node` is connected to the MainDevice.
    #[must_use]
    pub fn is_attached(&self, node: usize) -> bool {
        self.place(node).position.is_some()
    }

    /// Controllers for which no place was found. Only a derived tree can have some.
    pub fn detached(&self) -> impl Iterator<Item = usize> {
        (0..self.len()).filter(|&node| !self.is_attached(node))
    }

    /// The description of this tree, which [`Tree::from_wiring`] turns back into an equal one.
    ///
    /// # Errors
    /// [`WiringError::Detached`] when a controller has no place.
    pub fn wiring(&self) -> Result<Vec<Wired>, WiringError> {
        let wired = |(index, node): (usize, &Node)| match node.on {
            Some(on) if self.is_attached(index) => Ok(Wired { on, entry: node.entry }),
            Some(_) | None => Err(WiringError::Detached { node: index }),
        };
        self.nodes.iter().enumerate().map(wired).collect()
    }

    /// The same line with controllers numbered in [`Tree::order`], detached ones last: controller
    /// `i` of the new tree is `order()[i]` of this one.
    #[must_use]
    pub fn in_processing_order(&self) -> Self {
        let old: Vec<usize> = self.order.iter().copied().chain(self.detached()).collect();
        let mut new = vec![0; old.len()];
        for (now, &before) in old.iter().enumerate() {
            new[before] = now;
        }
        let renumber = |node: &Node| Node {
            on: node.on.map(|end| end.map(|parent| new[parent])),
            entry: node.entry,
            children: PortMap(node.children.0.map(|child| child.map(|child| new[child]))),
        };
        let nodes = old.iter().map(|&node| renumber(&self.nodes[node])).collect();
        Self::assemble(nodes, self.closes_at.map(|(node, port)| (new[node], port)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Port::{A, B, C, D};

    fn on(parent: usize, port: Port) -> Wired {
        Wired { on: End::Controller(parent, port), entry: A }
    }

    const FIRST: Wired = Wired { on: End::MainDevice(Path::A), entry: A };

    /// A coupler with two terminals, and behind its second socket a junction with three branches.
    fn branched() -> Tree {
        let wired = [FIRST, on(0, B), on(1, B), on(0, C), on(3, C), on(3, B), on(3, D)];
        Tree::from_wiring(&wired, None).unwrap()
    }

    // proves: ESC-07 partial, ESC-13 partial
    #[test]
    fn a_described_line_knows_order_depth_and_neighbours() {
        let tree = branched();
        assert_eq!(tree.order(), [0, 1, 2, 3, 6, 5, 4]);
        assert_eq!(tree.reached(), tree.order());
        assert_eq!(tree.position(4), Some(6));
        assert_eq!(tree.subtree(3), [3, 6, 5, 4]);
        assert_eq!(tree.behind(0, B), [1, 2]);
        assert_eq!(tree.behind(0, A), []);
        assert_eq!(tree.path_to(4), [0, 3, 4]);
        assert_eq!([0, 1, 2, 3, 4].map(|node| tree.depth(node)), [1, 2, 3, 2, 3]);
        assert_eq!(tree.children(3).collect::<Vec<_>>(), [(D, 6), (B, 5), (C, 4)]);
        assert_eq!(tree.open_ports(0).collect::<Vec<_>>(), [A, B, C]);
        assert!(tree.is_downstream_of(6, 0) && !tree.is_downstream_of(3, 3));
        assert!(!tree.is_downstream_of(2, 3) && !tree.is_downstream_of(0, 6));
        assert_eq!(tree.links().len(), 7);
        assert_eq!(tree.links()[4].to_string(), "3.C-4.A");
        assert_eq!(tree.opposite(End::Controller(3, A)), Some(End::Controller(0, C)));
        assert_eq!(tree.opposite(End::Controller(0, A)), Some(End::MainDevice(Path::A)));
        assert_eq!(tree.opposite(End::MainDevice(Path::A)), Some(End::Controller(0, A)));
        assert_eq!(tree.opposite(End::Controller(2, B)), None);
        assert_eq!(tree.opposite(End::MainDevice(Path::B)), None);
    }

    #[test]
    fn controllers_behind_port_a_of_a_reversed_controller_are_processed_before_it() {
        let wired = [FIRST, Wired { entry: B, ..on(0, B) }, on(1, A), on(1, C), on(1, D)];
        let tree = Tree::from_wiring(&wired, None).unwrap();
        assert_eq!(tree.reached(), [0, 1, 3, 2, 4]);
        assert_eq!(tree.order(), [0, 3, 2, 1, 4]);
        assert!(tree.is_reversed(1) && !tree.is_reversed(0));
        assert_eq!(tree.subtree(1), [1, 3, 2, 4]);
    }

    #[test]
    fn a_description_may_come_in_any_order_and_is_renumbered() {
        let shuffled = [on(2, C), on(2, B), FIRST];
        let tree = Tree::from_wiring(&shuffled, None).unwrap();
        assert_eq!(tree.order(), [2, 1, 0]);
        let straight = Tree::from_wiring(&[FIRST, on(0, B), on(0, C)], None).unwrap();
        assert_eq!(tree.in_processing_order(), straight);
        assert_eq!(Tree::from_wiring(&tree.wiring().unwrap(), None), Ok(tree));
    }

    #[test]
    fn a_description_that_is_no_line_is_refused_with_the_place() {
        let refused = |wired: &[Wired]| Tree::from_wiring(wired, None).unwrap_err();
        let end = End::Controller(7, B);
        assert_eq!(refused(&[FIRST, on(7, B)]), WiringError::NoSuchController { end, len: 2 });
        let end = End::Controller(0, B);
        assert_eq!(
            refused(&[FIRST, on(0, B), on(0, B)]),
            WiringError::WiredTwice { end, first: 1, second: 2 }
        );
        assert_eq!(
            refused(&[FIRST, on(0, A)]),
            WiringError::OnEntry { node: 0, port: A, child: 1 }
        );
        assert_eq!(refused(&[FIRST, on(2, B), on(1, B)]), WiringError::Detached { node: 1 });
        let text = refused(&[FIRST, FIRST]).to_string();
        assert_eq!(text, "MainDevice.A is wired twice, to controllers 0 and 1: move one of them");
    }

    #[test]
    fn a_controller_beyond_the_tree_is_detached_like_one_without_a_place() {
        let tree = branched();
        let ring = tree.closed_at(2, B).unwrap();
        for tree in [tree, ring, Tree::from_wiring(&[], None).unwrap()] {
            for node in [tree.len(), usize::MAX] {
                assert_eq!((tree.upstream(node), tree.parent(node)), (None, None));
                assert_eq!((tree.link_above(node), tree.position(node)), (None, None));
                assert_eq!((tree.depth(node), tree.subtree(node)), (0, &[][..]));
                assert_eq!(tree.path_to(node), [node]);
                assert!(!tree.is_attached(node) && !tree.is_reversed(node));
                assert!(!tree.is_downstream_of(node, 0) && !tree.is_downstream_of(0, node));
                assert_eq!(tree.children(node).count() + tree.open_ports(node).count(), 0);
                assert_eq!(tree.in_a_row(node, |_| true), [0; 0]);
                for port in Port::ALL {
                    let end = End::Controller(node, port);
                    assert_eq!((tree.link_at(end), tree.opposite(end)), (None, None));
                    assert_eq!((tree.child(node, port), tree.behind(node, port)), (None, &[][..]));
                }
            }
        }
    }

    #[test]
    fn no_controllers_make_an_empty_tree() {
        let tree = Tree::from_wiring(&[], None).unwrap();
        assert!(tree.is_empty() && tree.links().is_empty() && tree.order().is_empty());
    }
}
