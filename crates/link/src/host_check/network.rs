//! Network settings of this host that Ethernet over EtherCAT needs: an interface, forwarding, routes, answers to ping.
//!
//! Reference: S0 L2985-3067 (EOE-13); `networking/ip-sysctl.rst` of Linux, proc(5) (`/proc/net/route`), capabilities(7).

use super::firewall::{self, FirewallRules};
use super::{Area, Check, Files, Outcome};
use crate::error::this_program;

/// CAP_NET_ADMIN.
const NET_ADMIN: u32 = 12;
/// Flag of a route that is up, and of one by a gateway.
const UP: u32 = 0x1;
const GATEWAY: u32 = 0x2;

/// Checks of what frames between SubDevices and other computers need; `interface` is the one of `run --eoe`.
pub(super) fn checks(
    files: &Files,
    interface: Option<&str>,
    rules: Option<&FirewallRules>,
) -> Vec<Check> {
    let mut checks = vec![rights(files), device(files), forwarding(files), echo(files)];
    checks.push(firewall::check(files, rules));
    checks.push(routes(files, interface));
    if let Some(interface) = interface {
        checks.push(reverse_path(files, interface));
    }
    checks
}

fn rights(files: &Files) -> Check {
    const NAME: &str = "interface-rights";
    let status = files.text("proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let set = line.and_then(|line| u64::from_str_radix(line.trim(), 16).ok());
    match set {
        None => Check::unknown(Area::Network, NAME, "/proc/self/status does not tell"),
        Some(set) if set >> NET_ADMIN & 1 == 1 => {
            Check::good(Area::Network, NAME, "CAP_NET_ADMIN is there")
        }
        Some(_) => Check::new(Area::Network, NAME, Outcome::Doubtful, "CAP_NET_ADMIN is missing")
            .effect("no interface can be made for EoE, and no route be set")
            .mend(format!(
                "sudo setcap cap_net_admin,cap_net_raw,cap_sys_nice,cap_ipc_lock+ep {}",
                this_program().display()
            )),
    }
}

fn device(files: &Files) -> Check {
    const NAME: &str = "tap-interfaces";
    match files.text("proc/misc") {
        None => Check::unknown(Area::Network, NAME, "/proc/misc does not tell"),
        Some(devices) if devices.split_whitespace().any(|word| word == "tun") => {
            Check::good(Area::Network, NAME, "/dev/net/tun is there")
        }
        Some(_) => Check::new(
            Area::Network,
            NAME,
            Outcome::Doubtful,
            "the kernel has no /dev/net/tun: the module tun is not loaded",
        )
        .effect("no interface can be made for EoE")
        .mend("sudo modprobe tun"),
    }
}

fn forwarding(files: &Files) -> Check {
    const NAME: &str = "forwarding";
    match files.number::<u32>("proc/sys/net/ipv4/ip_forward") {
        None => Check::unknown(Area::Network, NAME, "/proc/sys/net/ipv4/ip_forward does not tell"),
        Some(0) => {
            Check::new(Area::Network, NAME, Outcome::Doubtful, "this computer does not route")
                .effect("SubDevices are reached from this computer, and from no other subnet")
                .mend("sudo sysctl -w net.ipv4.ip_forward=1")
                .mend(
                    "echo net.ipv4.ip_forward=1 | sudo tee /etc/sysctl.d/90-eoe.conf   # keeps it",
                )
        }
        Some(_) => Check::good(Area::Network, NAME, "this computer routes"),
    }
}

fn echo(files: &Files) -> Check {
    const NAME: &str = "ping-answers";
    match files.number::<u32>("proc/sys/net/ipv4/icmp_echo_ignore_all") {
        None => Check::unknown(Area::Network, NAME, "the kernel does not tell"),
        Some(0) => Check::good(Area::Network, NAME, "this computer answers pings"),
        Some(_) => {
            Check::new(Area::Network, NAME, Outcome::Doubtful, "this computer answers no ping")
                .effect("a ping from a SubDevice or from the LAN says nothing about the way here")
                .mend("sudo sysctl -w net.ipv4.icmp_echo_ignore_all=0")
        }
    }
}

fn routes(files: &Files, interface: Option<&str>) -> Check {
    const NAME: &str = "routes";
    let Some(table) = files.text("proc/net/route") else {
        return Check::unknown(Area::Network, NAME, "/proc/net/route does not tell");
    };
    let rows = table.lines().skip(1).map(|line| line.split_whitespace().collect::<Vec<_>>());
    let mut shown = Vec::new();
    let mut own = false;
    for row in rows {
        let [name, destination, gateway, flags, _, _, _, mask, ..] = row[..] else { continue };
        let number = |text: &str| u32::from_str_radix(text, 16).unwrap_or(0);
        let flags = number(flags);
        if flags & UP == 0 {
            continue;
        }
        own |= interface == Some(name);
        // The kernel prints the number as it lies in memory, the first byte of the address lowest.
        let address = |text: &str| std::net::Ipv4Addr::from(number(text).to_le_bytes());
        let by = match flags & GATEWAY {
            0 => String::new(),
            _ => format!(" via {}", address(gateway)),
        };
        shown.push(format!(
            "{}/{}{by} dev {name}",
            address(destination),
            number(mask).count_ones()
        ));
    }
    let found = if shown.is_empty() { "none".to_owned() } else { shown.join(", ") };
    match interface {
        Some(name) if !own => {
            Check::new(Area::Network, NAME, Outcome::Doubtful, format!("none by {name}: {found}"))
                .effect("nothing that this computer sends goes to SubDevices")
                .mend(format!("sudo ip address add 192.168.1.100/24 dev {name}   # an address in the subnet of the SubDevices"))
                .mend(format!("sudo ip link set {name} up"))
        }
        _ => Check::good(Area::Network, NAME, found),
    }
}

fn reverse_path(files: &Files, interface: &str) -> Check {
    const NAME: &str = "reverse-path";
    let value =
        |which: &str| files.number::<u32>(&format!("proc/sys/net/ipv4/conf/{which}/rp_filter"));
    // The stricter of both counts.
    match value("all").max(value(interface)) {
        None => Check::unknown(Area::Network, NAME, "the kernel does not tell"),
        Some(1) => Check::new(
            Area::Network,
            NAME,
            Outcome::Doubtful,
            "packets are dropped whose answer would leave by another interface (rp_filter 1)",
        )
        .effect("SubDevices that are reached over two ways get no answer")
        .mend(format!(
            "sudo sysctl -w net.ipv4.conf.{interface}.rp_filter=2   # only where there are two ways"
        )),
        Some(_) => Check::good(Area::Network, NAME, "packets may come by any way"),
    }
}
