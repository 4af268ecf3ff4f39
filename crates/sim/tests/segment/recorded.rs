//! Error counters of a real robot over time, and the fault that leaves the same.

#![allow(clippy::disallowed_methods, reason = "the recording is a file beside the project")]

use linesman_config::fault::FaultName;
use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::port::Port;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment_file::FaultEntry;

use super::rig::{Bench, answer, at, frame};

/// A motor controller at the end of a cable, as on the robot.
const ROBOT: &str = r#"
name = "robot"
[[device]]
name = "tilt_laser_motor"
type = "EP1008-0001"
on = "maindevice"
"#;

/// The first value of a key in the recording.
fn value(text: &str, key: &str) -> f64 {
    let quoted = format!("\"{key}\": \"");
    let from = text.find(&quoted).unwrap_or_else(|| panic!("no {key}")) + quoted.len();
    text[from..].split('"').next().unwrap().parse().unwrap()
}

/// PR2, 11 January 2011: of 1,127,295 frames 156 were late and one was lost, and no controller had
/// counted anything. A host that keeps frames back leaves just that.
#[expect(clippy::disallowed_macros, reason = "a test that skips says so")]
#[test]
fn the_counters_of_a_real_robot_come_out_of_a_late_host() {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = std::env::var("LINESMAN_DATA").unwrap_or(beside.to_owned());
    let file = std::path::Path::new(&data).join("sii/diag/pr2-2011-01-11.decoded.json");
    if !file.is_file() {
        eprintln!("SKIPPED: no recording of the robot at {}; set LINESMAN_DATA", file.display());
        return;
    }
    let text = std::fs::read_to_string(&file).unwrap();
    let sent = value(&text, "Sent Packets") as u32;
    let (late, dropped) = (value(&text, "RX Late Packet"), value(&text, "Dropped Packets"));
    let round_trip_us = value(&text, "RX Late Packet Avg RTT");

    let mut bench = Bench::new(ROBOT);
    let cycle = Span::ms(1);
    let end_ms = Some(f64::from(sent));
    let jitter = FaultEntry::new(FaultName::HostJitter).from_to(0.0, end_ms);
    bench.inject(&jitter.with("hits", late as u32).with("delay_us", round_trip_us));
    let drops = FaultEntry::new(FaultName::HostDrops).from_to(0.0, end_ms);
    bench.inject(&drops.with("hits", (dropped - late) as u32));

    let frame_of = |number: u32| frame(Command::Nop, at(0, 0), &number.to_le_bytes());
    let (mut in_time, mut too_late) = (0, 0);
    let mut buffer = Vec::new();
    let mut now = Instant::ZERO;
    for number in 0..sent {
        bench.segment.handle_frame(now, Path::A, &frame_of(number));
        now += cycle;
        bench.segment.advance(now);
        while let Some(arrival) = bench.segment.poll_arrival(&mut buffer) {
            let number = u32::from_le_bytes(answer(&buffer).0.try_into().unwrap());
            let left = Instant::ZERO + cycle * u64::from(number);
            match arrival.at.since(left) <= cycle {
                true => in_time += 1,
                false => too_late += 1,
            }
        }
    }
    assert_eq!(too_late, late as u32, "frames that came after their cycle");
    assert_eq!(sent - in_time - too_late, (dropped - late) as u32, "frames that never came");
    // The controller has seen nothing of it, as the real one.
    assert_eq!(bench.counters(), [""; 0]);
    for key in ["EPU Errors", "RX Error Port 0", "Invalid Frame Port 0", "Lost Link Port 0"] {
        assert_eq!(value(&text, key), 0.0, "{key}");
    }
    let status = bench.segment.controller(bench.id("tilt_laser_motor")).unwrap().dl_status();
    let (near, far) = (status.port_state(Port::A), status.port_state(Port::B));
    assert!(near.link && !near.closed && !far.link && far.closed, "as recorded");
    bench.assert_audit();
}
