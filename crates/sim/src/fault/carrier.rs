//! Carriers of faults: which part of a plant goes away with a fault when it is exchanged or set right.

use linesman_config::fault::FaultName::{self, *};

/// Part of a plant that a fault sits in.
///
/// It follows from what the kind does to the segment, and is used to try repairs: a fault is gone when its carrier was
/// exchanged, and acts on when anything else was.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum FaultCarrier {
    /// The cable or contact of its link, with its plugs and all that is looped into it.
    Cable,
    /// Something outside that disturbs its link.
    NoiseSource,
    /// The device or card whose port sends in its direction.
    Sender,
    /// The device or card whose port receives in its direction.
    Receiver,
    /// Its device: hardware, firmware, quartz.
    Device,
    /// Supply of its devices, with its wiring and its fuse.
    Supply,
    /// Settings of its device, in the project or in itself.
    Settings,
    /// The wiring at its place: what stands there, and at which port.
    Wiring,
    /// The network card of the computer.
    Card,
    /// The computer: its load, its driver, its settings.
    Computer,
    /// Somebody else who sends on the line.
    OtherSender,
}

impl FaultCarrier {
    /// Of a fault of the catalogue.
    #[must_use]
    pub const fn of(fault: FaultName) -> Self {
        match fault {
            // The contact is in the plug; a link of one pair only is a cable with a broken pair; an early link comes
            // from a switch or converter in between.
            LinkOpen | LinkFlapping | RingOpen | CableDegraded | FalseLink | EarlyLink => {
                Self::Cable
            }
            EmcNoise => Self::NoiseSource,
            TransmitterDamaged => Self::Sender,
            ReceiverDamaged => Self::Receiver,
            DeviceInternal | FirmwareFault | MailboxError | MailboxSlow | MailboxStuck
            | EoeFault | Emergency | ClockDrift | ReferenceClockLost => Self::Device,
            DeviceOff | SupplyOff | BrownOut | EbusOverload => Self::Supply,
            InitRefused | ConfigMismatch | WatchdogStarved | CycleTooFast | SyncLost => {
                Self::Settings
            }
            DeviceMissing | DeviceWrong | DeviceExtra | DevicesSwapped | TwinsSwapped
            | PortsSwapped | DuplicateAddress | MainDeviceWrongPort => Self::Wiring,
            NicDamaged => Self::Card,
            HostDrops | HostJitter | LateFrames | OneSidedRecording => Self::Computer,
            SecondMainDevice | ForeignFrames => Self::OtherSender,
        }
    }
}
