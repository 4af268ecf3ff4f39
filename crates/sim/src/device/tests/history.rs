//! Diagnosis history of a device and how a MainDevice reads it: 0x10F3, 0x10F8, emergencies.

use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::diagnosis::{DiagnosisMessage, Parameter, Severity};
use linesman_proto::mailbox::coe::{
    DataType, Emergency, ErrorRegister, Message as CoeMessage, ObjectIndex,
};
use linesman_proto::mailbox::{ErrorReplyCode, Message};
use linesman_proto::time::Span;

use super::Device;
use crate::device::SoftwareFault;
use crate::device::software_fault::{RefusedWith, SdoRefusals};
use crate::seed::Seed;

const HISTORY: u16 = 0x10F3;

fn messages(device: &mut Device) -> Vec<Vec<u8>> {
    let count = device.upload(HISTORY, 0).unwrap()[0];
    (6..=count).map(|subindex| device.upload(HISTORY, subindex).unwrap()).collect()
}

// proves: SW-08 partial: the history of one virtual device, read and acknowledged through SDOs
#[test]
fn a_fall_out_of_op_is_noted_with_its_code() {
    let mut device = Device::of("EL4102");
    device.bring_up();
    assert_eq!(device.upload(HISTORY, 3).unwrap(), [0]);
    device.bench.wait(Span::ms(150));
    assert_eq!(device.status(), (0x14, 0x001B));
    let all = messages(&mut device);
    let last = DiagnosisMessage::parse(all.last().unwrap()).unwrap();
    assert_eq!(
        (last.severity, last.code & 0xFFFF, last.local_time),
        (Severity::Error, 0xE000, true)
    );
    assert_eq!(last.code >> 16, 0x1006, "the type stands in the high word");
    let parameters: Vec<Parameter<'_>> = last.parameters().collect();
    assert_eq!(
        parameters,
        [Parameter::Value(DataType::USINT, &[4]), Parameter::Value(DataType::UINT, &[0x1B, 0x00])]
    );
    assert!(last.time_ns > 100_000_000, "{}", last.time_ns);
    assert_eq!(device.upload(HISTORY, 4).unwrap(), [1]);
    let newest = device.upload(HISTORY, 2).unwrap();
    assert_eq!(usize::from(newest[0]), 5 + all.len());
    device.download(HISTORY, 3, &newest).unwrap();
    assert_eq!(device.upload(HISTORY, 4).unwrap(), [0]);
    assert_eq!(device.download(HISTORY, 3, &[5]), Err(0x0609_0030));
    device.download(HISTORY, 3, &[0]).unwrap();
    assert_eq!(device.upload(HISTORY, 0).unwrap(), [5]);
    assert_eq!(device.upload(HISTORY, 6), Err(0x0609_0011));
    assert_eq!(device.upload_any(HISTORY, 0, true), Err(0x0601_0004));
}

#[test]
fn notes_come_as_emergencies_when_the_flags_say_so() {
    let mut device = Device::of("EL4102");
    device.enter_preop();
    device.download(HISTORY, 5, &[1, 0]).unwrap();
    device.set_up_process_data();
    device.bench.write(0x081E, &[0]);
    device.bench.write(0x0816, &[0]);
    assert_eq!(device.request(4), (0x12, 0x001D));
    let message = device.fetch_soon().unwrap();
    let message = Message::parse(&message).unwrap();
    let CoeMessage::Emergency(emergency) = CoeMessage::parse(message.data).unwrap() else {
        panic!("{message:?}")
    };
    // Specific to the device; severity 2, text 0x8001.
    assert_eq!((emergency.code, emergency.data), (0xFF00, [2, 0x01, 0x80, 0, 0]));
}

