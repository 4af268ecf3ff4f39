//! Propagation delays from receive times.
//!
//! One broadcast write to 0x0900 makes every controller latch the time at which that frame was
//! received at each of its ports, each by its own clock. Only differences at one controller are of
//! use: how long the frame was away behind a port. From that and how long it was inside the tree
//! behind, the delay of the cable between follows, if it is the same in both directions.
//! Reference: S1 chapter 9 (propagation delay measurement); the rule reproduces eleven values
//! measured on two real lines.

use super::tree::Tree;
use super::wiring::{End, passes_unit};
use crate::address::Path;
use crate::port::{Port, PortMap};
use crate::time::{DcTime32, Span};

/// The longest delay between two neighbouring clocks that is believed: far more than 100 m of cable
/// (0.5 µs) and any media converter take.
pub const MAX_HOP: Span = Span::ms(1);

/// The delay of one controller that has a clock.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Delay {
    /// From the reception at the nearest controller with a clock above, at the port from which the
    /// frame was forwarded, to the reception at this one's entry. `None` if no clock is above.
    pub hop: Option<Span>,
    /// From the moment the frame reaches the reference clock's processing unit to the moment it
    /// reaches this one's: what register 0x0928 wants.
    ///
    /// Unless the controller is reversed that is the reception at its entry. For reversed ones it
    /// follows from the definition of 0x0918 (S2) and has not been compared with hardware.
    pub from_reference: Span,
}

/// Why receive times give no delays. Controllers are indices of the tree.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
pub enum DelayError {
    /// In a closed ring no frame returns to the ports it left by, and where a branch comes behind the port that leads on, that of
    /// the other card tells nothing either.
    #[error("the ring is closed, so the frame does not come back: measure with card B unplugged")]
    RingClosed,
    /// A controller has receive times at some open ports and not at others.
    #[error("controller {node}: no receive time at its open port {port}; read 0x0900 again")]
    MissingTime {
        /// The controller.
        node: usize,
        /// The open port without a time.
        port: Port,
    },
    /// The receive times of a controller do not grow in frame order.
    #[error(
        "controller {node}: receive time of port {port} is not later than that of the port before \
         it in frame order; latch again, and check at which port frames come in"
    )]
    OutOfOrder {
        /// The controller.
        node: usize,
        /// The port whose time is not later.
        port: Port,
    },
    /// A controller without a clock forks the line: the time a frame spends in one branch cannot be
    /// told from the time in the other.
    #[error("controller {node}: the line forks at {fork} above it, which has no receive times")]
    ForkWithoutClock {
        /// The controller whose delay cannot be found.
        node: usize,
        /// Where the line forks.
        fork: usize,
    },
    /// The delay between two neighbours is out of bounds.
    #[error(
        "controller {node}: {hop_ns} ns from the clock above, expected 0 to {} ns; latch again",
        MAX_HOP.as_nanos()
    )]
    Implausible {
        /// The controller further from the MainDevice.
        node: usize,
        /// What the receive times say.
        hop_ns: i64,
    },
}

/// The delays of a line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Delays {
    reference: Option<usize>,
    by_node: Vec<Option<Delay>>,
}

impl Delays {
    /// Delays of the line, or half of a broken ring, on `card`, from the receive times of each
    /// controller of `tree`, latched by one frame. A controller of which no open port has a time
    /// has no clock; it counts as part of the cable.
    ///
    /// `difference` is how much longer a frame takes through a controller if it passes the
    /// processing unit: 20 ns for the ET1100, zero if not known.
    ///
    /// The reference is the first controller with a clock that processes the frame.
    ///
    /// # Errors
    /// [`DelayError`], which names the controller whose times cannot be right.
    pub fn measure(
        tree: &Tree,
        card: Path,
        received: &[PortMap<Option<DcTime32>>],
        difference: Span,
    ) -> Result<Self, DelayError> {
        if tree.closes_at().is_some() {
            return Err(DelayError::RingClosed);
        }
        Self::of_times(tree, card, received, difference)
    }

