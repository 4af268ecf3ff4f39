//! Real-time requests of a cyclic thread: granted, or refused with the way to get them.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

use std::fs;
use std::sync::{Mutex, PoisonError};
use std::thread;

use linesman_link::real_time::{RealTimeError, lock_memory, pin_to_cpu, sched_fifo};
use rustix::thread::{CapabilitySet, CapabilitySets, capabilities, sched_getaffinity};

/// Runs `test` in a thread of its own, whose rights, priority and CPU are then no other's, and while
/// no other test runs: memory is locked for the whole process, and without rights only a little.
fn alone(test: impl FnOnce() + Send + 'static) {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    if let Err(panic) = thread::spawn(test).join() {
        std::panic::resume_unwind(panic);
    }
}

/// Whether this process may try; says so when it may not.
fn may(capability: CapabilitySet, name: &str) -> bool {
    let held = capabilities(None).unwrap().effective.contains(capability);
    if !held {
        eprintln!("SKIPPED: no {name}; run as root");
    }
    held
}

/// Takes all capabilities from the calling thread.
fn give_up_rights() {
    let none = CapabilitySet::empty();
    let sets = CapabilitySets { effective: none, permitted: none, inheritable: none };
    rustix::thread::set_capabilities(None, sets).unwrap();
}

/// Real-time priority and policy of the calling thread, as the kernel tells them (proc_pid_stat(5),
/// fields 40 and 41).
fn scheduling() -> (u32, u32) {
    let stat = fs::read_to_string("/proc/thread-self/stat").unwrap();
    let behind_name = stat.rsplit_once(')').unwrap().1;
    let fields: Vec<_> = behind_name.split_whitespace().collect();
    (fields[40 - 3].parse().unwrap(), fields[41 - 3].parse().unwrap())
}

#[test]
fn a_thread_gets_its_priority_and_its_cpu() {
    alone(|| {
        assert_eq!(scheduling(), (0, 0));
        if may(CapabilitySet::SYS_NICE, "CAP_SYS_NICE") {
            match sched_fifo(7) {
                Ok(()) => assert_eq!(scheduling(), (7, libc::SCHED_FIFO as u32)),
                Err(RealTimeError::Refused { .. }) => {
                    eprintln!("SKIPPED: this container grants no real-time priority");
                }
                Err(error) => panic!("{error}"),
            }
        }
        let before = sched_getaffinity(None).unwrap();
        let cpu = (0..1024).rfind(|cpu| before.is_set(*cpu)).unwrap();
        pin_to_cpu(cpu).unwrap();
        let after = sched_getaffinity(None).unwrap();
        assert_eq!((after.count(), after.is_set(cpu)), (1, true));
    });
}

#[test]
fn locked_memory_is_told_by_the_kernel() {
    alone(|| {
        let locked = || {
            let status = fs::read_to_string("/proc/self/status").unwrap();
            let line = status.lines().find(|line| line.starts_with("VmLck:")).unwrap();
            line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap()
        };
        if may(CapabilitySet::IPC_LOCK, "CAP_IPC_LOCK") {
            assert_eq!(locked(), 0);
            lock_memory().unwrap();
            assert!(locked() > 100, "{} KiB", locked());
            rustix::mm::munlockall().unwrap();
        }
    });
}

#[test]
fn what_is_not_there_is_refused_with_what_is() {
    for priority in [0, 100] {
        let error = sched_fifo(priority).unwrap_err();
        assert!(matches!(error, RealTimeError::Priority { .. }), "{error}");
    }
    let online = fs::read_to_string("/sys/devices/system/cpu/online").unwrap();
    for cpu in [1023, 1024, usize::MAX] {
        let error = pin_to_cpu(cpu).unwrap_err();
        assert!(matches!(error, RealTimeError::NoCpu { .. }), "{error}");
        assert!(error.to_string().contains(&format!("there are {}. Do:", online.trim())));
    }
}

#[test]
fn without_privilege_the_way_to_get_it_is_told() {
    alone(|| {
        give_up_rights();
        let binary = std::env::current_exe().unwrap();
        let setcap = format!(
            "sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock+ep {}` once",
            binary.display()
        );
        let limits = fs::read_to_string("/proc/self/limits").unwrap();
        let limit = |name: &str| {
            let line = limits.lines().find_map(|line| line.strip_prefix(name)).unwrap();
            line.split_whitespace().next().unwrap().to_owned()
        };
        let rows = [
            (limit("Max realtime priority") == "0", sched_fifo(7), "CAP_SYS_NICE"),
            (limit("Max locked memory") != "unlimited", lock_memory(), "CAP_IPC_LOCK"),
        ];
        for (needed, result, capability) in rows {
            if !needed {
                eprintln!("SKIPPED: this host needs no {capability}");
                continue;
            }
            let error = result.unwrap_err();
            assert!(matches!(error, RealTimeError::NoPrivilege { .. }), "{error}");
            let text = error.to_string();
            assert!(text.contains(&setcap) && text.contains(capability), "{text}");
        }
    });
}
