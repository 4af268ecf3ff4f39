//! Planned against found: which SubDevice is which, and what differs, as one cable or one device at a time.
//!
//! Both sides are trees. They are laid upon each other from the MainDevice on, at the least cost: a
//! device of another kind, a device too few or too many with all behind it moving up or down, a
//! cable in the wrong port of a branch, a device that is plugged in the wrong way round. What is missing
//! at one place and found at another is told as one cable that was moved.
//!
//! Reference: S0 L1587-1625 (expected against detected topology).

mod overlay;

use std::collections::BTreeSet;

use linesman_proto::port::Port;
use linesman_proto::sii::Identity;
use linesman_proto::topology::{End, Tree};

use crate::identity::{Mismatch, RevisionRule, mismatch};

/// What is planned of a SubDevice, as far as it can be compared.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Wanted {
    /// Who it must be; `None` when the project does not say.
    pub identity: Option<Identity>,
    /// How the revision is compared.
    pub rule: RevisionRule,
    /// Its station alias, where the project gives one.
    pub alias: Option<u16>,
}

/// What was found of a SubDevice.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct There {
    /// Who it says it is; `None` when that is not known.
    pub identity: Option<Identity>,
    /// Its station alias; `None` when that is not known, 0 for none.
    pub alias: Option<u16>,
}

/// In what a SubDevice differs from the one planned at its place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Unlike {
    /// In its identity.
    Identity(Mismatch),
    /// In its station alias alone: a twin.
    Alias {
        /// As planned.
        planned: u16,
        /// As found.
        found: u16,
    },
}

/// One thing that is otherwise than planned. Numbers are indices of nodes, of the planned tree or of the
/// one found.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Difference {
    /// Planned, and not there.
    Missing {
        /// The first planned one that is not there.
        planned: usize,
        /// All of them: with what hangs on it, if that is not there either.
        all: Vec<usize>,
    },
    /// There, and not planned.
    Extra {
        /// The first one that was not planned.
        found: usize,
        /// All of them, with what hangs on it.
        all: Vec<usize>,
        /// Where it hangs.
        on: Option<End>,
    },
    /// Another device than planned.
    Wrong {
        /// Where it was planned.
        planned: usize,
        /// What is there.
        found: usize,
        /// In what it differs.
        what: Unlike,
    },
    /// Two devices sit in each other's place; both as planned nodes.
    Swapped {
        /// One of them.
        one: usize,
        /// The other one.
        other: usize,
        /// Whether they are of the same kind, told apart by serial number or alias alone.
        twins: bool,
    },
    /// It is plugged in the wrong way round: frames come in at another port than planned.
    Reversed {
        /// Who.
        planned: usize,
        /// The same one as found.
        found: usize,
        /// Where frames come in.
        entry: Port,
        /// Where they should come in.
        wanted: Port,
    },
    /// It hangs elsewhere than planned: one cable was moved, with all behind it.
    Moved {
        /// The first SubDevice behind that cable.
        planned: usize,
        /// The same one as found.
        found: usize,
        /// Where it should hang, in the planned tree.
        wanted: Option<End>,
        /// Where it hangs, in the tree that was found.
        on: Option<End>,
    },
}

/// What came of a comparison.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Comparison {
    /// For each planned node the one found in its place; `None` where none is.
    pub pairs: Vec<Option<usize>>,
    /// What differs, in the order of the planned tree; empty when all is as planned.
    pub differences: Vec<Difference>,
}

impl Comparison {
    /// The same without what hot connect groups may do: be absent, and hang elsewhere than planned. `may_go` says
    /// of which planned SubDevices that is true.
    #[must_use]
    pub fn without_groups(mut self, may_go: impl Fn(usize) -> bool) -> Self {
        self.differences.retain(|difference| match difference {
            Difference::Missing { all, .. } => !all.iter().all(|node| may_go(*node)),
            Difference::Moved { planned, .. } => !may_go(*planned),
            Difference::Extra { .. }
            | Difference::Wrong { .. }
            | Difference::Swapped { .. }
            | Difference::Reversed { .. } => true,
        });
        self
    }
}

/// One side of a comparison.
#[derive(Clone, Copy, Debug)]
pub struct Side<'a, T> {
    /// How the SubDevices are wired.
    pub tree: &'a Tree,
    /// The SubDevices by node.
    pub nodes: &'a [T],
}

/// Compares what was planned with what was found. SubDevices without a place in their tree are left out.
#[must_use]
pub fn compare(planned: Side<'_, Wanted>, found: Side<'_, There>) -> Comparison {
    let mut comparison = overlay::lay(planned, found);
    join_moved(&mut comparison, planned, found);
    join_swapped(&mut comparison, planned, found);
    comparison.differences.sort_by_key(|difference| place(difference, planned.tree, found.tree));
    comparison
}

