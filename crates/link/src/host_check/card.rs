//! The network card: how it holds frames back, what it dropped, who else uses it.

use super::{Area, Check, Files, Outcome};

/// What only a card's driver knows; `None` where it does not say.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct DriverSettings {
    /// How long the card may hold back received frames to report several at once, in µs.
    pub receive_delay_us: Option<u32>,
    /// Whether it chooses that time itself, by load.
    pub adaptive_receive_delay: Option<bool>,
    /// How long it may hold back the report that frames were sent, in µs.
    pub send_delay_us: Option<u32>,
    /// Whether received frames are put together into larger ones by the kernel (GRO).
    pub generic_receive_offload: Option<bool>,
    /// Whether received frames are put together into larger ones by the card (LRO).
    pub large_receive_offload: Option<bool>,
    /// Whether the link sleeps between frames (Energy Efficient Ethernet).
    pub energy_efficient: Option<bool>,
    /// Received frames that the card has room for, now and at most.
    pub receive_ring: Option<(u32, u32)>,
}

/// More than this, in µs, is seen in cycles of 1 ms.
const DELAY_US: u32 = 10;

/// Counters of a card that say frames were lost in this computer: the file, what it means.
/// Reference: `Documentation/networking/statistics.rst`.
const LOSSES: [(&str, &str); 6] = [
    ("rx_dropped", "received and dropped by the kernel, also those that nobody wanted"),
    ("rx_missed_errors", "received while the card had no buffer: the host was too slow"),
    ("rx_fifo_errors", "received while the card's memory was full"),
    ("rx_over_errors", "received and longer than the buffers"),
    ("tx_dropped", "dropped before they were sent"),
    ("tx_errors", "not sent for an error"),
];

/// Counters that say frames came damaged: the last hop of the line, or the card.
const DAMAGES: [&str; 3] = ["rx_crc_errors", "rx_frame_errors", "rx_length_errors"];

pub(super) fn checks(files: &Files, name: &str, settings: &DriverSettings) -> Vec<Check> {
    if !files.has(&format!("sys/class/net/{name}")) {
        let found = format!("{name}: the kernel has no such card");
        return vec![
            Check::new(Area::Card, "present", Outcome::Bad, found)
                .effect("nothing can be sent")
                .mend("linesman interfaces   # lists the cards there are"),
        ];
    }
    let mut checks = vec![
        sharing(files, name),
        receive_delay(name, settings),
        receive_offload(name, settings),
        energy(name, settings),
        receive_ring(name, settings),
        runtime_power(files, name),
        losses(files, name),
        damages(files, name),
    ];
    checks.extend(interrupt(files, name));
    checks
}

fn sharing(files: &Files, name: &str) -> Check {
    const NAME: &str = "bridge-or-bond";
    let folder = format!("sys/class/net/{name}");
    if let Some(owner) = files.link_name(&format!("{folder}/master")) {
        return Check::new(Area::Card, NAME, Outcome::Bad, format!("{name} belongs to {owner}"))
            .effect("it takes the frames away before they reach Linesman, or sends its own between them")
            .mend(format!("sudo ip link set {name} nomaster"));
    }
    for kind in ["bridge", "bonding", "wireless"] {
        if files.has(&format!("{folder}/{kind}")) {
            return Check::new(
                Area::Card,
                NAME,
                Outcome::Bad,
                format!("{name} is no card: {kind}"),
            )
            .effect("frames are spread, learnt or held back; EtherCAT needs the cable itself")
            .mend("linesman interfaces   # lists the cards that suit");
        }
    }
    Check::good(Area::Card, NAME, format!("{name} belongs to no bridge and no bond"))
}

fn receive_delay(name: &str, settings: &DriverSettings) -> Check {
    const NAME: &str = "interrupt-moderation";
    let adaptive = settings.adaptive_receive_delay == Some(true);
    match settings.receive_delay_us {
        None => Check::unknown(Area::Card, NAME, format!("{name}: the driver does not tell")),
        Some(us) if us > DELAY_US || adaptive => {
            let by = if adaptive { ", and changes that by load" } else { "" };
            let found = format!("{name} holds received frames back for up to {us} µs{by}");
            Check::new(Area::Card, NAME, Outcome::Doubtful, found)
                .effect("answers come late and unevenly: a cycle below 1 ms misses them")
                .mend(format!(
                    "sudo ethtool -C {name} adaptive-rx off rx-usecs 0 rx-frames 1 tx-usecs 0"
                ))
        }
        Some(us) => Check::good(Area::Card, NAME, format!("{name}: {us} µs")),
    }
}

fn receive_offload(name: &str, settings: &DriverSettings) -> Check {
    const NAME: &str = "offloads";
    let (gro, lro) = (settings.generic_receive_offload, settings.large_receive_offload);
    if gro.is_none() && lro.is_none() {
        return Check::unknown(Area::Card, NAME, format!("{name}: the driver does not tell"));
    }
    let on: Vec<&str> = [(gro, "gro"), (lro, "lro")]
        .into_iter()
        .filter_map(|(on, word)| (on == Some(true)).then_some(word))
        .collect();
    if on.is_empty() {
        return Check::good(Area::Card, NAME, format!("{name}: none on the way in"));
    }
    let off: Vec<String> = on.iter().map(|word| format!("{word} off")).collect();
    let found = format!("{name}: {} on", on.join(", "));
    Check::new(Area::Card, NAME, Outcome::Doubtful, found)
        .effect("the kernel may wait for more frames before it hands one on")
        .mend(format!("sudo ethtool -K {name} {}", off.join(" ")))
}

