//! The process data interface, the controller's side towards the SubDevice's own processor, and the
//! configuration it was given from the SII: 0x0140 to 0x019D.
//!
//! Reference: S2 2.6 and 2.7. Everything here comes from the SII at power-on and is read-only over
//! EtherCAT but for the user modes.

use crate::register::entry::{Access, Register, choice, flag, hex, number, register};
use Access::{Read, ReadWrite};

const PDI_TYPES: &[(u32, &str)] = &[
    (0x00, "deactivated"),
    (0x01, "4 digital inputs"),
    (0x02, "4 digital outputs"),
    (0x03, "2 digital inputs, 2 digital outputs"),
    (0x04, "digital I/O"),
    (0x05, "SPI slave"),
    (0x06, "oversampling I/O"),
    (0x07, "EtherCAT bridge (port D)"),
    (0x08, "16/64 bit asynchronous microcontroller"),
    (0x09, "8/32 bit asynchronous microcontroller"),
    (0x0A, "16/64 bit synchronous microcontroller"),
    (0x0B, "8/32 bit synchronous microcontroller"),
    (0x0C, "16/64 bit multiplexed asynchronous microcontroller"),
    (0x0D, "8/32 bit multiplexed asynchronous microcontroller"),
    (0x0E, "16/64 bit multiplexed synchronous microcontroller"),
    (0x0F, "8/32 bit multiplexed synchronous microcontroller"),
    (0x10, "32 digital inputs"),
    (0x11, "24 digital inputs, 8 digital outputs"),
    (0x12, "16 digital inputs, 16 digital outputs"),
    (0x13, "8 digital inputs, 24 digital outputs"),
    (0x14, "32 digital outputs"),
    (0x15, "SPI master"),
    (0x80, "on-chip bus"),
];
const DRIVERS: &[(u32, &str)] = &[
    (0, "push-pull active low"),
    (1, "open drain (active low)"),
    (2, "push-pull active high"),
    (3, "open source (active high)"),
];
const SYNC_OR_LATCH: &[(u32, &str)] = &[(0, "LATCH input"), (1, "SYNC output")];
const SECOND_PDI: &str = "ET1150; IP core since 4.0.0";

