//! The CoE server, as a MainDevice asks it.

use linesman_proto::mailbox::Message;
use linesman_proto::mailbox::coe::information::{
    Answer, Body, EntryDescription, ListKind, Message as Information, ObjectDescription,
    ObjectList, ValueInfo,
};
use linesman_proto::mailbox::coe::sdo::{Initial, Request, Response, Segment};
use linesman_proto::mailbox::coe::{Message as CoeMessage, ObjectAddress, ObjectIndex};
use linesman_proto::time::Span;

use super::Device;

fn preop(name: &str) -> Device {
    let mut device = Device::of(name);
    device.enter_preop();
    device
}

#[test]
fn values_come_by_upload() {
    let mut device = preop("EL3104");
    let table: [(u16, u8, &[u8]); 12] = [
        (0x1000, 0, &[0x89, 0x13, 0, 0]),
        (0x1001, 0, &[0]),
        (0x1008, 0, b"EL3104"),
        (0x1018, 0, &[4]),
        (0x1018, 1, &[2, 0, 0, 0]),
        (0x1018, 2, &[0x52, 0x30, 0x20, 0x0C]),
        (0x1018, 4, &[0x67, 0x12, 0, 0]),
        (0x1C00, 3, &[3]),
        (0x1C12, 0, &[0]),
        (0x1C13, 4, &[0x06, 0x1A]),
        (0x1A02, 1, &[1, 1, 0x10, 0x60]),
        (0x1A00, 11, &[16, 0x11, 0x00, 0x60]),
    ];
    for (index, subindex, expected) in table {
        let found = device.upload(index, subindex);
        assert_eq!(found.as_deref(), Ok(expected), "0x{index:04X}:{subindex:02X}");
    }
}

#[test]
fn whole_objects_come_by_complete_access() {
    let mut device = preop("EL4102");
    let found = device.upload_any(0x1C12, 0, true);
    assert_eq!(found, Ok(vec![2, 0, 0x00, 0x16, 0x01, 0x16]));
    let found = device.upload_any(0x1018, 1, true).unwrap();
    assert_eq!((found.len(), &found[..8]), (16, &[2, 0, 0, 0, 0x52, 0x30, 0x06, 0x10][..]));
    // One bit, then words at whole bytes.
    let found = device.upload_any(0x8000, 0, true);
    assert_eq!(found, Ok(vec![0x13, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]));
    assert_eq!(device.download_any(0x8000, 1, &[1, 5, 0, 0, 0, 2, 0, 7, 0], true), Ok(()));
    assert_eq!(device.upload(0x8000, 0x12), Ok(vec![0, 0, 2, 0]));
    assert_eq!(device.upload(0x8000, 0x13), Ok(vec![7, 0]));
    assert_eq!(device.download_any(0x8000, 1, &[1, 5], true), Err(0x0607_0013));
    assert_eq!(device.upload_any(0x1008, 0, true), Err(0x0601_0004));
    assert_eq!(device.upload_any(0x1018, 2, true), Err(0x0601_0000));
}

#[test]
fn a_whole_assignment_is_taken_or_left() {
    let mut device = preop("EL4102");
    let assign = |device: &mut Device, data: &[u8]| device.download_any(0x1C12, 0, data, true);
    assert_eq!(assign(&mut device, &[1, 0, 0x01, 0x16]), Ok(()));
    assert_eq!(device.upload_any(0x1C12, 0, true), Ok(vec![1, 0, 0x01, 0x16]));
    assert_eq!(assign(&mut device, &[1, 0, 0x02, 0x16]), Err(0x0604_0041));
    assert_eq!(assign(&mut device, &[2, 0, 0x01, 0x16]), Err(0x0607_0010));
    assert_eq!(assign(&mut device, &[3, 0, 0, 0x16, 1, 0x16, 0, 0x16]), Err(0x0609_0011));
    assert_eq!(device.upload_any(0x1C12, 0, true), Ok(vec![1, 0, 0x01, 0x16]), "as before");
}

