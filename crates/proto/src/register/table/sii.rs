//! Access to the SII EEPROM: 0x0500 to 0x050F.
//!
//! Reference: S2 2.11. The typed view is [`SiiControl`](crate::register::SiiControl).

use crate::register::entry::{Access, Register, choice, flag, hex, register};
use Access::{Read, ReadWrite, ReadWriteIf};

registers! {
    SII: "SII EEPROM interface";

    /// Who may use the SII. The MainDevice takes it with 2 and then 0, and hands it to the
    /// SubDevice's processor with 1.
    SII_ACCESS_ECAT = register("EEPROM ECAT access state", 0x0500, 1, ReadWrite, Read, "S2 2.11.1")
        .reset(0)
        .fields(&[
            flag(0, "offered to PDI", "The SubDevice's processor has the SII."),
            flag(1, "force ECAT access", "Takes the SII back: clears bit 0 of 0x0501."),
        ]);

    /// Whether the SubDevice's processor uses the SII at this moment.
    SII_ACCESS_PDI = register("EEPROM PDI access state", 0x0501, 1, Read, ReadWriteIf, "S2 2.11.2")
        .reset(0)
        .fields(&[flag(0, "taken by PDI", "The SubDevice's processor uses the SII.")]);

    /// Starts SII commands and tells how they went. While bit 15 is set, writes have no effect. Bit
    /// 13 set after a command means that the EEPROM was not ready: try again after some ms.
    SII_CONTROL_STATUS =
        register("EEPROM control/status", 0x0502, 2, ReadWriteIf, ReadWriteIf, "S2 2.11.3")
        .fields(&[
            flag(0, "write enable", "A write command in this same frame is allowed."),
            flag(3, "EEPROM not present", "No EEPROM is connected."),
            flag(5, "emulation", "The SubDevice's processor plays the EEPROM."),
            choice(6, 6, "read size", "How much one read command brings.",
                &[(0, "4 bytes"), (1, "8 bytes")]),
            choice(7, 7, "address size", "What the EEPROM expects.",
                &[(0, "1 byte, up to 16 Kbit"), (1, "2 bytes, 32 Kbit and more")]),
            choice(10, 8, "command", "Command to start, or the one that is running.",
                &[(0, "none"), (1, "read"), (2, "write"), (4, "reload")]),
            flag(11, "checksum error", "The first words of the SII do not match their checksum."),
            flag(12, "device information not loaded",
                "The SII was not loaded, yet or at all: process data RAM cannot be reached."),
            flag(13, "acknowledge error", "The EEPROM did not answer, or the command is invalid."),
            flag(14, "write enable error", "A write command came without write enable."),
            flag(15, "busy", "A command is running."),
        ]);

    /// Which word of the SII the next command is about.
    SII_ADDRESS = register("EEPROM address", 0x0504, 4, ReadWriteIf, ReadWriteIf, "S2 2.11.4")
        .reset(0)
        .fields(&[hex(31, 0, "word address", "Address in words of two bytes.")]);

    /// What was read, 2 or 4 words, or the one word to write.
    SII_DATA = register("EEPROM data", 0x0508, 8, ReadWriteIf, ReadWriteIf, "S2 2.11.5")
        .reset(0)
        .fields(&[
            hex(15, 0, "word 0", "The word read, or the word to write."),
            hex(31, 16, "word 1", "Second word read.").ecat(Read),
            hex(47, 32, "word 2", "Third word read, where 8 bytes are read at once.").ecat(Read),
            hex(63, 48, "word 3", "Fourth word read, where 8 bytes are read at once.").ecat(Read),
        ]);
}
