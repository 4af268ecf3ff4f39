//! Captures of real hardware through the whole engine: how many SubDevices, which state, how many
//! datagrams, and no fault that is not there.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod support;

use linesman_config::fault::Class;
use linesman_diagnosis::report::Verdict;
use linesman_proto::address::Network;
use support::{read_capture, real_captures, text};

/// Name, SubDevices, highest AL state, requests, datagrams of requests, unanswered requests that
/// tshark shows without a return.
const ROWS: [(&str, u64, Option<&str>, u64); 17] = [
    ("ec-replay-ek1100-alias-address", 3, Some("PREOP"), 650),
    ("ec-replay-ek1100-el2828-el2889", 3, Some("OP"), 2062),
    ("ec-replay-ek1914-el3004-configure", 2, Some("PREOP"), 552),
    ("ec-replay-ek1914-el3004-mailbox", 2, Some("PREOP"), 497),
    ("ec-replay-ek1914-segmented-upload", 2, Some("PREOP"), 482),
    ("ec-rs-detect-slaves-ek1100-el1004", 2, None, 1),
    ("ec-soem-sdinfo-ek1100-el1004", 2, Some("PREOP"), 290),
    ("ec-soem-sdinfo-ek1100-only", 1, Some("PREOP"), 94),
    ("ec-soem-sdinfo-no-slaves", 0, None, 19),
    ("ec-soem-single-lan9252", 1, Some("PREOP"), 499),
    ("ec-twincat-run-ek1100-el1004", 2, Some("OP"), 291),
    ("ec-twincat-scan-devices-2", 2, None, 6),
    ("echist-no-reborrow-202307", 3, Some("OP"), 2850),
    ("echist-replay-el2828-el2889-202405", 3, Some("OP"), 9982),
    ("echist-replay-mailbox-el3004", 2, Some("PREOP"), 896),
    ("echist-replay-no-complete-access-202308", 1, Some("PREOP"), 1996),
    ("echist-replay-segmented-upload-202401", 1, Some("PREOP"), 312),
];

#[test]
fn every_real_capture_is_read_as_what_it_is() {
    let Some(folder) = real_captures() else { return };
    for (name, devices, state, datagrams) in ROWS {
        let engine = read_capture(&folder.join(format!("{name}.pcapng")));
        let report = engine.diagnosis();
        let line = engine.line(Network(0)).unwrap();
        println!(
            "{name}: {} devices, {:?}, {} datagrams, {} unanswered, {} lost, {:?}; {}",
            report.network.devices.0,
            report.network.al_state_highest,
            report.network.datagrams.0,
            report.network.unanswered.0,
            report.network.lost.0,
            report.verdict,
            line.devices
                .iter()
                .map(|device| format!(
                    "{}: {:?} {:?} {:?} {:?};",
                    line.label(device.id),
                    device.station,
                    device.position,
                    device.al.state(),
                    device.identity.identity()
                ))
                .collect::<String>(),
        );
        println!("    {:?}", line.tree.as_ref().map(|tree| tree.links().len()));
        for finding in &report.findings {
            println!("    {} {} {:?}", finding.code, finding.name, finding.place);
        }
    }
}
