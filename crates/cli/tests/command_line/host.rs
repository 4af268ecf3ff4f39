//! `linesman host`: this computer, and a copy of another one's files, judged with the commands that mend.

use std::fs;

use crate::support::{assert_valid, linesman};

#[test]
fn a_copy_of_another_computer_is_judged_with_commands_to_mend() {
    let folder = tempfile::TempDir::new().unwrap();
    for (path, text) in [
        ("proc/self/status", "CapEff:\t00000000008a7fff\n"),
        ("proc/version", "Linux version 6.1 SMP PREEMPT_DYNAMIC"),
        ("proc/sys/kernel/sched_rt_runtime_us", "950000"),
        ("proc/sys/kernel/sched_rt_period_us", "1000000"),
        ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave"),
        ("sys/class/net/eth7/statistics/rx_missed_errors", "17"),
    ] {
        let path = folder.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    let root = folder.path().to_str().unwrap();
    let run = linesman(["host", "eth7", "--root", root]);
    assert_eq!(run.status, 1, "{}", run.all());
    for wanted in [
        "no real-time kernel",
        "mend:   sudo sysctl -w kernel.sched_rt_runtime_us=-1",
        "mend:   echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
        "rx_missed_errors 17",
        "Nothing was changed",
    ] {
        assert!(run.stdout.contains(wanted), "`{wanted}` is missing:\n{}", run.stdout);
    }
    let run = linesman(["host", "eth7", "--root", root, "--json"]);
    let report = run.json();
    assert_valid(&report, "host");
    assert_eq!((run.status, &report["schema"]), (1, &"linesman.host/1".into()));
    let checks = report["checks"].as_array().unwrap();
    let governor = checks.iter().find(|check| check["name"] == "clock-rate").unwrap();
    assert_eq!(governor["outcome"], "doubtful");
}

#[test]
fn this_computer_is_measured_against_the_cycle() {
    let run = linesman(["host", "--measure", "1", "--cycle-us", "10000", "--json"]);
    let report = run.json();
    assert_valid(&report, "host");
    let jitter = &report["jitter"];
    assert_eq!(
        (jitter["cycle_us"].as_f64(), jitter["cycles"].as_u64()),
        (Some(10_000.0), Some(100))
    );
    assert!(jitter["latest_us"].as_f64() >= jitter["median_us"].as_f64(), "{jitter}");
}

#[test]
fn a_folder_or_card_that_is_not_there_is_told() {
    let run = linesman(["host", "--root", "/nowhere/at/all"]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("/nowhere/at/all: no such folder"), "{}", run.stderr);
    let run = linesman(["host", "eth4711"]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("eth4711"), "{}", run.stderr);
}
