//! The mailbox itself: waiting, repeating, and whatever a bad MainDevice may put into it.

use linesman_proto::mailbox::coe::{Emergency, ErrorRegister};
use linesman_proto::mailbox::{ErrorReply, Header, MailboxType, Message};
use linesman_proto::time::Span;
use proptest::prelude::*;

use super::Device;

/// An upload of the vendor, with mailbox counter `counter`.
fn upload(counter: u8) -> [u8; 16] {
    [10, 0, 0, 0, 0, 0x03 | counter << 4, 0, 0x20, 0x40, 0x18, 0x10, 1, 0, 0, 0, 0]
}

fn preop() -> Device {
    let mut device = Device::of("EL3104");
    device.enter_preop();
    device
}

#[test]
fn one_request_is_worked_on_and_one_waits() {
    let mut device = preop();
    assert!(device.post(&upload(1)));
    assert!(device.post(&upload(2)), "taken out at once");
    assert!(!device.post(&upload(3)), "full");
    assert!(device.fetch().is_none(), "not answered yet");
    for counter in [1, 2] {
        let answer = device.fetch_soon().unwrap();
        let header = Header::parse(&answer).unwrap();
        assert_eq!(header.counter.value(), counter, "the device counts its own messages");
        assert_eq!(answer[6..16], [0, 0x30, 0x43, 0x18, 0x10, 1, 2, 0, 0, 0]);
    }
    assert!(device.fetch_soon().is_none());
}

#[test]
fn a_repeated_counter_is_not_answered_again() {
    let mut device = preop();
    for (counter, answered) in [(3, true), (3, false), (4, true), (0, true), (0, true)] {
        assert!(device.post(&upload(counter)));
        assert_eq!(device.fetch_soon().is_some(), answered, "counter {counter}");
    }
}

#[test]
fn a_lost_answer_is_repeated() {
    let mut device = preop();
    device.post(&upload(1));
    let answer = device.fetch_soon().unwrap();
    assert!(device.fetch().is_none());
    // The MainDevice did not get it: it turns the repeat bit and waits for the acknowledgement.
    device.bench.write(0x080E, &[0x03]);
    device.bench.wait(Span::ms(1));
    assert_eq!(device.bench.byte(0x080F) & 0x02, 0x02);
    assert_eq!(device.fetch(), Some(answer));
    device.post(&upload(2));
    assert!(device.fetch_soon().is_some(), "and on it goes");
}

#[test]
fn lost_answer_is_repeated_before_the_next_message_that_waits_already() {
    let mut device = Device::of("EL3104");
    device.enter_preop();
    let report = |device: &mut Device, code| {
        let emergency = Emergency { code, register: ErrorRegister(1), data: [0; 5] };
        let now = device.bench.now;
        device.bench.controller.report(now, emergency);
        device.bench.wait(Span::ms(10));
    };
    let code = |message: Option<Vec<u8>>| message.map(|m| u16::from_le_bytes([m[8], m[9]]));
    for emergency in [1, 2, 3] {
        report(&mut device, emergency);
    }
    // Nothing has been fetched, so there is nothing to repeat: the first stays where it is.
    device.bench.write(0x080E, &[0x03]);
    device.bench.wait(Span::ms(1));
    assert_eq!(device.bench.byte(0x080F) & 0x02, 0x02);
    assert_eq!(code(device.fetch()), Some(1));
    device.bench.wait(Span::ms(1));
    assert_eq!(device.bench.byte(0x080D) & 0x08, 0x08, "the second one is in the mailbox");
    // The MainDevice did not get the first. It asks twice, which changes nothing.
    for request in [0x01, 0x03] {
        device.bench.write(0x080E, &[request]);
        device.bench.wait(Span::ms(1));
        assert_eq!(device.bench.byte(0x080F) & 0x02, request & 0x02);
    }
    for expected in [1, 2, 3] {
        assert_eq!(code(device.fetch_soon()), Some(expected));
    }
    assert!(device.fetch_soon().is_none());
    // The same with an empty mailbox: the last one comes once more, and none before it.
    for request in [0x01, 0x03] {
        device.bench.write(0x080E, &[request]);
        device.bench.wait(Span::ms(1));
    }
    assert_eq!(code(device.fetch_soon()), Some(3));
    assert!(device.fetch_soon().is_none());
}

