//! Identification, addresses and write protection of a controller: 0x0000 to 0x0041.
//!
//! Reference: S2 2.1, 2.2, 2.3. Type numbers of other makers come from their own register lists.

use crate::register::entry::{Access, Register, choice, flag, hex, number, register};
use Access::{Read, ReadWrite};

const PORT_TYPES: &[(u32, &str)] =
    &[(0, "not implemented"), (1, "not configured"), (2, "E-bus"), (3, "MII")];
const RESET_PROGRESS: &[(u32, &str)] =
    &[(0, "idle"), (1, "0x52 written"), (2, "0x52, 0x45 written"), (3, "in reset")];

registers! {
    INFORMATION: "ESC information";

    /// Which kind of EtherCAT controller it is.
    ESC_TYPE = register("ESC type", 0x0000, 1, Read, Read, "S2 2.1.1").fields(&[
        choice(7, 0, "type", "Kind of controller.", &[
            (0x01, "first terminals"), (0x02, "ESC10/ESC20"), (0x03, "first EK1100"),
            (0x04, "IP core"), (0x05, "internal IP core"), (0x11, "ET1100/ET1150"),
            (0x12, "ET1200"), (0x90, "TI PRU-ICSS"), (0x98, "XMC4300/XMC4800"),
            (0xC0, "LAN925x"),
        ]),
    ]);

    /// Revision of the controller; for the IP core the major version. 0x50 tells an ET1150 from an
    /// ET1100.
    ESC_REVISION = register("ESC revision", 0x0001, 1, Read, Read, "S2 2.1.2").fields(&[
        hex(7, 0, "revision", "Revision, or major version of an IP core."),
    ]);

    /// Build of the controller; for the IP core maintenance version, minor version and patch level.
    ESC_BUILD = register("ESC build", 0x0002, 2, Read, Read, "S2 2.1.3").fields(&[
        number(3, 0, "maintenance version", "Z of version X.Y.Z of an IP core.", ""),
        number(7, 4, "minor version", "Y of version X.Y.Z of an IP core.", ""),
        hex(15, 8, "patch level", "0 for a release, 0x10 and above for a development build."),
    ]);

    /// How many FMMUs the controller has: ET1100 8, ET1150 16, ET1200 3, ESC20 4.
    FMMU_COUNT = register("FMMUs supported", 0x0004, 1, Read, Read, "S2 2.1.4").fields(&[
        number(7, 0, "FMMUs", "Number of FMMUs.", ""),
    ]);

    /// How many SyncManagers the controller has: ET1100 8, ET1150 16, ET1200 4, ESC20 4.
    SYNC_MANAGER_COUNT = register("SyncManagers supported", 0x0005, 1, Read, Read, "S2 2.1.5")
        .fields(&[number(7, 0, "SyncManagers", "Number of SyncManagers.", "")]);

    /// Size of the process data RAM from 0x1000 up: ET1100 8 KB, ET1150 15 or 16 KB, ET1200 1 KB,
    /// ESC20 4 KB. RAM that is private to the SubDevice's processor is not counted here.
    RAM_SIZE = register("RAM size", 0x0006, 1, Read, Read, "S2 2.1.6").fields(&[
        number(7, 0, "size", "Process data RAM that a MainDevice can reach.", "KB"),
    ]);

    /// How each of the four ports is built. It tells which ports exist before anything is plugged.
    PORT_DESCRIPTOR = register("port descriptor", 0x0007, 1, Read, Read, "S2 2.1.7").fields(&[
        choice(1, 0, "port A", "How port 0 is built.", PORT_TYPES),
        choice(3, 2, "port B", "How port 1 is built.", PORT_TYPES),
        choice(5, 4, "port C", "How port 2 is built.", PORT_TYPES),
        choice(7, 6, "port D", "How port 3 is built.", PORT_TYPES),
    ]);

    /// What the controller can do beyond the minimum, and what it cannot. Bits 9 and 10 forbid
    /// commands: a MainDevice that ignores them sees working counters that never fit.
    ESC_FEATURES = register("ESC features supported", 0x0008, 2, Read, Read, "S2 2.1.8").fields(&[
        choice(0, 0, "FMMU operation", "Whether FMMUs map single bits.",
            &[(0, "bit-oriented"), (1, "byte-oriented")]),
        choice(1, 1, "unused register access", "Whether registers that are not there may be read.",
            &[(0, "allowed"), (1, "not supported")]),
        flag(2, "distributed clocks", "Distributed clocks are there."),
        choice(3, 3, "clock width", "Width of the distributed clock.",
            &[(0, "32 bit"), (1, "64 bit")]),
        flag(4, "low jitter E-bus", "E-bus ports can run with little jitter."),
        flag(5, "enhanced link detection E-bus", "E-bus ports can watch their link closely."),
        flag(6, "enhanced link detection MII",
            "MII ports take a link down when symbol errors come in quick succession."),
        flag(7, "separate FCS error handling",
            "Frames that an earlier controller marked are counted as forwarded errors."),
        flag(8, "enhanced DC SYNC activation", "Bits 3 to 7 of 0x0981, and 0x0984, are there."),
        flag(9, "LRW not supported", "The controller does not process LRW."),
        flag(10, "BRW, APRW, FPRW not supported",
            "The controller does not process these read/write commands."),
        flag(11, "fixed FMMU and SyncManager configuration",
            "FMMUs and SyncManagers cannot be configured freely."),
        flag(12, "SyncManager sequential mode",
            "SyncManagers can insist on being written in order."),
    ]);
}