fn energy(name: &str, settings: &DriverSettings) -> Check {
    const NAME: &str = "energy-efficient-ethernet";
    match settings.energy_efficient {
        None => Check::unknown(Area::Card, NAME, format!("{name}: the driver does not tell")),
        Some(false) => Check::good(Area::Card, NAME, format!("{name}: off")),
        Some(true) => Check::new(Area::Card, NAME, Outcome::Doubtful, format!("{name}: on"))
            .effect("the link sleeps between frames and needs some 30 µs to wake up; EtherCAT has no such sleep")
            .mend(format!("sudo ethtool --set-eee {name} eee off")),
    }
}

fn receive_ring(name: &str, settings: &DriverSettings) -> Check {
    const NAME: &str = "receive-ring";
    match settings.receive_ring {
        None => Check::unknown(Area::Card, NAME, format!("{name}: the driver does not tell")),
        Some((now, most)) if now < 64 && most > now => {
            let found = format!("{name} has room for {now} received frames, of {most} at most");
            Check::new(Area::Card, NAME, Outcome::Doubtful, found)
                .effect("a burst of frames does not fit while the host is busy")
                .mend(format!("sudo ethtool -G {name} rx {}", most.min(1024)))
        }
        Some((now, _)) => {
            Check::good(Area::Card, NAME, format!("{name} has room for {now} received frames"))
        }
    }
}

fn runtime_power(files: &Files, name: &str) -> Check {
    const NAME: &str = "card-power-saving";
    let file = format!("sys/class/net/{name}/device/power/control");
    match files.text(&file).as_deref() {
        None => Check::unknown(Area::Card, NAME, format!("{name}: there is no such setting")),
        Some("on") => Check::good(Area::Card, NAME, format!("{name}: off")),
        Some(_) => {
            Check::new(Area::Card, NAME, Outcome::Doubtful, format!("{name} may be put to sleep"))
                .effect("the first frames after a pause are late or lost")
                .mend(format!("echo on | sudo tee /{file}"))
        }
    }
}

fn losses(files: &Files, name: &str) -> Check {
    const NAME: &str = "dropped-frames";
    let folder = format!("sys/class/net/{name}/statistics");
    let count = |(file, _): &(&str, &str)| files.number::<u64>(&format!("{folder}/{file}"));
    if LOSSES.iter().all(|entry| count(entry).is_none()) {
        return Check::unknown(Area::Card, NAME, format!("{name}: no counters"));
    }
    let risen = LOSSES.iter().filter_map(|entry| Some((entry, count(entry)?)));
    let risen: Vec<String> = risen
        .filter(|(_, count)| *count > 0)
        .map(|((file, meaning), count)| format!("{file} {count} ({meaning})"))
        .collect();
    if risen.is_empty() {
        return Check::good(Area::Card, NAME, format!("{name}: none since the driver was loaded"));
    }
    Check::new(Area::Card, NAME, Outcome::Doubtful, format!("{name}: {}", risen.join(", ")))
        .effect("such frames look lost on the line although no cable is to blame; only what rises counts")
        .mend(format!("linesman diagnose {name}   # tells whether they rise, and when; beside a MainDevice at work: listen:{name}"))
        .mend(format!("sudo ethtool -S {name} | grep -iE 'drop|miss|err'   # the driver's own counters"))
}

fn damages(files: &Files, name: &str) -> Check {
    const NAME: &str = "damaged-frames";
    let folder = format!("sys/class/net/{name}/statistics");
    let counts = DAMAGES.map(|file| (file, files.number::<u64>(&format!("{folder}/{file}"))));
    if counts.iter().all(|(_, count)| count.is_none()) {
        return Check::unknown(Area::Card, NAME, format!("{name}: no counters"));
    }
    let risen = counts.iter().filter(|(_, count)| count.is_some_and(|count| count > 0));
    let risen: Vec<String> =
        risen.map(|(file, count)| format!("{file} {}", count.unwrap_or(0))).collect();
    if risen.is_empty() {
        return Check::good(Area::Card, NAME, format!("{name}: none since the driver was loaded"));
    }
    Check::new(Area::Card, NAME, Outcome::Doubtful, format!("{name}: {}", risen.join(", ")))
        .effect(
            "frames came back damaged: by the cable between card and first SubDevice, by the card, or \
             anywhere on the line, since a damaged frame travels on to the card",
        )
        .mend(format!("linesman diagnose {name}   # tells where, from the SubDevices' counters"))
}

/// Where the card's interrupts go. They should reach a processor that does nothing else, and stay there.
fn interrupt(files: &Files, name: &str) -> Option<Check> {
    const NAME: &str = "interrupt-affinity";
    let table = files.text("proc/interrupts")?;
    let is_of_card = |line: &&str| {
        let last = line.split_whitespace().next_back().unwrap_or_default();
        last == name || last.starts_with(&format!("{name}-"))
    };
    let numbers: Vec<&str> = table
        .lines()
        .filter(is_of_card)
        .filter_map(|line| line.trim().split_once(':').map(|(number, _)| number))
        .collect();
    let first = numbers.first()?;
    let all = files.text("sys/devices/system/cpu/online").unwrap_or_default();
    let to = files.text(&format!("proc/irq/{first}/smp_affinity_list"))?;
    let is_free = to == all && files.processors().len() > 1;
    if !is_free {
        return Some(Check::good(
            Area::Card,
            NAME,
            format!("{name}: interrupt {first} goes to processor {to}"),
        ));
    }
    let found = format!("{name}: interrupt {first} may go to any processor ({to})");
    let commands = numbers.iter().map(|number| {
        format!("echo 0 | sudo tee /proc/irq/{number}/smp_affinity_list   # or the processor of the cycle")
    });
    let check = Check::new(Area::Card, NAME, Outcome::Doubtful, found)
        .effect("it moves between processors: some cycles get their answers later than others");
    Some(commands.fold(check, Check::mend))
}
