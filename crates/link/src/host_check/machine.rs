//! Machine beneath the kernel: a hypervisor or a container, and the time it takes away.

use super::{Area, Check, Files, Outcome};

pub(super) fn checks(files: &Files) -> Vec<Check> {
    [Some(virtual_machine(files)), stolen_time(files), Some(container(files))]
        .into_iter()
        .flatten()
        .collect()
}

fn virtual_machine(files: &Files) -> Check {
    const NAME: &str = "virtual-machine";
    let version = files.text("proc/version").unwrap_or_default().to_lowercase();
    let maker = files.text("sys/class/dmi/id/sys_vendor");
    let product = files.text("sys/class/dmi/id/product_name");
    let kind = if version.contains("microsoft") {
        Some("the Windows subsystem for Linux".to_owned())
    } else if let Some(kind) = files.text("sys/hypervisor/type").filter(|kind| !kind.is_empty()) {
        Some(kind)
    } else {
        let flags = files.text("proc/cpuinfo").is_some_and(|text| {
            let mut lines = text.lines().filter(|line| line.starts_with("flags"));
            lines.any(|line| line.split_whitespace().any(|flag| flag == "hypervisor"))
        });
        flags.then(|| maker.into_iter().chain(product).collect::<Vec<_>>().join(" "))
    };
    match kind {
        None => Check::good(Area::Machine, NAME, "none: this is the computer itself"),
        Some(kind) => {
            let by = if kind.is_empty() { String::new() } else { format!(" ({kind})") };
            Check::new(Area::Machine, NAME, Outcome::Doubtful, format!("this is a virtual machine{by}"))
                .effect(
                    "another computer's scheduler decides when a cycle begins; frames pass through a \
                     virtual switch, which may drop or delay them, and card counters are not the card's",
                )
                .mend("run Linesman on the computer that has the card")
                .mend("or pass the card itself through (PCI passthrough) and give the machine CPUs of its own")
        }
    }
}

/// Ticks that the hypervisor gave to others: field 8 of the line `cpu` in /proc/stat, proc_stat(5).
fn stolen_time(files: &Files) -> Option<Check> {
    const NAME: &str = "stolen-time";
    let stat = files.text("proc/stat")?;
    let line = stat.lines().find_map(|line| line.strip_prefix("cpu "))?;
    let ticks: Vec<u64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let stolen = *ticks.get(7)?;
    let all: u64 = ticks.iter().take(8).sum();
    if stolen == 0 || all == 0 {
        return Some(Check::good(Area::Machine, NAME, "no processor time was taken away"));
    }
    let share = stolen as f64 * 100.0 / all as f64;
    let found =
        format!("{share:.2} % of the processor time since the start went to other machines");
    let outcome = if share >= 0.1 { Outcome::Bad } else { Outcome::Doubtful };
    Some(
        Check::new(Area::Machine, NAME, outcome, found)
            .effect("cycles stand still meanwhile: watchdogs expire although this system was idle")
            .mend("give the virtual machine processors that no other machine shares"),
    )
}

fn container(files: &Files) -> Check {
    const NAME: &str = "container";
    let marks = [(".dockerenv", "Docker"), ("run/.containerenv", "Podman")];
    let marked = marks.into_iter().find(|(path, _)| files.has(path)).map(|(_, kind)| kind);
    let groups = files.text("proc/1/cgroup").unwrap_or_default();
    let grouped = ["docker", "kubepods", "lxc", "containerd"];
    let grouped = grouped.into_iter().find(|word| groups.contains(word));
    match marked.or(grouped) {
        None => Check::good(Area::Machine, NAME, "none"),
        Some(kind) => Check::new(
            Area::Machine,
            NAME,
            Outcome::Doubtful,
            format!("inside a container ({kind})"),
        )
        .effect("it sees only the cards it was given, and real-time priority is mostly refused")
        .mend(
            "start the container with --network=host --cap-add=NET_RAW --cap-add=SYS_NICE \
                     --cap-add=IPC_LOCK --ulimit rtprio=99 --ulimit memlock=-1",
        ),
    }
}
