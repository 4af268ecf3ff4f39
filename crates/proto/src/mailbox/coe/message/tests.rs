//! CoE messages as bytes: tables from specification and captures, properties, hostile bytes.

use proptest::prelude::*;

use super::*;
use crate::mailbox::coe::information::{Answer, Body, ListKind, ValueInfo};
use crate::mailbox::coe::object::{ObjectAddress, ObjectIndex};
use crate::mailbox::coe::sdo::{Expedited, Initial, Request, Response, Segment};
use crate::mailbox::coe::{ErrorRegister, emergency};

fn written(message: &Message<'_>) -> Vec<u8> {
    let mut buffer = vec![0xAA; 2048];
    let len = message.write(&mut buffer).unwrap();
    buffer.truncate(len);
    buffer
}

/// Bytes that mean a message, and that the message is written as.
#[track_caller]
fn both_ways(bytes: &[u8], message: Message<'_>) {
    assert_eq!(Message::parse(bytes), Ok(message), "{bytes:02X?}");
    assert_eq!(written(&message), bytes, "{message:?}");
}

fn expedited(data: &[u8]) -> Initial<'static> {
    Initial::Expedited(Expedited::new(data).unwrap())
}

#[test]
fn expedited_transfers_have_the_commands_of_the_specification() {
    let object = ObjectAddress::new(0x1C12, 0);
    for (command, data) in
        [(0x2F, [9].as_slice()), (0x2B, &[9, 8]), (0x27, &[9, 8, 7]), (0x23, &[9, 8, 7, 6])]
    {
        let mut bytes = [0x00, 0x20, command, 0x12, 0x1C, 0x00, 0, 0, 0, 0];
        bytes[6..6 + data.len()].copy_from_slice(data);
        let initial = expedited(data);
        assert!(initial.is_complete());
        let download = Request::Download { object, complete: false, initial };
        both_ways(&bytes, Message::SdoRequest(download));
        // 0x4F, 0x4B, 0x47, 0x43: the same bits under the other specifier.
        bytes[1] = 0x30;
        bytes[2] = command - 0x20 + 0x40;
        let upload = Response::Upload { object, complete: false, initial };
        both_ways(&bytes, Message::SdoResponse(upload));
    }
}

#[test]
fn questions_and_acknowledgements_take_ten_bytes() {
    let object = ObjectAddress::new(0x1018, 4);
    let upload = |complete| Message::SdoRequest(Request::Upload { object, complete });
    let download = |complete| Message::SdoResponse(Response::Download { object, complete });
    both_ways(&[0, 0x20, 0x40, 0x18, 0x10, 4, 0, 0, 0, 0], upload(false));
    both_ways(&[0, 0x20, 0x50, 0x18, 0x10, 4, 0, 0, 0, 0], upload(true));
    both_ways(&[0, 0x30, 0x60, 0x18, 0x10, 4, 0, 0, 0, 0], download(false));
    both_ways(&[0, 0x30, 0x70, 0x18, 0x10, 4, 0, 0, 0, 0], download(true));
    for (toggle, bit) in [(false, 0x00), (true, 0x10)] {
        let ask = Message::SdoRequest(Request::UploadSegment { toggle });
        both_ways(&[0, 0x20, 0x60 | bit, 0, 0, 0, 0, 0, 0, 0], ask);
        let taken = Message::SdoResponse(Response::DownloadSegment { toggle });
        both_ways(&[0, 0x30, 0x20 | bit, 0, 0, 0, 0, 0, 0, 0], taken);
    }
}

#[test]
fn normal_transfers_announce_their_size() {
    // A LAN9252's 0x1C00 by complete access, and an EK1914's name.
    let types = [0, 0x30, 0x51, 0x00, 0x1C, 0, 6, 0, 0, 0, 4, 0, 1, 2, 3, 4];
    let initial = Initial::Normal { size: 6, data: &[4, 0, 1, 2, 3, 4] };
    let object = ObjectAddress::new(0x1C00, 0);
    both_ways(&types, Message::SdoResponse(Response::Upload { object, complete: true, initial }));
    let name = [0, 0x30, 0x41, 8, 0x10, 0, 6, 0, 0, 0, b'E', b'K', b'1', b'9', b'1', b'4'];
    let initial = Initial::Normal { size: 6, data: b"EK1914" };
    let object = ObjectAddress::new(0x1008, 0);
    both_ways(&name, Message::SdoResponse(Response::Upload { object, complete: false, initial }));
    // What stands behind the announced size is not the object's.
    let long = [0, 0x30, 0x41, 8, 0x10, 0, 2, 0, 0, 0, b'E', b'K', 0, 0];
    let Ok(Message::SdoResponse(Response::Upload { initial, .. })) = Message::parse(&long) else {
        panic!("no upload");
    };
    assert_eq!(initial.data(), b"EK");
}