    /// Delays of a whole ring, from receive times that the two copies of one frame latched: that of card A came in at the
    /// entry of each controller of the ring, that of card B, which goes round the other way, at the port that leads on.
    /// So the frame of card A is away for as long as the one of card B came later than it would have come back,
    /// which may be less than nothing, and is the same for all: it cancels out.
    ///
    /// # Errors
    /// As [`Delays::measure`]; [`DelayError::RingClosed`] where a branch comes behind the port that leads on, for no frame of card A
    /// gets there.
    pub fn measure_whole_ring(
        tree: &Tree,
        received: &[PortMap<Option<DcTime32>>],
        difference: Span,
    ) -> Result<Self, DelayError> {
        let ends_with_ring = |node: &usize| {
            tree.open_ports(*node).last().is_some_and(|last| leads_on(tree, *node, last))
        };
        if !tree.ring_nodes().iter().all(ends_with_ring) {
            return Err(DelayError::RingClosed);
        }
        Self::of_times(tree, Path::A, received, difference)
    }

    fn of_times(
        tree: &Tree,
        card: Path,
        received: &[PortMap<Option<DcTime32>>],
        difference: Span,
    ) -> Result<Self, DelayError> {
        let reached = tree.first(card).map_or(&[][..], |first| tree.subtree(first));
        let mut clocks: Vec<Option<Clock>> = vec![None; tree.len()];
        let mut above = vec![Above::default(); tree.len()];
        let mut hops: Vec<Option<Span>> = vec![None; tree.len()];
        let mut is_first = true;
        for &node in reached {
            above[node] = Above::of(tree, node, &clocks, &above);
            let Some(mut clock) = Clock::of(tree, node, received.get(node))? else { continue };
            let Above { clock: parent, fork } = above[node];
            if let (Some(fork), false) = (fork, parent.is_none() && is_first) {
                return Err(DelayError::ForkWithoutClock { node, fork });
            }
            is_first = false;
            if let Some((from, port)) = parent.and_then(|(at, port)| Some((clocks[at]?, port))) {
                let hop = hop(node, &clock, &from, port, difference)?;
                clock.at_entry = from.at_entry + from.since_entry[from.before[port]] + hop;
                hops[node] = Some(Span::ns(hop.unsigned_abs()));
            }
            clocks[node] = Some(clock);
        }
        let at_unit = |node: usize| clocks[node].map(|clock| clock.at_entry + clock.to_unit);
        let with_clock = reached.iter().copied().filter(|&node| clocks[node].is_some());
        let reference = with_clock.min_by_key(|&node| tree.position(node));
        let zero = reference.and_then(at_unit).unwrap_or(0);
        let by_node = (0..tree.len()).map(|node| {
            let from_reference = Span::ns((at_unit(node)? - zero).max(0).unsigned_abs());
            Some(Delay { hop: hops[node], from_reference })
        });
        Ok(Self { reference, by_node: by_node.collect() })
    }

    /// The reference clock; `None` if no controller has a clock.
    #[must_use]
    pub fn reference(&self) -> Option<usize> {
        self.reference
    }

    /// The delay of controller `node`; `None` if it has no clock.
    #[must_use]
    pub fn of(&self, node: usize) -> Option<Delay> {
        self.by_node.get(node).copied().flatten()
    }
}

/// Receive times of one controller, as ns since the reception at its entry.
#[derive(Clone, Copy)]
struct Clock {
    entry: Port,
    /// The last open port in frame order.
    last: Port,
    /// For each open port but the entry, the open port before it in frame order.
    before: PortMap<Port>,
    since_entry: PortMap<i64>,
    /// When the frame reaches the processing unit, on the same scale.
    to_unit: i64,
    /// When the frame reaches the entry, in ns since it reached that of the first clock.
    at_entry: i64,
}

