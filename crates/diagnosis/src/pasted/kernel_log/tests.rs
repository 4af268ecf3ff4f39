//! Kernel logs as the master writes them.

#![allow(clippy::wildcard_enum_match_arm, reason = "helpers of tests")]

use super::super::text::lines;
use super::*;
use crate::observation_file::Count;

fn facts(text: &str) -> Vec<FactKind> {
    take(&lines(text)).unwrap().facts.into_iter().map(|fact| fact.what).collect()
}

fn mains(text: &str) -> Vec<ObservedMainDevice> {
    let told = facts(text).into_iter().filter_map(|what| match what {
        FactKind::Main(main) | FactKind::Added(main) => Some(*main),
        _ => None,
    });
    told.filter(|main| *main != ObservedMainDevice::default()).collect()
}

#[test]
fn senders_of_all_versions_are_told() {
    for (text, expected) in [
        ("EtherCAT 0: Scanning bus.", Some((MessageSource::Master(0), "Scanning bus."))),
        (
            "EtherCAT WARNING 0: 1 datagram TIMED OUT!",
            Some((MessageSource::Master(0), "1 datagram TIMED OUT!")),
        ),
        ("EtherCAT ERROR 0-3: x", Some((MessageSource::Device(0, 3), "x"))),
        ("EtherCAT ERROR 1-main-12: x", Some((MessageSource::Device(1, 12), "x"))),
        ("EtherCAT: Master driver 1.5.2", Some((MessageSource::Module, "Master driver 1.5.2"))),
        ("EtherCAT ERROR 0-99999: x", None),
        ("EtherCAT is a field bus: yes", None),
    ] {
        assert_eq!(sender(text).map(|(from, text)| (from, text.trim())), expected, "{text}");
    }
}

#[test]
fn a_link_that_is_lost_takes_its_subdevices_and_a_start_does_not_count() {
    let text = "\
[  100.000000] EtherCAT: Master driver 1.5.2 unknown
[  100.100000] ec_igb 0000:02:00.0 eth0: Link is Down
[  102.000000] EtherCAT 0: Link state of ecm0 changed to UP.
[  102.100000] EtherCAT 0: 4 slave(s) responding on main device.
[  102.200000] EtherCAT WARNING 0: 1 datagram TIMED OUT!
[  500.000000] EtherCAT 0: Link state of ecm0 changed to DOWN.
[  500.100000] EtherCAT WARNING 0: 13 datagrams TIMED OUT!
[  500.100001] EtherCAT WARNING 0: 19 datagrams UNMATCHED!
[  500.200000] EtherCAT 0: 0 slave(s) responding on main device.
";
    let told = mains(text);
    let links: Vec<_> = told.iter().filter_map(|main| main.link).collect();
    assert_eq!(links, [true, false], "the link was down before it came up first");
    let answering: Vec<_> = told.iter().filter_map(|main| main.answering).collect();
    assert_eq!(answering, [4, 0]);
    let timed_out: Vec<_> = told.iter().filter_map(|main| main.timed_out).collect();
    assert_eq!(timed_out, [Count(13)], "one was of the start");
    let what = take(&lines(text)).unwrap().what;
    assert!(what.contains("1 count of a start"), "{what}");
}

#[test]
fn al_status_codes_states_and_refused_requests_are_of_their_subdevice() {
    let text = "\
EtherCAT ERROR 0-3: Failed to set SAFEOP state, slave refused state change (PREOP + ERROR).
EtherCAT ERROR 0-3: AL status message 0x001E: \"Invalid input configuration\".
EtherCAT 0-3: Acknowledged state PREOP.
EtherCAT ERROR 0-2: SDO download 0x1C12:01 (2 bytes) aborted.
EtherCAT ERROR 0-2: SDO abort message 0x06010002: \"Attempt to write a read-only object\".
EtherCAT WARNING 0-1: Slave did not sync after 5000 ms.
EtherCAT ERROR 0-5: Failed to check state PREOP: No response.
EtherCAT 0-3: Opening ports.
";
    let told = facts(text);
    let read: Vec<_> = told
        .iter()
        .filter_map(|what| match what {
            FactKind::Read(SubDeviceRef::Position(position), read) => {
                Some((*position, read.state.as_deref(), read.al_code.map(|code| code.0)))
            }
            _ => None,
        })
        .collect();
    assert_eq!(
        read,
        [
            (3, Some("ERR PREOP"), None),
            (3, None, Some(0x1E)),
            (3, Some("PREOP"), None),
            (1, None, None),
            (5, Some("INIT NO_COMM"), None),
        ]
    );
    assert!(told.iter().any(|what| matches!(
        what,
        FactKind::Abort {
            whom: SubDeviceRef::Position(2),
            index: 0x1C12,
            subindex: 1,
            code: 0x0601_0002
        }
    )));
}

#[test]
fn working_counters_count_from_when_they_were_first_complete() {
    let received = |text: &str| -> Vec<(Option<u16>, Option<u16>)> {
        let told = facts(text).into_iter().filter_map(|what| match what {
            FactKind::WorkingCounter(counter, _) => Some((counter.received, counter.expected)),
            _ => None,
        });
        told.collect()
    };
    let line = |text: &str| format!("EtherCAT 0: Domain 0: {text}\n");
    let start = [
        line("Logical address 0x00000000, 12 byte, expected working counter 9."),
        line("Working counter changed to 3/9."),
        line("2 working counter changes - now 9/9."),
    ]
    .concat();
    assert_eq!(received(&start), [(Some(9), Some(9))]);
    let fall = format!("{start}{}", line("Working counter changed to 7/9."));
    assert_eq!(received(&fall), [(Some(9), Some(9)), (Some(7), Some(9))]);
    let never =
        line("Working counter changed to 3/9.") + &line("Working counter changed to 6/9 (6+0).");
    assert_eq!(received(&never), [(Some(6), Some(9))]);
}

#[test]
fn states_and_skipped_datagrams_are_read() {
    let told = mains(
        "EtherCAT 0: Slave states on main device: SAFEOP + ERROR.\n\
         EtherCAT WARNING: Datagram 00000000a1b2c3d4 (domain0-0-main) was SKIPPED 3 times.\n\
         EtherCAT 0: Slave states on main device: INIT, OP.\nEtherCAT WARNING 0: 2 frames CORRUPTED!\n",
    );
    let states: Vec<_> = told.iter().filter_map(|main| main.states).collect();
    assert_eq!(states, [0x14, 0x09]);
    assert!(told.iter().any(|main| main.skipped == Some(Count(3))));
    assert!(told.iter().any(|main| main.corrupted == Some(Count(2))));
}

#[test]
fn other_lines_of_the_kernel_are_of_the_log_and_other_masters_are_left_aside() {
    let text = "\
[   10.5] usb 3-2: new full speed USB device
[   10.6] EtherCAT 0: 2 slave(s) responding on main device.
[   10.7] EtherCAT 1: 7 slave(s) responding on main device.
[   10.8] systemd[1]: hello
";
    let block = take(&lines(text)).unwrap();
    assert_eq!(block.lines, 4);
    assert!(
        block.what.contains("2 lines not of EtherCAT, 1 line of another master"),
        "{}",
        block.what
    );
    let answering: Vec<_> = mains(text).iter().filter_map(|main| main.answering).collect();
    assert_eq!(answering, [2]);
    assert!(take(&lines("[   10.5] usb 3-2: new full speed USB device\n")).is_none());
}
