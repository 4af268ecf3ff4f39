//! The fault catalogue: one name for what the segment breaks, what diagnosis says, what is scored.
//!
//! A name says the *cause*. Where it can be and how it shows is the business of `sim::fault` and of
//! the rules.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// What kind of trouble a fault or finding is; it decides who is called.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// Cables, contacts, supplies, devices.
    Hardware,
    /// Firmware and state machines of SubDevices.
    Software,
    /// What was planned is not what is there.
    Configuration,
    /// Clocks, jitter, deadlines.
    Timing,
    /// The computer that runs the MainDevice.
    Host,
}

/// Declares the catalogue: variant, name, class, and one sentence.
macro_rules! catalogue {
    ($($variant:ident $name:literal $class:ident $meaning:literal;)*) => {
        /// A cause of trouble on a network.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
        #[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
        pub enum FaultName {
            $(
                #[doc = $meaning]
                #[serde(rename = $name)]
                $variant,
            )*
        }

        impl FaultName {
            /// The whole catalogue.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The name in files and outputs.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }

            /// What kind of trouble it is.
            #[must_use]
            pub const fn class(self) -> Class {
                match self { $(Self::$variant => Class::$class),* }
            }

            /// What it is, in one sentence.
            #[must_use]
            pub const fn meaning(self) -> &'static str {
                match self { $(Self::$variant => $meaning),* }
            }
        }
    };
}

catalogue! {
    LinkOpen "link-open" Hardware
        "A cable or contact is interrupted: no signal crosses it in either direction.";
    LinkFlapping "link-flapping" Hardware
        "A contact opens and closes again and again.";
    CableDegraded "cable-degraded" Hardware
        "A cable, plug or contact is worn: symbol errors that come and go with movement and heat.";
    EmcNoise "emc-noise" Hardware
        "Outside interference couples into one or more cables in bursts.";
    FalseLink "false-link" Hardware
        "A port shows a link although nothing behind it answers; every frame sent there vanishes.";
    EarlyLink "early-link" Hardware
        "A device shows a link before it can forward frames; what is sent in between is lost.";
    PortsSwapped "ports-swapped" Hardware
        "IN and OUT of a SubDevice are swapped: the cable is plugged into the OUT port.";
    MainDeviceWrongPort "maindevice-wrong-port" Hardware
        "The MainDevice is plugged into a port of the first SubDevice that is not its IN port.";
    DeviceOff "device-off" Hardware
        "A SubDevice is without power or its controller is dead.";
    SupplyOff "supply-off" Hardware
        "A supply that several SubDevices share has failed: all of them are off.";
    BrownOut "brown-out" Hardware
        "A supply dipped: SubDevices started anew, with station address and counters cleared.";
    TransmitterDamaged "transmitter-damaged" Hardware
        "The output stage of a port is damaged: symbol errors at the neighbour.";
    ReceiverDamaged "receiver-damaged" Hardware
        "The input stage of a port is damaged: symbol errors at that port.";
    DeviceInternal "device-internal" Hardware
        "A SubDevice spoils frames inside, before they are coded: bad frames with clean symbols.";
    EbusOverload "ebus-overload" Hardware
        "The terminals of a coupler draw more current than it supplies.";
    DeviceMissing "device-missing" Configuration
        "A SubDevice that was planned is not there.";
    DeviceExtra "device-extra" Configuration
        "A SubDevice is there that was not planned.";
    DeviceWrong "device-wrong" Configuration
        "Another type or revision of SubDevice sits at a place than was planned.";
    DevicesSwapped "devices-swapped" Configuration
        "Two SubDevices of different type sit in each other's place.";
    TwinsSwapped "twins-swapped" Configuration
        "Two equal SubDevices sit in each other's place.";
    DuplicateAddress "duplicate-address" Configuration
        "Two SubDevices answer to the same station address or alias.";
    ConfigMismatch "config-mismatch" Configuration
        "Settings of a SubDevice do not fit what it is: process data, mailbox, modules.";
    InitRefused "init-refused" Software
        "A SubDevice refuses a change of state and gives a status code.";
    FirmwareFault "firmware-fault" Software
        "The firmware of a SubDevice hangs or misbehaves while its controller works.";
    WatchdogStarved "watchdog-starved" Software
        "Outputs did not come in time: the SubDevice's watchdog expired.";
    SyncLost "sync-lost" Timing
        "A SubDevice lost its synchronisation with the SYNC events or frames.";
    ClockDrift "clock-drift" Timing
        "The distributed clock of a SubDevice does not stay with the reference clock.";
    ReferenceClockLost "reference-clock-lost" Timing
        "The reference clock is gone: the clocks drift apart.";
    LateFrames "late-frames" Timing
        "Frames come later than the cycle allows.";
    CycleTooFast "cycle-too-fast" Timing
        "The cycle is shorter than a SubDevice can follow.";
    MailboxError "mailbox-error" Software
        "A SubDevice answers mailbox requests with errors.";
    MailboxSlow "mailbox-slow" Software
        "A SubDevice answers mailbox requests later than expected.";
    MailboxStuck "mailbox-stuck" Software
        "A SubDevice does not empty or fill its mailbox any more.";
    EoeFault "eoe-fault" Software
        "The EoE stack of a SubDevice loses, doubles or mixes up fragments of Ethernet frames, or has no buffer for them.";
    Emergency "emergency" Software
        "A SubDevice sent an emergency message.";
    RingOpen "ring-open" Hardware
        "The ring is open at one place: everything still runs, but the next break will not be survived.";
    SecondMainDevice "second-maindevice" Configuration
        "Another MainDevice sends on the same line.";
    ForeignFrames "foreign-frames" Configuration
        "Frames that are not EtherCAT travel on the line.";
    NicDamaged "nic-damaged" Host
        "The MainDevice's network card spoils or drops frames.";
    HostJitter "host-jitter" Host
        "The computer sends its frames unevenly.";
    HostDrops "host-drops" Host
        "The computer drops frames after they came back.";
    OneSidedRecording "one-sided-recording" Host
        "A recording shows frames in one direction only: what came back, or what went out, is missing.";
}

impl fmt::Display for FaultName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// No fault has this name.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("no fault is called `{given}`; the names are: {}", all_names())]
pub struct UnknownFault {
    /// What was given.
    pub given: String,
}

fn all_names() -> String {
    FaultName::ALL.iter().map(|fault| fault.name()).collect::<Vec<_>>().join(", ")
}

impl FromStr for FaultName {
    type Err = UnknownFault;

    fn from_str(given: &str) -> Result<Self, UnknownFault> {
        let found = Self::ALL.iter().copied().find(|fault| fault.name() == given);
        found.ok_or_else(|| UnknownFault { given: given.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_unique_and_reads_back() {
        for fault in FaultName::ALL {
            assert_eq!(fault.name().parse(), Ok(*fault));
            assert!(fault.name().chars().all(|c| c.is_ascii_lowercase() || c == '-'));
            assert!(fault.meaning().ends_with('.'), "{fault}");
        }
        let error = "link-opened".parse::<FaultName>().unwrap_err();
        assert!(error.to_string().contains("link-open, link-flapping"), "{error}");
    }
}
