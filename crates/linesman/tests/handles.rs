//! Handles of a plan: found by name, refused with another plan.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use linesman::prelude::*;
use linesman::{DeviceState, Error};

const SMALL: [(&str, &str); 3] = [("K1", "EK1100"), ("Buttons", "EL1008"), ("Lamps", "EL2008")];
const LARGE: [(&str, &str); 5] = [
    ("K1", "EK1100"),
    ("Buttons", "EL1008"),
    ("More buttons", "EL1008"),
    ("Lamps", "EL2008"),
    ("Sensor", "EL3104"),
];

fn machine(devices: &[(&str, &str)]) -> (Segment, Plan) {
    let file = SegmentFile::in_a_row("machine", 1, devices);
    let mut segment = Segment::simulated(&file).unwrap();
    let plan = segment.scan().unwrap().plan().unwrap();
    (segment, plan)
}

#[test]
fn device_is_found_by_product_by_own_name_and_by_number() {
    let (_, plan) = machine(&LARGE);
    let lamps = plan.device("EL2008").unwrap();
    assert_eq!(lamps.no(), 4);
    let name = plan.name(4).unwrap();
    assert_eq!(plan.device(name).unwrap(), lamps);
    assert_eq!(plan.device("4").unwrap(), lamps);
    assert_eq!(plan.devices().map(|(device, _)| device.no()).collect::<Vec<_>>(), [1, 2, 3, 4, 5]);
}

#[test]
fn unknown_device_is_refused_with_all_names() {
    let (_, plan) = machine(&SMALL);
    let error = plan.device("EL9999").unwrap_err().to_string();
    for (_, name) in plan.devices() {
        assert!(error.contains(name), "{error}");
    }
}

#[test]
fn product_of_several_devices_is_refused_with_their_names() {
    let (_, plan) = machine(&LARGE);
    let error = plan.device("EL1008").unwrap_err().to_string();
    for no in [2, 3] {
        assert!(error.contains(plan.name(no).unwrap()), "{error}");
    }
}

#[test]
fn handles_of_a_plan_with_the_same_layout_are_the_same() {
    let ((_, first), (mut segment, second)) = (machine(&SMALL), machine(&SMALL));
    assert_eq!(first.id(), second.id());
    let lamp: Output<bool> = first.output("EL2008/1").unwrap();
    let mut cycles = 0;
    let report = segment.run(second, RunOptions::us(1_000), |io| {
        io.set(lamp, true);
        cycles += 1;
        if cycles < 100 { Next::Continue } else { Next::Stop }
    });
    assert!(report.is_ok());
}

#[test]
fn handle_of_another_plan_ends_the_run_with_both_plans_named() {
    let ((mut segment, plan), (_, other)) = (machine(&SMALL), machine(&LARGE));
    let names = (other.to_string(), plan.to_string());
    let lamp: Output<bool> = other.output("EL2008/1").unwrap();
    let mut cycles = 0;
    let error = segment
        .run(plan, RunOptions::us(1_000), |io| {
            io.set(lamp, true);
            assert!(io.outputs_mut().iter().all(|byte| *byte == 0), "nothing is written");
            cycles += 1;
            if cycles < 100 { Next::Continue } else { Next::Stop }
        })
        .unwrap_err();
    assert!(matches!(error, Error::OtherPlan { .. }));
    assert_eq!(cycles, 1);
    let text = error.to_string();
    assert!(text.contains(&names.0) && text.contains(&names.1), "{text}");
}

#[test]
fn device_of_another_plan_ends_a_stepped_run() {
    let ((mut segment, plan), (_, other)) = (machine(&SMALL), machine(&LARGE));
    let sensor = other.device("EL3104").unwrap();
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    assert!(!run.cycle().unwrap().quality(sensor).valid);
    assert!(run.cycle().is_none());
    assert!(matches!(run.stop(), Err(Error::OtherPlan { .. })));
}

#[test]
fn variable_of_a_device_of_another_plan_is_refused() {
    let ((_, plan), (_, other)) = (machine(&SMALL), machine(&LARGE));
    let lamps = other.device("EL2008").unwrap();
    assert!(matches!(plan.output_of::<bool>(lamps, "1"), Err(Error::OtherPlan { .. })));
}

linesman::inputs! {
    #[derive(Debug)]
    struct Pressed {
        first: bool = "1",
        second: bool = "2",
    }
}

linesman::outputs! {
    struct Lit {
        first: bool = "1",
        second: bool = "2",
    }
}

linesman::inputs! {
    #[derive(Debug)]
    struct Wrong {
        _first: u16 = "1",
    }
}

#[test]
fn record_reads_and_writes_its_variables_by_name() {
    let (mut segment, plan) = machine(&SMALL);
    let pressed = plan.inputs::<Pressed>("EL1008").unwrap();
    let lit = plan.outputs::<Lit>("EL2008").unwrap();
    let lamps = plan.device("EL2008").unwrap();
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    let mut settled = 0;
    while let Some(mut io) = run.cycle() {
        io.write(lit, Lit { first: true, second: false });
        settled += u32::from(io.is_settled());
        if settled == 10 {
            // The segment has wires from its outputs to its inputs.
            let Pressed { first, second } = io.read(pressed);
            assert_eq!((first, second), (true, false));
            assert_eq!(io.state(lamps), DeviceState::OP);
            break;
        }
    }
    run.stop().unwrap();
}

#[test]
fn record_with_a_field_of_another_type_is_refused_with_the_variable() {
    let (_, plan) = machine(&SMALL);
    let error = plan.inputs::<Wrong>("EL1008").unwrap_err().to_string();
    assert!(error.contains("u16") && error.contains("1 bits"), "{error}");
}
