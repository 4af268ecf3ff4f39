//! The kernel: preemption, throttling of real-time programs, clock source, other MainDevices.

use super::{Area, Check, Files, Outcome};

pub(super) fn checks(files: &Files) -> Vec<Check> {
    vec![
        preemption(files),
        throttling(files),
        clock_source(files),
        other_maindevice(files),
        sockets_of_others(files),
    ]
}

fn preemption(files: &Files) -> Check {
    const NAME: &str = "preemption";
    let version = files.text("proc/version").unwrap_or_default();
    let is_real_time =
        files.text("sys/kernel/realtime").as_deref() == Some("1") || version.contains("PREEMPT_RT");
    if is_real_time {
        return Check::good(Area::Kernel, NAME, "a real-time kernel (PREEMPT_RT)");
    }
    if version.is_empty() {
        return Check::unknown(Area::Kernel, NAME, "/proc/version does not tell");
    }
    let kind = ["PREEMPT_DYNAMIC", "PREEMPT"].into_iter().find(|kind| version.contains(kind));
    let found = format!("no real-time kernel ({})", kind.unwrap_or("without preemption"));
    Check::new(Area::Kernel, NAME, Outcome::Doubtful, found)
        .effect(
            "a cycle may begin some 100 µs late, at times ms; enough for cycles of 2 ms and longer \
             without SYNC signals",
        )
        .mend("sudo apt install linux-image-rt-amd64   # Debian; of Ubuntu: sudo pro enable realtime-kernel")
}

fn throttling(files: &Files) -> Check {
    const NAME: &str = "real-time-throttling";
    let runtime: Option<i64> = files.number("proc/sys/kernel/sched_rt_runtime_us");
    let period: Option<i64> = files.number("proc/sys/kernel/sched_rt_period_us");
    match (runtime, period) {
        (Some(-1), _) => Check::good(Area::Kernel, NAME, "off"),
        (Some(runtime), Some(period)) if runtime >= period => {
            Check::good(Area::Kernel, NAME, "none: the whole period is for real-time programs")
        }
        (Some(0), _) => {
            Check::new(Area::Kernel, NAME, Outcome::Bad, "real-time programs get no time at all")
                .effect("real-time priority is refused")
                .mend("sudo sysctl -w kernel.sched_rt_runtime_us=-1")
        }
        (Some(runtime), Some(period)) => {
            let found = format!("real-time programs are stopped after {runtime} of {period} µs");
            Check::new(Area::Kernel, NAME, Outcome::Doubtful, found)
                .effect(
                    "a MainDevice that waits in a busy loop stands still for the rest of the period: \
                     a pause of up to 50 ms each second",
                )
                .mend("sudo sysctl -w kernel.sched_rt_runtime_us=-1")
        }
        (None, _) | (_, None) => {
            Check::unknown(Area::Kernel, NAME, "/proc/sys/kernel/sched_rt_runtime_us does not tell")
        }
    }
}

fn clock_source(files: &Files) -> Check {
    const NAME: &str = "clock-source";
    let folder = "sys/devices/system/clocksource/clocksource0";
    let Some(now) = files.text(&format!("{folder}/current_clocksource")) else {
        return Check::unknown(Area::Kernel, NAME, "the kernel does not tell");
    };
    if !matches!(now.as_str(), "hpet" | "acpi_pm" | "jiffies" | "refined-jiffies") {
        return Check::good(Area::Kernel, NAME, now);
    }
    let all = files.text(&format!("{folder}/available_clocksource")).unwrap_or_default();
    let check = Check::new(Area::Kernel, NAME, Outcome::Doubtful, format!("{now}: slow to read"))
        .effect("each look at the clock takes about a microsecond, and time stamps are coarse");
    if all.split_whitespace().any(|source| source == "tsc") {
        check.mend(format!("echo tsc | sudo tee /{folder}/current_clocksource"))
    } else {
        check.mend("look into `dmesg` why the kernel gave up tsc; mostly a matter of the BIOS")
    }
}

/// A MainDevice in the kernel takes the card for itself.
fn other_maindevice(files: &Files) -> Check {
    const NAME: &str = "other-maindevice";
    let modules = files.text("proc/modules").unwrap_or_default();
    let mut names = modules.lines().filter_map(|line| line.split_whitespace().next());
    match names.find(|name| *name == "ec_master") {
        None => Check::good(Area::Kernel, NAME, "no MainDevice in the kernel"),
        Some(module) => Check::new(
            Area::Kernel,
            NAME,
            Outcome::Bad,
            format!("the kernel module {module} is loaded: another MainDevice in the kernel"),
        )
        .effect("two MainDevices on one line read and write each other's SubDevices")
        .mend("sudo systemctl stop ethercat   # ends it until the next start")
        .mend("sudo systemctl disable ethercat"),
    }
}

/// Programs that read frames from a card: proc(5) does not list /proc/net/packet, its columns are
/// those of `net/packet/af_packet.c`: address, references, type, protocol, interface, …
fn sockets_of_others(files: &Files) -> Check {
    const NAME: &str = "packet-sockets";
    let Some(table) = files.text("proc/net/packet") else {
        return Check::unknown(Area::Kernel, NAME, "/proc/net/packet does not tell");
    };
    let all: Vec<Vec<&str>> =
        table.lines().skip(1).map(|line| line.split_whitespace().collect()).collect();
    // 88A4: EtherCAT; 0003: every frame.
    let ethercat =
        all.iter().filter(|row| row.get(3).is_some_and(|p| p.eq_ignore_ascii_case("88a4")));
    let every = all.iter().filter(|row| row.get(3) == Some(&"0003")).count();
    let ethercat = ethercat.count();
    if ethercat > 0 {
        let (sockets, are) = if ethercat == 1 { ("socket", "is") } else { ("sockets", "are") };
        let found = format!(
            "{ethercat} {sockets} for EtherCAT frames {are} open: a MainDevice or a virtual segment is at work"
        );
        return Check::new(Area::Kernel, NAME, Outcome::Doubtful, found)
            .effect("two MainDevices on one card disturb each other")
            .mend("sudo ss -0 -p   # shows whose sockets they are");
    }
    if every > 0 {
        let found = format!("{every} sockets take every frame: a recorder or a DHCP client");
        return Check::new(Area::Kernel, NAME, Outcome::Doubtful, found)
            .effect("each frame is copied for them, too: more work in each cycle")
            .mend("sudo ss -0 -p   # shows whose sockets they are");
    }
    Check::good(Area::Kernel, NAME, "no program takes frames directly from cards")
}
