//! The switch: learns, passes on, floods, and buffers.

use std::collections::VecDeque;
use std::sync::Arc;

use linesman_proto::ethernet::MacAddress;
use linesman_proto::time::{Instant, Span};

use super::flood::FloodLimit;
use super::mac_table::MacTable;
use super::{LONGEST_FRAME, SHORTEST_FRAME};

/// Sizes of a switch (EOE-02, EOE-04).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SwitchLimits {
    /// Ports for SubDevices; this computer has one of its own beside them.
    pub ports: usize,
    /// Hardware addresses that are known at once.
    pub macs: usize,
    /// Frames that wait at a port; what comes then is dropped.
    pub frames: usize,
    /// Frames to all, or to addresses that nobody knows, that one port may send in a second.
    pub flooded_per_second: u32,
    /// An address that sends nothing is forgotten after so long.
    pub ageing: Span,
}

impl Default for SwitchLimits {
    fn default() -> Self {
        Self { ports: 64, macs: 256, frames: 64, flooded_per_second: 200, ageing: Span::s(300) }
    }
}

/// Counts of one port.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct SwitchCounts {
    /// Frames that came in by it.
    pub received: u64,
    /// Frames that left by it.
    pub sent: u64,
    /// Frames that should have left by it and found its buffer full.
    pub dropped_full: u64,
    /// Frames to all that came in by it beyond the limit.
    pub dropped_flood: u64,
    /// Frames that came in by it with a length or a sender's address that no Ethernet frame has.
    pub malformed: u64,
    /// Frames that came in by it from addresses that found no room in the table. They were passed on.
    pub not_learned: u64,
    /// The most frames that waited at once.
    pub most_waiting: u64,
}

/// A port, counted from 0, which is this computer.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct SwitchPort(usize);

impl SwitchPort {
    /// This computer.
    pub const HOST: Self = Self(0);

    /// Its number, from 0.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0
    }
}

#[derive(Clone, Debug)]
struct SwitchPortState {
    waiting: VecDeque<Arc<[u8]>>,
    flood: FloodLimit,
    counts: SwitchCounts,
}

/// A virtual Ethernet switch.
#[derive(Clone, Debug)]
pub struct VirtualSwitch {
    limits: SwitchLimits,
    ports: Vec<SwitchPortState>,
    table: MacTable,
}

/// Addresses of protocols that end at the next switch (IEEE 802.1D, 7.12.6): 01:80:C2:00:00:00 to 0F.
const LINK_LOCAL: [u8; 5] = [0x01, 0x80, 0xC2, 0x00, 0x00];

impl VirtualSwitch {
    /// A switch of these sizes, with the port of this computer.
    #[must_use]
    pub fn new(limits: SwitchLimits) -> Self {
        let table = MacTable::new(limits.macs, limits.ageing);
        let mut switch = Self { limits, ports: Vec::new(), table };
        switch.push();
        switch
    }

    /// One more port for a SubDevice; `None` when all are taken.
    pub fn add_port(&mut self) -> Option<SwitchPort> {
        (self.ports.len() <= self.limits.ports).then(|| self.push())
    }

    fn push(&mut self) -> SwitchPort {
        let flood = FloodLimit::new(self.limits.flooded_per_second, Instant::ZERO);
        let state =
            SwitchPortState { waiting: VecDeque::new(), flood, counts: SwitchCounts::default() };
        self.ports.push(state);
        SwitchPort(self.ports.len() - 1)
    }

    /// Takes a frame that came in by a port: it waits at the ports that it leaves by.
    pub fn handle_frame(&mut self, now: Instant, from: SwitchPort, frame: Vec<u8>) {
        let Some(state) = self.ports.get_mut(from.0) else { return };
        state.counts.received += 1;
        let addresses = frame.split_first_chunk::<6>().and_then(|(to, rest)| {
            let (source, _) = rest.split_first_chunk::<6>()?;
            Some((MacAddress(*to), MacAddress(*source)))
        });
        let fits = (SHORTEST_FRAME..=LONGEST_FRAME).contains(&frame.len());
        let Some((to, source)) =
            addresses.filter(|(_, source)| fits && !is_group(*source) && source.0 != [0; 6])
        else {
            state.counts.malformed += 1;
            return;
        };
        if !self.table.learn(now, source, from.0) {
            state.counts.not_learned += 1;
        }
        if to.0[..5] == LINK_LOCAL && to.0[5] <= 0x0F {
            return;
        }
        let known = if is_group(to) { None } else { self.table.port_of(now, to) };
        match known {
            // Whoever it is for has had it already.
            Some(port) if port == from.0 => {}
            Some(port) => self.queue(port, frame.into()),
            None if !state.flood.admit(now) => state.counts.dropped_flood += 1,
            None => {
                let frame: Arc<[u8]> = frame.into();
                for port in (0..self.ports.len()).filter(|port| *port != from.0) {
                    self.queue(port, Arc::clone(&frame));
                }
            }
        }
    }

    fn queue(&mut self, port: usize, frame: Arc<[u8]>) {
        let most = self.limits.frames;
        let Some(state) = self.ports.get_mut(port) else { return };
        if state.waiting.len() >= most {
            state.counts.dropped_full += 1;
            return;
        }
        state.waiting.push_back(frame);
        state.counts.most_waiting = state.counts.most_waiting.max(state.waiting.len() as u64);
    }

    /// The next frame that leaves by a port.
    pub fn poll_transmit(&mut self, port: SwitchPort) -> Option<Arc<[u8]>> {
        let state = self.ports.get_mut(port.0)?;
        let frame = state.waiting.pop_front()?;
        state.counts.sent += 1;
        Some(frame)
    }

    /// Counts of a port.
    #[must_use]
    pub fn counts(&self, port: SwitchPort) -> SwitchCounts {
        self.ports.get(port.0).map(|state| state.counts).unwrap_or_default()
    }

    /// How many hardware addresses are known.
    #[must_use]
    pub fn known_addresses(&self, now: Instant) -> usize {
        self.table.len(now)
    }

    /// Its sizes.
    #[must_use]
    pub const fn limits(&self) -> SwitchLimits {
        self.limits
    }
}

/// True for an address of a group, or of all.
const fn is_group(address: MacAddress) -> bool {
    address.0[0] & 1 != 0
}