#[test]
fn an_expedited_upload_without_a_size_is_four_bytes() {
    // The bits that would count unused bytes mean nothing then.
    for command in [0x42, 0x4E] {
        let bytes = [0, 0x30, command, 0x18, 0x10, 1, 1, 2, 3, 4];
        let Ok(Message::SdoResponse(Response::Upload { initial, .. })) = Message::parse(&bytes)
        else {
            panic!("no upload");
        };
        assert_eq!(initial, expedited(&[1, 2, 3, 4]), "0x{command:02X}");
    }
}

#[test]
fn short_segments_are_filled_up_and_say_so() {
    for (len, command) in
        [(0, 0x0F), (1, 0x0D), (2, 0x0B), (3, 0x09), (4, 0x07), (5, 0x05), (6, 0x03), (7, 0x01)]
    {
        let data = &[1, 2, 3, 4, 5, 6, 7][..len];
        let mut bytes = [0, 0x20, command, 0, 0, 0, 0, 0, 0, 0];
        bytes[3..3 + len].copy_from_slice(data);
        let segment = Segment { toggle: false, last: true, data };
        both_ways(&bytes, Message::SdoRequest(Request::DownloadSegment(segment)));
        bytes[1] = 0x30;
        both_ways(&bytes, Message::SdoResponse(Response::UploadSegment(segment)));
    }
    // From eight bytes on the length of the message tells, and the unused bits mean nothing.
    let segment = Segment { toggle: true, last: false, data: &[1, 2, 3, 4, 5, 6, 7, 8] };
    let bytes = [0, 0x20, 0x10, 1, 2, 3, 4, 5, 6, 7, 8];
    both_ways(&bytes, Message::SdoRequest(Request::DownloadSegment(segment)));
    // A SubDevice that does not fill up sends what it has.
    let short = [0, 0x30, 0x01, 1, 2, 3];
    let unfilled = Segment { toggle: false, last: true, data: &[1, 2, 3] };
    let expected = Ok(Message::SdoResponse(Response::UploadSegment(unfilled)));
    assert_eq!(Message::parse(&short), expected);
}

// proves: SW-10 partial
#[test]
fn aborts_come_under_either_service() {
    // The case of the sources: 0x10F0:01 is write-only.
    let abort = Abort { object: ObjectAddress::new(0x10F0, 1), code: 0x0601_0002 };
    let bytes = [0, 0x20, 0x80, 0xF0, 0x10, 1, 0x02, 0x00, 0x01, 0x06];
    both_ways(&bytes, Message::Abort(abort));
    let mut as_response = bytes;
    as_response[1] = 0x30;
    assert_eq!(Message::parse(&as_response), Ok(Message::Abort(abort)));
}

#[test]
fn information_has_its_questions_and_answers() {
    let whole = |body| Message::Information(information::Message::whole(body));
    let index = ObjectIndex(0x1018);
    let object = ObjectAddress::new(0x1018, 1);
    let values = ValueInfo(0x07);
    let list = Body::Answer { to: Answer::List, fragment: &[1, 0, 0, 0x10] };
    for (bytes, body) in [
        ([0, 0x80, 1, 0, 0, 0, 1, 0].as_slice(), Body::ListRequest { list: ListKind::All }),
        (&[0, 0x80, 2, 0, 0, 0, 1, 0, 0, 0x10], list),
        (&[0, 0x80, 3, 0, 0, 0, 0x18, 0x10], Body::ObjectRequest { index }),
        (&[0, 0x80, 5, 0, 0, 0, 0x18, 0x10, 1, 7], Body::EntryRequest { object, values }),
        (&[0, 0x80, 7, 0, 0, 0, 0, 0, 2, 6], Body::Error { code: 0x0602_0000 }),
    ] {
        both_ways(bytes, whole(body));
    }
    let fragment = Body::Answer { to: Answer::Entry, fragment: &[] };
    let more = information::Message { incomplete: true, fragments_left: 0x0102, body: fragment };
    both_ways(&[0, 0x80, 0x86, 0, 2, 1], Message::Information(more));
}

#[test]
fn emergencies_and_mailbox_pdos_are_carried() {
    let emergency =
        emergency::Emergency { code: 0xA000, register: ErrorRegister(0x10), data: [1, 2, 3, 4, 5] };
    both_ways(&[0, 0x10, 0x00, 0xA0, 0x10, 1, 2, 3, 4, 5], Message::Emergency(emergency));
    let pdo = Message::Pdo { service: PdoService::Rx, number: 0x0102, data: &[7, 8] };
    both_ways(&[0x02, 0x51, 7, 8], pdo);
}

