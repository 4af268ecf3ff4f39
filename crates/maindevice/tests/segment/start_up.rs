//! Start-up commands, states asked for, and what is told when a step fails.

use crate::bench::Bench;
use crate::mailbox::{PLANT, upload};
use linesman_config::fault::FaultName;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_config::start_up::{StartUpAction, StartUpCommand, Transition};
use linesman_maindevice::{Event, Options, Phase};
use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

fn download(transition: Transition, index: u16, subindex: u8, data: &[u8]) -> StartUpCommand {
    StartUpCommand {
        transition,
        action: StartUpAction::CoeDownload {
            object: ObjectAddress::new(index, subindex),
            complete_access: false,
            data: data.to_vec(),
        },
        comment: "test".to_owned(),
    }
}

fn complete(transition: Transition, index: u16, data: &[u8]) -> StartUpCommand {
    let object = ObjectAddress::new(index, 0);
    let data = data.to_vec();
    let action = StartUpAction::CoeDownload { object, complete_access: true, data };
    StartUpCommand { transition, action, comment: String::new() }
}

/// The plan of what is there, with commands for one SubDevice.
fn plan_with(bench: &mut Bench, name: &str, commands: Vec<StartUpCommand>) -> Plan {
    let inventory = bench.scan();
    let tree = inventory.tree().clone();
    let mut planned = inventory.planned(AlState::Op);
    planned[bench.id(name).index()].start_up = commands;
    Plan::build(&planned, tree, &PlanOptions::default()).expect("a plan")
}

fn lines(bench: &Bench) -> Vec<String> {
    let name = |id: linesman_proto::address::DeviceId| format!("SubDevice {}", id.no());
    bench.events.iter().flat_map(|(_, event)| event.state_lines(name)).collect()
}

#[test]
fn commands_are_executed_at_their_transitions() {
    let mut bench = Bench::new(PLANT);
    let watchdog = StartUpCommand {
        transition: Transition::PRE_OP_TO_SAFE_OP,
        action: StartUpAction::RegisterWrite {
            address: RegisterAddress(0x0420),
            data: vec![0xF4, 0x01],
        },
        comment: String::new(),
    };
    let commands = vec![
        // In the order of the list, each at its step; the assignment as a whole.
        download(Transition::INIT_TO_PRE_OP, 0x8010, 1, &[0xA0, 0x0F]),
        complete(Transition::PRE_OP_TO_SAFE_OP, 0x1C13, &[2, 0, 0x00, 0x1A, 0x03, 0x1A]),
        watchdog,
        download(Transition::SAFE_OP_TO_OP, 0x8010, 2, &[0xD0, 0x07]),
    ];
    let plan = plan_with(&mut bench, "M1", commands);
    bench.device.start(bench.now, plan);
    let all = |event: &Event| matches!(event, Event::AllReached);
    assert!(bench.run_until(Span::s(5), all), "{:#?}", lines(&bench));
    assert_eq!(upload(&mut bench, "M1", 0x8010, 1).unwrap(), [0xA0, 0x0F]);
    assert_eq!(upload(&mut bench, "M1", 0x8010, 2).unwrap(), [0xD0, 0x07]);
    let controller = bench.segment.controller(bench.id("M1")).unwrap();
    assert_eq!(controller.register(RegisterAddress(0x0420)), 0xF4);
    let times = bench.device.bring_up_times().unwrap();
    let phases = &times.devices[bench.id("M1").index()].phases;
    for state in [AlState::PreOp, AlState::SafeOp, AlState::Op] {
        for phase in [Phase::StartUp(state), Phase::Step(state)] {
            assert!(phases.iter().any(|(what, _)| *what == phase), "{phase}: {phases:?}");
        }
    }
    let took = times.took().unwrap();
    assert!(phases.iter().all(|(_, span)| *span <= took), "{took}: {phases:?}");
    assert!(
        times.network.iter().any(|(phase, span)| *phase == Phase::Identify && *span > Span::ZERO)
    );
}

// proves: SW-10 partial: refused start-up commands name device, object and abort text
#[test]
fn a_refused_command_stops_the_step_and_says_why() {
    let mut bench = Bench::new(PLANT);
    let commands = vec![
        download(Transition::PRE_OP_TO_SAFE_OP, 0x1018, 1, &[9, 0, 0, 0]),
        download(Transition::PRE_OP_TO_SAFE_OP, 0x8010, 1, &[0xA0, 0x0F]),
    ];
    let plan = plan_with(&mut bench, "M1", commands);
    bench.device.start(bench.now, plan);
    bench.run_until(Span::ms(900), |event| matches!(event, Event::StartUpFailed { .. }));
    bench.run_for(Span::ms(100));
    let told = lines(&bench).join("\n");
    for words in [
        "SubDevice 3: state change aborted (requested SAFEOP, back to PREOP)",
        "SubDevice 3: PREOP to SAFEOP failed at start-up command 0x1018:01 = 09 00 00 00 (test)",
        "0x06010002",
    ] {
        assert!(told.contains(words), "{words} in {told}");
    }
    assert_eq!(bench.state("M1"), "PREOP");
    assert_eq!(bench.state("A1"), "OP", "the others go on");
    assert_ne!(upload(&mut bench, "M1", 0x8010, 1).unwrap(), [0xA0, 0x0F], "not executed");
    // It is tried again: whatever held it back may have gone.
    bench.run_for(Span::s(4));
    let failed = |event: &Event| matches!(event, Event::StartUpFailed { .. });
    assert!(bench.events.iter().filter(|(_, event)| failed(event)).count() >= 2);
}

