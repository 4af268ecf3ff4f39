//! Rings: the port that leads to card B, the two halves of a broken ring, and how they join.
//!
//! In the intact ring a frame of card A is processed by all and arrives at card B; one of card B
//! only passes through. (A reversed controller on the ring swaps the two: frames of card A pass it
//! by, those of card B are processed there.) Where the ring is cut, each card reaches its half,
//! and the half on card B is processed from the cut outwards, which is the order of the intact ring.
//! Reference: S1 chapter 9 (redundancy). What a frame meets is for
//! [`Route`](crate::topology::Route) to say.

use super::{Node, Tree, Wired, WiringError};
use crate::address::Path;
use crate::port::{Port, PortMap};
use crate::topology::wiring::End;

impl Tree {
    /// The port that is wired to card B, if the line is a ring.
    #[must_use]
    pub fn closes_at(&self) -> Option<(usize, Port)> {
        self.closes_at
    }

    /// The controllers on the way from card A to card B, in this order; none if the line is no ring.
    #[must_use]
    pub fn ring_nodes(&self) -> Vec<usize> {
        let last = self.closes_at().map(|(node, _)| node);
        let mut nodes: Vec<usize> =
            std::iter::successors(last, |node| self.parent(*node)).collect();
        nodes.reverse();
        nodes
    }

    /// The index in [`Tree::links`] of the link to card B, if the line is a ring.
    #[must_use]
    pub fn ring_link(&self) -> Option<usize> {
        self.closes_at.and_then(|_| self.links.len().checked_sub(1))
    }

    /// Whether `link` (index in [`Tree::links`]) may break without loss of any controller: it lies
    /// on the way from card A to card B. False for all links while the line is no ring.
    #[must_use]
    pub fn is_on_ring(&self, link: usize) -> bool {
        let Some((last, _)) = self.closes_at else { return false };
        match self.links.get(link).map(|link| link.downstream) {
            None => false,
            Some(End::MainDevice(_)) => true,
            Some(End::Controller(node, _)) => node == last || self.is_downstream_of(last, node),
        }
    }

    /// The same line with `port` of `node` wired to card B.
    ///
    /// The wiring is legal (S1: "port B of the last two-port device or port C of the last coupler")
    /// only where a frame of card A then still passes every processing unit; whether it does is
    /// asked of [`Route::unprocessed`](crate::topology::Route::unprocessed).
    ///
    /// # Errors
    /// [`WiringError`] when there is no such controller, or the port or card B is in use.
    pub fn closed_at(&self, node: usize, port: Port) -> Result<Self, WiringError> {
        let end = End::Controller(node, port);
        if node >= self.len() {
            return Err(WiringError::NoSuchController { end, len: self.len() });
        }
        let card = End::MainDevice(Path::B);
        let is_taken = |end: &End| self.link_at(*end).is_some();
        if let Some(taken) = [end, card].into_iter().find(is_taken) {
            return Err(WiringError::RingTaken { node, port, taken });
        }
        Ok(Self::assemble(self.nodes.clone(), Some((node, port))))
    }

    /// Two halves of a broken ring as one tree: this one on card A, `other` on card B. Controller
    /// `i` of `other` becomes `self.len() + i`.
    ///
    /// Both halves may be on any card beforehand; a ring in either is forgotten.
    #[must_use]
    pub fn beside(&self, other: &Self) -> Self {
        let offset = self.len();
        let moved = |node: &Node, path: Path, offset: usize| Node {
            on: node.on.map(|end| match end {
                End::MainDevice(_) => End::MainDevice(path),
                End::Controller(parent, port) => End::Controller(parent + offset, port),
            }),
            entry: node.entry,
            children: PortMap(node.children.0.map(|child| child.map(|child| child + offset))),
        };
        let mut nodes: Vec<Node> = self.nodes.iter().map(|n| moved(n, Path::A, 0)).collect();
        nodes.extend(other.nodes.iter().map(|n| moved(n, Path::B, offset)));
        Self::assemble(nodes, None)
    }

