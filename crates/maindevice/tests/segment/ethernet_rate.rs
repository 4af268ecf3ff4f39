//! Throughput of Ethernet over EtherCAT on a virtual segment, and what is estimated.

use std::collections::BTreeSet;

use linesman_config::plan::ethernet::EthernetRate;
use linesman_config::plan::layout::TaskOptions;
use linesman_config::plan::{DatagramPlan, FramePlan, Plan, PlanOptions, Role};
use linesman_maindevice::Event;
use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::Service;
use linesman_maindevice::virtual_switch::SubDevicePort;
use linesman_proto::address::LogicalAddress;
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::mailbox::MailboxType;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use crate::bench::Bench;

/// A device with a mailbox of 1,024 bytes, and one with 256; the one that `sends` has always something to send.
fn plant(sends: Option<&str>) -> String {
    let line = |name: &str, kind: &str, on: &str, ip: u8| {
        let sends = match sends == Some(name) {
            true => ", sends = { bytes = 1472, burst = 64, every_ms = 1 }",
            false => "",
        };
        format!(
            "[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n\
             ethernet = {{ ip = \"192.168.1.{ip}/24\"{sends} }}\n"
        )
    };
    let coupler =
        "name = \"office\"\n[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n";
    [coupler, &line("W1", "EL6688", "K1.B", 11), &line("B1", "EL6692", "W1.B", 12)].concat()
}

/// A frame that carries process data of nobody: it takes time on the wire.
fn filler(len: usize) -> FramePlan {
    FramePlan::new(vec![DatagramPlan {
        command: Command::Lrd,
        address: DatagramAddress::Logical(LogicalAddress(0x0800_0000)),
        len,
        role: Role::ProcessData,
        sync_unit: None,
        ownership: Vec::new(),
    }])
}

/// Bytes of data that a device sends or takes in a second, and the estimate; `fillers` are the lengths of further
/// cyclic frames.
fn carried(name: &str, from: bool, us: u64, fillers: &[usize]) -> (f64, EthernetRate) {
    let mut bench = Bench::new(&plant(from.then_some(name)));
    let inventory = bench.scan();
    let tasks = vec![TaskOptions::new("t", Span::us(us))];
    let options = PlanOptions { tasks, ..PlanOptions::default() };
    let plan = Plan::build(&inventory.planned(AlState::Op), inventory.tree().clone(), &options);
    let mut plan = plan.expect("a plan");
    plan.tasks[0].frames.extend(fillers.iter().map(|len| filler(*len)));
    let id = bench.id(name);
    let mut rates = plan.ethernet_rates().into_iter();
    let estimated = rates.find(|rate| rate.device == id && rate.from_device == from);
    let estimated = estimated.expect("a rate");
    let load = plan.load_percent();
    bench.device.start(bench.now, plan);
    assert!(bench.run_until(Span::s(30), |event| matches!(event, Event::AllReached)));
    let mut frame = vec![0x55; 1_514];
    frame[..14].copy_from_slice(&[2, 9, 9, 9, 9, 9, 2, 0, 0, 0, 0, 1, 0x08, 0]);
    let mut number = 0;
    let mut send = |bench: &mut Bench| {
        let request = MailboxRequest::SendFrame { port: 0, number, frame: frame.clone() };
        number = (number + 1) & 0x0F;
        bench.device.serve(bench.now, id, Service::Mailbox(request));
    };
    bench.run_for(Span::ms(100));
    if !from {
        send(&mut bench);
        send(&mut bench);
    }
    let began = bench.now;
    let (mut port, mut came) = (SubDevicePort::default(), 0);
    let end = bench.now + Span::s(1);
    while bench.now < end {
        let left = end.since(bench.now);
        bench.events.clear();
        let mut done = 0;
        bench.run_until(left, |event| {
            if let Event::Mailbox { kind: MailboxType::Eoe, data, .. } = event {
                let frame = port.handle_message(data);
                came += usize::from(frame.is_some_and(|frame| frame.len() == 1_514));
            } else if let Event::Served { result, .. } = event {
                assert!(result.is_ok(), "{result:?}");
                done += 1;
            }
            done > 0
        });
        if done > 0 {
            came += 1;
            send(&mut bench);
        }
    }
    let seconds = bench.now.since(began).as_nanos() as f64 / 1e9;
    let carried = (came * 1_460) as f64 / seconds;
    println!(
        "{name} {} {us} us, wire {load:.0} %: {carried:.0} B/s, estimated {} by {:?}",
        if from { "sends" } else { "takes" },
        estimated.bytes_per_second,
        estimated.limit,
    );
    (carried, estimated)
}

/// Cycles, in µs, and lengths of further cyclic frames: up to 96 % of the wire is taken.
const CASES: [(u64, &[usize]); 13] = [
    (250, &[]),
    (500, &[]),
    (1_000, &[]),
    (2_000, &[]),
    (4_000, &[]),
    (250, &[1_400]),
    (250, &[1_400, 800]),
    (250, &[1_400, 1_400]),
    (500, &[1_400, 1_400]),
    (500, &[1_400, 1_400, 1_400]),
    (500, &[1_400, 1_400, 1_400, 800]),
    (1_000, &[1_400; 7]),
    (1_000, &[1_400; 8]),
];

// S0 L2899-2922.
// proves: EOE-08 (S)
#[test]
fn throughput_is_within_10_percent_of_the_estimate_on_a_full_wire_too() {
    let mut off = Vec::new();
    let mut limits = BTreeSet::new();
    for from in [true, false] {
        for name in ["W1", "B1"] {
            for (us, fillers) in CASES {
                let (carried, estimated) = carried(name, from, us, fillers);
                let ratio = carried / estimated.bytes_per_second as f64;
                limits.insert(estimated.limit);
                if !(0.9..=1.1).contains(&ratio) {
                    off.push(format!("{name} from={from} {us} us {fillers:?}: {ratio:.2}"));
                }
            }
        }
    }
    assert!(off.is_empty(), "carried to estimated: {off:#?}");
    assert_eq!(limits.len(), 3, "each limit occurs: {limits:?}");
}
