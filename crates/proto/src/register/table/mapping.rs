//! FMMUs, which map logical addresses to memory, and SyncManagers, which guard memory: 0x0600 to
//! 0x087F.
//!
//! Reference: S2 2.13 and 2.14. The typed views are [`FmmuConfig`](crate::register::FmmuConfig) and
//! [`SyncManagerConfig`](crate::register::SyncManagerConfig).

use crate::register::entry::{Access, Register, Unit, choice, flag, hex, number, register};
use crate::register::{fmmu, sync_manager};
use Access::{Read, ReadWrite, ReadWriteIf};

registers! {
    FMMUS: "FMMU";

    /// Maps a range of logical addresses, bit by bit where wanted, to a range of this controller's
    /// memory. A logical datagram acts on a controller only where an active FMMU hits. Usually one
    /// maps outputs, one inputs, and one the full bit of the mailbox.
    FMMU = register("FMMU", 0x0600, 16, ReadWrite, Read, "S2 2.13")
        .per(Unit::Fmmu, 16)
        .reset(0)
        .view(fmmu::view)
        .fields(&[
            hex(31, 0, "logical start address", "First logical byte that is mapped."),
            number(47, 32, "length", "Logical bytes spanned, first and last included.", "bytes"),
            number(50, 48, "logical start bit", "First bit mapped in the first logical byte.", ""),
            number(58, 56, "logical stop bit", "Last bit mapped in the last logical byte.", ""),
            hex(79, 64, "physical start address", "First byte in the controller's memory."),
            number(82, 80, "physical start bit", "First bit in that byte.", ""),
            flag(88, "reads", "Logical reads are mapped: inputs."),
            flag(89, "writes", "Logical writes are mapped: outputs."),
            flag(96, "active", "The FMMU is switched on."),
        ]);
}

registers! {
    SYNC_MANAGERS: "SyncManager";

    /// Guards a range of memory, so that MainDevice and SubDevice exchange whole messages (mailbox)
    /// or whole process images (three buffers). An access that does not begin at the start address,
    /// a write to a full mailbox, or a read from an empty one adds nothing to the working counter.
    /// Start, length and control can be written only while it is off. By custom SyncManager 0 is
    /// the mailbox out, 1 the mailbox in, 2 the outputs, 3 the inputs.
    SYNC_MANAGER = register("SyncManager", 0x0800, 8, ReadWriteIf, Read, "S2 2.14")
        .per(Unit::SyncManager, 16)
        .view(sync_manager::view)
        .fields(&[
            hex(15, 0, "start address", "First byte that is guarded."),
            number(31, 16, "length", "Bytes that are guarded; 0 switches it off.", "bytes"),
            choice(33, 32, "mode", "How data are exchanged.",
                &[(0, "buffered"), (2, "mailbox")]),
            choice(35, 34, "direction", "Who writes.",
                &[(0, "MainDevice reads"), (1, "MainDevice writes")]),
            flag(36, "ECAT interrupt", "Events appear in the ECAT event request."),
            flag(37, "PDI interrupt", "Events appear in the AL event request."),
            flag(38, "watchdog trigger", "A complete write starts the process data watchdog anew."),
            flag(39, "sequential mode", "A MainDevice must write it from start to end in order."),
            flag(40, "written", "It was written completely and not yet read.").ecat(Read),
            flag(41, "read", "It was read completely and not yet written.").ecat(Read),
            flag(42, "sequence violation", "It was not written in order.").ecat(Read),
            flag(43, "mailbox full", "The mailbox holds a message.").ecat(Read),
            choice(45, 44, "last buffer", "Buffer that was last written, in buffered mode.",
                &[(0, "first"), (1, "second"), (2, "third"), (3, "none")]).ecat(Read),
            flag(46, "read buffer open", "A buffer is being read.").ecat(Read),
            flag(47, "write buffer open", "A buffer is being written.").ecat(Read),
            flag(48, "enabled", "The SyncManager is switched on.").ecat(ReadWrite),
            flag(49, "repeat request",
                "Toggled by a MainDevice that lost a mailbox message and wants it again.")
                .ecat(ReadWrite),
            flag(54, "latch event ECAT", "A buffer exchange by the MainDevice is time-stamped.")
                .ecat(ReadWrite),
            flag(55, "latch event PDI", "A buffer exchange by the PDI is time-stamped.")
                .ecat(ReadWrite),
            flag(56, "deactivated by PDI", "The SubDevice locked the guarded memory.").ecat(Read),
            flag(57, "repeat acknowledge",
                "Equal to the repeat request once the message is there again.").ecat(Read),
            flag(62, "deactivation delay", "The PDI may finish reading after it is switched off.")
                .ecat(Read),
            flag(63, "deactivation pending", "It is off, and the PDI still reads.").ecat(Read),
        ]);
}
