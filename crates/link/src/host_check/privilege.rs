//! Privileges of this process: raw sockets, real-time priority, locked memory.

use super::{Area, Check, Files, Outcome};
use crate::error::this_program;

/// A capability: its bit in `CapEff`, its name for `setcap`, what it is for.
struct Right {
    bit: u32,
    name: &'static str,
    label: &'static str,
    outcome: Outcome,
    effect: &'static str,
}

/// Reference: capabilities(7), `linux/capability.h`.
const RIGHTS: [Right; 3] = [
    Right {
        bit: 13,
        name: "raw-sockets",
        label: "CAP_NET_RAW",
        outcome: Outcome::Bad,
        effect: "no EtherCAT frame can be sent or received",
    },
    Right {
        bit: 23,
        name: "real-time-priority",
        label: "CAP_SYS_NICE",
        outcome: Outcome::Doubtful,
        effect: "any other program may delay the cycle: watchdogs expire, synchronisation is lost",
    },
    Right {
        bit: 14,
        name: "locked-memory",
        label: "CAP_IPC_LOCK",
        outcome: Outcome::Doubtful,
        effect: "a cycle may wait for a page of memory to be fetched",
    },
];

pub(super) fn checks(files: &Files) -> Vec<Check> {
    let status = files.text("proc/self/status");
    let effective = status.as_deref().and_then(|status| {
        let line = status.lines().find_map(|line| line.strip_prefix("CapEff:"))?;
        u64::from_str_radix(line.trim(), 16).ok()
    });
    let one = |right: &Right| {
        let Right { bit, name, label, outcome, effect } = *right;
        match effective {
            None => Check::unknown(Area::Rights, name, "/proc/self/status does not tell"),
            Some(set) if set >> bit & 1 == 1 => {
                Check::good(Area::Rights, name, format!("{label} is there"))
            }
            Some(_) => Check::new(Area::Rights, name, outcome, format!("{label} is missing"))
                .effect(effect)
                .mend(format!(
                    "sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock+ep {}",
                    this_program().display()
                )),
        }
    };
    RIGHTS.iter().map(one).collect()
}
