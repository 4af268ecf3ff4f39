//! The controllers that devices are made with.
//!
//! References: data sheets of ET1100 and ET1200 and of the IP core for programmable logic (numbers
//! of FMMUs and SyncManagers, RAM, features at 0x0008). Delays are those from which the walk makes the
//! receive times that were measured on two real lines: 145 to 155 ns from terminal to terminal, 485 to
//! 540 ns over a short cable (a test has both lines).

use linesman_proto::port::PortMap;
use linesman_proto::time::Span;

use crate::hardware::{CountingProfile, Hardware, PortKind, Timing};

/// A controller without its ports.
#[derive(Debug)]
pub(in crate::device) struct Chip {
    controller_type: u8,
    revision: u8,
    build: u16,
    fmmus: u8,
    sync_managers: u8,
    ram_kib: u8,
    features: u16,
    counting: CountingProfile,
    timing: Timing,
}

/// Distributed clocks of 64 bits, low jitter and enhanced link detection, separate forwarded errors.
const FULL: u16 = 0x00FC;
/// The activation register of the SYNC unit has its enhanced bits.
const ENHANCED_SYNC: u16 = 0x0100;
/// The same without anything that is about E-bus.
const WITHOUT_EBUS: u16 = 0x00CC;

const TIMING: Timing = Timing {
    forward: Span::ns(125),
    process: Span::ns(145),
    ebus_crossing: Span::ns(10),
    mii_crossing: Span::ns(350),
    ebus_loss_detection: Span::us(2),
    mii_loss_detection: Span::us(15),
    ebus_link_up: Span::us(500),
    mii_link_up: Span::ms(1_500),
};

const COUNTING: CountingProfile = CountingProfile {
    forwarded: true,
    remakes_symbol_errors: false,
    counts_when_closed: false,
    counts_missing_start: true,
};

/// The large one: up to four ports, used in couplers, junctions and terminals with a processor.
pub(in crate::device) const ET1100: Chip = Chip {
    controller_type: 0x11,
    revision: 0,
    build: 2,
    fmmus: 8,
    sync_managers: 8,
    ram_kib: 8,
    features: FULL,
    counting: COUNTING,
    timing: TIMING,
};

/// The large one with Fast Hot Connect: both ends of a cable have fixed link parameters, so that a
/// link is there within a few milliseconds instead of one to three seconds (facts, hot connect).
pub(super) const ET1100_FAST: Chip =
    Chip { timing: Timing { mii_link_up: Span::ms(5), ..TIMING }, ..ET1100 };

/// The small one: two ports and a third, for simple terminals.
pub(in crate::device) const ET1200: Chip = Chip {
    controller_type: 0x12,
    // Revision and features are those that recordings of real terminals show.
    revision: 1,
    build: 1,
    fmmus: 3,
    sync_managers: 4,
    ram_kib: 1,
    features: FULL | ENHANCED_SYNC,
    counting: COUNTING,
    timing: TIMING,
};

/// Programmable logic with the IP core: it makes symbol errors anew when it forwards a bad frame.
pub(in crate::device) const IP_CORE: Chip = Chip {
    controller_type: 0x04,
    revision: 3,
    build: 0x0300,
    fmmus: 8,
    sync_managers: 8,
    ram_kib: 8,
    features: WITHOUT_EBUS,
    counting: CountingProfile { remakes_symbol_errors: true, ..COUNTING },
    timing: Timing { forward: Span::ns(160), process: Span::ns(180), ..TIMING },
};

/// The first generation: four FMMUs and SyncManagers, and no counters of forwarded errors.
pub(in crate::device) const ESC20: Chip = Chip {
    controller_type: 0x02,
    revision: 1,
    build: 0,
    fmmus: 4,
    sync_managers: 4,
    ram_kib: 4,
    features: 0x0004,
    counting: CountingProfile { forwarded: false, ..COUNTING },
    timing: Timing { forward: Span::ns(150), process: Span::ns(170), ..TIMING },
};

/// The same with clocks of 64 bits. Terminals whose SII switches no clock unit on, and that use them
/// all the same, must have one like it: its units are always on.
pub(in crate::device) const ESC20_64: Chip = Chip { features: 0x000C, ..ESC20 };
/// A controller with two ports and a processor interface, from another maker: three FMMUs, four
/// SyncManagers, distributed clocks of 64 bits.
const LAN9252: Chip = Chip {
    controller_type: 0xC0,
    revision: 2,
    build: 0,
    fmmus: 3,
    sync_managers: 4,
    ram_kib: 4,
    features: WITHOUT_EBUS,
    counting: COUNTING,
    timing: TIMING,
};

/// The controllers that devices are made with, with these ports: to find out which of them answers
/// as a device was seen to answer.
#[must_use]
pub fn controllers(ports: PortMap<PortKind>) -> Vec<Hardware> {
    [&ET1100, &ET1200, &IP_CORE, &ESC20, &LAN9252].map(|chip| chip.with_ports(ports)).into()
}

impl Chip {
    /// Whether its cables have Fast Hot Connect: they fit each other only.
    pub(super) const fn fast_hot_connect(&self) -> bool {
        self.timing.mii_link_up.as_nanos() < Span::ms(500).as_nanos()
    }

    /// The controller with these ports.
    pub(in crate::device) fn with_ports(&self, ports: PortMap<PortKind>) -> Hardware {
        Hardware {
            controller_type: self.controller_type,
            revision: self.revision,
            build: self.build,
            fmmus: self.fmmus,
            sync_managers: self.sync_managers,
            ram_kib: self.ram_kib,
            features: self.features,
            ports,
            counting: self.counting,
            timing: self.timing,
        }
    }
}