registers! {
    PDI0: "PDI0 and ESC configuration A";

    /// Which interface connects the controller to the SubDevice's own processor or signals. Loaded
    /// from SII word 0.
    PDI_CONTROL = register("PDI0 control", 0x0140, 1, Read, Read, "S2 2.6.1").fields(&[
        choice(7, 0, "interface", "Kind of process data interface.", PDI_TYPES),
    ]);

    /// Basic configuration of the controller, loaded from the high byte of SII word 0. With device
    /// emulation there is no processor behind the controller: AL status follows AL control and
    /// there are no status codes.
    ESC_CONFIGURATION_A0 = register("ESC configuration A0", 0x0141, 1, Read, Read, "S2 2.6.2")
        .fields(&[
            flag(0, "device emulation", "AL status is copied from AL control."),
            flag(1, "enhanced link detection, all ports", "It is on at all ports."),
            flag(2, "DC SYNC unit", "The SYNC unit of distributed clocks is on."),
            flag(3, "DC latch unit", "The latch unit of distributed clocks is on."),
            flag(4, "enhanced link, port A", "Enhanced link detection is on at port 0."),
            flag(5, "enhanced link, port B", "Enhanced link detection is on at port 1."),
            flag(6, "enhanced link, port C", "Enhanced link detection is on at port 2."),
            flag(7, "enhanced link, port D", "Enhanced link detection is on at port 3."),
        ]);

    /// Further configuration of the controller, loaded from SII word 5: power saving, defaults of
    /// DL control.
    ESC_CONFIGURATION_A5 = register("ESC configuration A5", 0x0142, 2, Read, Read, "S2 2.6.3")
        .only("ET1100, ET1150, ET1200")
        .fields(&[
            flag(1, "port B disabled", "Port 1 is switched off to save power."),
            choice(2, 2, "system time control", "Who steers the system time.",
                &[(0, "by EtherCAT"), (1, "by PDI")]),
            flag(3, "SyncManager deactivation delay", "Default of bit 6 of 0x0807."),
            choice(6, 6, "E-bus remote link down time", "Default of bit 22 of DL control.",
                &[(0, "about 660 ms"), (1, "about 80 µs")]),
            flag(8, "time loop control unit", "It runs even without SYNC and latch unit."),
            number(11, 9, "FIFO size reduction", "How far below 7 the RX FIFO size is set.", ""),
        ]);

    /// Further configuration of the controller, loaded from SII word 6.
    ESC_CONFIGURATION_A6 = register("ESC configuration A6", 0x0144, 2, Read, Read, "S2 2.6.4")
        .only(SECOND_PDI)
        .fields(&[
            flag(0, "area B present", "The SII has a second configuration area."),
            flag(1, "forward foreign frames", "Bit 0 of DL control starts as 0."),
        ]);

    /// How the process data interface stands: whether its configuration was loaded and is valid.
    PDI_INFORMATION = register("PDI0 information", 0x014E, 2, Read, Read, "S2 2.6.5")
        .only("ET1150; IP core since 3.0.0")
        .fields(&[
            flag(0, "acknowledge by write", "The PDI acknowledges events by writing, not reading."),
            flag(1, "configuration area A loaded", "The SII was loaded."),
            flag(2, "PDI active", "The interface works."),
            flag(3, "PDI configuration invalid", "The interface does not work for this reason."),
            flag(4, "SyncManager acknowledge by read", "SyncManagers are excepted from bit 0."),
        ]);

    /// Settings of the process data interface. Their meaning depends on the kind of interface in
    /// 0x0140. Loaded from the low byte of SII word 1.
    PDI_CONFIGURATION = register("PDI0 configuration", 0x0150, 1, Read, Read, "S2 2.6.6")
        .fields(&[hex(7, 0, "configuration", "Meaning as the kind of interface defines.")]);

    /// What the pins SYNC0/LATCH0 and SYNC1/LATCH1 are, and whether SYNC signals raise AL events.
    /// Loaded from the high byte of SII word 1.
    SYNC_LATCH_CONFIGURATION =
        register("SYNC/LATCH configuration A", 0x0151, 1, Read, Read, "S2 2.6.6.9").fields(&[
            choice(1, 0, "SYNC0 driver", "Driver and polarity of the output.", DRIVERS),
            choice(2, 2, "SYNC0/LATCH0", "What the pin is.", SYNC_OR_LATCH),
            flag(3, "SYNC0 to AL event", "SYNC0 sets bit 2 of the AL event request."),
            choice(5, 4, "SYNC1 driver", "Driver and polarity of the output.", DRIVERS),
            choice(6, 6, "SYNC1/LATCH1", "What the pin is.", SYNC_OR_LATCH),
            flag(7, "SYNC1 to AL event", "SYNC1 sets bit 3 of the AL event request."),
        ]);

    /// More settings of the process data interface, loaded from SII word 3.
    PDI_CONFIGURATION_EXTENDED =
        register("extended PDI0 configuration", 0x0152, 2, Read, Read, "S2 2.6.6").fields(&[
            hex(15, 0, "configuration", "Meaning as the kind of interface defines."),
        ]);

    /// Lets a MainDevice replace some settings of a digital I/O or SPI master interface while it
    /// runs.
    PDI_USER_MODE_ECAT =
        register("PDI0 user mode from ECAT", 0x0158, 2, ReadWrite, Read, "S2 2.6.7")
        .reset(0)
        .only(SECOND_PDI)
        .fields(&[
            flag(0, "user mode", "The settings here replace those of the SII."),
            hex(15, 1, "settings", "Meaning as the kind of interface defines."),
        ]);

    /// The same as 0x0158 from the side of the PDI; 0x0158 has precedence.
    PDI_USER_MODE_PDI = register("PDI0 user mode from PDI", 0x015C, 2, Read, ReadWrite, "S2 2.6.8")
        .reset(0)
        .only(SECOND_PDI)
        .fields(&[
            flag(0, "user mode", "The settings here replace those of the SII."),
            hex(15, 1, "settings", "Meaning as the kind of interface defines."),
        ]);
}

