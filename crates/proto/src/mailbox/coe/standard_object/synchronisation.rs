//! Objects that say how a device keeps step, and what it counts of its cycles.
//!
//! Reference: ETG.1020, synchronisation. The flags of subindex 04 are
//! [`SyncTypes`](crate::mailbox::coe::SyncTypes).

use super::{Entry, StandardObject, entry, object};

const ETG_1020: &str = "ETG.1020, synchronisation";

/// The entries of both objects; the first differs.
macro_rules! sync_entries {
    ($sync_type:literal) => {
        &[
            entry(1, "synchronisation type", $sync_type),
            entry(2, "cycle time", "The cycle in ns, as the MainDevice set it or the device measured it."),
            entry(3, "shift time", "From SYNC0 to the moment when values are taken or given, ns."),
            entry(
                4,
                "supported types",
                "Bit 0 free run, 1 with SM events, 2 with SYNC0, 3 with SYNC1, 4 subordinated, 5 shift by \
                 a local timer, 6 shift by SYNC1, 10 delay to be measured, 11 delay fixed, 14 measures \
                 its own times.",
            ),
            entry(
                5,
                "minimum cycle time",
                "The shortest cycle that the device can follow, ns. A shorter one is refused (0x0035, \
                 0x0036) or not kept (0x001A).",
            ),
            entry(6, "calculation and copy time", "What the device needs for its work on a cycle, ns."),
            entry(7, "minimum delay time", "Between SYNC0 and the values at the terminals, at least, ns."),
            entry(8, "measure times", "Write 1 to let the device measure 05, 06 and 09 anew."),
            entry(9, "delay time", "Between SYNC0 and the values at the terminals, at most, ns."),
            entry(0x0A, "SYNC0 cycle time", "Time between two SYNC0 signals, ns."),
            entry(
                0x0B,
                "SM event missed",
                "Counts cycles without fresh data in time: frames late, lost, or on the wrong side of \
                 SYNC0. When it rises, look at jitter and shift.",
            ),
            entry(
                0x0C,
                "cycle time too small",
                "Counts cycles in which the device was not done with its work: the cycle is too short for \
                 it, or outputs and SYNC0 follow each other too closely.",
            ),
            entry(
                0x0D,
                "shift time too short",
                "Counts cycles in which outputs were taken over late against the shift.",
            ),
            entry(
                0x0E,
                "RxPDO toggle failed",
                "Counts cycles in which the same outputs came again though fresh ones were due.",
            ),
            entry(0x0F, "minimum cycle distance", "Shortest time between two cycles so far, ns."),
            entry(0x10, "maximum cycle distance", "Longest time between two cycles so far, ns."),
            entry(0x11, "minimum SM SYNC distance", "Shortest time from frame to SYNC0 so far, ns."),
            entry(0x12, "maximum SM SYNC distance", "Longest time from frame to SYNC0 so far, ns."),
            entry(0x20, "sync error", "Whether the device was out of step in recent cycles."),
        ]
    };
}

const OUTPUTS: &[Entry] =
    sync_entries!("0 free run, 1 with the SM event, 2 with SYNC0, 3 with SYNC1.");
const INPUTS: &[Entry] = sync_entries!(
    "0 free run, 1 with the event of SM3, 2 with SYNC0, 3 with SYNC1, 0x22 with the event of SM2."
);

objects! {
    SYNCHRONISATION;
    0x1C32 "Synchronisation of outputs", "RECORD", ETG_1020;
        "How the device keeps step with outputs (SyncManager 2), and what it counts of cycles that went \
         wrong. Counters stay until the device restarts."
        => "Read it twice with some seconds in between: `linesman sdo WHERE DEVICE read 0x1C32`. Subindex \
            0B that rises means frames at the wrong time, 0C a cycle that is too short for the device."
        ; entries OUTPUTS;
    0x1C33 "Synchronisation of inputs", "RECORD", ETG_1020;
        "How the device keeps step with inputs (SyncManager 3), and what it counts of cycles that went \
         wrong. Counters stay until the device restarts."
        => "Read it twice with some seconds in between: `linesman sdo WHERE DEVICE read 0x1C33`. Subindex \
            0B that rises means frames at the wrong time, 0C a cycle that is too short for the device."
        ; entries INPUTS;
}
