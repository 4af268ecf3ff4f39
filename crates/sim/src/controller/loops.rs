//! The loops of the ports: which are open, which are closed.
//!
//! Read first: S1 3.1 and figure 4 (loop control and loop state), 3.5 (circulating frames), 3.7
//! (port 0). DL control says how a loop follows its link, DL status shows how it stands.

use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{DlControl, DlStatus, LoopMode, PortState};

use super::port_event::{PortEvent, QueuedEvent};
use crate::hardware::{Hardware, PortKind};

/// All ports with links, modes and loops.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loops {
    present: PortMap<bool>,
    link: PortMap<bool>,
    mode: PortMap<LoopMode>,
    open: PortMap<bool>,
}

impl Loops {
    /// No links, modes as after a reset.
    pub(super) fn new(hardware: &Hardware) -> Self {
        let present = PortMap::from_fn(|port| hardware.ports[port] != PortKind::Absent);
        let mut loops = Self {
            present,
            link: PortMap::default(),
            mode: PortMap::default(),
            open: PortMap::default(),
        };
        loops.rewrite(DlControl::RESET);
        loops
    }

    /// Modes as after a reset; links are as they are.
    pub(super) fn reset(&mut self) {
        self.rewrite(DlControl::RESET);
    }

    /// Whether frames leave and enter here. When every loop is closed, port 0 is opened so that the
    /// controller can still be reached, whatever its loop says.
    pub(super) fn is_open(&self, port: Port) -> bool {
        self.open[port] || (port == Port::A && self.open.0 == [false; 4])
    }

    /// Whether a frame that passes port 0 here has come round the wrong way: the loop of port 0 is
    /// closed by itself, not by hand.
    pub(super) fn port_zero_closes_ring(&self) -> bool {
        let by_itself = match self.mode[Port::A] {
            LoopMode::Auto | LoopMode::AutoClose => true,
            LoopMode::Open | LoopMode::Closed => false,
        };
        by_itself && !self.is_open(Port::A)
    }

    /// Whether lost links of this port count now.
    pub(super) fn counts_lost_link(&self, port: Port) -> bool {
        let follows_link = match self.mode[port] {
            LoopMode::Auto | LoopMode::AutoClose => true,
            LoopMode::Open | LoopMode::Closed => false,
        };
        follows_link && self.open[port]
    }

    /// Whether a good frame at this port would open its loop.
    pub(super) fn waits_for_frame(&self, port: Port) -> bool {
        self.mode[port] == LoopMode::AutoClose && self.link[port] && !self.open[port]
    }

    /// The open ports, one bit each, port A lowest.
    pub(super) fn open_bits(&self) -> u8 {
        Port::ALL
            .into_iter()
            .fold(0, |bits, port| bits | u8::from(self.is_open(port)) << port.index())
    }

    /// Whether any port would open with a good frame.
    pub(super) fn waits_for_any_frame(&self) -> bool {
        Port::ALL.into_iter().any(|port| self.waits_for_frame(port))
    }

    /// The loop modes were written: ports in mode auto close get a new chance.
    pub(super) fn rewrite(&mut self, control: DlControl) {
        for port in Port::ALL.into_iter().filter(|port| self.present[*port]) {
            self.mode[port] = control.loop_mode(port);
            self.open[port] = match self.mode[port] {
                LoopMode::Auto | LoopMode::AutoClose => self.link[port],
                LoopMode::Open => true,
                LoopMode::Closed => false,
            };
        }
    }

    /// What happens at a port changes its loop.
    pub(super) fn apply(&mut self, event: QueuedEvent) {
        match event {
            QueuedEvent::Posted(PortEvent::Link { port, up }) => self.set_link(port, up),
            QueuedEvent::GoodFrame(port) => self.open[port] |= self.waits_for_frame(port),
            QueuedEvent::Posted(PortEvent::Count { .. }) => {}
        }
    }

    fn set_link(&mut self, port: Port, up: bool) {
        if !self.present[port] {
            return;
        }
        self.link[port] = up;
        match self.mode[port] {
            LoopMode::Auto => self.open[port] = up,
            LoopMode::AutoClose => self.open[port] &= up,
            LoopMode::Open | LoopMode::Closed => {}
        }
    }

    /// Where there is a link.
    pub(super) const fn links(&self) -> PortMap<bool> {
        self.link
    }

    /// DL status with the ports filled in: their true state, not that of port 0 as a way out.
    pub(super) fn status(&self, base: DlStatus) -> DlStatus {
        Port::ALL.into_iter().fold(base, |status, port| {
            let link = self.link[port];
            let closed = !self.open[port];
            status.with_port(port, PortState { link, closed, communication: link })
        })
    }
}
