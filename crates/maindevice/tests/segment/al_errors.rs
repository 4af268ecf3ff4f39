//! Every AL status code of the sources, brought about on a segment and told to the user.

use crate::bench::Bench;
use crate::clocks::{plan, start};
use linesman_config::fault::FaultName;
use linesman_config::plan::Plan;
use linesman_maindevice::Event;
use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

const PLANT: &str = r#"
name = "errors"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "I1"
type = "EL3102"
on = "K1.B"
[[device]]
name = "O1"
type = "EL4102"
on = "I1.B"
"#;

/// Waits for a line that names a code, and looks for the step or change that it belongs to, and for
/// what to do about it.
fn told(bench: &mut Bench, words: &str, code: &str) {
    let name = |id: DeviceId| format!("SubDevice {}", id.no());
    let names = |event: &Event| event.state_lines(name).iter().any(|line| line.contains(code));
    let found = bench.run_until(Span::s(25), names);
    let lines: Vec<Vec<String>> =
        bench.events.iter().map(|(_, event)| event.state_lines(name)).collect();
    assert!(found, "no {code} in {lines:#?}");
    let names = |line: &String| line.contains(code);
    let event = lines.iter().find(|event| event.iter().any(names)).expect("it was found");
    let at = event.iter().position(names).expect("it was found");
    assert!(event[at].contains(words), "{words} in {event:#?}");
    let action = event.get(at + 1).map_or("", String::as_str);
    assert!(action.len() > "SubDevice 1: ".len() + 10, "what to do: {event:#?}");
    // Named, and not one of the unknown.
    assert!(!event[at].contains("unknown"), "{event:#?}");
}

fn at_start(entry: FaultEntry, words: &str, code: &str) {
    let mut bench = Bench::new(PLANT);
    let plan = plan(&mut bench, |_| false);
    bench.segment.inject(bench.now, &entry).unwrap();
    bench.run_for(Span::ms(5));
    bench.device.start(bench.now, plan);
    told(&mut bench, words, code);
}

fn clocked() -> (Bench, Plan) {
    let mut bench = Bench::new(PLANT);
    let plan = plan(&mut bench, |kind| kind == "EL4102");
    (bench, plan)
}

fn in_op(entry: FaultEntry, words: &str, code: &str) {
    let (mut bench, plan) = clocked();
    start(&mut bench, plan);
    bench.run_for(Span::ms(500));
    bench.segment.inject(bench.now, &entry).unwrap();
    told(&mut bench, words, code);
}

// proves: SW-04 partial: 0x001E and 0x001D from a PDO assignment that another tool has stored
#[test]
fn a_stored_assignment_that_does_not_fit_is_refused() {
    let of = |device| FaultEntry::new(FaultName::ConfigMismatch).device(device);
    at_start(of("I1"), "PREOP to SAFEOP failed", "AL 0x001E invalid input configuration");
    at_start(of("O1"), "PREOP to SAFEOP failed", "AL 0x001D invalid output configuration");
}

// proves: SW-04 partial: 0x0003 from a device that refuses
#[test]
fn an_invalid_device_setup_is_refused() {
    let entry = FaultEntry::new(FaultName::InitRefused).device("I1").with("code", 3);
    at_start(entry, "PREOP to SAFEOP failed", "AL 0x0003 invalid device setup");
}

// proves: SW-04 partial: 0x0035 from a SYNC0 without a cycle
#[test]
fn a_sync_signal_without_a_cycle_is_refused() {
    let (mut bench, mut plan) = clocked();
    for device in &mut plan.devices {
        if let Some(clock) = &mut device.settings.clock {
            clock.sync0_cycle = Span::ZERO;
        }
    }
    bench.device.start(bench.now, plan);
    told(&mut bench, "PREOP to SAFEOP failed", "AL 0x0035 DC invalid sync cycle time");
}

// proves: SW-04 partial: 0x001A from frames that come too late, 0x001B from frames that do not come, 0x002C from a SYNC0 that is gone
#[test]
fn fault_in_op_is_an_abnormal_change() {
    let from = "abnormal state change (from OP to SAFEOP)";
    let jitter = FaultEntry::new(FaultName::HostJitter)
        .with("delays_per_s", 2_000.0)
        .with("delay_us", 900.0);
    in_op(jitter, from, "AL 0x001A synchronization error");
    let starved = FaultEntry::new(FaultName::WatchdogStarved).device("O1").with("watchdog_ms", 0.3);
    in_op(starved, from, "AL 0x001B sync manager watchdog");
    let lost = FaultEntry::new(FaultName::SyncLost).device("O1");
    in_op(lost, from, "AL 0x002C fatal sync error");
}
