//! The manual page of a kind of fault: the comment at the head of its file.

use linesman_config::fault::FaultName;

/// The file of each kind, by its name with `_` for `-`.
macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!($name, ".rs")))),*]
    };
}

const FILES: &[(&str, &str)] = files![
    "brown_out",
    "cable_degraded",
    "clock_drift",
    "config_mismatch",
    "cycle_too_fast",
    "device_extra",
    "device_internal",
    "device_missing",
    "device_off",
    "device_wrong",
    "devices_swapped",
    "duplicate_address",
    "early_link",
    "ebus_overload",
    "emc_noise",
    "emergency",
    "eoe_fault",
    "false_link",
    "firmware_fault",
    "foreign_frames",
    "host_drops",
    "host_jitter",
    "init_refused",
    "late_frames",
    "link_flapping",
    "link_open",
    "mailbox_error",
    "mailbox_slow",
    "mailbox_stuck",
    "maindevice_wrong_port",
    "nic_damaged",
    "ports_swapped",
    "receiver_damaged",
    "reference_clock_lost",
    "ring_open",
    "second_maindevice",
    "supply_off",
    "sync_lost",
    "transmitter_damaged",
    "twins_swapped",
    "watchdog_starved",
];

/// What happens on the line with a fault of this name, in Markdown; empty when there is no page.
#[must_use]
pub fn manual(name: FaultName) -> String {
    let file = name.name().replace('-', "_");
    let source = FILES.iter().find(|(known, _)| *known == file).map_or("", |(_, text)| text);
    let head = source.lines().take_while(|line| line.starts_with("//!"));
    let mut text = String::new();
    for line in head {
        let line = line.trim_start_matches("//!");
        text.push_str(line.strip_prefix(' ').unwrap_or(line));
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_begins_with_the_name() {
        let page = manual(FaultName::LinkOpen);
        assert!(page.starts_with("`link-open`: "), "{page}");
        assert!(page.contains("detection time"), "{page}");
        assert_eq!(manual(FaultName::OneSidedRecording), "");
    }
}