#[test]
fn a_command_for_a_device_without_mailbox_is_refused() {
    let mut bench = Bench::new(PLANT);
    let commands = vec![download(Transition::PRE_OP_TO_SAFE_OP, 0x8010, 1, &[0])];
    let plan = plan_with(&mut bench, "K1", commands);
    bench.device.start(bench.now, plan);
    assert!(bench.run_until(Span::s(2), |event| matches!(event, Event::StartUpFailed { .. })));
    let told = lines(&bench).join("\n");
    assert!(told.contains("it has no mailbox"), "{told}");
}

// proves: SW-02 partial: through a segment, with what to do
#[test]
fn a_refused_step_is_told_as_a_pair() {
    let mut bench = Bench::new(PLANT);
    let entry = FaultEntry::new(FaultName::InitRefused)
        .device("M1")
        .with("to", "PREOP")
        .with("code", 0x0014)
        .with("refusals", 1);
    bench.segment.inject(bench.now, &entry).unwrap();
    bench.start(AlState::Op);
    let told = lines(&bench);
    let at = told.iter().position(|line| line.contains("aborted")).expect("the first of the pair");
    assert_eq!(told[at], "SubDevice 3: state change aborted (requested PREOP, back to INIT)");
    assert_eq!(
        told[at + 1],
        "SubDevice 3: INIT to PREOP failed, read 0x0011, expected 0x0002, AL 0x0014 no valid firmware"
    );
}

#[test]
fn states_are_asked_for_of_one_or_of_all() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    let id = bench.id("M1");
    for state in [AlState::SafeOp, AlState::PreOp, AlState::Init, AlState::Op] {
        assert!(bench.device.request_state(bench.now, Some(id), state));
        let there = |event: &Event| matches!(event, Event::TargetReached { id: of, state: at } if *of == id && *at == state);
        assert!(bench.run_until(Span::s(5), there), "{state}: {}", bench.state("M1"));
        bench.run_for(Span::ms(300));
        assert_eq!((bench.state("M1"), bench.state("A1")), (state.to_string(), "OP".to_owned()));
    }
    assert!(bench.device.request_state(bench.now, None, AlState::PreOp));
    assert!(bench.run_until(Span::s(5), |event| matches!(event, Event::AllReached)));
    for name in ["K1", "A1", "M1"] {
        assert_eq!(bench.state(name), "PREOP", "{name}");
    }
    let wrong =
        bench.events.iter().filter(|(_, event)| matches!(event, Event::AbnormalState { .. }));
    assert_eq!(wrong.count(), 0);
}

// proves: SW-14 partial: BOOT and back
#[test]
fn bootstrap_is_entered_by_who_has_it_and_refused_by_who_has_not() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    let (with, without) = (bench.id("M1"), bench.id("A1"));
    bench.device.request_state(bench.now, Some(with), AlState::Boot);
    bench.run_for(Span::s(1));
    let shown = bench.state("M1");
    bench.device.request_state(bench.now, Some(without), AlState::Boot);
    bench.run_for(Span::s(1));
    let told = lines(&bench).join("\n");
    assert!(shown == "BOOT" || told.contains("0x0013 bootstrap not supported"), "{shown}: {told}");
    for id in [with, without] {
        bench.device.request_state(bench.now, Some(id), AlState::Op);
    }
    bench.run_for(Span::s(3));
    assert_eq!((bench.state("M1"), bench.state("A1")), ("OP".to_owned(), "OP".to_owned()));
}

// proves: SW-16 partial: start state, stay in PREOP until the task runs
#[test]
fn all_stay_in_pre_op_until_the_application_is_ready() {
    let options = Options { hold_at: Some(AlState::PreOp), ..Options::default() };
    let mut bench = Bench::with_options(PLANT, options);
    bench.start(AlState::Op);
    bench.run_for(Span::s(1));
    assert_eq!((bench.state("K1"), bench.state("M1")), ("PREOP".to_owned(), "PREOP".to_owned()));
    assert!(upload(&mut bench, "M1", 0x1018, 1).is_ok());
    bench.device.release(bench.now);
    assert!(bench.run_until(Span::s(5), |event| matches!(event, Event::AllReached)));
    assert_eq!((bench.state("K1"), bench.state("M1")), ("OP".to_owned(), "OP".to_owned()));
}

// proves: SW-15 partial: states restored or not, set up anew after a loss or not
#[test]
fn restoring_can_be_left_to_the_user() {
    let options = Options { restore_states: false, ..Options::default() };
    let mut bench = Bench::with_options(PLANT, options);
    bench.start(AlState::Op);
    let id = bench.id("M1");
    let crash = FaultEntry::new(FaultName::FirmwareFault)
        .device("M1")
        .with("how", "restarts")
        .with("boot_ms", 40.0);
    bench.segment.inject(bench.now, &crash).unwrap();
    bench.run_for(Span::s(5));
    assert_eq!(bench.state("M1"), "INIT, error");
    let told = lines(&bench).join("\n");
    assert!(told.contains("abnormal state change (from OP to INIT), AL 0x0060"), "{told}");
    bench.device.request_state(bench.now, Some(id), AlState::Op);
    bench.run_for(Span::s(2));
    assert_eq!(bench.state("M1"), "OP");

    let options = Options { reinitialise: false, ..Options::default() };
    let mut bench = Bench::with_options(PLANT, options);
    bench.start(AlState::Op);
    let off = FaultEntry::new(FaultName::DeviceOff).device("M1");
    let fault = bench.segment.inject(bench.now, &off).unwrap();
    bench.run_for(Span::s(1));
    bench.segment.heal(bench.now, fault);
    bench.run_for(Span::s(10));
    assert_eq!(bench.state("M1"), "INIT");
    bench.device.request_state(bench.now, Some(id), AlState::Op);
    bench.run_for(Span::s(5));
    assert_eq!(bench.state("M1"), "OP");
}
