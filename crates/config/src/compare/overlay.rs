//! Laying one tree upon another at the least cost.

use std::collections::BTreeMap;

use linesman_proto::port::Port;
use linesman_proto::topology::Tree;

use super::{Comparison, Difference, Side, There, Unlike, Wanted, is_other_kind, unlike};

/// A device too few or too many.
const ALONE: u32 = 64;
/// Each further device of the same branch, up to [`MOST_WITH`]: a branch is gone as easily as a device.
const WITH: u32 = 1;
const MOST_WITH: u32 = 20;
/// A device of another kind: less than one that is missing and another that is too many.
const OTHER_KIND: u32 = 48;
/// Another revision, serial number or alias.
const OTHER_ONE: u32 = 32;
/// Cables in each other's port, or a device the wrong way round.
const REPLUGGED: u32 = 48;
/// How many devices too few or too many are looked for within one chain.
const SHIFT: usize = 12;

/// How a planned node and a found one are taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum NodeMatch {
    /// As the same; the children of these planned ports hang on these ports of the found one.
    Same([Port; 4]),
    /// The planned one is missing, and what hangs on this port of it has moved up.
    Skip(Port),
    /// The found one is too much, and what hangs on this port of it was planned in its place.
    Insert(Port),
    /// They have nothing to do with each other.
    Apart,
}

struct Overlay<'a> {
    planned: Side<'a, Wanted>,
    found: Side<'a, There>,
    known: BTreeMap<(usize, usize), (u32, NodeMatch)>,
}

/// Lays what was found upon what was planned.
pub(super) fn lay(planned: Side<'_, Wanted>, found: Side<'_, There>) -> Comparison {
    let mut overlay = Overlay { planned, found, known: BTreeMap::new() };
    let mut comparison =
        Comparison { pairs: vec![None; planned.tree.len()], differences: Vec::new() };
    let first = |tree: &Tree| {
        use linesman_proto::address::Path;
        Path::ALL.map(|path| tree.first(path))
    };
    for (wanted, there) in first(planned.tree).into_iter().zip(first(found.tree)) {
        overlay.take(wanted, there, &mut comparison);
    }
    comparison
}

/// The pairs of nodes, when two branches are the same device by device.
pub(super) fn same(
    planned: Side<'_, Wanted>,
    found: Side<'_, There>,
    wanted: usize,
    there: usize,
) -> Option<Vec<(usize, usize)>> {
    let mut overlay = Overlay { planned, found, known: BTreeMap::new() };
    // Without a single identity everything would be the same.
    let known = |node: &usize| found.nodes.get(*node).is_some_and(|there| there.identity.is_some());
    if overlay.cost(wanted, there).0 != 0 || !found.tree.subtree(there).iter().any(known) {
        return None;
    }
    let mut comparison =
        Comparison { pairs: vec![None; planned.tree.len()], differences: Vec::new() };
    overlay.take(Some(wanted), Some(there), &mut comparison);
    let pairs = comparison.pairs.into_iter().enumerate();
    Some(pairs.filter_map(|(node, there)| there.map(|there| (node, there))).collect())
}

