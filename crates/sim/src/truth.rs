//! The truth log: what was injected, and every effect that it had.
//!
//! It is written by the physics, never read by them, and shown to nobody who diagnoses: it is what
//! a verdict is held against.

use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::time::Instant;

/// Which fault of the run: its index in the order of injection.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct FaultId(pub u32);

/// One end of a link, by stable identity.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum LinkEnd {
    /// A card of the MainDevice.
    MainDevice(Path),
    /// A port of a controller.
    Device(DeviceId, Port),
}

/// Where something happened.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Place {
    /// One direction of a link: from the first end to the second.
    Direction(LinkEnd, LinkEnd),
    /// A link, both directions; the first end is the one nearer the MainDevice.
    Link(LinkEnd, LinkEnd),
    /// A controller.
    Device(DeviceId),
    /// A card of the MainDevice.
    Host(Path),
}

/// What a cause made happen.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Effect {
    /// A symbol error outside of frames, counted by the receiver as physical-layer error.
    IdleSymbolError,
    /// A frame was spoiled on the wire or in a device.
    FrameSpoiled {
        /// Number of the frame in the segment.
        frame: u64,
    },
    /// A frame, or the rest of one, vanished.
    FrameLost {
        /// Number of the frame in the segment.
        frame: u64,
    },
    /// The signal on a link went away.
    SignalLost,
    /// The signal on a link came back.
    SignalBack,
    /// A controller lost its supply.
    PowerLost,
    /// A controller has its supply again and starts.
    PowerBack,
    /// A change of state was refused with this AL status code.
    StateRefused {
        /// The code in 0x0134.
        code: u16,
    },
    /// A counter was moved by something that is no fault: noise at power-on or plugging.
    PowerOnNoise,
    /// Another type of device than planned sits here.
    WrongDevice,
}

/// An entry of the log.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Entry {
    /// A fault begins to act.
    Begin {
        /// When.
        at: Instant,
        /// Which one.
        fault: FaultId,
        /// Its name.
        name: FaultName,
        /// Where it was put.
        place: Place,
    },
    /// A fault ends or is healed.
    End {
        /// When.
        at: Instant,
        /// Which one.
        fault: FaultId,
    },
    /// Something happened.
    Effect {
        /// When.
        at: Instant,
        /// The fault that caused it; `None` for what is no fault.
        fault: Option<FaultId>,
        /// Where.
        place: Place,
        /// What.
        effect: Effect,
    },
}