/// In what a found device differs from a planned one; `None` when it fits. What is not known fits.
#[must_use]
pub fn unlike(wanted: &Wanted, there: &There) -> Option<Unlike> {
    if let (Some(planned), Some(found)) = (&wanted.identity, &there.identity)
        && let Some(what) = mismatch(planned, found, wanted.rule)
    {
        return Some(Unlike::Identity(what));
    }
    match (wanted.alias, there.alias) {
        (Some(planned), Some(found)) if planned != 0 && planned != found => {
            Some(Unlike::Alias { planned, found })
        }
        _ => None,
    }
}

/// Whether a device is of another kind, not just another one of the same kind.
const fn is_other_kind(what: Unlike) -> bool {
    match what {
        Unlike::Identity(Mismatch::Vendor | Mismatch::Product) => true,
        Unlike::Identity(Mismatch::Revision | Mismatch::Serial) | Unlike::Alias { .. } => false,
    }
}

/// What is missing at one place and too much at another, and the same, was moved.
fn join_moved(comparison: &mut Comparison, planned: Side<'_, Wanted>, found: Side<'_, There>) {
    let mut taken = BTreeSet::new();
    for at in 0..comparison.differences.len() {
        let Difference::Missing { planned: missing, all } = &comparison.differences[at] else {
            continue;
        };
        let (missing, missing_len) = (*missing, all.len());
        // Only a branch that is gone as a whole can be found as a whole elsewhere.
        if missing_len != planned.tree.subtree(missing).len() {
            continue;
        }
        let same = comparison.differences.iter().enumerate().find_map(|(other, difference)| {
            let Difference::Extra { found: extra, all, on } = difference else { return None };
            let is_whole = all.len() == found.tree.subtree(*extra).len();
            let fits = is_whole && all.len() == missing_len && !taken.contains(&other);
            let pairs = fits.then(|| overlay::same(planned, found, missing, *extra)).flatten()?;
            Some((other, *extra, *on, pairs))
        });
        let Some((other, extra, on, pairs)) = same else { continue };
        taken.insert(other);
        for (node, there) in pairs {
            comparison.pairs[node] = Some(there);
        }
        let wanted = planned.tree.upstream(missing);
        comparison.differences[at] =
            Difference::Moved { planned: missing, found: extra, wanted, on };
    }
    let mut index = 0;
    comparison.differences.retain(|_| {
        index += 1;
        !taken.contains(&(index - 1))
    });
}

/// Two that differ, and fit in each other's place, were swapped.
fn join_swapped(comparison: &mut Comparison, planned: Side<'_, Wanted>, found: Side<'_, There>) {
    let mut wrong: Vec<(usize, usize, Unlike)> = comparison
        .differences
        .iter()
        .filter_map(|difference| {
            let Difference::Wrong { planned, found, what } = difference else { return None };
            Some((*planned, *found, *what))
        })
        .collect();
    wrong.sort_by_key(|(node, ..)| planned.tree.position(*node));
    let mut joined = BTreeSet::new();
    for (at, (one, one_found, what)) in wrong.iter().enumerate() {
        if joined.contains(one) {
            continue;
        }
        let fits = |wanted: usize, there: usize| {
            planned.nodes.get(wanted).zip(found.nodes.get(there)).is_some_and(|(wanted, there)| {
                // A swap is told by what both say of themselves.
                there.identity.is_some() && unlike(wanted, there).is_none()
            })
        };
        let other = wrong[at + 1..].iter().find(|(other, other_found, _)| {
            !joined.contains(other) && fits(*one, *other_found) && fits(*other, *one_found)
        });
        let Some((other, ..)) = other else { continue };
        joined.extend([*one, *other]);
        let twins = !is_other_kind(*what);
        comparison.differences.push(Difference::Swapped { one: *one, other: *other, twins });
    }
    comparison.differences.retain(|difference| {
        !matches!(difference, Difference::Wrong { planned, .. } if joined.contains(planned))
    });
}

/// Where a difference comes in the planned tree; what was not planned comes where it hangs.
fn place(difference: &Difference, planned: &Tree, found: &Tree) -> (usize, usize) {
    let (node, tree) = match difference {
        Difference::Missing { planned: node, .. }
        | Difference::Wrong { planned: node, .. }
        | Difference::Swapped { one: node, .. }
        | Difference::Reversed { planned: node, .. }
        | Difference::Moved { planned: node, .. } => (*node, planned),
        Difference::Extra { found: node, .. } => (*node, found),
    };
    (tree.position(node).unwrap_or(usize::MAX), node)
}

#[cfg(test)]
mod tests;
