//! A network namespace of a benchmark's own, with a virtual cable in it.

use std::process::{Command, ExitCode};

/// One end of the cable.
pub(crate) const NEAR: &str = "near0";
/// The other end.
pub(crate) const FAR: &str = "far0";
/// Set for the process inside the namespace.
const INSIDE: &str = "LINESMAN_BENCH_INSIDE";

/// Starts this program again in a namespace of its own, where it lays the cable and does `inside`. Where
/// that cannot be, it says so: nothing is measured.
pub(crate) fn run(inside: fn() -> ExitCode) -> ExitCode {
    if std::env::var_os(INSIDE).is_some() {
        return match lay() {
            Ok(()) => inside(),
            Err(command) => {
                println!("skipped: `{command}` failed; it needs root and iproute2");
                ExitCode::SUCCESS
            }
        };
    }
    let program = std::env::current_exe().unwrap();
    let mut command = Command::new("unshare");
    command.arg("--net").arg(program).args(std::env::args().skip(1)).env(INSIDE, "1");
    match command.status() {
        Ok(status) => ExitCode::from(status.code().unwrap_or(1) as u8),
        Err(error) => {
            println!("skipped: a network namespace cannot be made here: {error}");
            ExitCode::SUCCESS
        }
    }
}

/// Lays the cable; else the command that failed.
fn lay() -> Result<(), String> {
    let mut commands = vec![format!("ip link add {NEAR} type veth peer name {FAR}")];
    for card in [NEAR, FAR] {
        commands.push(format!("sysctl -q -w net.ipv6.conf.{card}.disable_ipv6=1"));
        commands.push(format!("ip link set {card} up"));
    }
    for command in commands {
        let done = Command::new("sh").args(["-c", &command]).status();
        if !done.is_ok_and(|status| status.success()) {
            return Err(command);
        }
    }
    Ok(())
}
