//! Calls and menus of each kind of MainDevice that read registers beside its cycle.

use super::kind::MainDeviceKind;

/// The step that gets the error counters of a line which this kind of MainDevice drives: read twice, a minute apart,
/// and given to `linesman diagnose`.
#[must_use]
pub const fn error_counters(kind: MainDeviceKind) -> &'static str {
    match kind {
        MainDeviceKind::Soem => {
            "in its program call `ecx_FPRD(port, slavelist[n].configadr, 0x0300, 20, bytes, EC_TIMEOUTRET)` for each \
             SubDevice n, between two of its cycles, print `slave n 0x0300: 00 00 …` with all bytes, and again a minute \
             later; the text goes to `linesman diagnose counters.txt` as it is"
        }
        MainDeviceKind::Igh => {
            "read them beside its cycle with `ethercat reg_read -p N 0x0300 20` for each position N, and again a \
             minute later; what the terminal shows, commands included, goes to `linesman diagnose counters.txt` as it is"
        }
        MainDeviceKind::Ethercrab => {
            "in its program call `subdevice.register_read::<[u8; 20]>(0x0300u16)` for each SubDevice n, print `slave {n} \
             0x0300: {bytes:02x?}`, and again a minute later; the text goes to `linesman diagnose counters.txt` as it is"
        }
        MainDeviceKind::Kickcat => {
            "in its program call `bus.sendRefreshErrorCounters(on_error)` and `bus.processAwaitingFrames()`, print \
             `toString(slave.error_counters)` of each of `bus.slaves()` beneath its number, and again a minute later; the \
             text goes to `linesman diagnose counters.txt` as it is"
        }
        MainDeviceKind::Twincat => {
            "it adds them up itself: I/O, the EtherCAT device, tab Online, copy the list with its column CRC and the \
             counters of frames beneath it into a file and give it to `linesman diagnose online.txt`; Advanced \
             Settings, Online View, adds registers as columns (0x0300, 0x0310)"
        }
        MainDeviceKind::Linesman => {
            "its own diagnosis reads them: look at the verdict of that run, not started with `--no-diagnosis`"
        }
        MainDeviceKind::Unknown => {
            "read the error counters with the MainDevice's own tool, or with `linesman counters WHERE --for 60` \
             while the line is idle"
        }
    }
}

/// The step that gets DL status and the counters of lost links.
#[must_use]
pub const fn link_status(kind: MainDeviceKind) -> &'static str {
    match kind {
        MainDeviceKind::Igh => {
            "read it with `ethercat slaves -v`, which tells the link of each port, and `ethercat reg_read -p N \
             0x0310 4`; what the terminal shows goes to `linesman diagnose links.txt` as it is"
        }
        MainDeviceKind::Soem => {
            "in its program call `ecx_FPRD(port, slavelist[n].configadr, 0x0110, 2, bytes, EC_TIMEOUTRET)`, and \
             0x0310 with 4 bytes, for each SubDevice n, and print `slave n 0x0110: 00 00`, which `linesman diagnose \
             links.txt` takes"
        }
        MainDeviceKind::Ethercrab => {
            "in its program call `subdevice.register_read::<u16>(0x0110u16)`, and `<[u8; 4]>(0x0310u16)`, for each \
             SubDevice n, and print `slave {n} 0x0310: {bytes:02x?}`, which `linesman diagnose links.txt` takes"
        }
        MainDeviceKind::Kickcat => {
            "in its program call `bus.sendGetDLStatus(slave, on_error)` for each SubDevice, and \
             `bus.sendRefreshErrorCounters(on_error)`, then `bus.processAwaitingFrames()`"
        }
        MainDeviceKind::Twincat => {
            "I/O, the EtherCAT device, Advanced Settings, Online View: add 0x0110 and 0x0310 as columns of the \
             Online list, and paste that list"
        }
        MainDeviceKind::Linesman | MainDeviceKind::Unknown => {
            "read DL status (0x0110) and 0x0310 to 0x0313 with the MainDevice's own tool"
        }
    }
}
