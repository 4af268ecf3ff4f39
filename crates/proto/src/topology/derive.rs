//! The tree behind what was seen: from open ports in processing order to wiring.
//!
//! A scan or a capture knows the controllers in the order in which they process a frame, which
//! ports of each are open (DL status, 0x0110), and perhaps when a frame was received at each port
//! (0x0900). From that the wiring follows:
//!
//! * *Entered at port A* (the rule for every line that is plugged in right): all other open ports
//!   lead on, in frame order, to controllers that come later. Each controller hangs on the nearest
//!   earlier one that has a port left. This is exact, without receive times.
//! * *Entered elsewhere*: what hangs behind the ports up to and with A was processed earlier
//!   ([`ports_before_unit`](super::wiring::ports_before_unit)). The controller then takes finished
//!   trees that end right before it, and stands where the earliest of them stood. Which tree, of
//!   those that end there, is told by receive times alone: a frame is away behind a port for longer
//!   than it is inside the tree that hangs there, and for less than inside any tree around it.
//!   With receive times of all controllers this is exact, too.
//! * *Without receive times* the entry of a controller is not observable. Port A is taken if open;
//!   else the last open port in frame order, since then all else is processed later, as on a line
//!   that is plugged in right. Only where that leaves a controller without a place, and it has open
//!   ports enough, is it taken to have been entered elsewhere, above all that came before.
//!   [`EntryBasis`] says which of these holds for each controller, [`Doubt`] what else fits.
//!
//! Receive times of closed ports are never looked at: they hold leftovers of other memory.
//! Reference: S1 chapters 3 and 9; SOEM, KickCAT and ethercrab agree on the rule for port A.

mod error;

pub use error::TopologyError;

use super::tree::{Node, Tree};
use super::wiring::{End, Ports, ports_after, split_at_unit};
use crate::address::Path;
use crate::port::{Port, PortMap};
use crate::time::DcTime32;

/// What was read from one controller.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct SeenController {
    /// Ports with stable communication and open loop: DL status, register 0x0110.
    pub open: PortMap<bool>,
    /// Receive times, registers 0x0900 to 0x090F, all latched by the same frame; `None` for what
    /// was not read or cannot be, such as all of them where there are no distributed clocks.
    ///
    /// In a closed ring leave them out: the latching frame does not come back to these ports.
    pub received: PortMap<Option<DcTime32>>,
}

impl SeenController {
    /// A controller of which only the open ports are known.
    #[must_use]
    pub fn open_at(ports: &[Port]) -> Self {
        Self { open: PortMap::from_fn(|port| ports.contains(&port)), ..Self::default() }
    }
}

/// How the port was found at which frames come in to a controller.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum EntryBasis {
    /// No other port is open.
    OnlyPort,
    /// It has the earliest receive time.
    ReceiveTimes,
    /// No usable receive times; port A is open.
    PortAOpen,
    /// No usable receive times, port A is closed: the last open port in frame order was taken.
    LastInFrameOrder,
    /// No usable receive times; entered at port A it would have no place, elsewhere it has one.
    OnlyPlace,
    /// No port is open, which cannot be, since it answered: port A was taken.
    NoOpenPort,
}

/// Something that what was seen leaves open; the tree has one of the possible answers.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Doubt {
    /// The entry of this controller was taken by convention while others are possible.
    Entry {
        /// The controller.
        node: usize,
        /// The port that was taken.
        taken: Port,
    },
    /// A reversed controller may stand at several places of the line above the one it was given.
    Place {
        /// The controller.
        node: usize,
        /// Its port behind which another tree may hang.
        port: Port,
        /// The first controller of the tree that was put there, the largest possible.
        child: usize,
        /// How many trees fit.
        candidates: usize,
    },
    /// Its receive times do not grow in frame order, so they were left aside.
    ReceiveTimes {
        /// The controller.
        node: usize,
    },
}

