//! The data link: loop modes, link and communication of each port: 0x0100 to 0x0111.
//!
//! Reference: S2 2.4. The typed views are [`DlControl`](crate::register::DlControl) and
//! [`DlStatus`](crate::register::DlStatus).

use crate::register::dl_status;
use crate::register::entry::{Access, Register, choice, flag, hex, number, register};
use Access::{Read, ReadWrite};

const LOOP_MODES: &[(u32, &str)] =
    &[(0, "auto"), (1, "auto close"), (2, "always open"), (3, "always closed")];

registers! {
    LINK: "Data link layer";

    /// How the controller forwards frames and treats its ports. A loop that is closed by hand here
    /// cuts off everything behind the port, cable or no cable. A change of a loop waits until the
    /// frame that is passing has ended.
    DL_CONTROL = register("DL control", 0x0100, 4, ReadWrite, Read, "S2 2.4.1")
        .reset(0x0007_0001)
        .fields(&[
            choice(0, 0, "forwarding rule",
                "What happens to frames that are not EtherCAT, and whether bit 1 of the first byte \
                 of the source address is set in frames that are processed.",
                &[(0, "forward foreign frames"), (1, "destroy foreign frames")]),
            flag(1, "temporary use",
                "The loop settings hold for about one second; then the former ones return."),
            choice(9, 8, "loop port A", "When port 0 is open.", LOOP_MODES),
            choice(11, 10, "loop port B", "When port 1 is open.", LOOP_MODES),
            choice(13, 12, "loop port C", "When port 2 is open.", LOOP_MODES),
            choice(15, 14, "loop port D", "When port 3 is open.", LOOP_MODES),
            number(18, 16, "RX FIFO size",
                "Delay before forwarding starts; 7, the default, tolerates clocks 100 ppm off.",
                ""),
            flag(19, "E-bus low jitter", "E-bus ports run with little jitter."),
            choice(22, 22, "E-bus remote link down time",
                "How long an E-bus port signals a lost link to its neighbour.",
                &[(0, "about 660 ms"), (1, "about 80 µs")]),
            flag(24, "station alias enabled", "The alias in 0x0012 counts as a station address."),
        ]);

    /// Commands that read and write (APRW, FPRW, BRW) read at the datagram's address and write at
    /// this many bytes behind it.
    PHYSICAL_READ_WRITE_OFFSET =
        register("physical read/write offset", 0x0108, 2, ReadWrite, Read, "S2 2.4.2")
        .reset(0)
        .only("optional")
        .fields(&[hex(15, 0, "offset", "Distance from read to write address.")]);

    /// How each port stands: whether there is a carrier, whether the loop is closed, and whether
    /// communication is stable. A used port is open with communication; an unused one is closed
    /// without carrier. Carrier with a closed loop points at a bad cable or a peer that does not
    /// talk.
    DL_STATUS = register("DL status", 0x0110, 2, Read, Read, "S2 2.4.3")
        .read_effect("Clears bit 2 of the ECAT event request (0x0210).")
        .view(dl_status::view)
        .fields(&[
            flag(0, "PDI operational",
                "The SII was loaded without error; process data RAM can be reached."),
            flag(1, "PDI watchdog OK", "The PDI watchdog has not expired."),
            flag(2, "enhanced link detection", "It is switched on for at least one port."),
            flag(4, "link, port A", "Port 0 has a carrier."),
            flag(5, "link, port B", "Port 1 has a carrier."),
            flag(6, "link, port C", "Port 2 has a carrier."),
            flag(7, "link, port D", "Port 3 has a carrier."),
            flag(8, "loop closed, port A", "Port 0 does not send or receive frames."),
            flag(9, "communication, port A", "Communication over port 0 is stable."),
            flag(10, "loop closed, port B", "Port 1 does not send or receive frames."),
            flag(11, "communication, port B", "Communication over port 1 is stable."),
            flag(12, "loop closed, port C", "Port 2 does not send or receive frames."),
            flag(13, "communication, port C", "Communication over port 2 is stable."),
            flag(14, "loop closed, port D", "Port 3 does not send or receive frames."),
            flag(15, "communication, port D", "Communication over port 3 is stable."),
        ]);
}
