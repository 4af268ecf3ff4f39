//! Network namespaces of the tests' own, with virtual cables in them.

#![allow(dead_code, reason = "each test program uses a part of it")]

use std::process::Command;
use std::thread;
use std::time::Duration;

use linesman_link::interface::{self, OperationalState};

/// Runs `test` in a thread with a network namespace of its own that has a virtual cable between
/// `va` and `vb`, both up. Says so and returns when this process may not make one.
pub fn with_cable(test: impl FnOnce() + Send + 'static) {
    let run = || {
        // SAFETY: only the calling thread's network namespace changes; no memory is shared or
        // unshared, and the thread ends with this function.
        if unsafe { libc::unshare(libc::CLONE_NEWNET) } != 0 {
            let error = std::io::Error::last_os_error();
            eprintln!("SKIPPED: no network namespace of its own ({error}); run as root");
            return;
        }
        if Command::new("ip").arg("-V").output().is_err() {
            eprintln!("SKIPPED: no `ip` command (package iproute2)");
            return;
        }
        ip("link set lo up");
        ip("link add va type veth peer name vb");
        for card in ["va", "vb"] {
            // Without this, IPv6 sends frames of its own.
            ip(&format!("link set {card} addrgenmode none"));
            ip(&format!("link set {card} up"));
        }
        for card in ["va", "vb"] {
            await_operation(card);
        }
        test();
    };
    if let Err(panic) = thread::spawn(run).join() {
        std::panic::resume_unwind(panic);
    }
}

/// Waits until frames can pass: for a while after a card is switched on, the kernel takes frames
/// and throws them away.
pub fn await_operation(card: &str) {
    for _ in 0..500 {
        let operational = interface::find(card).expect("it was made above").operational;
        if operational == OperationalState::Up {
            return;
        }
        thread::sleep(Duration::from_millis(5));
    }
    panic!("{card} does not come up");
}

/// Runs `ip` in the calling thread's namespace.
pub fn ip(arguments: &str) -> String {
    let output = Command::new("ip").args(arguments.split(' ')).output().expect("ip is there");
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "ip {arguments}: {complaint}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}
