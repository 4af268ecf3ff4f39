//! Services for single SubDevices beside the cycle.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::time::Duration;

use linesman::prelude::*;
use linesman::{AlState, Error, PendingAnswer, RefusalKind, RequestError, register};

const DEVICES: [(&str, &str); 3] = [("K1", "EK1100"), ("Sensor", "EL3104"), ("Lamps", "EL2008")];
/// Identity object, settings of the first channel, and an object that is not there.
const IDENTITY: u16 = 0x1018;
const SETTINGS: u16 = 0x8000;
const LIMIT: u8 = 0x13;
const MISSING: u16 = 0x5FFF;

fn machine() -> (Segment, Plan) {
    let file = SegmentFile::in_a_row("machine", 1, &DEVICES);
    let mut segment = Segment::simulated(&file).unwrap();
    let plan = segment.scan().unwrap().plan().unwrap();
    (segment, plan)
}

/// Takes cycles until the answer is there.
fn answer<T>(
    run: &mut linesman::SteppedRun<'_>,
    mut pending: PendingAnswer<T>,
) -> Result<T, RequestError> {
    for _ in 0..20_000 {
        assert!(run.cycle().is_some());
        if let Some(answer) = pending.poll() {
            return answer;
        }
    }
    panic!("no answer in 20,000 cycles");
}

#[test]
fn objects_are_read_and_written_in_the_type_of_rust() {
    let (mut segment, plan) = machine();
    let (sensor, services) = (plan.device("EL3104").unwrap(), segment.services());
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    let vendor: u32 = answer(&mut run, services.sdo_read(sensor, IDENTITY, 1)).unwrap();
    assert_eq!(vendor, 2);
    let before: i16 = answer(&mut run, services.sdo_read(sensor, SETTINGS, LIMIT)).unwrap();
    let other = before.wrapping_add(77);
    answer(&mut run, services.sdo_write(sensor, SETTINGS, LIMIT, &other)).unwrap();
    let after: i16 = answer(&mut run, services.sdo_read(sensor, SETTINGS, LIMIT)).unwrap();
    assert_eq!(after, other);
    let whole = answer(&mut run, services.sdo_read_complete(sensor, IDENTITY)).unwrap();
    assert_eq!(whole.get(2..6), Some(&vendor.to_le_bytes()[..]), "{whole:?}");
    run.stop().unwrap();
}

#[test]
fn value_of_another_size_and_a_missing_object_are_refused() {
    let (mut segment, plan) = machine();
    let (sensor, services) = (plan.device("EL3104").unwrap(), segment.services());
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    let size = answer(&mut run, services.sdo_read::<u16>(sensor, IDENTITY, 1));
    assert!(matches!(size, Err(RequestError::Size { expected: 2, received: 4, .. })), "{size:?}");
    let missing = answer(&mut run, services.sdo_read::<u16>(sensor, MISSING, 0));
    let Err(RequestError::Failed(failure)) = missing else { panic!("{missing:?}") };
    assert_eq!(failure.refusal().map(|(kind, _)| kind), Some(RefusalKind::SdoAbort));
    run.stop().unwrap();
}

#[test]
fn registers_sii_and_state_are_read_beside_the_cycle() {
    let (mut segment, plan) = machine();
    let (lamps, services) = (plan.device("EL2008").unwrap(), segment.services());
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    let address = register::STATION_ADDRESS.address;
    let station: u16 = answer(&mut run, services.register_read(lamps, address)).unwrap();
    assert_eq!(station, 0x1003, "{station:#x}");
    let bytes = answer(&mut run, services.register_read_bytes(lamps, address, 2)).unwrap();
    assert_eq!(bytes, station.to_le_bytes());
    let sii = answer(&mut run, services.sii_read(lamps)).unwrap();
    assert_eq!(sii.get(16..20), Some(&2_u32.to_le_bytes()[..]), "vendor, word 8");
    for _ in 0..2_000 {
        run.cycle();
    }
    let state = answer(&mut run, services.state(lamps)).unwrap();
    assert_eq!(state.status.state(), linesman::StateValue::Known(AlState::Op));
    let lower = answer(&mut run, services.enter(lamps, AlState::PreOp)).unwrap();
    assert_eq!(lower.status.state(), linesman::StateValue::Known(AlState::PreOp));
    run.stop().unwrap();
}

#[test]
fn file_is_written_and_read_back_by_foe() {
    let devices = [("K1", "EK1100"), ("Serial", "EL6601")];
    let mut segment = Segment::simulated(&SegmentFile::in_a_row("files", 1, &devices)).unwrap();
    let plan = segment.scan().unwrap().plan().unwrap();
    let (serial, services) = (plan.device("EL6601").unwrap(), segment.services());
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    let settings = b"baud = 115200".to_vec();
    answer(&mut run, services.foe_write(serial, "settings.txt", 0, settings.clone())).unwrap();
    let back = answer(&mut run, services.foe_read(serial, "settings.txt", 0)).unwrap();
    assert_eq!(back, settings);
    let missing = answer(&mut run, services.foe_read(serial, "other.txt", 0));
    let Err(RequestError::Failed(failure)) = missing else { panic!("{missing:?}") };
    assert_eq!(failure.refusal(), Some((RefusalKind::FoeError, 0x8001)));
    run.stop().unwrap();
}

