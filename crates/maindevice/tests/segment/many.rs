//! Many SubDevices at once: how long a start takes, and what it costs in frames.

use std::fmt::Write as _;

use crate::bench::Bench;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_config::start_up::{StartUpAction, StartUpCommand, Transition};
use linesman_maindevice::Event;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

/// A coupler and terminals behind it, every fourth with a processor.
fn plant(count: usize) -> String {
    let mut text = "name = \"many\"\n".to_owned();
    for number in 0..count {
        let kind = match number {
            0 => "EK1100",
            _ if number % 4 == 2 => "EL7041",
            _ if number % 2 == 0 => "EL2008",
            _ => "EL1008",
        };
        let on = match number.checked_sub(1) {
            None => "maindevice".to_owned(),
            Some(before) => format!("D{before}.B"),
        };
        let _ =
            write!(text, "[[device]]\nname = \"D{number}\"\ntype = \"{kind}\"\non = \"{on}\"\n");
    }
    text
}

struct Cost {
    scan: Span,
    scan_frames: u64,
    start: Span,
    start_frames: u64,
}

/// Scans, then starts to OP, with a start-up command for each SubDevice with a mailbox.
fn cost(count: usize) -> (Bench, Plan, Cost) {
    let mut bench = Bench::new(&plant(count));
    let inventory = bench.scan();
    let (scan, scan_frames) =
        (Span::ns(bench.now.as_nanos()), bench.device.statistics().frames_sent);
    let tree = inventory.tree().clone();
    let mut planned = inventory.planned(AlState::Op);
    for device in planned.iter_mut().filter(|device| device.profile.mailbox.is_some()) {
        let command = |transition, subindex, value: u16| StartUpCommand {
            transition,
            action: StartUpAction::CoeDownload {
                object: ObjectAddress::new(0x8010, subindex),
                complete_access: false,
                data: value.to_le_bytes().to_vec(),
            },
            comment: String::new(),
        };
        device.start_up = vec![
            command(Transition::INIT_TO_PRE_OP, 1, 4_000),
            command(Transition::PRE_OP_TO_SAFE_OP, 2, 2_000),
        ];
    }
    let plan = Plan::build(&planned, tree, &PlanOptions::default()).expect("a plan");
    let began = bench.now;
    bench.device.start(bench.now, plan.clone());
    let done = bench.run_until(Span::s(30), |event| matches!(event, Event::AllReached));
    assert!(done, "{count} do not reach OP");
    let start_frames = bench.device.statistics().frames_sent - scan_frames;
    let start = bench.now.since(began);
    (bench, plan, Cost { scan, scan_frames, start, start_frames })
}

#[test]
fn a_start_takes_as_long_as_the_slowest_subdevice() {
    println!("SubDevices  scan        frames  start to OP  frames");
    for (count, limit_ms) in [(2, 100), (32, 130), (128, 170), (250, 250)] {
        let (bench, plan, cost) = cost(count);
        let Cost { scan, scan_frames, start, start_frames } = cost;
        println!("{count:10}  {scan:>10}  {scan_frames:6}  {start:>11}  {start_frames:6}");
        let times = bench.device.bring_up_times().unwrap();
        let (id, slowest) = times.slowest().unwrap();
        let (phase, span) = slowest.longest().unwrap();
        println!("            slowest: {} {}, of it {phase} {span}", id.no(), slowest.total());
        for (phase, span) in &times.network {
            println!("            {phase}: {span}");
        }
        assert!(start < Span::ms(limit_ms), "{count}: {start}");
        // Every identity was verified: a start with another one does not get there.
        assert!(plan.devices.iter().all(|device| device.identity.vendor_id == 2));
        let commands = plan.devices.iter().filter(|device| !device.start_up.is_empty()).count();
        assert_eq!(commands, (0..count).filter(|number| number % 4 == 2).count());
        for number in [count / 2, count - 1] {
            assert_eq!(bench.state(&format!("D{number}")), "OP");
        }
    }
}
