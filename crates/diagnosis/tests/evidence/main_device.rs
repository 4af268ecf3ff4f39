//! MainDevices recognised in recordings of real lines, and of foreign programs beside the virtual segment.

#![allow(clippy::disallowed_macros, reason = "a test says what it skips")]

use crate::support::{read_capture, real_captures};
use linesman_diagnosis::main_device::{Access, Certainty, MainDeviceKind};
use linesman_diagnosis::report::MainDeviceReport;

/// Recording, kind, certainty.
///
/// Who sent is what the data's description says. The scans of two frames hold nothing that is of one kind alone, or
/// the destination address alone.
const ROWS: [(&str, MainDeviceKind, Certainty); 19] = {
    use Certainty::{Likely, None, Perhaps};
    use MainDeviceKind::{Ethercrab, Soem, Twincat, Unknown};
    [
        ("pcap/ec-replay-ek1100-alias-address.pcapng", Ethercrab, Likely),
        ("pcap/ec-replay-ek1100-el2828-el2889.pcapng", Ethercrab, Likely),
        ("pcap/ec-replay-ek1914-el3004-mailbox.pcapng", Ethercrab, Likely),
        ("pcap/echist-no-reborrow-202307.pcapng", Ethercrab, Likely),
        ("pcap/echist-replay-no-complete-access-202308.pcapng", Ethercrab, Likely),
        ("pcap/ec-rs-detect-slaves-ek1100-el1004.pcapng", Unknown, None),
        ("pcap/ec-soem-sdinfo-ek1100-el1004.pcapng", Soem, Likely),
        ("pcap/ec-soem-sdinfo-ek1100-only.pcapng", Soem, Likely),
        ("pcap/ec-soem-sdinfo-no-slaves.pcapng", Soem, Likely),
        ("pcap/ec-soem-single-lan9252.pcapng", Soem, Likely),
        ("pcap/ec-twincat-run-ek1100-el1004.pcapng", Twincat, Likely),
        ("pcap/ec-twincat-scan-devices-2.pcapng", Twincat, Perhaps),
        ("foreign/device-off.pcapng.gz", Soem, Likely),
        ("foreign/emergency.pcapng.gz", Soem, Likely),
        ("foreign/host-drops.pcapng.gz", Soem, Likely),
        ("foreign/soem-link-open-late.pcapng.gz", Soem, Likely),
        ("foreign/soem-ring.pcapng.gz", Soem, Likely),
        ("foreign/ecs-device-off-late.pcapng.gz", Soem, Likely),
        // libethercat numbers from 1000 and sends with the card's own address: none of those that have a name.
        ("foreign/lec-link-open-early.pcapng.gz", Unknown, None),
    ]
};

fn main_device(name: &str) -> Option<MainDeviceReport> {
    let folder = real_captures()?;
    let path = folder.parent().unwrap().join(name);
    if !path.exists() {
        eprintln!("SKIPPED: no {}", path.display());
        return None;
    }
    Some(read_capture(&path).diagnosis().main_device.unwrap())
}

#[test]
fn main_devices_of_recordings_are_recognised() {
    for (name, kind, certainty) in ROWS {
        let Some(found) = main_device(name) else { continue };
        assert_eq!((found.kind, found.certainty), (kind, certainty), "{name}: {found:?}");
        let is_named = kind != MainDeviceKind::Unknown;
        assert_eq!(!found.marks.is_empty(), is_named, "{name}: {found:?}");
    }
}

#[test]
fn twincat_polls_states_and_links_and_clears_the_counters_it_reads() {
    let Some(found) = main_device("pcap/ec-twincat-run-ek1100-el1004.pcapng") else { return };
    let polls: Vec<_> = found.polls.iter().map(|poll| (poll.register, poll.how)).collect();
    let expected = [
        (0x0111, Access::Station),
        (0x0130, Access::Station),
        (0x0300, Access::Station),
        (0x0300, Access::Cleared),
    ];
    assert_eq!(polls, expected, "{found:?}");
    let never: Vec<_> = found.never_reads.iter().map(|one| one.register).collect();
    assert_eq!(never, [0x0310], "{found:?}");
    assert_eq!(found.cycle_ns, None, "only its acyclic frames were recorded");
}

#[test]
fn soem_in_operation_reads_states_alone() {
    let Some(found) = main_device("foreign/host-drops.pcapng.gz") else { return };
    let never: Vec<_> = found.never_reads.iter().map(|one| one.register).collect();
    assert_eq!(never, [0x0110, 0x0300, 0x0310], "{found:?}");
    let states = found.polls.iter().find(|poll| poll.register == 0x0130).unwrap();
    assert_eq!((states.how, states.name.as_str()), (Access::Broadcast, "AL status"));
    // 115 broadcasts in 6 s.
    let every = states.every_ns.unwrap().0;
    assert!((45_000_000..65_000_000).contains(&every), "{every}");
    // 1,490 frames with process data in 6 s.
    let cycle = found.cycle_ns.unwrap().0;
    assert!((3_800_000..4_200_000).contains(&cycle), "{cycle}");
}

#[test]
fn the_step_that_gets_counters_is_that_of_the_kind_which_drives() {
    let Some(folder) = real_captures() else { return };
    let steps = |name: &str| {
        let report = read_capture(&folder.join(name)).diagnosis();
        let gaps = report.coverage.subjects.into_iter().flat_map(|subject| subject.gaps);
        gaps.filter_map(|gap| gap.next_step).collect::<Vec<_>>().join("\n")
    };
    let soem = steps("ec-soem-sdinfo-ek1100-el1004.pcapng");
    assert!(soem.contains("ecx_FPRD(port, slavelist[n].configadr, 0x0300"), "{soem}");
    let ethercrab = steps("ec-replay-ek1100-el2828-el2889.pcapng");
    assert!(ethercrab.contains("register_read::<[u8; 20]>(0x0300u16)"), "{ethercrab}");
}
