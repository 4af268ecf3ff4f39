//! Ends and links, and the way through one controller.
//!
//! A link joins two ends: ports of controllers, or cards of the MainDevice. Inside a controller the
//! frame goes round in the port order of [`port`](crate::port) and skips closed ports; the
//! processing unit sits between port A and the port after it. So the port a frame came in at decides
//! which other ports it meets before the processing unit and which after. That rule is here;
//! everything else about a frame's way follows from it.
//! Reference: S1 chapter 3 (frame processing order).

use std::fmt;

use crate::address::Path;
use crate::port::Port;

/// One end of a link. `N` names the controller: an index into a [`Tree`](super::Tree) unless said.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum End<N = usize> {
    /// A card of the MainDevice.
    MainDevice(Path),
    /// A port of a controller.
    Controller(N, Port),
}

impl<N> End<N> {
    /// The controller at this end, `None` for the MainDevice.
    #[must_use]
    pub fn node(self) -> Option<N> {
        match self {
            Self::MainDevice(_) => None,
            Self::Controller(node, _) => Some(node),
        }
    }

    /// The same end with the controller named in another way, such as by its identity.
    #[must_use]
    pub fn map<M>(self, name: impl FnOnce(N) -> M) -> End<M> {
        match self {
            Self::MainDevice(path) => End::MainDevice(path),
            Self::Controller(node, port) => End::Controller(name(node), port),
        }
    }
}

impl<N: fmt::Display> fmt::Display for End<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MainDevice(path) => write!(f, "MainDevice.{path}"),
            Self::Controller(node, port) => write!(f, "{node}.{port}"),
        }
    }
}

/// A cable or E-bus contact between two ends.
///
/// Upstream is the end nearer card A; in a ring it is so in the intact ring, and stays so when the
/// ring breaks. The link that closes a ring has [`End::MainDevice`] with [`Path::B`] downstream.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Link<N = usize> {
    /// The end nearer the MainDevice.
    pub upstream: End<N>,
    /// The end further from the MainDevice.
    pub downstream: End<N>,
}

impl<N> Link<N> {
    /// The same link with its controllers named in another way.
    #[must_use]
    pub fn map<M>(self, mut name: impl FnMut(N) -> M) -> Link<M> {
        Link { upstream: self.upstream.map(&mut name), downstream: self.downstream.map(&mut name) }
    }
}

impl<N: fmt::Display> fmt::Display for Link<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.upstream, self.downstream)
    }
}

/// The other three ports in the order in which a frame that came in at `entry` meets them.
#[must_use]
pub const fn ports_after(entry: Port) -> [Port; 3] {
    let first = entry.next();
    let second = first.next();
    [first, second, second.next()]
}

/// How many of [`ports_after`] `entry` lie before the processing unit.
///
/// None for the IN port. For another entry all ports up to and with port A: the unit is met only
/// when the frame comes back in through port A, or passes its closed loop.
#[must_use]
pub const fn ports_before_unit(entry: Port) -> usize {
    match entry {
        Port::A => 0,
        Port::C => 1,
        Port::B => 2,
        Port::D => 3,
    }
}

/// Whether the way inside a controller from reception at `from` to sending at `to` leads through
/// the processing unit. A frame that goes back out where it came in has gone all the way round.
#[must_use]
pub const fn passes_unit(from: Port, to: Port) -> bool {
    let mut at = from;
    loop {
        if matches!(at, Port::A) {
            return true;
        }
        at = at.next();
        if at.index() == to.index() {
            return false;
        }
    }
}

/// Up to three ports of a controller, in frame order.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Ports {
    ports: [Port; 3],
    len: usize,
}

impl Ports {
    pub(super) const EMPTY: Self = Self { ports: [Port::A; 3], len: 0 };

    pub(super) fn as_slice(&self) -> &[Port] {
        &self.ports[..self.len]
    }

    fn push(&mut self, port: Port) {
        self.ports[self.len] = port;
        self.len += 1;
    }
}

/// The ports that a frame entered at `entry` meets, split at the processing unit: those behind
/// which controllers are processed before this one, and those behind which they come after it.
pub(super) fn split_at_unit(entry: Port, is_open: impl Fn(Port) -> bool) -> (Ports, Ports) {
    let (mut before, mut after) = (Ports::EMPTY, Ports::EMPTY);
    for (index, port) in ports_after(entry).into_iter().enumerate() {
        if is_open(port) {
            let side = if index < ports_before_unit(entry) { &mut before } else { &mut after };
            side.push(port);
        }
    }
    (before, after)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Port::{A, B, C, D};

    // proves: ESC-02, ESC-09 partial, JCT-09 partial, JCT-10 partial
    #[test]
    fn the_entry_decides_what_lies_before_the_processing_unit() {
        // Each row: entry, open ports, met before the unit, met after it.
        type Row = (Port, &'static [Port], &'static [Port], &'static [Port]);
        let table: [Row; 12] = [
            (A, &[A], &[], &[]),
            (A, &[A, D], &[], &[D]),             // EL terminal
            (A, &[A, B], &[], &[B]),             // two-port box
            (A, &[A, B, C], &[], &[B, C]),       // EK1100: E-bus, then second socket
            (A, &[A, B, C, D], &[], &[D, B, C]), // EK1122, CU1124
            (B, &[B], &[], &[]),
            (B, &[A, B], &[A], &[]),
            (B, &[B, C, D], &[C], &[D]),
            (B, &[A, B, C, D], &[C, A], &[D]),
            (C, &[B, C], &[], &[B]), // EK1100, MainDevice in the second socket
            (C, &[A, B, C], &[A], &[B]),
            (D, &[A, B, C, D], &[B, C, A], &[]),
        ];
        for (entry, open, before, after) in table {
            let split = split_at_unit(entry, |port| open.contains(&port));
            assert_eq!(split.0.as_slice(), before, "before, entry {entry}, open {open:?}");
            assert_eq!(split.1.as_slice(), after, "after, entry {entry}, open {open:?}");
        }
    }

    // proves: ESC-07 partial
    #[test]
    fn one_round_through_a_controller_passes_the_unit_once() {
        for entry in Port::ALL {
            assert!(passes_unit(entry, entry), "turned back at {entry}");
            for open in 0..8u8 {
                let others = ports_after(entry).into_iter().enumerate();
                let mut stops = vec![entry];
                stops.extend(others.filter(|(i, _)| open & (1 << i) != 0).map(|(_, port)| port));
                stops.push(entry);
                let passes = stops.windows(2).filter(|way| passes_unit(way[0], way[1])).count();
                assert_eq!(passes, 1, "{stops:?}");
            }
        }
    }

    #[test]
    fn links_are_written_as_in_segment_files() {
        let link = Link { upstream: End::Controller(5, C), downstream: End::Controller(13, A) };
        assert_eq!(link.map(|node| node + 1).to_string(), "6.C-14.A");
        let ring: Link =
            Link { upstream: End::Controller(0, B), downstream: End::MainDevice(Path::B) };
        assert_eq!(ring.to_string(), "0.B-MainDevice.B");
        assert_eq!(ring.downstream.node(), None);
    }
}
