use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use proptest::prelude::*;

use super::*;

const CARD: MacAddress = MacAddress([0x00, 0x1B, 0x21, 0x12, 0x34, 0x56]);

fn frame(parts: &[(Command, DatagramAddress, &[u8])]) -> Vec<u8> {
    let mut buffer = [0; 1514];
    let mut builder = FrameBuilder::new(&mut buffer, CARD);
    for (command, address, data) in parts {
        builder.push(*command, 1, *address, data.len()).unwrap().copy_from_slice(data);
    }
    let len = builder.finish();
    buffer[..len].to_vec()
}

fn at(register: u16) -> DatagramAddress {
    DatagramAddress::Physical(0x1001, RegisterAddress(register))
}

fn data(frame: &[u8]) -> Vec<Vec<u8>> {
    let view = FrameView::parse(frame).unwrap();
    view.datagrams().map(|datagram| datagram.unwrap().data().to_vec()).collect()
}

#[test]
fn serial_number_of_the_sii_becomes_another_and_stays_the_same() {
    let mut anonymiser = FrameAnonymiser::default();
    let asked = [0, 1, 0x0E, 0, 0, 0];
    let mut request = frame(&[(Command::Fpwr, at(0x0502), &asked)]);
    anonymiser.frame(&mut request);
    let answer = [0, 0, 0x0E, 0, 0, 0, 0x78, 0x56, 0x34, 0x12];
    for _ in 0..2 {
        let mut read = frame(&[(Command::Fprd, at(0x0502), &answer)]);
        anonymiser.frame(&mut read);
        assert_eq!(data(&read)[0], [0, 0, 0x0E, 0, 0, 0, 1, 0, 0, 0]);
    }
    let mut alone = frame(&[(Command::Fprd, at(0x0508), &answer[6..])]);
    anonymiser.frame(&mut alone);
    assert_eq!(data(&alone)[0], [1, 0, 0, 0]);
    let eight = [0x40, 0, 0x0C, 0, 0, 0, 9, 9, 9, 9, 0x78, 0x56, 0x34, 0x12];
    let mut read = frame(&[(Command::Fprd, at(0x0502), &eight)]);
    anonymiser.frame(&mut read);
    assert_eq!(data(&read)[0][6..], [9, 9, 9, 9, 1, 0, 0, 0]);
    let stale = [0, 0, 0x0C, 0, 0, 0, 9, 9, 9, 9, 8, 8, 8, 8];
    let mut read = frame(&[(Command::Fprd, at(0x0502), &stale)]);
    anonymiser.frame(&mut read);
    assert_eq!(data(&read)[0][6..], [9, 9, 9, 9, 0, 0, 0, 0], "four bytes are read");
    let mut empty = frame(&[(Command::Fprd, at(0x0502), &[0; 10])]);
    anonymiser.frame(&mut empty);
    let busy = [0, 0x80, 0x10, 0, 0, 0, 0x78, 0x56, 0x34, 0x12];
    let mut read = frame(&[(Command::Fprd, at(0x0502), &busy)]);
    anonymiser.frame(&mut read);
    assert_eq!(data(&read)[0][6..], [0; 4], "what was read before is still there");
    let half = [0, 0, 0x0D, 0, 0, 0, 9, 9, 0x78, 0x56];
    let mut read = frame(&[(Command::Fprd, at(0x0502), &half)]);
    anonymiser.frame(&mut read);
    assert_eq!(data(&read)[0][6..], [9, 9, 0, 0]);
    assert_eq!(anonymiser.serials(), 1);
}

#[test]
fn serial_number_of_the_identity_object_is_the_same_as_that_of_the_sii() {
    let mut anonymiser = FrameAnonymiser::default();
    assert_eq!(anonymiser.serial(0x1234_5678), 1);
    let upload = [10, 0, 0, 0, 0, 0x13, 0, 0x30, 0x43, 0x18, 0x10, 4, 0x78, 0x56, 0x34, 0x12];
    let mut read = frame(&[(Command::Fprd, at(0x1080), &upload)]);
    anonymiser.frame(&mut read);
    assert_eq!(data(&read)[0][12..], [1, 0, 0, 0]);
}

