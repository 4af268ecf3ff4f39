//! Ports: links come and go, loops open and close, counters count.
//!
//! Read first: S1 chapter 3 (loops) and 14 (error counters); S2 2.4 and 2.9.

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{self as r, DlControl, DlStatus, ErrorCounter, Features};
use linesman_proto::time::{Instant, Span};

use super::core::Core;
use super::loops::Loops;
use super::memory::Rights;
use super::port_event::{CountKind, PortEvent, QueuedEvent};
use crate::event_queue::EventQueue;
use crate::frame::WireFrame;
use crate::hardware::{Hardware, PortKind};

/// How long loop modes hold that were set for temporary use ("approximately one second", S2 2.4.1).
const TEMPORARY_LOOPS: Span = Span::s(1);

/// Ports: how their loops stand, and what is to happen to them.
#[derive(Clone, Debug)]
pub(super) struct ControllerPorts {
    pub(super) loops: Loops,
    /// What happens at the ports, told by the wire or by frames that end.
    pub(super) queue: EventQueue<QueuedEvent>,
    /// When written loop modes take effect: at the end of the frame that wrote them.
    pub(super) change_at: Option<Instant>,
    /// When temporary loop modes end, and the byte of DL control that returns.
    pub(super) returns: Option<(Instant, u8)>,
    /// The last loss of a link that was reported for each port.
    link_lost_at: PortMap<Option<Instant>>,
}

impl ControllerPorts {
    /// No links, modes as after a reset.
    pub(super) fn new(hardware: &Hardware) -> Self {
        Self {
            loops: Loops::new(hardware),
            queue: EventQueue::default(),
            change_at: None,
            returns: None,
            link_lost_at: PortMap::default(),
        }
    }

    /// Modes as after a reset. Links are as they are, and what happens to them happens: they belong to the wires.
    pub(super) fn restart(&mut self) {
        self.loops.reset();
        (self.change_at, self.returns) = (None, None);
    }

    /// All loops are closed.
    pub(super) fn power_off(&mut self, hardware: &Hardware) {
        self.loops = Loops::new(hardware);
        (self.change_at, self.returns) = (None, None);
    }
}

impl Core {
    pub(super) fn happens(&mut self, event: QueuedEvent, when: Instant) {
        match event {
            QueuedEvent::Posted(PortEvent::Count { port, kind }) => self.count(port, kind, when),
            QueuedEvent::Posted(PortEvent::Link { port, up }) => {
                if !up {
                    self.count(port, CountKind::LostLink, when);
                    self.phys.link_lost(port);
                }
                self.ports.loops.apply(event);
                self.refresh_phy_status();
                self.refresh_dl_status();
            }
            QueuedEvent::GoodFrame(_) => {
                self.ports.loops.apply(event);
                self.refresh_dl_status();
            }
        }
    }

    /// Moves a counter, if the rules let it move.
    pub(super) fn count(&mut self, port: Port, kind: CountKind, when: Instant) {
        let counts = self.ports.loops.is_open(port) || self.hardware.counting.counts_when_closed;
        self.note_rx_error(port, kind, when);
        let (counter, counts) = match kind {
            CountKind::SymbolError => (ErrorCounter::PhysicalLayer(port), counts),
            CountKind::InvalidFrame => (ErrorCounter::InvalidFrame(port), counts),
            CountKind::ForwardedError => (ErrorCounter::Forwarded(port), counts),
            CountKind::ProcessingUnitError => (ErrorCounter::ProcessingUnit, true),
            CountKind::LostLink => {
                let again = self.ports.link_lost_at[port].replace(when) == Some(when);
                (ErrorCounter::LostLink(port), self.ports.loops.counts_lost_link(port) && !again)
            }
        };
        if counts {
            self.increment(counter.address());
        }
    }

    /// One more, up to 255. Counters that the controller does not have stay at 0.
    pub(super) fn increment(&mut self, address: RegisterAddress) {
        let address = usize::from(address.0);
        if self.rights.byte(address) & Rights::READ != 0 {
            let counter = &mut self.memory.bytes_mut()[address];
            *counter = counter.saturating_add(1);
        }
    }

    /// Gives a counter a value, if the controller has it.
    pub(super) fn set_counter(&mut self, address: RegisterAddress, value: u8) {
        let address = usize::from(address.0);
        if self.rights.byte(address) & Rights::READ != 0 {
            self.memory.bytes_mut()[address] = value;
        }
    }