/// A tree, and how far to trust it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Reconstruction {
    /// The line as far as it could be put together: controller `i` is the `i`-th that was seen.
    /// Those without a place are [`Tree::detached`]. With a single open port left over on card A,
    /// the ring is taken to close there ([`Tree::closes_at`]); whether frames do arrive at card B
    /// is for the caller to know.
    pub tree: Tree,
    /// For each controller, how its entry port was found.
    pub entry_basis: Vec<EntryBasis>,
    /// What else would fit, in order of controllers.
    pub doubts: Vec<Doubt>,
    /// What cannot be; empty for a consistent line.
    pub errors: Vec<TopologyError>,
}

/// The line that these controllers, in processing order, form on card A.
///
/// # Errors
/// The first inconsistency. For as much of the tree as there is, and for what else would fit, see
/// [`Reconstruction::of`].
pub fn derive(seen: &[SeenController]) -> Result<Tree, TopologyError> {
    let Reconstruction { tree, errors, .. } = Reconstruction::of(Path::A, seen);
    errors.first().map_or(Ok(tree), |error| Err(*error))
}

impl Reconstruction {
    /// The line that these controllers, in processing order, form on `card`, or as much of it as
    /// can be put together. Time and memory are linear in the number of controllers.
    #[must_use]
    pub fn of(card: Path, seen: &[SeenController]) -> Self {
        let mut forest = Forest::with_capacity(seen.len());
        for seen in seen {
            forest.add(seen);
        }
        forest.finish(card)
    }
}

/// A controller while trees are being put together.
struct Growing {
    open: PortMap<bool>,
    /// Receive times of open ports; `None` unless all are known and grow in frame order.
    times: Option<PortMap<DcTime32>>,
    entry: Port,
    parent: Option<(usize, Port)>,
    children: PortMap<Option<usize>>,
    /// Ports that lead to controllers processed later, in frame order, and how many are taken.
    after: Ports,
    taken: usize,
    /// The earliest position in its tree.
    earliest: usize,
}

impl Growing {
    fn is_complete(&self) -> bool {
        self.taken == self.after.as_slice().len()
    }

    /// Open ports in frame order from the entry.
    fn open_ports(&self) -> impl DoubleEndedIterator<Item = Port> + Clone {
        let open = self.open;
        std::iter::once(self.entry).chain(ports_after(self.entry)).filter(move |&port| open[port])
    }

    /// How long a frame is inside this tree, in ns, from its own clock; `None` without one.
    fn stay(&self) -> Option<i32> {
        let last = self.open_ports().next_back().unwrap_or(self.entry);
        if last == self.entry {
            return Some(0);
        }
        self.times.map(|times| times[last].delta(times[self.entry]))
    }

    /// How long a frame is away behind `port`, in ns.
    fn absence(&self, port: Port) -> Option<i32> {
        let before = self.open_ports().take_while(|&open| open != port).last()?;
        self.times.map(|times| times[port].delta(times[before]))
    }
}

/// Trees put together so far, from controllers in processing order.
struct Forest {
    nodes: Vec<Growing>,
    /// Controllers with a port to later ones left, the nearest last.
    growing: Vec<usize>,
    /// Controllers that hang on none.
    roots: Vec<usize>,
    entry_basis: Vec<EntryBasis>,
    doubts: Vec<Doubt>,
    errors: Vec<TopologyError>,
}

impl Forest {
    fn with_capacity(len: usize) -> Self {
        Self {
            nodes: Vec::with_capacity(len),
            growing: Vec::new(),
            roots: Vec::new(),
            entry_basis: Vec::with_capacity(len),
            doubts: Vec::new(),
            errors: Vec::new(),
        }
    }

