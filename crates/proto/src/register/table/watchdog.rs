//! Watchdogs of process data and PDI: 0x0400 to 0x0448.
//!
//! Reference: S2 2.10. The typed views are [`WatchdogDivider`](crate::register::WatchdogDivider)
//! and [`WatchdogTime`](crate::register::WatchdogTime).

use crate::register::entry::{Access, Register, choice, number, register};
use Access::{Read, ReadClear, ReadWrite};

const EXPIRED_OR_NOT: &[(u32, &str)] = &[(0, "expired"), (1, "running or disabled")];

registers! {
    WATCHDOGS: "Watchdog";

    /// Length of the tick that all watchdog times count: the value plus 2, times 40 ns. The default
    /// makes 100 µs.
    WATCHDOG_DIVIDER = register("watchdog divider", 0x0400, 2, ReadWrite, Read, "S2 2.10.1")
        .reset(0x09C2)
        .fields(&[number(15, 0, "divider", "Periods of 40 ns in a tick, minus 2.", "")]);

    /// After how many ticks without access of the SubDevice's processor its watchdog expires; 0
    /// switches it off.
    WATCHDOG_TIME_PDI = register("watchdog time PDI0", 0x0410, 2, ReadWrite, Read, "S2 2.10.2")
        .reset(0x03E8)
        .fields(&[number(15, 0, "time", "Time until expiry.", "ticks")]);

    /// The same as 0x0410 for the second process data interface.
    WATCHDOG_TIME_PDI1 = register("watchdog time PDI1", 0x0412, 2, ReadWrite, Read, "S2 2.10.3")
        .reset(0x03E8)
        .only("ET1150; IP core since 4.0.0")
        .fields(&[number(15, 0, "time", "Time until expiry.", "ticks")]);

    /// After how many ticks without fresh outputs the process data watchdog expires; 0 switches it
    /// off. Each complete, undamaged write to a SyncManager with watchdog trigger starts it anew;
    /// there is one for all SyncManagers. The default makes 100 ms.
    WATCHDOG_TIME_PROCESS_DATA =
        register("watchdog time process data", 0x0420, 2, ReadWrite, Read, "S2 2.10.4")
        .reset(0x03E8)
        .fields(&[number(15, 0, "time", "Time until expiry.", "ticks")]);

    /// Whether the process data watchdog has expired.
    WATCHDOG_STATUS_PROCESS_DATA =
        register("watchdog status process data", 0x0440, 2, Read, Read, "S2 2.10.5")
        .reset(0)
        .fields(&[choice(0, 0, "status", "State of the watchdog.", EXPIRED_OR_NOT)]);

    /// How often the process data watchdog expired. A write to any of 0x0442 to 0x0444 clears all
    /// three. Some controllers count while the watchdog is off.
    WATCHDOG_COUNTER_PROCESS_DATA =
        register("watchdog counter process data", 0x0442, 1, ReadClear, Read, "S2 2.10.6")
        .reset(0)
        .only("optional")
        .fields(&[number(7, 0, "expiries", "Times it expired. Stops at 255.", "")]);

    /// How often the PDI watchdog expired.
    WATCHDOG_COUNTER_PDI =
        register("watchdog counter PDI0", 0x0443, 1, ReadClear, Read, "S2 2.10.7")
        .reset(0)
        .only("optional")
        .fields(&[number(7, 0, "expiries", "Times it expired. Stops at 255.", "")]);

    /// How often the watchdog of the second process data interface expired.
    WATCHDOG_COUNTER_PDI1 =
        register("watchdog counter PDI1", 0x0444, 1, ReadClear, Read, "S2 2.10.8")
        .reset(0)
        .only("ET1150; IP core since 4.0.0")
        .fields(&[number(7, 0, "expiries", "Times it expired. Stops at 255.", "")]);

    /// Whether the PDI watchdogs have expired, each by itself.
    WATCHDOG_STATUS_PDI = register("watchdog status PDI", 0x0448, 1, Read, Read, "S2 2.10.9")
        .reset(0)
        .only("ET1150; IP core since 4.0.0")
        .fields(&[
            choice(0, 0, "PDI0", "State of its watchdog.", EXPIRED_OR_NOT),
            choice(1, 1, "PDI1", "State of its watchdog.", EXPIRED_OR_NOT),
        ]);
}
