//! Causes of a deficit of the working counter, a row for each thing that is seen of the SubDevices meanwhile.

use linesman_config::fault::FaultName::{
    self, BrownOut, ConfigMismatch, DeviceOff, FirmwareFault, LinkFlapping, LinkOpen, SupplyOff,
    WatchdogStarved,
};

use crate::model::Trouble;

/// Signs seen of the SubDevices that may be the cause.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum DeficitSymptom {
    /// Again and again for a moment: a contact that opens, and nothing that hangs.
    AgainAndAgain,
    /// All behind a link: a cable, or the supply of a device, takes shares for good.
    BehindLink,
    /// Nobody knows whose shares are missing, and a link has changed meanwhile.
    LinkChanged,
    /// Nobody knows whose shares are missing, and they still are.
    Nobody,
    /// One of several, and it came and went by itself: nothing that hangs, and nothing that was set up wrongly.
    Passing,
    /// The first of them does not answer.
    Absent,
    /// The first of them reports an error.
    Error,
    /// The first of them has left its state by itself.
    Fall,
    /// Nothing but the deficit.
    DeficitAlone,
}

impl DeficitSymptom {
    /// The row of a trouble that the first of them has.
    pub(super) const fn of_trouble(trouble: &Trouble) -> Self {
        match trouble {
            Trouble::Absent(_) => Self::Absent,
            Trouble::Error(_) => Self::Error,
            Trouble::Fall(_) => Self::Fall,
        }
    }

    /// The causes of the row with how sure each is, 0 to 1, the most likely first.
    pub(super) const fn causes(self) -> [(FaultName, f64); 3] {
        match self {
            Self::AgainAndAgain => [(LinkFlapping, 0.4), (LinkOpen, 0.2), (BrownOut, 0.1)],
            Self::BehindLink => [(LinkOpen, 0.5), (DeviceOff, 0.2), (SupplyOff, 0.1)],
            Self::LinkChanged => [(LinkOpen, 0.4), (DeviceOff, 0.25), (BrownOut, 0.15)],
            Self::Nobody => [(LinkOpen, 0.3), (DeviceOff, 0.2), (FirmwareFault, 0.15)],
            Self::Passing => [(LinkOpen, 0.35), (FirmwareFault, 0.25), (BrownOut, 0.1)],
            Self::Absent => [(DeviceOff, 0.4), (LinkOpen, 0.35), (BrownOut, 0.1)],
            Self::Error => [(FirmwareFault, 0.5), (ConfigMismatch, 0.2), (WatchdogStarved, 0.1)],
            Self::Fall => [(BrownOut, 0.5), (FirmwareFault, 0.2), (DeviceOff, 0.1)],
            Self::DeficitAlone => [(FirmwareFault, 0.4), (DeviceOff, 0.2), (ConfigMismatch, 0.2)],
        }
    }
}