#[test]
fn what_is_no_message_is_answered_with_an_error() {
    // message, code of the error reply
    let table: [(&[u8], u16); 9] = [
        // More data than there is mailbox.
        (&[0xFF, 0, 0, 0, 0, 0x13], 8),
        // AoE, EoE, SoE, VoE and a reserved protocol.
        (&[10, 0, 0, 0, 0, 0x11], 2),
        (&[10, 0, 0, 0, 0, 0x12], 2),
        (&[10, 0, 0, 0, 0, 0x15], 2),
        (&[10, 0, 0, 0, 0, 0x1F], 2),
        (&[10, 0, 0, 0, 0, 0x19], 2),
        // CoE: no header, a service that does not exist, one that only devices have.
        (&[1, 0, 0, 0, 0, 0x13], 6),
        (&[10, 0, 0, 0, 0, 0x13, 0, 0xF0], 5),
        (&[10, 0, 0, 0, 0, 0x13, 0, 0x10, 0, 0, 0, 0, 0, 0, 0, 0], 4),
    ];
    for (message, code) in table {
        let mut device = preop();
        assert!(device.post(message));
        let answer = device.fetch_soon().unwrap_or_else(|| panic!("{message:02X?}"));
        let answer = Message::parse(&answer).unwrap();
        assert_eq!(answer.header.kind, MailboxType::Error, "{message:02X?}");
        assert_eq!(ErrorReply::parse(answer.data).unwrap().code.code(), code, "{message:02X?}");
    }
}

#[test]
fn the_address_of_a_gateway_comes_back() {
    let mut device = preop();
    let mut request = upload(1);
    request[2..4].copy_from_slice(&1_001u16.to_le_bytes());
    device.post(&request);
    let answer = device.fetch_soon().unwrap();
    assert_eq!(answer[2..4], 1_001u16.to_le_bytes());
}

#[test]
fn an_emergency_comes_unasked_once_there_is_a_mailbox() {
    let mut device = Device::of("EL3104");
    let emergency =
        Emergency { code: 0x4210, register: ErrorRegister(0x09), data: [1, 2, 3, 4, 5] };
    let now = device.bench.now;
    device.bench.controller.report(now, emergency);
    device.bench.wait(Span::ms(10));
    device.enter_preop();
    let message = device.fetch_soon().unwrap();
    assert_eq!(message[..16], [10, 0, 0, 0, 0, 0x13, 0, 0x10, 0x10, 0x42, 9, 1, 2, 3, 4, 5]);
    assert_eq!(device.upload(0x1001, 0), Ok(vec![9]));
}

#[test]
fn in_init_nobody_answers_and_afterwards_nothing_is_left() {
    let mut device = preop();
    device.post(&upload(1));
    device.bench.write(0x0120, &[1, 0]);
    device.bench.wait(Span::ms(10));
    device.fetch();
    assert!(device.fetch_soon().is_none());
    device.bench.write(0x0806, &[0]);
    device.bench.write(0x080E, &[0]);
    device.enter_preop();
    assert!(device.fetch_soon().is_none());
    device.post(&upload(1));
    assert!(device.fetch_soon().is_some(), "the counter starts anew");
}

#[test]
fn in_boot_there_is_no_coe() {
    let mut device = Device::of("EL3104");
    let mut mailbox = device.profile.mailbox.unwrap();
    mailbox.areas.receive.size = 244;
    mailbox.areas.send.size = 244;
    mailbox.areas.send.offset.0 = 0x10F4;
    device.profile.mailbox = Some(mailbox);
    device.set_up_mailbox();
    assert_eq!(device.request(3), (3, 0));
    device.post(&upload(1));
    let answer = device.fetch_soon().unwrap();
    assert_eq!(answer[..10], [4, 0, 0, 0, 0, 0x10, 1, 0, 2, 0]);
}

/// Messages that look right for a while.
fn message() -> impl Strategy<Value = Vec<u8>> {
    let body = proptest::collection::vec(any::<u8>(), 0..120);
    let service = prop_oneof![Just(2u8), Just(8u8), any::<u8>()];
    (any::<u8>(), any::<bool>(), any::<u8>(), service, body).prop_map(
        |(len, honest, counter, service, body)| {
            let len = if honest { body.len() as u8 + 2 } else { len };
            let mut message = vec![len, 0, 0, 0, 0, 0x03 | counter << 4, 0, service << 4];
            message.extend(body);
            message
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn nothing_in_the_mailbox_brings_a_device_down(
        messages in proptest::collection::vec(
            prop_oneof![message(), proptest::collection::vec(any::<u8>(), 0..128)], 1..24)
    ) {
        let mut device = preop();
        for message in &messages {
            device.post(message);
            device.bench.wait(Span::ms(2));
            if let Some(answer) = device.fetch() {
                prop_assert!(Message::parse(&answer).is_ok());
            }
        }
        for _ in 0..40 {
            device.bench.wait(Span::ms(2));
            device.fetch();
        }
        prop_assert_eq!(device.status(), (2, 0));
        // A counter of 0 is never taken for a repetition.
        prop_assert!(device.post(&upload(0)));
        let answer = device.fetch_soon();
        prop_assert!(answer.is_some());
    }
}
