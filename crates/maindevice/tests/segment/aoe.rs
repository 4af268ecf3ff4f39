//! AoE, VoE and FoE with a virtual bridge terminal: requests, and start-up commands.

use crate::bench::Bench;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_config::start_up::{StartUpAction, StartUpCommand, Transition};
use linesman_maindevice::Event;
use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::{RefusalKind, Service, ServiceAnswer, ServiceFailure};
use linesman_proto::ads::{AdsCommand, AdsRequest, AmsAddress, AmsNetId, index};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

const PLANT: &str = r#"
name = "bridge"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "B1"
type = "EL6692"
on = "K1.B"
[[device]]
name = "C1"
type = "EL6601"
on = "B1.B"
"#;

const NET_ID: AmsNetId = AmsNetId([10, 0, 0, 1, 3, 1]);
const MAIN: u16 = AmsAddress::MAIN_DEVICE_PORT;

const fn object(index: u16, subindex: u8) -> u32 {
    (index as u32) << 16 | subindex as u32
}

fn start_up(transition: Transition, action: StartUpAction) -> StartUpCommand {
    StartUpCommand { transition, action, comment: "test".to_owned() }
}

/// Brings the plant up with commands of one SubDevice; true if all reach PREOP or what they are planned for.
fn start(bench: &mut Bench, name: &str, commands: Vec<StartUpCommand>) -> bool {
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::SafeOp);
    planned[bench.id(name).index()].start_up = commands;
    let tree = inventory.tree().clone();
    let plan = Plan::build(&planned, tree, &PlanOptions::default()).expect("a plan");
    bench.device.start(bench.now, plan);
    bench.run_until(Span::s(5), |event| matches!(event, Event::AllReached))
}

fn ask(
    bench: &mut Bench,
    net_id: Option<AmsNetId>,
    port: u16,
    request: &AdsRequest<'_>,
) -> Result<Vec<u8>, ServiceFailure> {
    let (number, data) = request.to_bytes();
    let command = AdsCommand::from_number(number).unwrap();
    let request = MailboxRequest::Ads { net_id, port, source: None, command, data };
    bench.ask_mailbox("B1", request)
}

fn code(outcome: Result<Vec<u8>, ServiceFailure>) -> u32 {
    let failure = outcome.unwrap_err();
    let (kind, code) = failure.refusal().unwrap_or_else(|| panic!("{failure}"));
    assert_eq!(kind, RefusalKind::AdsError, "{failure}");
    code
}

#[test]
fn objects_name_and_state_are_asked_by_ads_under_the_net_id_of_the_plan() {
    let mut bench = Bench::new(PLANT);
    let set = StartUpAction::set_net_id(NET_ID);
    assert_eq!(set.net_id(), Some(NET_ID));
    assert!(start(&mut bench, "B1", vec![start_up(Transition::INIT_TO_PRE_OP, set)]));
    let read = |index, subindex, len| AdsRequest::Read {
        group: index::SDO,
        offset: object(index, subindex),
        len,
    };
    assert_eq!(ask(&mut bench, None, MAIN, &read(0x1018, 1, 4)).unwrap(), [2, 0, 0, 0]);
    assert_eq!(ask(&mut bench, Some(NET_ID), 0x1000, &read(0x1008, 0, 4)).unwrap(), b"EL66");
    let info = ask(&mut bench, None, MAIN, &AdsRequest::DeviceInfo).unwrap();
    assert_eq!((info.len(), &info[4..11]), (20, &b"EL6692\0"[..]));
    assert_eq!(ask(&mut bench, None, MAIN, &AdsRequest::State).unwrap(), [5, 0, 4, 0]);
    let (group, offset) = (index::SDO, object(0x10F1, 2));
    let write = AdsRequest::ReadWrite { group, offset, len: 2, data: &[9, 0] };
    assert_eq!(ask(&mut bench, None, MAIN, &write).unwrap(), [9, 0]);
    let write = AdsRequest::Write { group, offset, data: &[7, 0] };
    assert_eq!(ask(&mut bench, None, MAIN, &write).unwrap(), Vec::<u8>::new());
    assert_eq!(ask(&mut bench, None, MAIN, &read(0x10F1, 2, 2)).unwrap(), [7, 0]);
    // What it refuses: no such object and subindex, read only, group, command, port, NetId.
    assert_eq!(code(ask(&mut bench, None, MAIN, &read(0x5555, 0, 4))), 0x70C);
    assert_eq!(code(ask(&mut bench, None, MAIN, &read(0x1018, 9, 4))), 0x703);
    let fixed = AdsRequest::Write { group, offset: object(0x1018, 1), data: &[1, 0, 0, 0] };
    assert_eq!(code(ask(&mut bench, None, MAIN, &fixed)), 0x704);
    let nothing = AdsRequest::Read { group: 0x99, offset: 0, len: 4 };
    assert_eq!(code(ask(&mut bench, None, MAIN, &nothing)), 0x702);
    let control = AdsRequest::Other(AdsCommand::WriteControl);
    assert_eq!(code(ask(&mut bench, None, MAIN, &control)), 0x701);
    assert_eq!(code(ask(&mut bench, None, 851, &read(0x1018, 1, 4))), 0x6);
    let other = Some(AmsNetId([10, 0, 0, 1, 4, 1]));
    assert_eq!(code(ask(&mut bench, other, MAIN, &read(0x1018, 1, 4))), 0x7);
}