#[test]
fn what_cannot_be_done_is_aborted_with_its_code() {
    let mut device = preop("EL3104");
    assert_eq!(device.upload(0x2000, 0), Err(0x0602_0000));
    assert_eq!(device.upload(0x1018, 5), Err(0x0609_0011));
    // index, subindex, data, code
    let table: [(u16, u8, &[u8], u32); 10] = [
        (0x2000, 0, &[1], 0x0602_0000),
        (0x1018, 9, &[1], 0x0609_0011),
        (0x1018, 1, &[1, 0, 0, 0], 0x0601_0002),
        (0x8000, 0x13, &[1], 0x0607_0013),
        (0x8000, 0x13, &[1, 2, 3], 0x0607_0012),
        (0x8000, 0x15, &[11, 0], 0x0609_0031),
        (0x8000, 0x01, &[2], 0x0609_0031),
        (0x1C13, 1, &[0x00, 0x1A], 0x0601_0003),
        (0x1C13, 0, &[9], 0x0609_0031),
        (0x1C32, 1, &[4, 0], 0x0609_0031),
    ];
    for (index, subindex, data, code) in table {
        let found = device.download(index, subindex, data);
        assert_eq!(found, Err(code), "0x{index:04X}:{subindex:02X} {data:?}");
    }
    assert_eq!(device.download(0x1C13, 0, &[0]), Ok(()));
    assert_eq!(device.download(0x1C13, 1, &[0x00, 0x16]), Err(0x0604_0041), "an RxPDO");
    device = preop("EL3104");
    device.enter_safeop();
    assert_eq!(device.download(0x1C13, 0, &[0]), Err(0x0800_0022), "in PREOP only");
    assert_eq!(device.download(0x8000, 0x13, &[1, 0]), Ok(()));
}

#[test]
fn settings_outlive_the_supply_and_assignments_do_not() {
    let mut device = preop("EL4102");
    assert_eq!(device.download(0x8000, 0x13, &[0x34, 0x12]), Ok(()));
    assert_eq!(device.download(0x1C12, 0, &[0]), Ok(()));
    let now = device.bench.now;
    device.bench.controller.power_off(now);
    device.bench.wait(Span::ms(1));
    let now = device.bench.now;
    device.bench.controller.power_on(now);
    device.bench.wait(Span::ms(200));
    device.enter_preop();
    assert_eq!(device.upload(0x8000, 0x13), Ok(vec![0x34, 0x12]));
    assert_eq!(device.upload(0x1C12, 0), Ok(vec![2]));
}

#[test]
fn long_values_come_in_segments() {
    // 128 bytes of mailbox; 0x1A00 has 11 entries of 4 bytes: 46 bytes, in one message. A mailbox
    // of the shortest length takes segments.
    let mut device = Device::of("EL3104");
    let mut areas = device.profile.mailbox.unwrap();
    areas.areas.receive.size = 0x22;
    areas.areas.send.size = 0x22;
    device.profile.mailbox = Some(areas);
    device.enter_preop();
    let whole = device.upload_any(0x1A00, 0, true).unwrap();
    assert_eq!(whole.len(), 2 + 11 * 4);
    assert_eq!(whole[..6], [11, 0, 1, 1, 0x00, 0x60]);
    assert_eq!(whole[42..], [16, 0x11, 0x00, 0x60]);
}

#[test]
fn segments_out_of_turn_are_aborted() {
    let mut device = Device::of("EL3104");
    let mut areas = device.profile.mailbox.unwrap();
    areas.areas.send.size = 0x22;
    device.profile.mailbox = Some(areas);
    device.enter_preop();
    let code = |answer: &[u8]| match CoeMessage::parse(answer).unwrap() {
        CoeMessage::Abort(abort) => Some(abort.code),
        _ => None,
    };
    let object = ObjectAddress::new(0x1A00, 0);
    let answer = device.ask(Request::UploadSegment { toggle: false });
    assert_eq!(code(&answer), Some(0x0504_0001), "no transfer is under way");
    device.ask(Request::Upload { object, complete: true });
    let answer = device.ask(Request::UploadSegment { toggle: true });
    assert_eq!(code(&answer), Some(0x0503_0000));
    let answer = device.ask(Request::UploadSegment { toggle: false });
    assert_eq!(code(&answer), Some(0x0504_0001), "the abort ended it");

    let object = ObjectAddress::new(0x8000, 0x13);
    let begin = |size| Request::Download {
        object,
        complete: false,
        initial: Initial::Normal { size, data: &[1] },
    };
    let segment = |data, last| Request::DownloadSegment(Segment { toggle: false, last, data });
    assert_eq!(code(&device.ask(begin(1_000_000))), Some(0x0504_0005));
    assert_eq!(code(&device.ask(begin(2))), None);
    assert_eq!(code(&device.ask(segment(&[2, 3], true))), Some(0x0607_0012));
    device.ask(begin(2));
    assert_eq!(code(&device.ask(segment(&[], true))), Some(0x0607_0013));
    device.ask(begin(2));
    assert_eq!(code(&device.ask(segment(&[2], true))), None);
    assert_eq!(device.upload(0x8000, 0x13), Ok(vec![1, 2]));
}