impl Overlay<'_> {
    fn unlike(&self, wanted: usize, there: usize) -> Option<Unlike> {
        unlike(self.planned.nodes.get(wanted)?, self.found.nodes.get(there)?)
    }

    /// The cost of two ends of a cable, with all behind them.
    fn both(&mut self, wanted: Option<usize>, there: Option<usize>) -> u32 {
        match (wanted, there) {
            (None, None) => 0,
            (Some(wanted), None) => alone(self.planned.tree, wanted),
            (None, Some(there)) => alone(self.found.tree, there),
            (Some(wanted), Some(there)) => self.cost(wanted, there).0,
        }
    }

    fn cost(&mut self, wanted: usize, there: usize) -> (u32, NodeMatch) {
        if let Some(known) = self.known.get(&(wanted, there)) {
            return *known;
        }
        let apart = alone(self.planned.tree, wanted) + alone(self.found.tree, there);
        let mut best = self.same(wanted, there);
        // What hangs on the MainDevice itself is what the line begins with, whatever follows.
        let is_first = self.planned.tree.parent(wanted).is_none();
        if apart < best.0 && !is_first {
            best = (apart, NodeMatch::Apart);
        }
        // As long as nothing is wrong but names, nothing better is to be found.
        if best.0 >= ALONE && self.may_shift(wanted, there) {
            for port in Port::ALL {
                if let Some(child) = self.planned.tree.child(wanted, port) {
                    let rest = self.rest(true, wanted, port);
                    if ALONE + rest < best.0 {
                        let cost = ALONE + rest + self.cost(child, there).0;
                        if cost < best.0 {
                            best = (cost, NodeMatch::Skip(port));
                        }
                    }
                }
                if let Some(child) = self.found.tree.child(there, port) {
                    let rest = self.rest(false, there, port);
                    if ALONE + rest < best.0 {
                        let cost = ALONE + rest + self.cost(wanted, child).0;
                        if cost < best.0 {
                            best = (cost, NodeMatch::Insert(port));
                        }
                    }
                }
            }
        }
        self.known.insert((wanted, there), best);
        best
    }

    /// Keeps the search close to the diagonal: many steps up or down are no shift any more.
    fn may_shift(&self, wanted: usize, there: usize) -> bool {
        self.planned.tree.depth(wanted).abs_diff(self.found.tree.depth(there)) <= SHIFT
    }

    /// What the other branches of a node cost when it is left out.
    fn rest(&self, of_planned: bool, node: usize, but: Port) -> u32 {
        let tree = if of_planned { self.planned.tree } else { self.found.tree };
        let others = tree.children(node).filter(|(port, _)| *port != but);
        others.map(|(_, child)| alone(tree, child)).sum()
    }

    /// The cost when both are the same device, with the best way to pair what hangs on them.
    fn same(&mut self, wanted: usize, there: usize) -> (u32, NodeMatch) {
        let own = match self.unlike(wanted, there) {
            None => 0,
            Some(what) if is_other_kind(what) => OTHER_KIND,
            Some(_) => OTHER_ONE,
        };
        let (entry, found_entry) = (self.planned.tree.entry(wanted), self.found.tree.entry(there));
        let mut straight = Port::ALL;
        let mut turned = 0;
        if entry != found_entry {
            // The cable of one port sits in the other one.
            straight.swap(entry.index(), found_entry.index());
            turned = REPLUGGED;
        }
        let mut best = (self.pairing(wanted, there, straight), NodeMatch::Same(straight));
        if best.0 >= REPLUGGED {
            for (one, other) in [(1, 2), (1, 3), (2, 3), (0, 1), (0, 2), (0, 3)] {
                let mut ports = straight;
                ports.swap(one, other);
                let cost = REPLUGGED + self.pairing(wanted, there, ports);
                if cost < best.0 {
                    best = (cost, NodeMatch::Same(ports));
                }
            }
        }
        (own + turned + best.0, best.1)
    }

    fn pairing(&mut self, wanted: usize, there: usize, ports: [Port; 4]) -> u32 {
        let pairs = Port::ALL.into_iter().zip(ports);
        let pairs = pairs.map(|(port, at)| {
            (self.planned.tree.child(wanted, port), self.found.tree.child(there, at))
        });
        let pairs: Vec<_> = pairs.collect();
        pairs.into_iter().map(|(wanted, there)| self.both(wanted, there)).sum()
    }

    /// Walks the cheapest way and notes what differs.
    fn take(&mut self, wanted: Option<usize>, there: Option<usize>, into: &mut Comparison) {
        // A list of what is still to be walked, since lines are long.
        let mut open = vec![(wanted, there)];
        while let Some((wanted, there)) = open.pop() {
            match (wanted, there) {
                (None, None) => {}
                (Some(wanted), None) => self.missing(wanted, None, into),
                (None, Some(there)) => self.extra(there, None, into),
                (Some(wanted), Some(there)) => match self.cost(wanted, there).1 {
                    NodeMatch::Apart => {
                        self.missing(wanted, None, into);
                        self.extra(there, None, into);
                    }
                    NodeMatch::Skip(port) => {
                        self.missing(wanted, Some(port), into);
                        open.push((self.planned.tree.child(wanted, port), Some(there)));
                    }
                    NodeMatch::Insert(port) => {
                        self.extra(there, Some(port), into);
                        open.push((Some(wanted), self.found.tree.child(there, port)));
                    }
                    NodeMatch::Same(ports) => {
                        self.pair(wanted, there, ports, into);
                        for (port, at) in Port::ALL.into_iter().zip(ports) {
                            open.push((
                                self.planned.tree.child(wanted, port),
                                self.found.tree.child(there, at),
                            ));
                        }
                    }
                },
            }
        }
    }

    fn pair(&self, wanted: usize, there: usize, ports: [Port; 4], into: &mut Comparison) {
        if let Some(pair) = into.pairs.get_mut(wanted) {
            *pair = Some(there);
        }
        if let Some(what) = self.unlike(wanted, there) {
            into.differences.push(Difference::Wrong { planned: wanted, found: there, what });
        }
        let (planned, found) = (self.planned.tree, self.found.tree);
        let (wanted_entry, entry) = (planned.entry(wanted), found.entry(there));
        if wanted_entry != entry {
            let wanted_port = wanted_entry;
            let (planned, found) = (wanted, there);
            into.differences.push(Difference::Reversed {
                planned,
                found,
                entry,
                wanted: wanted_port,
            });
        }
        for (port, at) in Port::ALL.into_iter().zip(ports) {
            let is_turned = wanted_entry != entry && (port == entry || at == entry);
            if port == at || is_turned {
                continue;
            }
            if let (Some(child), Some(found_child)) =
                (planned.child(wanted, port), found.child(there, at))
            {
                into.differences.push(Difference::Moved {
                    planned: child,
                    found: found_child,
                    wanted: planned.upstream(child),
                    on: found.upstream(found_child),
                });
            }
        }
    }

    fn missing(&self, wanted: usize, but: Option<Port>, into: &mut Comparison) {
        let all = branch(self.planned.tree, wanted, but);
        into.differences.push(Difference::Missing { planned: wanted, all });
    }

    fn extra(&self, there: usize, but: Option<Port>, into: &mut Comparison) {
        let all = branch(self.found.tree, there, but);
        let on = self.found.tree.upstream(there);
        into.differences.push(Difference::Extra { found: there, all, on });
    }
}

/// A node with all behind it, but for what hangs on one of its ports.
fn branch(tree: &Tree, node: usize, but: Option<Port>) -> Vec<usize> {
    let kept = but.map_or(&[][..], |port| tree.behind(node, port));
    tree.subtree(node).iter().copied().filter(|node| !kept.contains(node)).collect()
}

/// What a branch costs that the other side has not.
fn alone(tree: &Tree, node: usize) -> u32 {
    ALONE + (WITH * (tree.subtree(node).len() as u32 - 1)).min(MOST_WITH)
}