impl Clock {
    /// Reads and checks the times of `node`; `Ok(None)` if it has none.
    fn of(
        tree: &Tree,
        node: usize,
        received: Option<&PortMap<Option<DcTime32>>>,
    ) -> Result<Option<Self>, DelayError> {
        let Some(received) = received else { return Ok(None) };
        if tree.open_ports(node).all(|port| received[port].is_none()) {
            return Ok(None);
        }
        let time_of = |port| received[port].ok_or(DelayError::MissingTime { node, port });
        let entry = tree.entry(node);
        let mut clock = Self {
            entry,
            last: entry,
            before: PortMap([entry; 4]),
            since_entry: PortMap::default(),
            to_unit: 0,
            at_entry: 0,
        };
        let mut last_time = time_of(entry)?;
        for port in tree.open_ports(node).skip(1) {
            let time = time_of(port)?;
            let gap = i64::from(time.delta(last_time));
            if gap <= 0 && !leads_on(tree, node, port) {
                return Err(DelayError::OutOfOrder { node, port });
            }
            clock.before[port] = clock.last;
            clock.since_entry[port] = clock.since_entry[clock.last] + gap;
            if passes_unit(clock.last, port) {
                clock.to_unit = clock.since_entry[clock.last];
            }
            (clock.last, last_time) = (port, time);
        }
        if passes_unit(clock.last, entry) {
            clock.to_unit = clock.since_entry[clock.last];
        }
        Ok(Some(clock))
    }
}

/// True if a port of a controller of a ring leads to the next one of it, or to card B.
fn leads_on(tree: &Tree, node: usize, port: Port) -> bool {
    tree.link_at(End::Controller(node, port))
        .is_some_and(|link| tree.is_on_ring(link) && port != tree.entry(node))
}

/// What lies between a controller and the MainDevice: the nearest clock, with the port that leads
/// here, and the first fork without a clock on the way to it.
#[derive(Clone, Copy, Default)]
struct Above {
    clock: Option<(usize, Port)>,
    fork: Option<usize>,
}

impl Above {
    fn of(tree: &Tree, node: usize, clocks: &[Option<Clock>], above: &[Self]) -> Self {
        let Some(End::Controller(parent, port)) = tree.upstream(node) else {
            return Self::default();
        };
        if clocks[parent].is_some() {
            return Self { clock: Some((parent, port)), fork: None };
        }
        let forks = tree.children(parent).nth(1).is_some();
        Self { clock: above[parent].clock, fork: above[parent].fork.or(forks.then_some(parent)) }
    }
}

/// The delay from reception at the clock `from`, before it sends out of `port`, to reception at the
/// entry of `node` with the clock `to`, in ns.
///
/// The frame is away from the one above for: forwarding there, the cable, its stay in the tree
/// below, forwarding out of that, the cable. Halving what is left without the stay is exact if both
/// forwardings take equally long; one that leads through a processing unit takes longer by the
/// difference.
fn hop(
    node: usize,
    to: &Clock,
    from: &Clock,
    port: Port,
    difference: Span,
) -> Result<i64, DelayError> {
    let difference_ns = signed_ns(difference);
    let before = from.before[port];
    let away = from.since_entry[port] - from.since_entry[before];
    let stay = to.since_entry[to.last];
    let out = if passes_unit(before, port) { difference_ns } else { 0 };
    let back = if passes_unit(to.last, to.entry) { difference_ns } else { 0 };
    let hop_ns = (away - stay + out - back) / 2;
    if hop_ns.abs() > signed_ns(MAX_HOP) {
        return Err(DelayError::Implausible { node, hop_ns });
    }
    // Slightly below zero is the granularity of the clocks: 10 ns on E-bus, 40 ns on MII.
    Ok(hop_ns.max(0))
}

/// The span as a signed number, held far from the ends of its range.
fn signed_ns(span: Span) -> i64 {
    i64::try_from(span.as_nanos()).unwrap_or(i64::MAX).min(i64::MAX / 4)
}

#[cfg(test)]
mod tests;