    /// Written loop modes take effect.
    pub(super) fn change_loops(&mut self) {
        self.ports.change_at = None;
        self.ports.loops.rewrite(DlControl(self.memory.u32(&r::DL_CONTROL)));
        self.refresh_dl_status();
    }

    /// The loop byte of DL control was written, in a frame that ended at `end`; `before` is what it
    /// was.
    pub(super) fn loops_written(&mut self, before: DlControl, end: Instant) {
        let control = DlControl(self.memory.u32(&r::DL_CONTROL));
        self.ports.change_at = Some(end);
        self.ports.returns = match (control.temporary(), self.ports.returns) {
            (false, _) => None,
            (true, Some((_, byte))) => Some((end + TEMPORARY_LOOPS, byte)),
            (true, None) => Some((end + TEMPORARY_LOOPS, before.to_bytes()[1])),
        };
    }

    /// Temporary loop modes end: the former ones return.
    pub(super) fn return_loops(&mut self) {
        let Some((_, byte)) = self.ports.returns.take() else { return };
        let control = self.returned_loops(byte);
        self.memory.set_u32(&r::DL_CONTROL, control.0);
        self.change_loops();
    }

    /// DL control once its loop byte is `byte` again.
    fn returned_loops(&self, byte: u8) -> DlControl {
        let control = DlControl(self.memory.u32(&r::DL_CONTROL)).with_temporary(false);
        let [low, _, high, highest] = control.to_bytes();
        DlControl::from_bytes([low, byte, high, highest])
    }

    /// The loops as they will be at `when`, as far as is known now.
    pub(super) fn loops_at(&self, when: Instant) -> Loops {
        let mut loops = self.ports.loops;
        let written = DlControl(self.memory.u32(&r::DL_CONTROL));
        let mut rewrites = [
            self.ports.change_at.map(|at| (at, written)),
            self.ports.returns.map(|(at, byte)| (at, self.returned_loops(byte))),
        ]
        .into_iter()
        .flatten()
        .filter(|(at, _)| *at <= when)
        .peekable();
        for (at, event) in self.ports.queue.iter().take_while(|(at, _)| *at <= when) {
            while let Some((_, control)) = rewrites.next_if(|(rewrite, _)| *rewrite < at) {
                loops.rewrite(control);
            }
            loops.apply(*event);
        }
        for (_, control) in rewrites {
            loops.rewrite(control);
        }
        loops
    }

    /// Whether enhanced link detection is on for a port: wanted by the SII (0x0141, bit 1 for all
    /// ports, bits 4 to 7 for each) and there for its kind of port (0x0008, bits 5 and 6).
    pub(super) fn detects_links(&self, port: Port) -> bool {
        let wanted = self.memory.u8(&r::ESC_CONFIGURATION_A0);
        let features = Features(self.hardware.features);
        let there = match self.hardware.ports[port] {
            PortKind::Absent => false,
            PortKind::Ebus => features.enhanced_link_ebus(),
            PortKind::Mii => features.enhanced_link_mii(),
        };
        there && wanted & (1 << 1 | 1 << (4 + port.index())) != 0
    }

    /// DL status as it is now.
    pub(super) fn dl_status(&self) -> DlStatus {
        let detection = Port::ALL.into_iter().any(|port| self.detects_links(port));
        let base = DlStatus::default()
            .with_pdi(self.startup.loaded, self.watchdogs.pdi_ok)
            .with_enhanced_link_detection(detection);
        self.ports.loops.status(base)
    }

    /// Shows a change in DL status, and tells of it.
    pub(super) fn refresh_dl_status(&mut self) {
        let status = self.dl_status().0;
        if self.memory.u16(&r::DL_STATUS) != status {
            self.memory.set_u16(&r::DL_STATUS, status);
            self.raise_ecat_events(r::EcatEvents::DL_STATUS);
        }
    }

    /// The first bit of a frame comes in.
    pub(super) fn enters(&mut self, when: Instant, port: Port, frame: &WireFrame) {
        self.entries.entered[port] = (frame.number, when);
        if let Some(ends) = self.rx_reasons.frame_ends(port) {
            *ends = when + frame.duration();
        }
        self.latch_entry(port, frame, when);
        if self.ports.loops.waits_for_frame(port) && frame.damage.is_intact() {
            self.ports.queue.push(when + frame.duration(), QueuedEvent::GoodFrame(port));
        }
    }
}
