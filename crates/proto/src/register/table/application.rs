//! The application layer: requested state, actual state, status code, LEDs: 0x0120 to 0x0139.
//!
//! Reference: S2 2.5. The typed views are [`AlControl`](crate::register::AlControl) and
//! [`AlStatus`](crate::register::AlStatus); the states are in [`crate::state`].

use crate::register::al;
use crate::register::entry::{Access, Register, choice, flag, hex, register};
use Access::{Read, ReadWrite, ReadWriteIf};

const STATES: &[(u32, &str)] = &[(1, "INIT"), (2, "PREOP"), (3, "BOOT"), (4, "SAFEOP"), (8, "OP")];
const LED_CODES: &[(u32, &str)] = &[
    (0x0, "off"),
    (0x1, "flash 1x"),
    (0x2, "flash 2x"),
    (0x3, "flash 3x"),
    (0x4, "flash 4x"),
    (0x5, "flash 5x"),
    (0x6, "flash 6x"),
    (0x7, "flash 7x"),
    (0x8, "flash 8x"),
    (0x9, "flash 9x"),
    (0xA, "flash 10x"),
    (0xB, "flash 11x"),
    (0xC, "flash 12x"),
    (0xD, "blinking"),
    (0xE, "flickering"),
    (0xF, "on"),
];

registers! {
    APPLICATION: "Application layer";

    /// The state that the MainDevice asks for. It works like a mailbox: a new request is not taken
    /// before the SubDevice has read the last one. With device emulation (bit 0 of 0x0141) there is
    /// nobody to read it; the controller then copies it to AL status.
    AL_CONTROL = register("AL control", 0x0120, 2, ReadWriteIf, Read, "S2 2.5.1")
        .reset(1)
        .view(al::view_control)
        .fields(&[
            choice(3, 0, "requested state", "State to go to.", STATES),
            flag(4, "error acknowledge", "The MainDevice has seen the error in AL status."),
            flag(5, "identification request",
                "The SubDevice shall put its identification into the AL status code register."),
            flag(6, "warning acknowledge", "The MainDevice has seen the warning in AL status."),
        ]);

    /// The state that the SubDevice is in. With the error bit it is not the one asked for: the AL
    /// status code says why. In the data of a broadcast read the states of all are ORed together.
    AL_STATUS = register("AL status", 0x0130, 2, Read, ReadWriteIf, "S2 2.5.2")
        .reset(1)
        .read_effect("Clears bit 3 of the ECAT event request (0x0210).")
        .view(al::view_status)
        .fields(&[
            choice(3, 0, "state", "Actual state.", STATES),
            flag(4, "error", "A request was refused, or the SubDevice left its state on its own."),
            flag(5, "identification loaded",
                "The AL status code register holds the identification, not a code."),
            flag(6, "warning", "The AL status code register holds a warning."),
        ]);

    /// Why the SubDevice refused a state or left one. Read it whenever AL status is not what it
    /// should be.
    AL_STATUS_CODE = register("AL status code", 0x0134, 2, Read, ReadWrite, "S2 2.5.3")
        .reset(0)
        .only("optional, common")
        .view(al::view_code)
        .fields(&[hex(15, 0, "code", "AL status code, 0 for no error.")]);

    /// Takes over the RUN LED, or shows what it does: off in INIT, blinking in PREOP, single flash
    /// in SAFEOP, on in OP, flickering in BOOT.
    RUN_LED_OVERRIDE = register("RUN LED override", 0x0138, 1, ReadWrite, ReadWrite, "S2 2.5.4")
        .reset(0)
        .only("ET1150; IP core since 2.3.0")
        .fields(&[
            choice(3, 0, "LED code", "What the LED shows.", LED_CODES),
            flag(4, "override", "The code replaces the automatic one."),
        ]);

    /// Takes over the ERR LED, or shows what it does: single flash for a local error, double flash
    /// for the process data watchdog, blinking for a configuration error, flickering for a boot
    /// error, on for a failed application.
    ERR_LED_OVERRIDE = register("ERR LED override", 0x0139, 1, ReadWrite, ReadWrite, "S2 2.5.5")
        .reset(0)
        .only("ET1150; IP core since 2.3.0")
        .fields(&[
            choice(3, 0, "LED code", "What the LED shows.", LED_CODES),
            flag(4, "override", "The code replaces the automatic one."),
        ]);
}
