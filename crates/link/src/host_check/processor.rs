//! The processors: clock rate, idle states, isolation, load.

use super::{Area, Check, Files, Outcome};

/// A processor that needs longer than this to wake up, in µs, is seen in cycles of 1 ms.
const WAKE_US: u64 = 20;

pub(super) fn checks(files: &Files) -> Vec<Check> {
    vec![governor(files), idle_states(files), isolation(files), load(files)]
}

fn governor(files: &Files) -> Check {
    const NAME: &str = "clock-rate";
    let cpus = files.processors();
    let of = |cpu: &String| {
        files.text(&format!("sys/devices/system/cpu/{cpu}/cpufreq/scaling_governor"))
    };
    let governors: Vec<String> = cpus.iter().filter_map(of).collect();
    if governors.is_empty() {
        return Check::unknown(Area::Processor, NAME, "the kernel does not set clock rates");
    }
    let slow = governors.iter().filter(|governor| *governor != "performance");
    let (slow, first) = (slow.clone().count(), slow.clone().next());
    match first {
        None => Check::good(Area::Processor, NAME, "always the highest (performance)"),
        Some(governor) => {
            let count = governors.len();
            let found = format!("{slow} of {count} processors lower their clock rate ({governor})");
            Check::new(Area::Processor, NAME, Outcome::Doubtful, found)
                .effect("a cycle takes longer after a time of little work, and begins unevenly")
                .mend(
                    "echo performance | sudo tee \
                     /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
                )
        }
    }
}

fn idle_states(files: &Files) -> Check {
    const NAME: &str = "idle-states";
    let mut deepest: Option<(u64, String, String)> = None;
    let mut known = false;
    for cpu in files.processors() {
        let folder = format!("sys/devices/system/cpu/{cpu}/cpuidle");
        for state in files.names(&folder) {
            let Some(latency) = files.number::<u64>(&format!("{folder}/{state}/latency")) else {
                continue;
            };
            known = true;
            let disabled = files.text(&format!("{folder}/{state}/disable"));
            let is_deeper = deepest.as_ref().is_none_or(|(most, ..)| latency > *most);
            if disabled.as_deref() != Some("1") && is_deeper {
                let name = files.text(&format!("{folder}/{state}/name"));
                deepest = Some((latency, name.unwrap_or_default(), state));
            }
        }
    }
    match deepest {
        Some((latency, name, _)) if latency > WAKE_US => {
            let found = format!("processors sleep as deep as {name}: {latency} µs to wake up");
            Check::new(Area::Processor, NAME, Outcome::Doubtful, found)
                .effect("each cycle begins late by that, and unevenly")
                .mend(format!("sudo cpupower idle-set -D {WAKE_US}   # until the next start"))
                .mend("or for good: add `processor.max_cstate=1 intel_idle.max_cstate=0` to the kernel's command line")
        }
        Some((latency, name, _)) => {
            Check::good(Area::Processor, NAME, format!("at most {name}: {latency} µs to wake up"))
        }
        None if known => Check::good(Area::Processor, NAME, "all are switched off"),
        None => Check::unknown(Area::Processor, NAME, "the kernel tells of none"),
    }
}

fn isolation(files: &Files) -> Check {
    const NAME: &str = "isolated-processors";
    let isolated = files.text("sys/devices/system/cpu/isolated").unwrap_or_default();
    if !isolated.is_empty() {
        let found = format!("{isolated}; take one with `linesman run --cpu`");
        return Check::good(Area::Processor, NAME, found);
    }
    let count = files.processors().len();
    match count {
        0 => Check::unknown(Area::Processor, NAME, "the kernel does not tell"),
        1 => Check::new(Area::Processor, NAME, Outcome::Doubtful, "there is only one processor")
            .effect("every interrupt and every program shares it with the cycle")
            .mend("use a computer with two processors or more"),
        _ => {
            let last = count - 1;
            let found = format!("none of the {count} is kept free of other programs");
            Check::new(Area::Processor, NAME, Outcome::Doubtful, found)
                .effect("other programs and interrupts may delay the cycle by some 10 µs")
                .mend(format!(
                    "add `isolcpus={last} nohz_full={last} rcu_nocbs={last}` to the kernel's command \
                     line, start anew, and run with `--cpu {last}`"
                ))
        }
    }
}

fn load(files: &Files) -> Check {
    const NAME: &str = "load";
    let count = files.processors().len().max(1);
    let load = files
        .text("proc/loadavg")
        .and_then(|text| text.split_whitespace().next().and_then(|word| word.parse::<f64>().ok()));
    match load {
        None => Check::unknown(Area::Processor, NAME, "/proc/loadavg does not tell"),
        Some(load) if load > count as f64 => {
            let found = format!("{load} programs want to run on {count} processors (last minute)");
            Check::new(Area::Processor, NAME, Outcome::Doubtful, found)
                .effect("without real-time priority a cycle waits for its turn")
                .mend("end what is not needed: `top -o %CPU` shows it")
        }
        Some(load) => Check::good(Area::Processor, NAME, format!("{load} on {count} processors")),
    }
}
