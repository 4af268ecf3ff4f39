//! CoE messages that real SubDevices and MainDevices exchanged, out of captures.
//!
//! The captures are not part of the project, see [`real_data`].

use super::*;
use crate::command::Command;
use crate::ethernet::MacAddress;
use crate::frame::{Datagram, FrameView};
use crate::mailbox::coe::object::{ObjectAddress, ObjectIndex};
use crate::mailbox::coe::sdo::{Request, Response};
use crate::mailbox::{self, MailboxType};
use crate::sii::tests::real_images::real_data;

/// Calls `see` with every packet of a pcapng file (block type 6, enhanced packet).
fn for_each_packet(file: &[u8], mut see: impl FnMut(&[u8])) {
    let long = |at: usize| {
        let bytes = file.get(at..at + 4)?;
        Some(u32::from_le_bytes(*bytes.first_chunk()?) as usize)
    };
    let mut at = 0;
    while let (Some(kind), Some(len)) = (long(at), long(at + 4)) {
        assert!(len >= 12, "block of {len} bytes at {at}");
        if kind == 6 {
            let captured = long(at + 20).unwrap();
            see(&file[at + 28..at + 28 + captured]);
        }
        at += len;
    }
}

/// A mailbox that came back from a SubDevice: executed, in process RAM, of type CoE.
fn coe_mailbox<'a>(datagram: &Datagram<'a>) -> Option<mailbox::Message<'a>> {
    let by_station = matches!(datagram.command(), Some(Command::Fprd | Command::Fpwr));
    let in_ram = (0x1000..0x2000).contains(&datagram.ado().value());
    if !by_station || !in_ram || datagram.wkc().value() != 1 {
        return None;
    }
    let message = mailbox::Message::parse(datagram.data()).ok()?;
    (message.header.kind == MailboxType::Coe).then_some(message)
}

/// All CoE messages of a capture, in order, as bytes behind the mailbox header with its counter.
fn messages(path: &str) -> Option<Vec<(u8, Vec<u8>)>> {
    let file = real_data(path)?;
    let mut messages = Vec::new();
    for_each_packet(&file, |packet| {
        let Ok(frame) = FrameView::parse(packet) else { return };
        // Only frames that have been through a controller, which marks the source address.
        let MacAddress([first, ..]) = frame.source();
        if first & 0x02 == 0 {
            return;
        }
        for datagram in frame.datagrams().map_while(Result::ok) {
            if let Some(message) = coe_mailbox(&datagram) {
                messages.push((message.header.counter.value(), message.data.to_vec()));
            }
        }
    });
    Some(messages)
}

/// Captures with mailbox traffic, and how many downloads and uploads are in each.
const CAPTURES: [(&str, usize, usize); 7] = [
    ("pcap/ec-replay-ek1914-el3004-configure.pcapng", 7, 5),
    ("pcap/ec-replay-ek1914-el3004-mailbox.pcapng", 1, 2),
    ("pcap/ec-replay-ek1914-segmented-upload.pcapng", 0, 1),
    ("pcap/ec-soem-single-lan9252.pcapng", 0, 6),
    ("pcap/echist-replay-mailbox-el3004.pcapng", 1, 7),
    ("pcap/echist-replay-no-complete-access-202308.pcapng", 0, 39),
    ("pcap/echist-replay-segmented-upload-202401.pcapng", 0, 6),
];

