//! Error counters: 0x0300 to 0x0342. The registers a diagnosis lives on.
//!
//! Reference: S2 2.9. All counters are one byte and stop at 255; the value of a clearing write does
//! not matter. The typed view is [`ErrorCounters`](crate::register::ErrorCounters).

use crate::register::entry::{Access, Register, choice, hex, number, register};
use Access::{Read, ReadClear};

const RX_CODES: &[(u32, &str)] = &[
    (0x00, "none"),
    (0x20, "RX clock too fast"),
    (0x21, "RX clock too slow"),
    (0x22, "RX clock, other error"),
    (0x23, "TX clock too fast"),
    (0x24, "TX clock too slow"),
    (0x25, "TX clock, other error"),
    (0x28, "enhanced link detection prevents link"),
    (0x29, "MI link detection prevents link"),
    (0x2A, "unsupported speed or half duplex"),
    (0x30, "false carrier, or E-bus idle decode error"),
    (0x31, "false carrier extend"),
    (0x32, "bad start of stream"),
    (0x40, "RX_ER in frame, or E-bus frame decode error"),
    (0x50, "FIFO overrun"),
    (0x51, "FIFO underrun"),
    (0x52, "FIFO, other error"),
    (0x58, "frame dropped, gap too short"),
    (0x60, "checksum error"),
    (0x61, "forwarded error"),
    (0x62, "no start of frame delimiter"),
    (0x63, "frame too long"),
    (0x70, "frame shorter than expected"),
    (0x71, "frame longer than expected"),
    (0x72, "circulating frame"),
    (0x77, "other processing unit error"),
    (0x78, "non-EtherCAT frame"),
];

registers! {
    COUNTERS: "Error counters";

    /// What the receiver of a port saw spoiled. The low byte counts frames that arrived damaged and
    /// were not marked by an earlier controller: the fault lies on the link at this port. The high
    /// byte counts symbols that the physical layer could not decode, inside frames and between
    /// them. A write to any of 0x0300 to 0x030B clears 0x0300 to 0x030B, 0x0314 to 0x0317 and
    /// 0x0320 to 0x0327 together. Errors count only while the port is open.
    RX_ERROR_COUNTER = register("RX error counter", 0x0300, 2, ReadClear, Read, "S2 2.9.1")
        .per_port()
        .reset(0)
        .fields(&[
            number(7, 0, "invalid frames", "Damaged frames, first seen here. Stops at 255.", ""),
            number(15, 8, "physical-layer errors", "Symbols that cannot be decoded. Stops at 255.",
                ""),
        ]);

    /// Frames that arrived damaged at this port but were marked by an earlier controller: the fault
    /// lies further up in the direction the frame came from. Not every controller has it; those
    /// that do not count such frames as invalid.
    FORWARDED_RX_ERROR_COUNTER =
        register("forwarded RX error counter", 0x0308, 1, ReadClear, Read, "S2 2.9.2")
        .per_port()
        .reset(0)
        .only("optional")
        .fields(&[number(7, 0, "forwarded errors", "Marked frames. Stops at 255.", "")]);

    /// Damaged or malformed frames that entered the processing unit, whatever the reason: also
    /// frames that are too short or too long for their datagrams, that circulate, or that are not
    /// EtherCAT. Counts here without counts at a port are no cable fault.
    PROCESSING_UNIT_ERROR_COUNTER =
        register("processing unit error counter", 0x030C, 1, ReadClear, Read, "S2 2.9.3")
        .reset(0)
        .only("optional")
        .fields(&[number(7, 0, "processing unit errors", "Bad frames. Stops at 255.", "")]);

    /// Errors between the controller and the SubDevice's own processor. They are a matter of the
    /// device, never of the network, and should be 0.
    PDI_ERROR_COUNTER = register("PDI0 error counter", 0x030D, 1, ReadClear, Read, "S2 2.9.4")
        .reset(0)
        .only("optional")
        .fields(&[number(7, 0, "PDI errors", "Interface errors. Stops at 255.", "")]);

    /// What the last PDI error was; the bits depend on the kind of interface. Cleared with the PDI
    /// error counter.
    PDI_ERROR_CODE = register("PDI0 error code", 0x030E, 2, Read, Read, "S2 2.9.5")
        .reset(0)
        .only("IP core since 2.3.0; high byte ET1150 and IP core since 4.0.0")
        .fields(&[hex(15, 0, "code", "Reasons for the last PDI error.")]);

    /// How often a port that was open lost its link. It counts only with loop mode auto. A write to
    /// any of 0x0310 to 0x0313 clears all four. Counts from power-on and plugging are normal; a
    /// rise while the machine runs is a contact, a cable, or the supply of the neighbour.
    LOST_LINK_COUNTER = register("lost link counter", 0x0310, 1, ReadClear, Read, "S2 2.9.6")
        .per_port()
        .reset(0)
        .only("optional")
        .fields(&[number(7, 0, "lost links", "Links lost. Stops at 255.", "")]);

    /// Receive errors of a port whether it is open or closed. The first one after a clear leaves
    /// its reason in the RX error code.
    EXTENDED_RX_ERROR_COUNTER =
        register("extended RX error counter", 0x0314, 1, Read, Read, "S2 2.9.7")
        .per_port()
        .reset(0)
        .only("ET1150; IP core since 4.0.0")
        .fields(&[number(7, 0, "errors", "Receive errors. Stops at 255.", "")]);

    /// Why the extended RX error counter of the port went from 0 to 1; while it is 0, the present
    /// error of the link, if there is one.
    RX_ERROR_CODE = register("RX error code", 0x0320, 2, Read, Read, "S2 2.9.8, table 12")
        .per_port()
        .reset(0)
        .only("ET1150; IP core since 4.0.0")
        .fields(&[
            choice(7, 0, "code", "General error code.", RX_CODES),
            hex(15, 8, "details", "Details as the controller defines."),
        ]);

    /// The same as 0x030D for the second process data interface.
    PDI1_ERROR_COUNTER = register("PDI1 error counter", 0x0340, 1, ReadClear, Read, "S2 2.9.9")
        .reset(0)
        .only("ET1150; IP core since 4.0.0")
        .fields(&[number(7, 0, "PDI errors", "Interface errors. Stops at 255.", "")]);

    /// The same as 0x030E for the second process data interface.
    PDI1_ERROR_CODE = register("PDI1 error code", 0x0341, 2, Read, Read, "S2 2.9.10")
        .reset(0)
        .only("ET1150; IP core since 4.0.0")
        .fields(&[hex(15, 0, "code", "Reasons for the last PDI error.")]);
}
