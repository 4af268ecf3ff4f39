//! Receive times: the local times at which the frame that wrote to 0x0900 came in at each port.
//!
//! Reference: S2 2.15.1; S1 9.1.2. The first generation and the ET1200 know the time of that frame
//! for the port it is processed from only; the other ports take the next frame that comes in, which
//! is the same one as long as nothing else is on the line. An ET1200 that is entered from behind
//! (0x0936 = 1) takes the frame before instead.
//!
//! Of the ports behind port A the data sheet says that they keep the time of a frame that contains such a write (S2
//! 2.15.1, 0x0904 to 0x090F), and not that this controller has to process it: the copy that card B of a whole ring sends
//! passes the other way round, and its times are kept as well.

use linesman_proto::address::StationAddress;
use linesman_proto::command::Command;
use linesman_proto::frame::FrameView;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register as r;
use linesman_proto::register::ControllerType;
use linesman_proto::time::Instant;

use crate::controller::core::{Core, FrameProgress};
use crate::frame::WireFrame;
use crate::hardware::PortKind;

/// Frames that came in at the ports, and whose times are kept.
#[derive(Clone, Debug)]
pub(in crate::controller) struct FrameEntries {
    /// The last frame whose first bit came in by each port, and when.
    pub(in crate::controller) entered: PortMap<(u64, Instant)>,
    /// The frame whose receive times are being latched.
    latched: Option<u64>,
    /// Ports that take the time of the next frame which comes in after an instant.
    pub(in crate::controller) waits: PortMap<Option<Instant>>,
}

impl Default for FrameEntries {
    fn default() -> Self {
        Self {
            entered: PortMap([(u64::MAX, Instant::ZERO); 4]),
            latched: None,
            waits: PortMap::default(),
        }
    }
}

impl FrameEntries {
    /// No frame's times are waited for any more.
    pub(in crate::controller) fn forget_latches(&mut self) {
        (self.latched, self.waits) = (None, PortMap::default());
    }
}

impl Core {
    /// The frame that just passed wrote to 0x0900: its receive times are kept, those of ports that
    /// it has not reached yet when it does.
    pub(in crate::controller) fn latch_receive_times(&mut self) {
        let FrameProgress { number, began, .. } = self.passing;
        let local = self.clock.taken(began);
        self.memory.set_u64(&r::RECEIVE_TIME_PROCESSING_UNIT, local);
        if self.latches_next_frame() {
            self.latch_next_frames(number, began);
            return;
        }
        self.entries.latched = Some(number);
        for port in Port::ALL {
            let (frame, when) = self.entries.entered[port];
            if frame == number && self.hardware.ports[port] != PortKind::Absent {
                self.latch_receive_time(port, when);
            }
        }
    }

    /// A frame comes in at a port: its time is kept if this is the one that is waited for.
    pub(in crate::controller) fn latch_entry(
        &mut self,
        port: Port,
        frame: &WireFrame,
        when: Instant,
    ) {
        if !self.ports.loops.is_open(port) {
            return;
        }
        let waited = self.entries.waits[port].is_some_and(|from| from < when);
        if waited {
            self.entries.waits[port] = None;
        }
        if waited || self.entries.latched == Some(frame.number) || self.latches_passing(port, frame)
        {
            self.latch_receive_time(port, when);
        }
    }

    /// True if a port keeps the time of a frame that this controller has not processed.
    fn latches_passing(&self, port: Port, frame: &WireFrame) -> bool {
        let may = port != Port::A && !self.latches_next_frame() && frame.damage.is_intact();
        may && {
            let station = StationAddress(self.memory.u16(&r::STATION_ADDRESS));
            asks_for_receive_times(&frame.bytes, station)
        }
    }

    /// Whether ports other than A take the next frame, whichever it is.
    fn latches_next_frame(&self) -> bool {
        let kind = ControllerType(self.hardware.controller_type);
        matches!(kind, ControllerType::ESC20 | ControllerType::ET1200)
    }

    fn latch_next_frames(&mut self, number: u64, began: Instant) {
        let reversed = ControllerType(self.hardware.controller_type) == ControllerType::ET1200
            && self.memory.u8(&r::RECEIVE_TIME_LATCH_MODE) & 1 != 0;
        for port in Port::ALL {
            if self.hardware.ports[port] == PortKind::Absent {
                continue;
            }
            let (frame, when) = self.entries.entered[port];
            if port == Port::A {
                if frame == number {
                    self.latch_receive_time(port, when);
                } else {
                    self.entries.waits[port] = Some(began);
                }
            } else if reversed {
                if frame != u64::MAX {
                    self.latch_receive_time(port, when);
                }
            } else if frame != u64::MAX && when > began {
                // One that was ahead of it comes back only now.
                self.latch_receive_time(port, when);
            } else {
                self.entries.waits[port] = Some(began);
            }
        }
    }

    fn latch_receive_time(&mut self, port: Port, when: Instant) {
        let local = self.clock.taken(when) as u32;
        let address = usize::from(r::RECEIVE_TIME.of_port(port).0);
        self.memory.put(address, &local.to_le_bytes());
    }
}

/// True if a frame writes to 0x0900 of the controller with this station address, by a command that latches.
fn asks_for_receive_times(bytes: &[u8], station: StationAddress) -> bool {
    let Ok(view) = FrameView::parse(bytes) else { return false };
    view.datagrams().map_while(Result::ok).any(|datagram| {
        let command = datagram.command();
        let is_meant = command == Some(Command::Bwr)
            || (command == Some(Command::Fpwr) && datagram.adp() == station.0);
        is_meant && datagram.ado() == r::RECEIVE_TIME.address && !datagram.data().is_empty()
    })
}