#[test]
fn every_captured_message_is_understood() {
    for (path, downloads, uploads) in CAPTURES {
        let Some(messages) = messages(path) else { return };
        let mut asked = None;
        let (mut downloaded, mut uploaded) = (0, 0);
        for (_, bytes) in &messages {
            let message = Message::parse(bytes).unwrap_or_else(|error| panic!("{path}: {error}"));
            match message {
                Message::SdoRequest(request) => {
                    let (Request::Download { object, .. } | Request::Upload { object, .. }) =
                        request
                    else {
                        panic!("{path}: {request:?}");
                    };
                    asked = Some(object);
                    // MainDevices fill requests with zeros, so the bytes come out as they were.
                    let mut buffer = [0; 512];
                    let len = message.write(&mut buffer).unwrap();
                    assert_eq!(&buffer[..len], bytes, "{path}");
                }
                Message::SdoResponse(response) => {
                    let object = match response {
                        Response::Download { object, .. } => {
                            downloaded += 1;
                            object
                        }
                        Response::Upload { object, initial, .. } => {
                            assert!(initial.is_complete(), "{path}: {object}");
                            uploaded += 1;
                            object
                        }
                        Response::DownloadSegment { .. } | Response::UploadSegment(_) => {
                            panic!("{path}: {response:?}")
                        }
                    };
                    // Each answer is that of the request before it.
                    assert_eq!(asked.take(), Some(object), "{path}");
                }
                Message::Emergency(_)
                | Message::Abort(_)
                | Message::Information(_)
                | Message::Pdo { .. } => panic!("{path}: {message:?}"),
            }
        }
        assert_eq!((downloaded, uploaded), (downloads, uploads), "{path}");
        assert_eq!(messages.len(), 2 * (downloads + uploads), "{path}");
    }
}

/// What was uploaded from an object, first time it was asked for.
fn uploaded(messages: &[(u8, Vec<u8>)], wanted: ObjectAddress) -> Option<(bool, Vec<u8>)> {
    messages.iter().find_map(|(_, bytes)| match Message::parse(bytes) {
        Ok(Message::SdoResponse(Response::Upload { object, complete, initial })) => {
            (object == wanted).then(|| (complete, initial.data().to_vec()))
        }
        Ok(_) | Err(_) => None,
    })
}

#[test]
fn captured_data_are_those_the_devices_have() {
    let name = ObjectAddress { index: ObjectIndex::DEVICE_NAME, subindex: 0 };
    let Some(ek1914) = messages("pcap/ec-replay-ek1914-segmented-upload.pcapng") else { return };
    assert_eq!(uploaded(&ek1914, name), Some((false, b"EK1914".to_vec())));
    // The EL3004's inputs, after the capture's MainDevice has assigned them.
    let Some(el3004) = messages("pcap/ec-replay-ek1914-el3004-configure.pcapng") else { return };
    let assigned: Vec<Vec<u8>> = (1..=4)
        .filter_map(|subindex| uploaded(&el3004, ObjectAddress::new(0x1C13, subindex)))
        .map(|(_, data)| data)
        .collect();
    assert_eq!(assigned, [[0x00, 0x1A], [0x02, 0x1A], [0x04, 0x1A], [0x06, 0x1A]]);
    // Complete access: subindex 0 takes two bytes.
    let Some(lan9252) = messages("pcap/ec-soem-single-lan9252.pcapng") else { return };
    let types =
        uploaded(&lan9252, ObjectAddress { index: ObjectIndex::SYNC_MANAGER_TYPES, subindex: 0 });
    assert_eq!(types, Some((true, vec![4, 0, 1, 2, 3, 4])));
    let outputs = ObjectAddress { index: ObjectIndex(0x1C12), subindex: 0 };
    assert_eq!(uploaded(&lan9252, outputs), Some((true, vec![1, 0, 1, 0x16])));
}

#[test]
fn captured_counters_skip_zero() {
    let Some(messages) = messages("pcap/echist-replay-no-complete-access-202308.pcapng") else {
        return;
    };
    let requests = messages.iter().filter(|(_, bytes)| bytes[1] == 0x20);
    let mut last = None;
    for (counter, _) in requests {
        let counter = mailbox::Counter::new(*counter).unwrap();
        if let Some(last) = last.replace(counter) {
            assert_eq!(counter, mailbox::Counter::next(last));
        }
    }
    assert!(last.is_some());
}