#[test]
fn parameters_become_zeros_and_their_objects_stay() {
    let mut anonymiser = FrameAnonymiser::default();
    let download = [10, 0, 0, 0, 0, 0x13, 0, 0x20, 0x23, 0x10, 0x80, 1, 1, 2, 3, 4, 77, 77];
    let mut write = frame(&[(Command::Fpwr, at(0x1000), &download)]);
    anonymiser.frame(&mut write);
    let written = data(&write).remove(0);
    assert_eq!(written[..12], download[..12]);
    assert_eq!(written[12..], [0; 6], "what lies behind the message goes, too");
    assert_eq!(anonymiser.replaced().mailbox_messages, 1);
}

#[test]
fn segments_of_a_parameter_become_zeros_and_those_of_the_communication_area_stay() {
    for (object, expected) in [(0x8000_u16, 0), (0x1008, 5)] {
        let mut anonymiser = FrameAnonymiser::default();
        let [low, high] = object.to_le_bytes();
        let begin = [10, 0, 0, 0, 0, 0x13, 0, 0x20, 0x40, low, high, 0, 0, 0, 0, 0];
        let mut request = frame(&[(Command::Fpwr, at(0x1000), &begin)]);
        anonymiser.frame(&mut request);
        let segment = [10, 0, 0, 0, 0, 0x23, 0, 0x30, 0x01, 5, 5, 5, 5, 5, 5, 5];
        let mut answer = frame(&[(Command::Fprd, at(0x1000), &segment)]);
        anonymiser.frame(&mut answer);
        assert_eq!(data(&answer)[0][9..], [expected; 7], "{object:#x}");
    }
}

#[test]
fn card_addresses_become_others_and_keep_their_mark() {
    let mut anonymiser = FrameAnonymiser::default();
    let mut sent = frame(&[(Command::Brd, at(0x0130), &[0; 2])]);
    let mut returned = sent.clone();
    returned[6..12].copy_from_slice(&CARD.marked().0);
    anonymiser.frame(&mut sent);
    anonymiser.frame(&mut returned);
    assert_eq!(sent[6..12], [0, 0, 0x5E, 0x53, 0, 0]);
    assert_eq!(returned[6..12], [2, 0, 0x5E, 0x53, 0, 0]);
    assert_eq!(sent[..6], [0xFF; 6], "a broadcast is nobody's");
    assert_eq!(anonymiser.macs(), 1);
}

#[test]
fn states_and_counters_stay_and_process_data_go() {
    let mut anonymiser = FrameAnonymiser::default();
    let logical = DatagramAddress::Logical(LogicalAddress(0x0100_0000));
    let mut whole = frame(&[
        (Command::Fprd, at(0x0300), &[1, 2, 3, 4]),
        (Command::Lrw, logical, &[9; 6]),
        (Command::Fprd, at(0x0130), &[8, 0]),
    ]);
    anonymiser.frame(&mut whole);
    assert_eq!(data(&whole), [vec![1, 2, 3, 4], vec![0; 6], vec![8, 0]]);
    assert_eq!(anonymiser.replaced().process_data, 1);
}

#[test]
fn frame_of_another_protocol_keeps_its_kind_alone() {
    let mut anonymiser = FrameAnonymiser::default();
    let mut foreign = vec![0xFF; 12];
    foreign.extend([0x08, 0x06]);
    foreign.extend([7; 46]);
    anonymiser.frame(&mut foreign);
    assert_eq!(foreign[12..14], [0x08, 0x06]);
    assert_eq!(foreign[16..], [0; 44]);
}

proptest! {
    #[test]
    fn any_bytes_are_taken(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let mut anonymiser = FrameAnonymiser::default();
        let mut frame = bytes.clone();
        anonymiser.frame(&mut frame);
        prop_assert_eq!(frame.len(), bytes.len());
        let mut wrapped = [&[0xFF; 12][..], &[0x88, 0xA4], &bytes].concat();
        anonymiser.frame(&mut wrapped);
        prop_assert_eq!(wrapped.len(), bytes.len() + 14);
    }
}