registers! {
    PDI1: "PDI1 and ESC configuration B";

    /// Which second process data interface there is.
    PDI1_CONTROL = register("PDI1 control", 0x0180, 1, Read, Read, "S2 2.7.1")
        .only(SECOND_PDI)
        .fields(&[choice(7, 0, "interface", "Kind of process data interface.", PDI_TYPES)]);

    /// Which PDI watchdog counts in DL status and for the ERR LED.
    ESC_CONFIGURATION_B0 = register("ESC configuration B0", 0x0181, 1, Read, Read, "S2 2.7.2")
        .only(SECOND_PDI)
        .fields(&[choice(1, 0, "watchdog selection", "Which PDI watchdog counts.",
            &[(0, "PDI0"), (1, "PDI1"), (2, "PDI0 or PDI1"), (3, "PDI0 and PDI1")])]);

    /// Private RAM of the PDI, and link detection over the PHY management interface.
    ESC_CONFIGURATION_B5 = register("ESC configuration B5", 0x0182, 2, Read, Read, "S2 2.7.3")
        .only(SECOND_PDI)
        .fields(&[
            number(5, 0, "private RAM", "End of the process data RAM that only the PDI reaches.",
                "KB"),
            choice(7, 6, "acknowledge by write", "How the PDI acknowledges events.",
                &[(0, "disabled"), (1, "registers and buffers"), (3, "registers only")]),
            flag(8, "MI link detection, port A", "Port 0 watches its link by PHY registers."),
            flag(9, "MI link detection, port B", "Port 1 watches its link by PHY registers."),
            flag(10, "MI link detection, port C", "Port 2 watches its link by PHY registers."),
            flag(11, "MI link detection, port D", "Port 3 watches its link by PHY registers."),
        ]);

    /// Reserved for configuration that no controller uses yet.
    ESC_CONFIGURATION_B6 = register("ESC configuration B6", 0x0184, 2, Read, Read, "S2 2.7.4")
        .only(SECOND_PDI)
        .fields(&[hex(15, 0, "reserved", "Reserved, 0.")]);

    /// What further pins are used for: general purpose I/O, SYNC and LATCH signals, clock output.
    ESC_CONFIGURATION_B4 = register("ESC configuration B4", 0x0188, 2, Read, Read, "S2 2.7.5")
        .only("ET1150")
        .fields(&[
            number(5, 0, "first output pin", "First PDI pin used as general purpose output.", ""),
            choice(6, 6, "GPIO direction", "Whether pins work both ways.",
                &[(0, "unidirectional"), (1, "bidirectional")]),
            choice(7, 7, "DC signal position", "Where the DC signals lie.",
                &[(0, "next free byte"), (1, "before free byte")]),
            flag(8, "LATCH2/3", "The inputs are available."),
            flag(9, "SYNC0/1", "The outputs are available."),
            flag(10, "SYNC2/3", "The outputs are available."),
            flag(11, "PDI error LEDs", "The LEDs are available."),
            hex(15, 12, "CPU clock output", "0 is off; 1 to 15 select 50 MHz down to 2.5 MHz."),
        ]);

    /// How the second process data interface stands.
    PDI1_INFORMATION = register("PDI1 information", 0x018E, 2, Read, Read, "S2 2.7.6")
        .only(SECOND_PDI)
        .fields(&[
            flag(0, "acknowledge by write", "The PDI acknowledges events by writing, not reading."),
            flag(1, "configuration area B loaded", "The SII was loaded."),
            flag(2, "PDI active", "The interface works."),
            flag(3, "PDI configuration invalid", "The interface does not work for this reason."),
            flag(4, "SyncManager acknowledge by read", "SyncManagers are excepted from bit 0."),
        ]);

    /// Settings of the second process data interface.
    PDI1_CONFIGURATION = register("PDI1 configuration", 0x0190, 1, Read, Read, "S2 2.7.7")
        .only(SECOND_PDI)
        .fields(&[hex(7, 0, "configuration", "Meaning as the kind of interface defines.")]);

    /// Settings of SYNC2/LATCH2 and SYNC3/LATCH3; reserved in the controllers known so far.
    SYNC_LATCH_CONFIGURATION_B =
        register("SYNC/LATCH configuration B", 0x0191, 1, Read, Read, "S2 chapter 1")
        .only(SECOND_PDI)
        .fields(&[hex(7, 0, "reserved", "Reserved.")]);

    /// More settings of the second process data interface.
    PDI1_CONFIGURATION_EXTENDED =
        register("extended PDI1 configuration", 0x0192, 2, Read, Read, "S2 2.7.7")
        .only(SECOND_PDI)
        .fields(&[hex(15, 0, "configuration", "Meaning as the kind of interface defines.")]);

    /// Lets a MainDevice replace some settings of the second process data interface while it runs.
    PDI1_USER_MODE_ECAT =
        register("PDI1 user mode from ECAT", 0x0198, 2, ReadWrite, Read, "S2 2.7.8")
        .reset(0)
        .only(SECOND_PDI)
        .fields(&[
            flag(0, "user mode", "The settings here replace those of the SII."),
            hex(15, 1, "settings", "Meaning as the kind of interface defines."),
        ]);

    /// The same as 0x0198 from the side of the PDI; 0x0198 has precedence.
    PDI1_USER_MODE_PDI = register("PDI1 user mode from PDI", 0x019C, 2, Read, ReadWrite, "S2 2.7.9")
        .reset(0)
        .only(SECOND_PDI)
        .fields(&[
            flag(0, "user mode", "The settings here replace those of the SII."),
            hex(15, 1, "settings", "Meaning as the kind of interface defines."),
        ]);
}
