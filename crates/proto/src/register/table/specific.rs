//! Registers that differ from controller to controller, the pins it drives itself, and its user
//! RAM: 0x0E00 to 0x0FFF.
//!
//! Reference: S2 2.16, 2.17, 2.18.

use crate::register::entry::{Access, Register, bytes, choice, flag, hex, number, register};
use Access::{Read, ReadWrite, ReadWriteIf};

registers! {
    SPECIFIC: "ESC-specific registers";

    /// The configuration pins at power-on (ET1100, ET1150, ET1200) or the product id (IP core). On
    /// an ESC20 this area serves updates of its FPGA.
    POWER_ON_VALUES =
        register("power-on values or product id", 0x0E00, 8, Read, Read, "S2 2.16.1, 2.16.4.1")
        .fields(&[hex(63, 0, "value", "Meaning as the controller defines.")]);

    /// Vendor id of an IP core, from its license.
    ESC_VENDOR_ID = register("vendor id of the IP core", 0x0E08, 8, Read, Read, "S2 2.16.4.2")
        .only("IP core")
        .fields(&[
            hex(23, 0, "company", "Vendor id of the ETG."),
            hex(27, 24, "department", "Department of the vendor."),
            hex(31, 28, "reserved", "0xE marks a vendor id for tests."),
        ]);

    /// Self-test and supply of the controller. Its undervoltage bits are first-hand evidence of a
    /// brown-out. A write to 0x0E10 clears what was detected.
    ESC_HEALTH = register("ESC health status", 0x0E10, 8, ReadWrite, ReadWrite, "S2 2.16.2")
        .only("ET1150; evaluation IP core bits 4 and 5 with other meanings")
        .fields(&[
            flag(0, "PDI pin sharing error", "The configuration uses a pin twice."),
            flag(1, "RAM self-test error", "The RAM failed its test."),
            flag(2, "RAM test override", "The RAM may be used in spite of that."),
            flag(3, "undervoltage VCC_REG", "It was seen since the last clear."),
            flag(4, "undervoltage VCC_IO_COM", "It was seen since the last clear."),
            flag(5, "undervoltage VCC_IO_PDI", "It was seen since the last clear."),
            flag(6, "undervoltage VCC_PLL, coarse", "It was seen since the last clear."),
            flag(7, "undervoltage VCC_CORE, coarse", "It was seen since the last clear."),
            flag(8, "undervoltage VCC_PLL, fine", "It was seen since the last clear."),
            flag(9, "undervoltage VCC_CORE, fine", "It was seen since the last clear."),
            flag(10, "internal reset", "A reset over 0x0040 or 0x0041 was seen."),
            flag(11, "external reset", "A reset by pin was seen."),
            flag(12, "PLL coarse lock lost", "It was seen since the last clear."),
            flag(13, "PLL fine lock lost", "It was seen since the last clear."),
            flag(14, "OTP write disabled", "One-time memory cannot be written after test modes."),
            flag(15, "OTP load late", "Start-up was delayed by the one-time memory."),
            number(55, 32, "RAM errors", "Errors that the self-test found.", ""),
            number(58, 56, "RAM test runs with errors", "Runs that found errors.", ""),
            flag(63, "PLL lock late", "The PLL was not locked in the expected time."),
        ]);

    /// Whether the MainDevice keeps the one-time memory to itself.
    OTP_ACCESS_ECAT = register("OTP ECAT access state", 0x0E30, 1, ReadWriteIf, Read, "S2 2.16.3.1")
        .reset(0)
        .only("ET1150")
        .fields(&[flag(0, "exclusive", "The SubDevice's processor cannot take it.")]);

    /// Whether the SubDevice's processor has the one-time memory.
    OTP_ACCESS_PDI = register("OTP PDI access state", 0x0E31, 1, ReadWrite, ReadWriteIf,
        "S2 2.16.3.2")
        .reset(0)
        .only("ET1150")
        .fields(&[
            flag(0, "taken by PDI", "The SubDevice's processor has it.").ecat(Read),
            flag(1, "force release", "Takes it back: clears bit 0.").ecat(ReadWrite),
        ]);

    /// Starts commands of the one-time memory and tells how they went. Writing it is for good.
    OTP_CONTROL_STATUS =
        register("OTP control/status", 0x0E32, 2, ReadWriteIf, ReadWriteIf, "S2 2.16.3.3")
        .reset(0)
        .only("ET1150")
        .fields(&[
            flag(0, "enabled", "The memory is switched on."),
            flag(1, "write enabled", "It may be written."),
            choice(2, 2, "access", "Who has access.", &[(0, "ECAT or PDI"), (1, "JTAG only")]),
            choice(10, 8, "command", "Command to start, or the one that is running.", &[
                (0, "none"), (1, "read"), (2, "write and verify"), (3, "write enable"),
                (4, "reload"), (5, "write disable"), (6, "enable"), (7, "disable"),
            ]),
            choice(12, 11, "verification", "How the last write went.", &[
                (0, "written"), (1, "written, more bits were set"), (2, "not programmed"),
                (3, "weakly programmed"),
            ]),
            flag(13, "write not allowed", "The area is protected."),
            flag(14, "command error", "The last command failed."),
            flag(15, "busy", "A command is running."),
        ]);

    /// Which four bytes of the one-time memory the next command is about.
    OTP_ADDRESS = register("OTP address", 0x0E34, 4, ReadWriteIf, ReadWriteIf, "S2 2.16.3.4")
        .only("ET1150")
        .fields(&[hex(7, 0, "address", "Byte address, a multiple of 4.")]);

    /// What was read from the one-time memory, or what to write.
    OTP_DATA = register("OTP data", 0x0E38, 4, ReadWriteIf, ReadWriteIf, "S2 2.16.3.5")
        .only("ET1150")
        .fields(&[hex(31, 0, "data", "Value.")]);
}