    fn add(&mut self, seen: &SeenController) {
        let node = self.nodes.len();
        let (mut entry, times, mut basis) = self.entry_of(node, seen);
        let is_convention = matches!(basis, EntryBasis::PortAOpen | EntryBasis::LastInFrameOrder);
        if is_convention
            && self.growing.is_empty()
            && let Some(other) = entry_above(seen.open, self.roots.len())
        {
            (entry, basis) = (other, EntryBasis::OnlyPlace);
        }
        if basis == EntryBasis::LastInFrameOrder {
            self.doubts.push(Doubt::Entry { node, taken: entry });
        }
        let (before, after) = split_at_unit(entry, |port| seen.open[port]);
        self.entry_basis.push(basis);
        self.nodes.push(Growing {
            open: seen.open,
            times,
            entry,
            parent: None,
            children: PortMap::default(),
            after,
            taken: 0,
            earliest: node,
        });
        self.take_earlier_trees(node, before);
        self.hang_on_nearest(node);
    }

    /// The entry port of a controller, with its receive times if they are of use.
    fn entry_of(
        &mut self,
        node: usize,
        seen: &SeenController,
    ) -> (Port, Option<PortMap<DcTime32>>, EntryBasis) {
        let mut open = Port::FRAME_ORDER.into_iter().filter(|&port| seen.open[port]);
        let Some(first) = open.next() else {
            self.errors.push(TopologyError::NoOpenPort { node });
            return (Port::A, None, EntryBasis::NoOpenPort);
        };
        let Some(last) = open.next_back() else {
            return (first, None, EntryBasis::OnlyPort);
        };
        match entry_by_time(seen) {
            Timed::Entry(entry, times) => return (entry, times, EntryBasis::ReceiveTimes),
            Timed::Disordered => self.doubts.push(Doubt::ReceiveTimes { node }),
            Timed::Unknown => {}
        }
        if seen.open[Port::A] {
            (Port::A, None, EntryBasis::PortAOpen)
        } else {
            (last, None, EntryBasis::LastInFrameOrder)
        }
    }

    /// Gives `node` the trees processed right before it, for its ports that come before its unit.
    fn take_earlier_trees(&mut self, node: usize, before: Ports) {
        for &port in before.as_slice().iter().rev() {
            let absence = self.nodes[node].absence(port);
            let Some(found) = self.tree_before(self.nodes[node].earliest, absence) else {
                let entry = self.nodes[node].entry;
                self.errors.push(TopologyError::NothingBefore { node, entry, port });
                return;
            };
            let child = found.root;
            if found.candidates > 1 {
                let candidates = found.candidates;
                self.doubts.push(Doubt::Place { node, port, child, candidates });
            }
            self.release(child);
            self.nodes[child].parent = Some((node, port));
            self.nodes[node].children[port] = Some(child);
            self.nodes[node].earliest = self.nodes[child].earliest;
        }
    }

    /// The largest finished tree that ends right before position `end` and through which a frame
    /// passes within `absence`.
    ///
    /// Such trees lie within each other, and the time a frame is inside grows outwards. Climbing
    /// stops at the first that takes too long; those whose time is unknown are passed over and
    /// counted. All that is climbed but the last becomes part of the tree that is found, so the
    /// climbing of a whole line is linear.
    fn tree_before(&self, end: usize, absence: Option<i32>) -> Option<Found> {
        let mut root = end.checked_sub(1)?;
        if !self.nodes[root].is_complete() {
            return None;
        }
        let mut candidates = 1;
        while let Some((parent, _)) = self.nodes[root].parent {
            if !self.nodes[parent].is_complete() {
                break;
            }
            match (self.nodes[parent].stay(), absence) {
                (Some(stay), Some(absence)) if stay < absence => candidates = 1,
                (Some(_), Some(_)) => break,
                (None, _) | (_, None) => candidates += 1,
            }
            root = parent;
        }
        Some(Found { root, candidates })
    }

    /// Takes a tree off the port it hangs on, which may lead to a later controller again.
    fn release(&mut self, root: usize) {
        let Some((parent, port)) = self.nodes[root].parent.take() else {
            if let Some(at) = self.roots.iter().rposition(|&other| other == root) {
                self.roots.remove(at);
            }
            return;
        };
        self.nodes[parent].children[port] = None;
        self.nodes[parent].taken -= 1;
        if self.growing.last() != Some(&parent) {
            self.growing.push(parent);
        }
    }