#[test]
fn lost_frames_neither_double_nor_lose_requests_of_ads() {
    let mut bench = Bench::new(PLANT);
    assert!(start(&mut bench, "B1", Vec::new()));
    bench.tamper = Some(Box::new(|number| match number % 13 {
        0 => crate::bench::Fate::Lost,
        _ => crate::bench::Fate::Arrives,
    }));
    for value in 1..30_u8 {
        let (group, offset, data) = (index::SDO, object(0x10F1, 2), &[value, 0][..]);
        let both = AdsRequest::ReadWrite { group, offset, len: 2, data };
        assert_eq!(ask(&mut bench, None, MAIN, &both).unwrap(), [value, 0]);
    }
}

#[test]
fn subdevice_that_does_not_speak_ads_refuses_with_the_error_of_its_mailbox() {
    let mut bench = Bench::new(&PLANT.replace("EL6692", "EL3104"));
    assert!(start(&mut bench, "B1", Vec::new()));
    let failure = ask(&mut bench, None, MAIN, &AdsRequest::DeviceInfo).unwrap_err();
    assert_eq!(failure.refusal(), Some((RefusalKind::MailboxError, 2)), "{failure}");
}

#[test]
fn start_up_commands_by_aoe_foe_and_voe_are_carried_out() {
    let mut bench = Bench::new(PLANT);
    let (group, offset) = (index::SDO, object(0x10F1, 2));
    let (_, data) = AdsRequest::Write { group, offset, data: &[6, 0] }.to_bytes();
    let address = AmsAddress { net_id: NET_ID, port: MAIN };
    let ads =
        StartUpAction::Ads { target: address, source: address, command: AdsCommand::Write, data };
    let vendor = |data: &[u8]| StartUpAction::SendVendorMessage {
        data: data.to_vec(),
        answer_within: Span::ms(100),
    };
    let commands = vec![
        start_up(Transition::INIT_TO_PRE_OP, StartUpAction::set_net_id(NET_ID)),
        start_up(Transition::PRE_OP_TO_SAFE_OP, ads),
        start_up(Transition::PRE_OP_TO_SAFE_OP, vendor(&[2, 0, 0, 0, 1, 0, 7])),
    ];
    assert!(start(&mut bench, "B1", commands));
    let read = AdsRequest::Read { group, offset, len: 2 };
    assert_eq!(ask(&mut bench, Some(NET_ID), MAIN, &read).unwrap(), [6, 0]);
    // A file, which is there afterwards.
    let mut bench = Bench::new(PLANT);
    let (name, data) = ("settings.txt".to_owned(), b"speed = 3".to_vec());
    let file = StartUpAction::WriteFile { name: name.clone(), password: 0, data: data.clone() };
    assert!(start(&mut bench, "C1", vec![start_up(Transition::PRE_OP_TO_SAFE_OP, file)]));
    let id = bench.id("C1");
    let read = MailboxRequest::ReadFile { name, password: 0 };
    bench.device.serve(bench.now, id, Service::Mailbox(read));
    assert!(bench.run_until(Span::s(5), |event| matches!(event, Event::Served { .. })));
    let Some((_, Event::Served { result, .. })) = bench.events.pop() else { panic!("no answer") };
    assert_eq!(*result, Ok(ServiceAnswer::Data(data)));
}

#[test]
fn start_up_command_that_is_refused_is_named_with_the_code() {
    let address = AmsAddress { net_id: NET_ID, port: MAIN };
    let (group, offset) = (index::SDO, object(0x5555, 0));
    let (_, data) = AdsRequest::Write { group, offset, data: &[1] }.to_bytes();
    let command = AdsCommand::Write;
    let ads = StartUpAction::Ads { target: address, source: address, command, data };
    let vendor = StartUpAction::SendVendorMessage {
        data: vec![9, 9, 0, 0, 1, 0],
        answer_within: Span::ms(100),
    };
    let (name, password) = ("nothing.bin".to_owned(), 0);
    let file = StartUpAction::WriteFile { name, password, data: vec![1] };
    for (device, action, words) in [
        ("B1", ads, ["ADS write to 10.0.0.1.3.1:65535 by AoE", "0x70C not found"]),
        ("B1", vendor, ["message of the vendor by VoE: 09 09 00 00 01 00", "mailbox error 0x0005"]),
        ("C1", file, ["file `nothing.bin` by FoE = 01", "FoE error 0x8001"]),
    ] {
        let mut bench = Bench::new(PLANT);
        let inventory = bench.scan();
        let mut planned = inventory.planned(AlState::SafeOp);
        planned[bench.id(device).index()].start_up =
            vec![start_up(Transition::PRE_OP_TO_SAFE_OP, action)];
        let tree = inventory.tree().clone();
        let plan = Plan::build(&planned, tree, &PlanOptions::default()).expect("a plan");
        bench.device.start(bench.now, plan);
        let failed = |event: &Event| matches!(event, Event::StartUpFailed { .. });
        assert!(bench.run_until(Span::s(5), failed), "{device}: {:?}", bench.events);
        let (_, event) = bench.events.last().unwrap();
        let told = event.state_lines(|id| format!("SubDevice {}", id.no())).join("\n");
        for words in words {
            assert!(told.contains(words), "{words} in {told}");
        }
    }
}
