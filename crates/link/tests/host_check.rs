//! A computer judged by its files: each trait that delays or loses frames, with what mends it.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

use linesman_link::host_check::{Check, DriverSettings, Files, Outcome, inspect, inspect_network};
use tempfile::TempDir;

/// What is well: a computer for machines.
const WELL: [(&str, &str); 24] = [
    ("proc/self/status", "Name:\tlinesman\nCapEff:\t00000000008a7fff\n"),
    ("proc/version", "Linux version 6.12.0-rt (gcc) #1 SMP PREEMPT_RT"),
    ("proc/cpuinfo", "flags\t\t: fpu tsc\n"),
    ("proc/stat", "cpu  100 0 50 9000 10 0 0 0 0 0\ncpu0 50 0 25 4500 5 0 0 0 0 0\n"),
    ("proc/1/cgroup", "0::/init.scope\n"),
    ("proc/modules", "igc 200000 0 - Live 0x0\n"),
    ("proc/net/packet", "sk       RefCnt Type Proto  Iface R Rmem   User   Inode\n"),
    ("proc/loadavg", "0.20 0.10 0.05 1/200 4242\n"),
    ("proc/interrupts", "           CPU0       CPU1\n 33:   1   0   PCI-MSI   1-edge      eth7\n"),
    ("proc/irq/33/smp_affinity_list", "0\n"),
    ("proc/sys/kernel/sched_rt_runtime_us", "-1\n"),
    ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
    ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
    ("sys/devices/system/cpu/online", "0-1\n"),
    ("sys/devices/system/cpu/isolated", "1\n"),
    ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
    ("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "performance\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state1/latency", "2\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state1/name", "C1\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state1/disable", "0\n"),
    ("sys/class/net/eth7/device/power/control", "on\n"),
    ("sys/class/net/eth7/statistics/rx_dropped", "0\n"),
    ("sys/class/net/eth7/statistics/tx_errors", "0\n"),
    ("sys/class/net/eth7/statistics/rx_crc_errors", "0\n"),
];

const QUICK: DriverSettings = DriverSettings {
    receive_delay_us: Some(0),
    adaptive_receive_delay: Some(false),
    send_delay_us: Some(0),
    generic_receive_offload: Some(false),
    large_receive_offload: Some(false),
    energy_efficient: Some(false),
    receive_ring: Some((256, 4096)),
};

fn write(root: &Path, path: &str, text: &str) {
    let path = root.join(path);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

fn computer() -> TempDir {
    let folder = TempDir::new().unwrap();
    for (path, text) in WELL {
        write(folder.path(), path, text);
    }
    folder
}

fn checks(folder: &TempDir, settings: DriverSettings) -> Vec<Check> {
    inspect(&Files::below(folder.path()), &[("eth7".to_owned(), settings)])
}

#[track_caller]
fn one(checks: &[Check], name: &str) -> Check {
    checks.iter().find(|check| check.name == name).unwrap_or_else(|| panic!("{name}")).clone()
}

#[test]
fn a_computer_for_machines_is_good_in_every_respect() {
    let checks = checks(&computer(), QUICK);
    assert!(checks.len() >= 20, "{}", checks.len());
    for check in checks {
        assert_eq!(check.outcome, Outcome::Good, "{check:?}");
        assert!(check.mend.is_empty() && check.effect.is_empty(), "{check:?}");
    }
}

#[test]
fn each_trait_of_the_computer_is_told_with_what_mends_it() {
    use Outcome::{Bad, Doubtful};
    let rows: &[(&str, &str, &str, Outcome, &str)] = &[
        (
            "proc/self/status",
            "CapEff:\t0000000000000000\n",
            "raw-sockets",
            Bad,
            "sudo setcap cap_net_raw",
        ),
        (
            "proc/self/status",
            "CapEff:\t0000000000002000\n",
            "real-time-priority",
            Doubtful,
            "cap_sys_nice",
        ),
        (
            "proc/self/status",
            "CapEff:\t0000000000002000\n",
            "locked-memory",
            Doubtful,
            "cap_ipc_lock",
        ),
        (
            "proc/cpuinfo",
            "flags\t: fpu hypervisor\n",
            "virtual-machine",
            Doubtful,
            "on the computer that has",
        ),
        (
            "proc/stat",
            "cpu  100 0 50 900 0 0 0 50 0 0\n",
            "stolen-time",
            Bad,
            "no other machine shares",
        ),
        (".dockerenv", "", "container", Doubtful, "--cap-add=NET_RAW"),
        (
            "proc/version",
            "Linux version 6.1 SMP PREEMPT_DYNAMIC",
            "preemption",
            Doubtful,
            "linux-image-rt",
        ),
        (
            "proc/sys/kernel/sched_rt_runtime_us",
            "950000\n",
            "real-time-throttling",
            Doubtful,
            "sudo sysctl -w kernel.sched_rt_runtime_us=-1",
        ),
        (
            "sys/devices/system/clocksource/clocksource0/current_clocksource",
            "hpet\n",
            "clock-source",
            Doubtful,
            "dmesg",
        ),
        (
            "proc/modules",
            "ec_master 400000 1 - Live\n",
            "other-maindevice",
            Bad,
            "sudo systemctl stop ethercat",
        ),
        (
            "proc/net/packet",
            "sk RefCnt Type Proto\n0 3 3 88a4 2 1 0 0 1\n",
            "packet-sockets",
            Doubtful,
            "sudo ss -0 -p",
        ),
        ("proc/loadavg", "7.50 1 1 1/2 3\n", "load", Doubtful, "top -o %CPU"),
        (
            "proc/irq/33/smp_affinity_list",
            "0-1\n",
            "interrupt-affinity",
            Doubtful,
            "tee /proc/irq/33/smp_affinity_list",
        ),
        (
            "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor",
            "powersave\n",
            "clock-rate",
            Doubtful,
            "echo performance | sudo tee",
        ),
        (
            "sys/devices/system/cpu/cpu1/cpuidle/state1/latency",
            "133\n",
            "idle-states",
            Doubtful,
            "sudo cpupower idle-set -D 20",
        ),
        (
            "sys/devices/system/cpu/isolated",
            "\n",
            "isolated-processors",
            Doubtful,
            "isolcpus=1 nohz_full=1",
        ),
        (
            "sys/class/net/eth7/statistics/rx_missed_errors",
            "17\n",
            "dropped-frames",
            Doubtful,
            "linesman diagnose",
        ),
        (
            "sys/class/net/eth7/statistics/rx_crc_errors",
            "3\n",
            "damaged-frames",
            Doubtful,
            "linesman diagnose",
        ),
        (
            "sys/class/net/eth7/device/power/control",
            "auto\n",
            "card-power-saving",
            Doubtful,
            "echo on | sudo tee /sys/class/net/eth7/device/power/control",
        ),
    ];
    for (path, text, name, outcome, mend) in rows {
        let folder = computer();
        write(folder.path(), path, text);
        let all = checks(&folder, QUICK);
        let check = one(&all, name);
        assert_eq!(check.outcome, *outcome, "{check:?}");
        assert!(check.mend.iter().any(|command| command.contains(mend)), "{check:?}");
        assert!(!check.effect.is_empty(), "{check:?}");
        let rights = *path == "proc/self/status";
        let others =
            all.iter().filter(|check| check.name != *name && check.outcome > Outcome::Unknown);
        assert!(rights || others.count() == 0, "{name}: only this one");
    }
}

#[test]
fn what_a_driver_says_is_judged_too() {
    type Change = fn(&mut DriverSettings);
    let rows: [(Change, &str, &str); 6] = [
        (
            |s| s.receive_delay_us = Some(33),
            "interrupt-moderation",
            "sudo ethtool -C eth7 adaptive-rx off rx-usecs 0",
        ),
        (|s| s.adaptive_receive_delay = Some(true), "interrupt-moderation", "sudo ethtool -C eth7"),
        (|s| s.generic_receive_offload = Some(true), "offloads", "sudo ethtool -K eth7 gro off"),
        (|s| s.large_receive_offload = Some(true), "offloads", "sudo ethtool -K eth7 lro off"),
        (
            |s| s.energy_efficient = Some(true),
            "energy-efficient-ethernet",
            "sudo ethtool --set-eee eth7 eee off",
        ),
        (|s| s.receive_ring = Some((16, 4096)), "receive-ring", "sudo ethtool -G eth7 rx 1024"),
    ];
    for (change, name, mend) in rows {
        let mut settings = QUICK;
        change(&mut settings);
        let check = one(&checks(&computer(), settings), name);
        assert_eq!(check.outcome, Outcome::Doubtful, "{check:?}");
        assert!(check.mend[0].starts_with(mend), "{check:?}");
    }
    let unknown = one(&checks(&computer(), DriverSettings::default()), "interrupt-moderation");
    assert_eq!(unknown.outcome, Outcome::Unknown, "what is not known is not blamed");
}

#[test]
fn a_card_in_a_bridge_and_one_that_is_not_there_are_obstacles() {
    let folder = computer();
    symlink("../br0", folder.path().join("sys/class/net/eth7/master")).unwrap();
    let check = one(&checks(&folder, QUICK), "bridge-or-bond");
    assert_eq!((check.outcome, check.found.as_str()), (Outcome::Bad, "eth7 belongs to br0"));
    assert_eq!(check.mend, ["sudo ip link set eth7 nomaster"]);
    let all = inspect(&Files::below(folder.path()), &[("eth9".to_owned(), QUICK)]);
    assert_eq!(one(&all, "present").outcome, Outcome::Bad);
}

#[test]
fn an_empty_folder_is_unknown_and_not_good() {
    let folder = TempDir::new().unwrap();
    let checks = inspect(&Files::below(folder.path()), &[]);
    for name in
        ["raw-sockets", "preemption", "real-time-throttling", "clock-rate", "idle-states", "load"]
    {
        assert_eq!(one(&checks, name).outcome, Outcome::Unknown, "{name}");
    }
}

/// What is well for Ethernet over EtherCAT.
const NETWORK: [(&str, &str); 7] = [
    ("proc/self/status", "CapEff:\t0000000000001000\n"),
    ("proc/misc", "200 tun\n237 loop-control\n"),
    ("proc/modules", "nf_tables 200000 0 - Live 0x0\n"),
    ("proc/sys/net/ipv4/ip_forward", "1\n"),
    ("proc/sys/net/ipv4/icmp_echo_ignore_all", "0\n"),
    ("proc/sys/net/ipv4/conf/all/rp_filter", "0\n"),
    (
        "proc/net/route",
        "Iface\tDestination\tGateway\tFlags\tRefCnt\tUse\tMetric\tMask\tMTU\tWindow\tIRTT\n\
         eth0\t00000000\tCD0410AC\t0003\t0\t0\t0\t00000000\t0\t0\t0\n\
         eoe0\t0001A8C0\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0\n",
    ),
];

#[test]
fn network_settings_are_checked_one_by_one() {
    let judged = |change: Option<(&str, &str)>, interface: &str| {
        let folder = TempDir::new().unwrap();
        for (path, text) in NETWORK {
            write(folder.path(), path, text);
        }
        if let Some((path, text)) = change {
            write(folder.path(), path, text);
        }
        inspect_network(&Files::below(folder.path()), Some(interface), None)
    };
    let well = judged(None, "eoe0");
    assert!(well.iter().all(|check| check.outcome == Outcome::Good), "{well:#?}");
    let routes = well.iter().find(|check| check.name == "routes").unwrap();
    assert_eq!(routes.found, "0.0.0.0/0 via 172.16.4.205 dev eth0, 192.168.1.0/24 dev eoe0");
    for (name, path, text) in [
        ("interface-rights", "proc/self/status", "CapEff:\t0000000000002000\n"),
        ("tap-interfaces", "proc/misc", "237 loop-control\n"),
        ("firewall", "proc/modules", "nf_tables 200000 12 - Live 0x0\n"),
        ("firewall", "proc/net/ip_tables_names", "filter\n"),
        ("forwarding", "proc/sys/net/ipv4/ip_forward", "0\n"),
        ("ping-answers", "proc/sys/net/ipv4/icmp_echo_ignore_all", "1\n"),
        ("reverse-path", "proc/sys/net/ipv4/conf/eoe0/rp_filter", "1\n"),
    ] {
        let checks = judged(Some((path, text)), "eoe0");
        let bad: Vec<_> =
            checks.iter().filter(|check| check.outcome == Outcome::Doubtful).collect();
        assert_eq!(bad.len(), 1, "{name}: {checks:#?}");
        assert_eq!(bad[0].name, name);
        assert!(!bad[0].mend.is_empty() && !bad[0].effect.is_empty(), "{name}");
    }
    let elsewhere = judged(None, "eoe7");
    let routes = elsewhere.iter().find(|check| check.name == "routes").unwrap();
    assert_eq!(routes.outcome, Outcome::Doubtful, "{routes:?}");
}
