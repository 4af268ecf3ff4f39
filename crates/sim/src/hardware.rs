//! Hardware of one type of controller: data, so that types differ in tables and not in code.
//!
//! References: S2 chapter 2 (identity, features), S1 chapter 3 (error counting), `docs/` for the
//! delays that were measured on real devices.

use linesman_proto::port::PortMap;
use linesman_proto::time::Span;

/// What a port is wired to electrically.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum PortKind {
    /// The controller has no such port.
    #[default]
    Absent,
    /// The terminal bus: LVDS contacts between neighbours.
    Ebus,
    /// 100BASE-TX or -FX through a PHY.
    Mii,
}

/// How a type of controller counts errors.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CountingProfile {
    /// Has the forwarded-error counters 0x0308..0x030B: a frame that an earlier controller marked
    /// is counted there. Without them it is counted as an invalid frame again.
    pub forwarded: bool,
    /// Makes a symbol error anew when it forwards a bad frame: the next receiver's physical-layer
    /// counter moves with its frame counter (programmable-logic types).
    pub remakes_symbol_errors: bool,
    /// Counts on ports whose loop is closed, too.
    pub counts_when_closed: bool,
    /// Counts a frame whose start delimiter was destroyed.
    pub counts_missing_start: bool,
}

/// Times of a type of controller and its PHYs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Timing {
    /// From one port's receiver to the next port's transmitter, past the processing unit.
    pub forward: Span,
    /// The same through the processing unit.
    pub process: Span,
    /// Receiver and transmitter of an E-bus port together, for one crossing.
    pub ebus_crossing: Span,
    /// Receiving and transmitting PHY together, for one crossing.
    pub mii_crossing: Span,
    /// From the loss of the signal to the closed loop, on an E-bus port.
    pub ebus_loss_detection: Span,
    /// The same on an MII port with fast link signal.
    pub mii_loss_detection: Span,
    /// From the signal to the open loop on an E-bus port.
    pub ebus_link_up: Span,
    /// The same on an MII port: auto-negotiation.
    pub mii_link_up: Span,
}

/// A type of controller.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Hardware {
    /// Register 0x0000.
    pub controller_type: u8,
    /// Register 0x0001.
    pub revision: u8,
    /// Register 0x0002.
    pub build: u16,
    /// Number of FMMUs, 0..=16.
    pub fmmus: u8,
    /// Number of SyncManagers, 0..=16.
    pub sync_managers: u8,
    /// Process-data RAM from 0x1000 up, in KiB.
    pub ram_kib: u8,
    /// Register 0x0008.
    pub features: u16,
    /// What its ports are.
    pub ports: PortMap<PortKind>,
    /// How it counts.
    pub counting: CountingProfile,
    /// How long it takes.
    pub timing: Timing,
}
