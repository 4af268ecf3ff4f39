//! Access to the registers of the Ethernet PHYs: 0x0510 to 0x051B.
//!
//! Reference: S2 2.12. Reading PHY registers is how a diagnosis looks behind the port: link
//! partner, speed, signal quality.

use crate::register::entry::{Access, Register, choice, flag, hex, number, register};
use Access::{Read, ReadWrite, ReadWriteIf};

registers! {
    PHY: "PHY management interface";

    /// Starts accesses to PHY registers and tells how they went. Set PHY address and register
    /// first.
    PHY_CONTROL_STATUS =
        register("PHY management control/status", 0x0510, 2, ReadWriteIf, ReadWriteIf, "S2 2.12.1")
        .only("controllers with Ethernet PHYs")
        .fields(&[
            flag(0, "write enable", "A write command in this same frame is allowed."),
            flag(1, "PDI control possible", "The SubDevice's processor may take the interface."),
            flag(2, "MI link detection", "The controller itself watches links over PHY registers."),
            number(7, 3, "PHY address offset", "PHY address of port 0.", ""),
            choice(10, 8, "command", "Command to start, or the one that is running.", &[
                (0, "none"), (1, "read"), (2, "write"), (4, "set address (clause 45)"),
                (5, "read (clause 45)"), (6, "write (clause 45)"),
                (7, "read with post increment (clause 45)"),
            ]),
            flag(12, "clause 45", "Clause 45 commands are supported."),
            flag(13, "read error", "There is no such PHY or register."),
            flag(14, "command error", "Invalid command, or a write without write enable."),
            flag(15, "busy", "A command is running."),
        ]);

    /// Which PHY the next command is about: 0 to 3 are those of ports A to D.
    PHY_ADDRESS = register("PHY address", 0x0512, 1, ReadWriteIf, ReadWriteIf, "S2 2.12.2")
        .reset(0)
        .only("controllers with Ethernet PHYs")
        .fields(&[
            number(4, 0, "PHY", "Port number of the PHY, unless bit 7 is set.", ""),
            flag(7, "no translation", "The number is the PHY's own address."),
        ]);

    /// Which register of the PHY the next command is about.
    PHY_REGISTER_ADDRESS =
        register("PHY register address", 0x0513, 1, ReadWriteIf, ReadWriteIf, "S2 2.12.3")
        .reset(0)
        .only("controllers with Ethernet PHYs")
        .fields(&[number(4, 0, "register", "Register of the PHY.", "")]);

    /// What was read from the PHY, or what to write.
    PHY_DATA = register("PHY data", 0x0514, 2, ReadWriteIf, ReadWriteIf, "S2 2.12.4")
        .reset(0)
        .only("controllers with Ethernet PHYs")
        .fields(&[hex(15, 0, "data", "Value of the PHY register.")]);

    /// Whether the MainDevice keeps the interface to itself.
    PHY_ACCESS_ECAT =
        register("PHY management ECAT access state", 0x0516, 1, ReadWriteIf, Read, "S2 2.12.5")
        .reset(0)
        .only("ET1150; IP core since 2.0.0")
        .fields(&[flag(0, "exclusive", "The SubDevice's processor cannot take the interface.")]);

    /// Whether the SubDevice's processor has the interface.
    PHY_ACCESS_PDI =
        register("PHY management PDI access state", 0x0517, 1, ReadWrite, ReadWriteIf, "S2 2.12.6")
        .reset(0)
        .only("ET1150; IP core since 2.0.0")
        .fields(&[
            flag(0, "taken by PDI", "The SubDevice's processor has the interface.").ecat(Read),
            flag(1, "force release", "Takes the interface back: clears bit 0.").ecat(ReadWrite),
        ]);

    /// What the controller learned from the PHY of a port. Reliable only where MI link detection is
    /// on for the port. Writing any of them clears read error and configuration update.
    PHY_PORT_STATUS =
        register("PHY port status", 0x0518, 1, ReadWriteIf, ReadWriteIf, "S2 2.12.7")
        .per_port()
        .reset(0)
        .only("ET1150; IP core since 2.0.0")
        .fields(&[
            flag(0, "physical link", "The PHY sees a carrier."),
            flag(1, "link", "Speed, duplex and negotiation fit, too."),
            flag(2, "link error", "The link is kept down because something does not fit."),
            flag(3, "read error", "The PHY could not be read."),
            flag(4, "partner error", "The link partner does something wrong."),
            flag(5, "configuration updated", "The controller changed the PHY's settings."),
            flag(6, "MI link detection off", "It is off for this port."),
        ]);
}