registers! {
    IO: "ESC-specific I/O";

    /// The outputs of a controller that drives digital outputs itself. The one place below the RAM
    /// where FMMUs may write single bits.
    DIGITAL_OUTPUT = register("digital I/O output data", 0x0F00, 4, ReadWrite, Read, "S2 2.17.1.1")
        .reset(0)
        .only("controllers with digital I/O")
        .fields(&[hex(31, 0, "outputs", "One bit for each output.")]);

    /// The inputs of a second, digital process data interface.
    DIGITAL_INPUT_PDI1 =
        register("digital I/O input data PDI1", 0x0F08, 4, Read, Read, "S2 2.17.1.2")
        .reset(0)
        .only("ET1150; IP core since 4.0.0")
        .fields(&[hex(31, 0, "inputs", "One bit for each input.")]);

    /// Pins of the controller that the MainDevice may drive for general purposes.
    GENERAL_PURPOSE_OUTPUT =
        register("general purpose output data", 0x0F10, 8, ReadWrite, ReadWrite, "S2 2.17.1.3")
        .reset(0)
        .only("optional, 1 to 8 bytes")
        .fields(&[hex(63, 0, "outputs", "One bit for each output.")]);

    /// Pins of the controller read for general purposes; address switches are often read here.
    GENERAL_PURPOSE_INPUT =
        register("general purpose input data", 0x0F18, 8, Read, Read, "S2 2.17.1.4")
        .reset(0)
        .only("optional, 1 to 8 bytes")
        .fields(&[hex(63, 0, "inputs", "One bit for each input.")]);
}

registers! {
    RAM: "User RAM";

    /// Memory for the application's own use. An IP core puts the list of its features here at
    /// power-on; other controllers leave it undefined.
    USER_RAM = register("user RAM", 0x0F80, 128, ReadWrite, ReadWrite, "S2 2.18")
        .fields(&[bytes(1023, 0, "data", "Application data, or features of an IP core.")]);
}
