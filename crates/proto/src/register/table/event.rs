//! Events: what a controller reports to the MainDevice in the frames and to the SubDevice's
//! processor by interrupt: 0x0200 to 0x0223.
//!
//! Reference: S2 2.8. The typed views are [`EcatEvents`](crate::register::EcatEvents) and
//! [`AlEvents`](crate::register::AlEvents). A well-known dissector numbers the SyncManager bits of
//! 0x0210 as 8 to 15; the data sheet says 4 to 11.

use crate::register::entry::{Access, Field, Register, flag, register};
use Access::{Read, ReadWrite};

/// The bits of ECAT event request and mask.
const ECAT_EVENTS: &[Field] = &[
    flag(0, "DC latch", "A latch input changed."),
    flag(2, "DL status", "DL status changed: somewhere a link came or went."),
    flag(3, "AL status", "AL status changed."),
    flag(4, "SyncManager 0", "SyncManager 0 has an event."),
    flag(5, "SyncManager 1", "SyncManager 1 has an event."),
    flag(6, "SyncManager 2", "SyncManager 2 has an event."),
    flag(7, "SyncManager 3", "SyncManager 3 has an event."),
    flag(8, "SyncManager 4", "SyncManager 4 has an event."),
    flag(9, "SyncManager 5", "SyncManager 5 has an event."),
    flag(10, "SyncManager 6", "SyncManager 6 has an event."),
    flag(11, "SyncManager 7", "SyncManager 7 has an event."),
];

/// The bits of AL event request and masks.
const AL_EVENTS: &[Field] = &[
    flag(0, "AL control", "The MainDevice wrote AL control."),
    flag(1, "DC latch", "A latch input changed."),
    flag(2, "SYNC0", "SYNC0 is active."),
    flag(3, "SYNC1", "SYNC1 is active."),
    flag(4, "SyncManager activation", "A SyncManager was switched on or off."),
    flag(5, "EEPROM emulation", "An SII command waits for the processor."),
    flag(6, "process data watchdog", "The process data watchdog expired."),
    flag(8, "SyncManager 0", "SyncManager 0 has an event."),
    flag(9, "SyncManager 1", "SyncManager 1 has an event."),
    flag(10, "SyncManager 2", "SyncManager 2 has an event."),
    flag(11, "SyncManager 3", "SyncManager 3 has an event."),
    flag(12, "SyncManager 4", "SyncManager 4 has an event."),
    flag(13, "SyncManager 5", "SyncManager 5 has an event."),
    flag(14, "SyncManager 6", "SyncManager 6 has an event."),
    flag(15, "SyncManager 7", "SyncManager 7 has an event."),
    flag(16, "SyncManager 8", "SyncManager 8 has an event."),
    flag(17, "SyncManager 9", "SyncManager 9 has an event."),
    flag(18, "SyncManager 10", "SyncManager 10 has an event."),
    flag(19, "SyncManager 11", "SyncManager 11 has an event."),
    flag(20, "SyncManager 12", "SyncManager 12 has an event."),
    flag(21, "SyncManager 13", "SyncManager 13 has an event."),
    flag(22, "SyncManager 14", "SyncManager 14 has an event."),
    flag(23, "SyncManager 15", "SyncManager 15 has an event."),
    flag(24, "SYNC2", "SYNC2 is active."),
    flag(25, "SYNC3", "SYNC3 is active."),
];

registers! {
    EVENTS: "Interrupts";

    /// Which events of 0x0210 this controller ORs into the event field of passing datagrams.
    ECAT_EVENT_MASK = register("ECAT event mask", 0x0200, 2, ReadWrite, Read, "S2 2.8.1")
        .reset(0)
        .fields(ECAT_EVENTS);

    /// Which events of 0x0220 raise the interrupt of the SubDevice's processor.
    AL_EVENT_MASK = register("PDI0 AL event mask", 0x0204, 4, Read, ReadWrite, "S2 2.8.2")
        .reset(0x00FF_FF0F)
        .fields(AL_EVENTS);

    /// Which events of 0x0220 raise the interrupt of the second process data interface.
    PDI1_AL_EVENT_MASK = register("PDI1 AL event mask", 0x020A, 4, Read, ReadWrite, "S2 2.8.3")
        .reset(0x00FF_FF0F)
        .only("ET1150; IP core since 4.0.0")
        .fields(AL_EVENTS);

    /// What happened that a MainDevice may want to know. Each bit goes away by reading its source,
    /// not by reading this register: DL status clears bit 2, AL status bit 3, the latch times bit
    /// 0.
    ECAT_EVENT_REQUEST = register("ECAT event request", 0x0210, 2, Read, Read, "S2 2.8.4")
        .reset(0)
        .fields(ECAT_EVENTS);

    /// What happened that the SubDevice's processor has to serve. A bit that stays set points at a
    /// processor that does not get round to it.
    AL_EVENT_REQUEST = register("AL event request", 0x0220, 4, Read, Read, "S2 2.8.5")
        .reset(0)
        .fields(AL_EVENTS);
}