    /// The intact ring of which this tree holds the halves: as card A sees it when the missing link
    /// between `upstream`, a free port of the half on card A, and `downstream`, a free port of the
    /// half on card B, is mended. Controllers keep their indices.
    ///
    /// The controllers on the way from `downstream` to card B are entered from the other side then.
    ///
    /// # Errors
    /// [`WiringError`] when one of the ports is in use or in the wrong half.
    pub fn joined(
        &self,
        upstream: (usize, Port),
        downstream: (usize, Port),
    ) -> Result<Self, WiringError> {
        let mut wired = self.wiring()?;
        let len = wired.len();
        let (mut on, mut entry) = (End::Controller(upstream.0, upstream.1), downstream.1);
        let mut node = downstream.0;
        loop {
            let Some(place) = wired.get_mut(node) else {
                let end = End::Controller(node, entry);
                return Err(WiringError::NoSuchController { end, len });
            };
            let before = std::mem::replace(place, Wired { on, entry });
            match before.on {
                End::MainDevice(_) => return Self::from_wiring(&wired, Some((node, before.entry))),
                End::Controller(parent, port) => {
                    on = End::Controller(node, before.entry);
                    (node, entry) = (parent, port);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Port::{A, B, C};

    const FIRST: Wired = Wired { on: End::MainDevice(Path::A), entry: A };

    fn line(len: usize) -> Vec<Wired> {
        let on = |i: usize| Wired { on: End::Controller(i - 1, B), entry: A };
        std::iter::once(FIRST).chain((1..len).map(on)).collect()
    }

    // proves: RED-07 partial, RED-08 partial, RED-09 partial
    #[test]
    fn cables_of_the_ring_may_break_those_of_branches_may_not() {
        let mut wired = line(3);
        wired.push(Wired { on: End::Controller(1, C), entry: A });
        let ring = Tree::from_wiring(&wired, Some((2, B))).unwrap();
        assert_eq!(ring.ring_link(), Some(4));
        assert_eq!(ring.links()[4].to_string(), "2.B-MainDevice.B");
        assert_eq!(
            [0, 1, 2, 3, 4].map(|link| ring.is_on_ring(link)),
            [true, true, true, false, true]
        );
        assert_eq!(ring.opposite(End::MainDevice(Path::B)), Some(End::Controller(2, B)));
        let open = Tree::from_wiring(&wired, None).unwrap();
        assert!((0..4).all(|link| !open.is_on_ring(link)));
        assert_eq!(open.closed_at(2, B), Ok(ring));
    }

    #[test]
    fn a_ring_closes_only_at_a_free_port_and_card() {
        let open = Tree::from_wiring(&line(2), None).unwrap();
        let taken = End::Controller(0, B);
        assert_eq!(open.closed_at(0, B), Err(WiringError::RingTaken { node: 0, port: B, taken }));
        let taken = End::Controller(1, A);
        assert_eq!(open.closed_at(1, A), Err(WiringError::RingTaken { node: 1, port: A, taken }));
        let end = End::Controller(2, B);
        assert_eq!(open.closed_at(2, B), Err(WiringError::NoSuchController { end, len: 2 }));
        let taken = End::MainDevice(Path::B);
        assert_eq!(
            open.beside(&open).closed_at(1, B),
            Err(WiringError::RingTaken { node: 1, port: B, taken })
        );
        assert!(open.closed_at(1, B).unwrap().closed_at(1, C).is_err());
    }

    // proves: RED-11 partial
    #[test]
    fn two_halves_join_to_the_ring_they_came_from() {
        let near = Tree::from_wiring(&line(3), None).unwrap();
        // Seen from card B the far half is entered at port B, and each port A leads on.
        let tail = [
            Wired { on: End::Controller(1, A), entry: B },
            Wired { on: End::Controller(2, A), entry: B },
            Wired { on: End::MainDevice(Path::B), entry: B },
        ];
        let tail = Tree::from_wiring(&tail, None).unwrap();
        assert_eq!(tail.order(), [0, 1, 2]);
        let halves = near.beside(&tail);
        assert_eq!(halves.order(), [0, 1, 2, 3, 4, 5]);
        assert_eq!(halves.first(Path::B), Some(5));
        assert_eq!(halves.depth(5), 1);
        let ring = Tree::from_wiring(&line(6), Some((5, B))).unwrap();
        assert_eq!(halves.joined((2, B), (3, A)), Ok(ring));
        assert!(halves.joined((1, B), (3, A)).is_err(), "port in use");
        assert!(halves.joined((2, B), (1, C)).is_err(), "both in the half on card A");
        assert!(halves.joined((2, B), (9, A)).is_err(), "no such controller");
    }
}
