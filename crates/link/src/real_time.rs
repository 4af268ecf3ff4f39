//! Real-time requests of a cyclic thread to the host: priority, a CPU of its own, locked memory.
//!
//! Reference: sched(7), sched_setaffinity(2), mlockall(2), capabilities(7). Priority and CPU are
//! those of the calling thread, and of threads that it starts afterwards; memory is locked for the
//! whole process.

use std::fs;
use std::io;
use std::path::PathBuf;

use rustix::io::Errno;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit};
use rustix::thread::{CapabilitySet, CpuSet, capabilities, sched_setaffinity};

use crate::error::this_program;

/// Real-time priorities of Linux, lowest to highest.
const PRIORITIES: std::ops::RangeInclusive<u8> = 1..=99;

/// Why the host does not grant what a cycle needs. Its text says what was tried and what to do next.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RealTimeError {
    /// There is no such priority.
    #[error(
        "real-time priority {priority}: expected 1 to 99. Do: choose one above 50, where Linux runs \
         its interrupt threads, and below 99, where it runs its own watchdogs"
    )]
    Priority {
        /// The priority that was asked for.
        priority: u8,
    },
    /// There is no such CPU, or the process may not use it.
    #[error(
        "pinning to CPU {cpu}: it is not there, or not for this process; there are {present}. Do: \
         choose one of them (`taskset -cp $$` tells those of a container)"
    )]
    NoCpu {
        /// The CPU that was asked for.
        cpu: usize,
        /// The CPUs that are on, as Linux lists them.
        present: String,
    },
    /// It needs a capability that this process lacks.
    #[error(
        "{doing}: the capability {capability} is missing. Do: `sudo setcap \
         cap_net_raw,cap_sys_nice,cap_ipc_lock+ep {}` once, or start with sudo",
        .binary.display()
    )]
    NoPrivilege {
        /// What was tried.
        doing: &'static str,
        /// The capability.
        capability: &'static str,
        /// The program that needs it.
        binary: PathBuf,
    },
    /// The kernel refuses, although the capability is there.
    #[error(
        "{doing}: refused, although the capability {capability} is there; so do containers, and \
         control groups without a real-time share. Do: start outside of the container, or allow it \
         on the host: `sudo sysctl -w kernel.sched_rt_runtime_us=-1`"
    )]
    Refused {
        /// What was tried.
        doing: &'static str,
        /// The capability.
        capability: &'static str,
    },
    /// The kernel refuses something else.
    #[error("{doing}: {source}. Do: run without it; cycles then come later than planned at times")]
    System {
        /// What was tried.
        doing: &'static str,
        /// Why not.
        source: io::Error,
    },
}

/// Lets the calling thread run before all others but those of a higher real-time priority
/// (`SCHED_FIFO`), until it waits. `priority` is 1 to 99.
///
/// # Errors
/// When there is no such priority, the right is missing, or the host refuses.
pub fn sched_fifo(priority: u8) -> Result<(), RealTimeError> {
    const DOING: &str = "taking a real-time priority";
    if !PRIORITIES.contains(&priority) {
        return Err(RealTimeError::Priority { priority });
    }
    match set_fifo(priority) {
        Ok(()) => Ok(()),
        Err(error) if error.raw_os_error() == Some(libc::EPERM) => {
            Err(refusal(DOING, "CAP_SYS_NICE", CapabilitySet::SYS_NICE))
        }
        Err(source) => Err(RealTimeError::System { doing: DOING, source }),
    }
}

/// Keeps the calling thread on one CPU, counted from 0.
///
/// # Errors
/// When there is no such CPU, this process may not use it, or the host refuses.
pub fn pin_to_cpu(cpu: usize) -> Result<(), RealTimeError> {
    let no_cpu = || {
        let present = fs::read_to_string("/sys/devices/system/cpu/online");
        let present = present.map_or_else(|_| "others".to_owned(), |list| list.trim().to_owned());
        RealTimeError::NoCpu { cpu, present }
    };
    if cpu >= CpuSet::MAX_CPU {
        return Err(no_cpu());
    }
    let mut only = CpuSet::new();
    only.set(cpu);
    sched_setaffinity(None, &only).map_err(|error| match error {
        Errno::INVAL => no_cpu(),
        _ => RealTimeError::System { doing: "pinning to a CPU", source: error.into() },
    })
}

/// Brings the memory of the process into RAM and keeps it there, what it takes later included, so
/// that no cycle waits for a page.
///
/// # Errors
/// When the right is missing, the memory is not enough, or the host refuses.
pub fn lock_memory() -> Result<(), RealTimeError> {
    const DOING: &str = "locking memory";
    const CAPABILITY: &str = "CAP_IPC_LOCK";
    // With a limit, the lock could succeed now, and a later allocation fail and end the process.
    let limited = getrlimit(Resource::Memlock).current.is_some();
    if limited && !holds(CapabilitySet::IPC_LOCK) {
        return Err(refusal(DOING, CAPABILITY, CapabilitySet::IPC_LOCK));
    }
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|error| match error {
        Errno::PERM => refusal(DOING, CAPABILITY, CapabilitySet::IPC_LOCK),
        _ => RealTimeError::System { doing: DOING, source: error.into() },
    })
}

fn refusal(doing: &'static str, capability: &'static str, flag: CapabilitySet) -> RealTimeError {
    if holds(flag) {
        RealTimeError::Refused { doing, capability }
    } else {
        RealTimeError::NoPrivilege { doing, capability, binary: this_program() }
    }
}

/// Whether the calling thread has a capability.
fn holds(capability: CapabilitySet) -> bool {
    capabilities(None).is_ok_and(|sets| sets.effective.contains(capability))
}

/// Neither rustix nor the standard library offers this call; by way of `pthread` it is the same with
/// each C library.
#[allow(unsafe_code)]
fn set_fifo(priority: u8) -> io::Result<()> {
    // SAFETY: `sched_param` is a plain C structure, of which all zeros is a value.
    let mut parameters: libc::sched_param = unsafe { std::mem::zeroed() };
    parameters.sched_priority = priority.into();
    // SAFETY: the thread is the calling one, and the parameters live through the call.
    let error =
        unsafe { libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_FIFO, &parameters) };
    if error == 0 { Ok(()) } else { Err(io::Error::from_raw_os_error(error)) }
}