#[test]
fn what_is_no_coe_is_refused_by_name() {
    let table: [(&[u8], CoeError); 8] = [
        (&[0], CoeError::CutOff { what: "CoE header", needed: 2, len: 1 }),
        (&[0, 0x90], CoeError::ReservedService { code: 9 }),
        (&[0, 0x20], CoeError::CutOff { what: "SDO request", needed: 1, len: 0 }),
        (&[0, 0x20, 0xA0], CoeError::UnknownSpecifier { what: "request", specifier: 5 }),
        (&[0, 0x30, 0xC0], CoeError::UnknownSpecifier { what: "response", specifier: 6 }),
        (
            &[0, 0x20, 0x23, 0, 0, 0, 1],
            CoeError::CutOff { what: "SDO download", needed: 8, len: 5 },
        ),
        (&[0, 0x80, 9, 0, 0, 0], CoeError::UnknownOpcode { opcode: 9 }),
        (&[0, 0x10, 1, 2], CoeError::CutOff { what: "CoE emergency", needed: 8, len: 2 }),
    ];
    for (bytes, error) in table {
        assert_eq!(Message::parse(bytes), Err(error), "{bytes:02X?}");
    }
}

#[test]
fn a_mailbox_too_small_is_said_before_anything_is_lost() {
    let object = ObjectAddress::new(0x1008, 0);
    let upload = Message::SdoRequest(Request::Upload { object, complete: false });
    for len in 0..10 {
        assert!(upload.write(&mut vec![0; len]).is_err(), "{len} bytes");
    }
    assert_eq!(upload.write(&mut [0; 10]), Ok(10));
}

/// Carries data from one side to the other through a mailbox of this size, message by message as
/// bytes, and gives what arrives and how many messages it took.
fn carried(whole: &[u8], mailbox_size: usize) -> (Vec<u8>, usize) {
    let room = mailbox_size - crate::mailbox::HEADER_LEN;
    let object = ObjectAddress::new(0x1008, 0);
    let initial = Initial::of(whole, mailbox_size);
    let first = Message::SdoRequest(Request::Download { object, complete: false, initial });
    let bytes = written(&first);
    assert!(bytes.len() <= room);
    let Ok(Message::SdoRequest(Request::Download { initial, .. })) = Message::parse(&bytes) else {
        panic!("no download: {bytes:02X?}");
    };
    let size = usize::try_from(initial.size()).unwrap();
    let mut arrived = initial.data().to_vec();
    let mut messages = 1;
    let mut toggle = false;
    let mut last = initial.is_complete();
    while !last {
        let segment = Segment::of(&whole[arrived.len()..], toggle, mailbox_size);
        let bytes = written(&Message::SdoResponse(Response::UploadSegment(segment)));
        assert!((10..=room).contains(&bytes.len()));
        let Ok(Message::SdoResponse(Response::UploadSegment(segment))) = Message::parse(&bytes)
        else {
            panic!("no segment: {bytes:02X?}");
        };
        assert_eq!(segment.toggle, toggle);
        arrived.extend_from_slice(segment.data);
        toggle = !toggle;
        last = segment.last;
        messages += 1;
    }
    assert_eq!(size, arrived.len());
    (arrived, messages)
}

#[test]
fn a_transfer_takes_as_many_messages_as_its_mailbox_demands() {
    // 128 bytes of mailbox: 112 in the first message, 119 in each segment.
    for (len, messages) in [(0, 1), (1, 1), (4, 1), (5, 1), (112, 1), (113, 2), (231, 2), (232, 3)]
    {
        let whole: Vec<u8> = (0..len).map(|at| at as u8).collect();
        assert_eq!(carried(&whole, 128), (whole, messages), "{len} bytes");
    }
}

proptest! {
    #[test]
    fn any_data_arrive_through_any_mailbox(
        whole in proptest::collection::vec(any::<u8>(), 0..600),
        mailbox_size in 16usize..300,
    ) {
        prop_assert_eq!(carried(&whole, mailbox_size).0, whole);
    }

    #[test]
    fn hostile_bytes_are_read_or_refused(
        service in 0u8..16,
        mut bytes in proptest::collection::vec(any::<u8>(), 0..64),
    ) {
        if let Some(byte) = bytes.get_mut(1) {
            *byte = service << 4 | *byte & 0x0F;
        }
        let Ok(message) = Message::parse(&bytes) else { return Ok(()) };
        // What has been understood can be said again, and means the same.
        let again = written(&message);
        prop_assert_eq!(Message::parse(&again), Ok(message));
        // And no buffer is too small to be told so.
        for len in 0..again.len() {
            prop_assert!(message.write(&mut vec![0; len]).is_err());
        }
    }

    #[test]
    fn hostile_answers_are_read_or_refused(
        bytes in proptest::collection::vec(any::<u8>(), 0..64),
    ) {
        let mut buffer = [0; 128];
        if let Ok(list) = information::ObjectList::parse(&bytes) {
            prop_assert!(list.indices().count() <= bytes.len() / 2);
        }
        if let Ok(object) = information::ObjectDescription::parse(&bytes) {
            let len = object.write(&mut buffer).unwrap();
            prop_assert_eq!(&buffer[..len], &bytes[..]);
        }
        if let Ok(entry) = information::EntryDescription::parse(&bytes) {
            let len = entry.write(&mut buffer).unwrap();
            prop_assert_eq!(&buffer[..len], &bytes[..]);
        }
    }
}