registers! {
    STATION: "Station address";

    /// The address that FPRD, FPWR, FPRW and FRMW reach this controller by. The MainDevice gives it
    /// out during its scan; a loss of supply sets it back to 0, which is how a brown-out shows.
    STATION_ADDRESS =
        register("configured station address", 0x0010, 2, ReadWrite, Read, "S2 2.2.1")
        .reset(0)
        .fields(&[hex(15, 0, "address", "Station address; 0 means that none was given.")]);

    /// A second address, kept in SII word 4 and taken from there at the first load after power-on
    /// (ESC20: at every load). It counts only while bit 24 of DL control is set; MainDevices use it
    /// to tell equal devices apart.
    STATION_ALIAS = register("configured station alias", 0x0012, 2, Read, ReadWrite, "S2 2.2.2")
        .fields(&[hex(15, 0, "alias", "Station alias; 0 means that none is set.")]);
}

registers! {
    PROTECTION: "Write protection and reset";

    /// Lifts the register write protection for the rest of the frame in which it is written, with
    /// whatever value. It clears itself when the next frame begins.
    REGISTER_WRITE_ENABLE =
        register("register write enable", 0x0020, 1, ReadWrite, Read, "S2 2.3.1")
        .reset(0)
        .only("optional")
        .fields(&[flag(0, "enabled", "Registers may be written in this frame.")]);

    /// Protects 0x0000 to 0x0F7F, except 0x0020 and 0x0030, from writes of a MainDevice.
    REGISTER_WRITE_PROTECTION =
        register("register write protection", 0x0021, 1, ReadWrite, Read, "S2 2.3.2")
        .reset(0)
        .only("optional")
        .fields(&[flag(0, "protected", "Registers are write-protected.")]);

    /// Lifts the write protection of the whole controller for the rest of the frame in which it is
    /// written, with whatever value.
    ESC_WRITE_ENABLE = register("ESC write enable", 0x0030, 1, ReadWrite, Read, "S2 2.3.3")
        .reset(0)
        .only("optional")
        .fields(&[flag(0, "enabled", "Anything may be written in this frame.")]);

    /// Protects all memory of the controller, except 0x0030, from writes of a MainDevice.
    ESC_WRITE_PROTECTION =
        register("ESC write protection", 0x0031, 1, ReadWrite, Read, "S2 2.3.4")
        .reset(0)
        .only("optional")
        .fields(&[flag(0, "protected", "All memory is write-protected.")]);

    /// Resets the controller after 0x52, 0x45, 0x53 ("RES") were written here in three frames one
    /// after the other. Read, it tells how far the sequence has come.
    ESC_RESET_ECAT = register("ESC reset ECAT", 0x0040, 1, ReadWrite, Read, "S2 2.3.5")
        .reset(0)
        .only("optional")
        .fields(&[
            choice(1, 0, "progress", "How far the reset sequence has come.", RESET_PROGRESS),
        ]);

    /// The same as 0x0040, for the SubDevice's own processor.
    ESC_RESET_PDI = register("ESC reset PDI", 0x0041, 1, Read, ReadWrite, "S2 2.3.6")
        .reset(0)
        .only("optional; IP core since 2.2.0")
        .fields(&[
            choice(1, 0, "progress", "How far the reset sequence has come.", RESET_PROGRESS),
        ]);
}