#[test]
fn words_of_the_sii_and_a_register_are_written_beside_the_cycle() {
    let (mut segment, plan) = machine();
    let (lamps, services) = (plan.device("EL2008").unwrap(), segment.services());
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    let alias = 0x2A_u16;
    let word = 4;
    let bytes = alias.to_le_bytes().to_vec();
    assert!(answer(&mut run, services.sii_write(lamps, word, bytes)).unwrap() >= 1);
    let sii = answer(&mut run, services.sii_read(lamps)).unwrap();
    assert_eq!(sii.get(8..10), Some(&alias.to_le_bytes()[..]));
    let divider = register::WATCHDOG_DIVIDER.address;
    let other = 0x0400_u16;
    answer(&mut run, services.register_write(lamps, divider, other)).unwrap();
    let read: u16 = answer(&mut run, services.register_read(lamps, divider)).unwrap();
    assert_eq!(read, other);
    run.stop().unwrap();
}

#[test]
fn answer_that_is_not_there_when_the_run_ends_says_so() {
    let (mut segment, plan) = machine();
    let (sensor, services) = (plan.device("EL3104").unwrap(), segment.services());
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    run.cycle();
    let pending = services.sdo_read::<u32>(sensor, IDENTITY, 1);
    run.cycle();
    run.stop().unwrap();
    assert!(matches!(pending.wait(Duration::from_secs(5)), Err(RequestError::Ended)));
}

#[test]
fn answer_without_a_run_is_waited_for_so_long_as_was_said() {
    let (segment, plan) = machine();
    let sensor = plan.device("EL3104").unwrap();
    let pending = segment.services().sdo_read::<u32>(sensor, IDENTITY, 1);
    let after = Duration::from_millis(20);
    let late = pending.wait(after);
    assert!(matches!(late, Err(RequestError::Late { after: waited }) if waited == after));
}

#[test]
fn device_of_another_plan_is_refused() {
    let (mut segment, plan) = machine();
    let mut other = Segment::simulated(&SegmentFile::in_a_row("other", 1, &DEVICES[..2])).unwrap();
    let sensor = other.scan().unwrap().plan().unwrap().device("EL3104").unwrap();
    let services = segment.services();
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    let refused = answer(&mut run, services.sdo_read::<u32>(sensor, IDENTITY, 1));
    assert!(matches!(refused, Err(RequestError::OtherPlan { .. })), "{refused:?}");
    let text = Error::from(refused.unwrap_err()).to_string();
    assert!(text.contains("2 SubDevices") && text.contains("3 SubDevices"), "{text}");
    run.stop().unwrap();
}

#[test]
fn line_that_is_only_scanned_answers_registers_sii_states_and_objects() {
    let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &DEVICES)).unwrap();
    let mut line = segment.serve().unwrap();
    assert_eq!(line.inventory().devices.len(), 3);
    let sensor = line.device("EL3104").unwrap();
    let address = register::STATION_ADDRESS.address;
    let station: u16 = line.ask(|services| services.register_read(sensor, address)).unwrap();
    assert_eq!(station, 0x1002);
    let sii = line.ask(|services| services.sii_read(sensor)).unwrap();
    assert_eq!(sii.get(16..20), Some(&2_u32.to_le_bytes()[..]), "vendor, word 8");
    let state = line.ask(|services| services.state(sensor)).unwrap();
    assert_eq!(state.status.state(), linesman::StateValue::Known(AlState::Init), "left there");
    let early = line.ask(|services| services.sdo_read::<u32>(sensor, IDENTITY, 1)).unwrap_err();
    assert!(early.to_string().contains("takes PREOP"), "{early}");
    line.ask(|services| services.enter(sensor, AlState::PreOp)).unwrap();
    let vendor: u32 = line.ask(|services| services.sdo_read(sensor, IDENTITY, 1)).unwrap();
    assert_eq!(vendor, 2);
    // A run follows on the same line.
    let plan = segment.scan().unwrap().plan().unwrap();
    let mut run = segment.start(plan, RunOptions::us(1_000)).unwrap();
    let settled = (0..5_000).any(|_| run.cycle().is_some_and(|io| io.is_settled()));
    assert!(settled);
    run.stop().unwrap();
}

#[test]
fn request_of_another_thread_is_answered_by_the_next_that_is_asked_without_a_run() {
    let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &DEVICES)).unwrap();
    let beside = segment.services();
    let mut line = segment.serve().unwrap();
    let lamps = line.device("EL2008").unwrap();
    let mut pending = beside.state(lamps);
    assert!(pending.poll().is_none());
    line.ask(|services| services.sii_read(lamps)).unwrap();
    assert!(pending.poll().unwrap().is_ok());
}

#[test]
fn device_of_another_plan_is_refused_without_a_run() {
    let mut other = Segment::simulated(&SegmentFile::in_a_row("other", 1, &DEVICES[..2])).unwrap();
    let sensor = other.serve().unwrap().device("EL3104").unwrap();
    let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &DEVICES)).unwrap();
    let mut line = segment.serve().unwrap();
    let refused = line.ask(|services| services.state(sensor));
    assert!(matches!(refused, Err(Error::Service(RequestError::OtherPlan { .. }))), "{refused:?}");
}