#[test]
fn emergencies_are_noted_and_their_end_is_told() {
    let mut device = Device::of("EL3104");
    device.enter_preop();
    for (code, register) in [(0x4310, 0x08), (0x0000, 0x00)] {
        let now = device.bench.now;
        let register = ErrorRegister(register);
        device.bench.controller.report(now, Emergency { code, register, data: [0; 5] });
        let message = device.fetch_soon().unwrap();
        assert_eq!(message[6..11], [0, 0x10, code as u8, (code >> 8) as u8, register.0]);
        assert_eq!(device.upload(0x1001, 0).unwrap(), [register.0]);
        let newest = messages(&mut device).pop().unwrap();
        let newest = DiagnosisMessage::parse(&newest).unwrap();
        assert_eq!(newest.code, u32::from(code) << 16 | 0xE800);
    }
    // Nobody fetches them: no more than a few are kept, and the device works on.
    for code in 0x1000..0x1100 {
        let now = device.bench.now;
        let emergency = Emergency { code, register: ErrorRegister(1), data: [0; 5] };
        device.bench.controller.report(now, emergency);
        device.bench.wait(Span::ms(1));
    }
    let kept = std::iter::from_fn(|| device.fetch_soon()).count();
    assert!((8..=16).contains(&kept), "{kept}");
    assert_eq!(device.upload(0x1018, 1).unwrap(), [2, 0, 0, 0]);
}

#[test]
fn the_time_is_that_of_the_local_clock_until_another_is_set() {
    let mut device = Device::of("EL4102");
    device.enter_preop();
    let read = |device: &mut Device| {
        u64::from_le_bytes(device.upload(0x10F8, 0).unwrap().try_into().unwrap())
    };
    let first = read(&mut device);
    device.bench.wait(Span::ms(100));
    let later = read(&mut device);
    assert!((100_000_000..110_000_000).contains(&(later - first)), "{first} {later}");
    device.bench.write(0x0920, &1_000_000_000_000u64.to_le_bytes());
    assert!(read(&mut device) > 1_000_000_000_000);
}

#[test]
fn settings_go_back_to_what_they_were() {
    let mut device = Device::of("EL7041");
    device.enter_preop();
    let before = device.upload(0x8010, 1).unwrap();
    device.download(0x8010, 1, &[1, 0]).unwrap();
    assert_eq!(device.download(0x1011, 1, b"last"), Err(0x0800_0020));
    assert_eq!(device.upload(0x8010, 1).unwrap(), [1, 0]);
    device.download(0x1011, 1, b"load").unwrap();
    assert_eq!(device.upload(0x8010, 1).unwrap(), before);
    assert_eq!(device.upload(0x1011, 1).unwrap(), [1, 0, 0, 0], "it tells what it can");
}

#[test]
fn refused_requests_are_refused_as_the_fault_says() {
    let mut device = Device::of("EL7041");
    device.enter_preop();
    let refusals = |answer| {
        SoftwareFault::RefusesSdo(SdoRefusals {
            answer,
            first: ObjectIndex(0x8000),
            last: ObjectIndex(0x8FFF),
            share_ppm: 1_000_000,
            seed: Seed(1),
        })
    };
    let aborts = refusals(RefusedWith::Abort(SdoAbortCode::HARDWARE_ERROR));
    let firmware = device.bench.controller.firmware_mut();
    firmware.software_fault(aborts, true);
    assert_eq!(device.upload(0x8010, 1), Err(0x0606_0000));
    assert_eq!(device.download(0x8010, 1, &[1, 0]), Err(0x0606_0000));
    assert!(device.upload(0x1018, 1).is_ok(), "only those objects");
    let replies = refusals(RefusedWith::ErrorReply(ErrorReplyCode::NoMemory));
    let firmware = device.bench.controller.firmware_mut();
    firmware.software_fault(aborts, false);
    firmware.software_fault(replies, true);
    assert!(device.post(&[10, 0, 0, 0, 0, 0x03, 0, 0x20, 0x40, 0x10, 0x80, 1, 0, 0, 0, 0]));
    let answer = device.fetch_soon().unwrap();
    assert_eq!(answer[..10], [4, 0, 0, 0, 0, answer[5], 1, 0, 7, 0]);
    device.bench.controller.firmware_mut().software_fault(replies, false);
    assert!(device.upload(0x8010, 1).is_ok());
}

#[test]
fn the_priority_of_a_request_comes_back() {
    let mut device = Device::of("EL3104");
    device.enter_preop();
    let mut request = [10, 0, 0, 0, 0, 0x13, 0, 0x20, 0x40, 0x18, 0x10, 1, 0, 0, 0, 0];
    request[4] = 0x80;
    device.post(&request);
    assert_eq!(device.fetch_soon().unwrap()[4], 0x80);
}