/// Asks for information and puts the fragments together.
fn information(device: &mut Device, body: Body<'_>) -> Result<(Answer, Vec<u8>), u32> {
    device.send(&CoeMessage::Information(Information::whole(body)));
    let mut collected = Vec::new();
    loop {
        let answer = device.fetch_soon().expect("no answer");
        let message = Message::parse(&answer).unwrap();
        let CoeMessage::Information(message) = CoeMessage::parse(message.data).unwrap() else {
            panic!("{answer:02X?}");
        };
        match message.body {
            Body::Answer { to, fragment } => {
                collected.extend_from_slice(fragment);
                if !message.incomplete {
                    assert_eq!(message.fragments_left, 0);
                    return Ok((to, collected));
                }
            }
            Body::Error { code } => return Err(code),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn the_dictionary_can_be_asked_for() {
    let mut device = preop("EL7041");
    let ask = |list| Body::ListRequest { list };
    let (to, bytes) = information(&mut device, ask(ListKind::All)).unwrap();
    assert_eq!(to, Answer::List);
    let all: Vec<u16> = ObjectList::parse(&bytes).unwrap().indices().map(|i| i.0).collect();
    assert!(all.is_sorted());
    for index in [0x1000, 0x1018, 0x1602, 0x1A03, 0x1C12, 0x1C33, 0x6010, 0x7010, 0x8010, 0xF000] {
        assert!(all.contains(&index), "0x{index:04X}");
    }
    let (_, bytes) = information(&mut device, ask(ListKind::RxPdoMappable)).unwrap();
    let mappable: Vec<u16> = ObjectList::parse(&bytes).unwrap().indices().map(|i| i.0).collect();
    assert_eq!(mappable, [0x7000, 0x7010]);
    let (_, bytes) = information(&mut device, ask(ListKind::Counts)).unwrap();
    let counts = ObjectList::parse(&bytes).unwrap().counts().unwrap();
    assert_eq!(counts, [all.len() as u16, 2, 3, 2, 2]);
    assert_eq!(information(&mut device, ask(ListKind::Other(9))), Err(0x0609_0030));

    for index in &all {
        let body = Body::ObjectRequest { index: ObjectIndex(*index) };
        let (_, bytes) = information(&mut device, body).unwrap();
        let object = ObjectDescription::parse(&bytes).unwrap();
        assert!(!object.name_text().is_empty(), "0x{index:04X}");
        let body = Body::EntryRequest {
            object: ObjectAddress::new(*index, object.max_subindex),
            values: ValueInfo(0x7F),
        };
        let (_, bytes) = information(&mut device, body).unwrap();
        let entry = EntryDescription::parse(&bytes).unwrap();
        assert!(entry.bits > 0 && !entry.name_text().is_empty(), "0x{index:04X}");
    }
    let body =
        Body::EntryRequest { object: ObjectAddress::new(0x7010, 0x21), values: ValueInfo(0) };
    let (_, bytes) = information(&mut device, body).unwrap();
    let entry = EntryDescription::parse(&bytes).unwrap();
    assert_eq!((entry.name_text().as_ref(), entry.bits), ("Velocity", 16));
    assert_eq!(entry.access.0, 0x0047);
    // 0x7010 has no subindex 4, but others behind it.
    let body = |subindex| Body::EntryRequest {
        object: ObjectAddress::new(0x7010, subindex),
        values: ValueInfo(0),
    };
    let (_, bytes) = information(&mut device, body(4)).unwrap();
    assert_eq!(EntryDescription::parse(&bytes).unwrap().bits, 0);
    assert_eq!(information(&mut device, body(0x22)), Err(0x0609_0011));
    let body = Body::ObjectRequest { index: ObjectIndex(0x2000) };
    assert_eq!(information(&mut device, body), Err(0x0602_0000));
}

#[test]
fn an_upload_answer_is_what_the_specification_says() {
    let mut device = preop("EL3104");
    let object = ObjectAddress::new(0x1C00, 1);
    let answer = device.ask(Request::Upload { object, complete: false });
    assert_eq!(answer, [0x00, 0x30, 0x4F, 0x00, 0x1C, 0x01, 1, 0, 0, 0]);
    let CoeMessage::SdoResponse(Response::Upload { .. }) = CoeMessage::parse(&answer).unwrap()
    else {
        panic!()
    };
}