    /// Hangs `node` on the next port of the nearest controller that has one left.
    fn hang_on_nearest(&mut self, node: usize) {
        if let Some(&parent) = self.growing.last() {
            let nearest = &mut self.nodes[parent];
            let port = nearest.after.as_slice()[nearest.taken];
            nearest.taken += 1;
            nearest.children[port] = Some(node);
            if nearest.is_complete() {
                self.growing.pop();
            }
            self.nodes[node].parent = Some((parent, port));
        } else {
            self.roots.push(node);
        }
        if !self.nodes[node].is_complete() {
            self.growing.push(node);
        }
    }

    fn finish(mut self, card: Path) -> Reconstruction {
        for &root in self.roots.iter().skip(1) {
            let node = self.nodes[root].earliest;
            let open = self.nodes[node].open.0.into_iter().filter(|open| *open).count();
            self.errors.push(TopologyError::NoPlace { node, open });
        }
        let closes_at = self.leftover(card);
        let nodes = self.nodes.iter().enumerate().map(|(index, node)| Node {
            on: match node.parent {
                Some((parent, port)) => Some(End::Controller(parent, port)),
                None if self.roots.first() == Some(&index) => Some(End::MainDevice(card)),
                None => None,
            },
            entry: node.entry,
            children: node.children,
        });
        let tree = Tree::assemble(nodes.collect(), closes_at);
        let Self { entry_basis, doubts, errors, .. } = self;
        Reconstruction { tree, entry_basis, doubts, errors }
    }

    /// The one open port that leads to no controller, if all else is consistent.
    fn leftover(&mut self, card: Path) -> Option<(usize, Port)> {
        let free =
            |node: &usize| self.nodes[*node].after.as_slice().len() - self.nodes[*node].taken;
        let count: usize = self.growing.iter().map(free).sum();
        let &node = self.growing.last()?;
        let nearest = &self.nodes[node];
        let port = nearest.after.as_slice()[nearest.taken];
        if count == 1 && card == Path::A && self.errors.is_empty() {
            return Some((node, port));
        }
        self.errors.push(TopologyError::NothingBehind { node, port, others: count - 1 });
        None
    }
}

/// A tree that fits behind a port.
struct Found {
    root: usize,
    /// How many trees fit: 1 means no doubt.
    candidates: usize,
}

/// What receive times say about the entry.
enum Timed {
    Entry(Port, Option<PortMap<DcTime32>>),
    Disordered,
    Unknown,
}

/// The open port with the earliest receive time, and all times if all open ports have one. Those that are known must grow
/// in frame order, as those of one frame do; a port without time is one that the frame did not come back to.
fn entry_by_time(seen: &SeenController) -> Timed {
    let known = |port: &Port| seen.open[*port].then_some(seen.received[*port]).flatten();
    let mut earliest: Option<(Port, DcTime32)> = None;
    for port in Port::ALL {
        let Some(time) = known(&port) else { continue };
        if earliest.is_none_or(|(_, earliest)| time.delta(earliest) < 0) {
            earliest = Some((port, time));
        }
    }
    let Some((entry, mut before)) = earliest else { return Timed::Unknown };
    for time in ports_after(entry).iter().filter_map(known) {
        if time.delta(before) <= 0 {
            return Timed::Disordered;
        }
        before = time;
    }
    let is_whole = Port::ALL.iter().all(|port| !seen.open[*port] || known(port).is_some());
    let times = PortMap::from_fn(|port| known(&port).unwrap_or_default());
    Timed::Entry(entry, is_whole.then_some(times))
}

/// The entry port with which a controller takes as many earlier trees as it can, at most `trees`
/// and at least one; `None` if it has too few open ports for that.
fn entry_above(open: PortMap<bool>, trees: usize) -> Option<Port> {
    let taken = |entry: Port| split_at_unit(entry, |port| open[port]).0.as_slice().len();
    Port::FRAME_ORDER
        .into_iter()
        .filter(|&entry| open[entry] && (1..=trees).contains(&taken(entry)))
        .max_by_key(|&entry| taken(entry))
}

#[cfg(test)]
mod tests;
