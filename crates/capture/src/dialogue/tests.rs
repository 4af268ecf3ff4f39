//! Dialogues message by message.

use linesman_proto::address::{Network, StationAddress};
use linesman_proto::command::Command;
use linesman_proto::mailbox::coe::information::{self as info, ObjectDescription};
use linesman_proto::mailbox::coe::information::{Answer, Body, ObjectCode};
use linesman_proto::mailbox::coe::sdo::{Abort, Expedited, Initial, Request, Response, Segment};
use linesman_proto::mailbox::coe::{DataType, Message, ObjectAddress, ObjectIndex};
use linesman_proto::mailbox::{BufferTooSmall, Counter, Header, eoe, foe, soe};
use linesman_proto::time::Instant;

use super::*;

/// A mailbox at station address 0x1001, and what goes through it.
struct Bench {
    dialogue: Dialogue,
    model: NetworkModel,
    frame: u64,
}

impl Bench {
    fn new() -> Self {
        Self { dialogue: Dialogue::default(), model: NetworkModel::new(Network(0)), frame: 0 }
    }

    fn bytes(&mut self, data: &[u8], is_request: bool, wkc: u16) {
        self.frame += 1;
        let command = if is_request { Command::Fpwr } else { Command::Fprd };
        let access = DatagramAccess {
            command,
            effect: command.effect(),
            target: DatagramTarget::Station(StationAddress(0x1001)),
            address: RegisterAddress(if is_request { 0x1000 } else { 0x1080 }),
            len: data.len() as u16,
            written: is_request.then_some(data),
            read: (!is_request && wkc > 0).then_some(data),
            wkc: Some(wkc),
            own: wkc,
            sent_by: None,
            is_further_copy: false,
            at: Instant::from_nanos(self.frame * 1_000),
            frame: self.frame,
        };
        self.dialogue.access(&self.model, &access);
    }

    fn told(
        &mut self,
        kind: MailboxType,
        is_request: bool,
        body: impl FnOnce(&mut [u8]) -> Result<usize, BufferTooSmall>,
    ) {
        let mut buffer = [0; 128];
        Header::new(kind, Counter::FIRST, 0).write_message(&mut buffer, body).unwrap();
        self.bytes(&buffer, is_request, 1);
    }

    fn asks(&mut self, request: Request<'_>) {
        self.told(MailboxType::Coe, true, |body| Message::SdoRequest(request).write(body));
    }

    fn answers(&mut self, response: Response<'_>) {
        self.told(MailboxType::Coe, false, |body| Message::SdoResponse(response).write(body));
    }

    fn transfers(&self) -> Vec<TransferReport> {
        self.dialogue.report(&self.model).0
    }

    fn only(&self) -> TransferReport {
        let mut all = self.transfers();
        assert_eq!(all.len(), 1, "{all:?}");
        all.remove(0)
    }
}

const NAME: ObjectAddress = ObjectAddress::new(0x1008, 0);

#[test]
fn upload_in_segments_has_all_their_data() {
    let mut bench = Bench::new();
    bench.asks(Request::Upload { object: NAME, complete: false });
    let initial = Initial::Normal { size: 9, data: b"EL3" };
    bench.answers(Response::Upload { object: NAME, complete: false, initial });
    for (toggle, data, last) in [(false, b"004", false), (true, b"-00", true)] {
        bench.asks(Request::UploadSegment { toggle });
        bench.answers(Response::UploadSegment(Segment { toggle, last, data }));
    }
    let one = bench.only();
    assert_eq!((one.what.as_str(), one.form.as_deref()), ("upload", Some("segmented")));
    assert_eq!((one.index, one.subindex, one.complete), (Some(0x1008), Some(0), false));
    assert_eq!((one.outcome, one.messages, one.size.0), (TransferOutcome::Done, 6, 9));
    assert_eq!(one.data, "454c333030342d3030");
    assert_eq!((one.asked_frame.unwrap().0, one.answered_frame.unwrap().0), (1, 6));
    assert_eq!(one.station, Some(0x1001));
}

#[test]
fn download_with_complete_access_in_segments_ends_with_the_last_answer() {
    let mut bench = Bench::new();
    let object = ObjectAddress::new(0x1C12, 0);
    let initial = Initial::Normal { size: 6, data: &[2, 0, 0] };
    bench.asks(Request::Download { object, complete: true, initial });
    bench.answers(Response::Download { object, complete: true });
    assert_eq!(bench.only().outcome, TransferOutcome::Unfinished);
    bench.asks(Request::DownloadSegment(Segment {
        toggle: false,
        last: true,
        data: &[0x16, 1, 0x16],
    }));
    bench.answers(Response::DownloadSegment { toggle: false });
    let one = bench.only();
    assert_eq!((one.complete, one.outcome), (true, TransferOutcome::Done));
    assert_eq!(one.data, "020000160116");
}

#[test]
fn refused_upload_has_its_abort_code_and_the_next_one_stands_for_itself() {
    let mut bench = Bench::new();
    bench.asks(Request::Upload { object: NAME, complete: true });
    let abort = Abort { object: NAME, code: 0x0601_0000 };
    bench.told(MailboxType::Coe, false, |body| Message::Abort(abort).write(body));
    bench.asks(Request::Upload { object: NAME, complete: false });
    let all = bench.transfers();
    assert_eq!((all[0].outcome, all[0].code), (TransferOutcome::Refused, Some(0x0601_0000)));
    assert_eq!((all[1].outcome, all[1].answered_ns), (TransferOutcome::Unanswered, None));
}

#[test]
fn request_that_nobody_takes_is_none_and_an_answer_without_request_is_told() {
    let mut bench = Bench::new();
    let mut buffer = [0; 64];
    let upload = Message::SdoRequest(Request::Upload { object: NAME, complete: false });
    Header::new(MailboxType::Coe, Counter::FIRST, 0)
        .write_message(&mut buffer, |body| upload.write(body))
        .unwrap();
    bench.bytes(&buffer, true, 0);
    bench.bytes(&[0; 64], false, 0);
    assert!(bench.transfers().is_empty(), "mailbox full, mailbox empty");
    let initial = Initial::Expedited(Expedited::new(&[7]).unwrap());
    bench.answers(Response::Upload { object: NAME, complete: false, initial });
    let one = bench.only();
    assert_eq!((one.asked_ns, one.outcome, one.data.as_str()), (None, TransferOutcome::Done, "07"));
}

#[test]
fn object_description_in_fragments_is_read_as_one() {
    let mut bench = Bench::new();
    let question = info::Message::whole(Body::ObjectRequest { index: ObjectIndex(0x6000) });
    bench.told(MailboxType::Coe, true, |body| Message::Information(question).write(body));
    let description = ObjectDescription {
        index: ObjectIndex(0x6000),
        data_type: DataType(0x0006),
        max_subindex: 17,
        object_code: ObjectCode::Record,
        name: b"AI Inputs Channel 1",
    };
    let mut answer = [0; 64];
    let len = description.write(&mut answer).unwrap();
    for fragment in info::Fragments::new(Answer::Object, &answer[..len], 32) {
        bench.told(MailboxType::Coe, false, |body| Message::Information(fragment).write(body));
    }
    let one = bench.only();
    assert_eq!((one.what.as_str(), one.outcome), ("object-description", TransferOutcome::Done));
    assert!(one.messages > 2, "{one:?}");
    assert!(one.text.as_deref().is_some_and(|text| text.starts_with("AI Inputs Channel 1")));
    assert_eq!(one.index, Some(0x6000));
}

#[test]
fn file_that_is_written_ends_with_a_short_packet() {
    let mut bench = Bench::new();
    let send = |bench: &mut Bench, is_request: bool, message: foe::Message<'_>| {
        bench.told(MailboxType::Foe, is_request, |body| message.write(body));
    };
    send(&mut bench, true, foe::Message::Write { password: 0, name: b"fw.bin" });
    send(&mut bench, false, foe::Message::Ack { packet: 0 });
    send(&mut bench, true, foe::Message::Data { packet: 1, data: &[1; 20] });
    send(&mut bench, false, foe::Message::Ack { packet: 1 });
    assert_eq!(bench.only().outcome, TransferOutcome::Unfinished);
    send(&mut bench, true, foe::Message::Data { packet: 2, data: &[2; 5] });
    send(&mut bench, false, foe::Message::Ack { packet: 2 });
    let one = bench.only();
    assert_eq!((one.what.as_str(), one.text.as_deref()), ("write-file", Some("fw.bin")));
    assert_eq!((one.outcome, one.size.0, one.messages), (TransferOutcome::Done, 25, 6));
}

#[test]
fn ethernet_frame_in_fragments_is_put_together() {
    let mut bench = Bench::new();
    let mut frame = vec![0xFF; 6];
    frame.extend([2, 1, 5, 16, 0, 1, 8, 6]);
    frame.resize(120, 0x55);
    for fragment in eoe::fragments(&frame, 0, 3, 64) {
        let message = eoe::Message::Fragment(fragment);
        bench.told(MailboxType::Eoe, true, |body| message.write(body));
    }
    let one = bench.only();
    assert_eq!(
        (one.what.as_str(), one.outcome, one.size.0),
        ("frame-out", TransferOutcome::Told, 120)
    );
    assert!(one.messages > 1);
    let text = one.text.unwrap();
    assert!(text.ends_with("type 0x0806") && text.contains("02"), "{text}");
}

#[test]
fn drive_parameter_that_is_refused_says_why() {
    let mut bench = Bench::new();
    let message = |operation, error, data| soe::Message {
        operation,
        incomplete: false,
        error,
        drive: 0,
        elements: soe::VALUE,
        number: 32,
        data,
    };
    let ask = message(soe::Operation::ReadRequest, false, &[]);
    bench.told(MailboxType::Soe, true, |body| ask.write(body));
    let refuse = message(soe::Operation::ReadResponse, true, &[0x09, 0x70]);
    bench.told(MailboxType::Soe, false, |body| refuse.write(body));
    let one = bench.only();
    assert_eq!((one.what.as_str(), one.outcome), ("read-idn", TransferOutcome::Refused));
    assert_eq!((one.index, one.code), (Some(32), Some(0x7009)));
    let text = one.text.as_deref();
    assert_eq!(text, Some("value of drive 0: it is write-protected by a password"));
}

#[test]
fn drive_parameter_is_told_with_its_element_and_its_data_put_together() {
    let mut bench = Bench::new();
    let message = |operation, incomplete, number, data| soe::Message {
        operation,
        incomplete,
        error: false,
        drive: 1,
        elements: soe::NAME,
        number,
        data,
    };
    let ask = message(soe::Operation::ReadRequest, false, 36, &[]);
    bench.told(MailboxType::Soe, true, |body| ask.write(body));
    let first = message(soe::Operation::ReadResponse, true, 1, &[3, 0, 3, 0]);
    bench.told(MailboxType::Soe, false, |body| first.write(body));
    let last = message(soe::Operation::ReadResponse, false, 36, b"abc");
    bench.told(MailboxType::Soe, false, |body| last.write(body));
    let one = bench.only();
    assert_eq!((one.index, one.outcome), (Some(36), TransferOutcome::Done));
    assert_eq!((one.text.as_deref(), one.messages), (Some("name of drive 1"), 3));
    assert_eq!(one.data, "03000300616263");
}

#[test]
fn notification_of_a_drive_is_told_with_its_number() {
    let mut bench = Bench::new();
    let told = soe::Message {
        operation: soe::Operation::Notification,
        incomplete: false,
        error: false,
        drive: 0,
        elements: soe::DATA_STATE,
        number: 99,
        data: &[3, 0],
    };
    bench.told(MailboxType::Soe, false, |body| told.write(body));
    let one = bench.only();
    assert_eq!((one.what.as_str(), one.outcome), ("notification", TransferOutcome::Told));
    assert_eq!((one.index, one.data.as_str()), (Some(99), "0300"));
}

#[test]
fn mailbox_error_ends_what_waits_for_its_answer() {
    let mut bench = Bench::new();
    bench.asks(Request::Upload { object: NAME, complete: false });
    bench.told(MailboxType::Error, false, |body| {
        body[..4].copy_from_slice(&[1, 0, 2, 0]);
        Ok(4)
    });
    let one = bench.only();
    assert_eq!((one.outcome, one.code), (TransferOutcome::Refused, Some(2)));
    assert!(one.text.is_some());
}

#[test]
fn bytes_of_chance_make_no_panic() {
    let mut bench = Bench::new();
    let mut state = 1_u32;
    for round in 0..20_000_u32 {
        let mut data = [0_u8; 48];
        for byte in &mut data {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *byte = (state >> 24) as u8;
        }
        // Most have a header that fits, so that what follows it is read.
        if round % 4 > 0 {
            (data[0], data[1], data[5]) = ((state >> 8) as u8 % 42, 0, data[5] & 0x77);
        }
        bench.bytes(&data, round % 2 == 0, 1);
    }
    assert!(!bench.transfers().is_empty());
}

/// Reads an object, whole or in part.
fn reads(bench: &mut Bench, object: ObjectAddress, complete: bool, data: &[u8]) {
    let size = data.len() as u32;
    bench.asks(Request::Upload { object, complete });
    let initial = Initial::Normal { size, data };
    bench.answers(Response::Upload { object, complete, initial });
}

/// PDOs of SyncManager 3 as the objects say that the bench has seen: PDO, and index, subindex and bits of its entries.
fn assigned(bench: &Bench) -> Option<Vec<(u16, String, Vec<MappedPart>)>> {
    let mut objects = PdoObjects::default();
    let transfers = bench.dialogue.store.transfers.iter();
    transfers.filter(|one| PdoObjects::concerns(one)).for_each(|one| objects.learn(one));
    let pdos = objects.assigned(3)?.into_iter();
    let parts = pdos.map(|pdo| {
        let entries = pdo.entries.into_iter();
        (
            pdo.index,
            pdo.name,
            entries.map(|one| (one.index, one.subindex, one.bits, one.name)).collect(),
        )
    });
    Some(parts.collect())
}

/// Index, subindex, bits and name of an entry.
type MappedPart = (u16, u8, u16, String);

#[test]
fn pdos_of_a_sync_manager_are_read_from_their_objects_entry_by_entry_or_whole() {
    let at = ObjectAddress::new;
    let mut bench = Bench::new();
    reads(&mut bench, at(0x1C13, 0), false, &[2]);
    reads(&mut bench, at(0x1C13, 1), false, &[0x01, 0x1A]);
    reads(&mut bench, at(0x1C13, 2), false, &[0x00, 0x1A]);
    // The number of entries takes a word of its own: ETG.1000.6, complete access.
    reads(&mut bench, at(0x1A01, 0), true, &[1, 0, 16, 0x11, 0x10, 0x60]);
    assert_eq!(assigned(&bench), None, "0x1A00 was not read");
    reads(&mut bench, at(0x1A00, 0), false, &[2]);
    reads(&mut bench, at(0x1A00, 1), false, &[1, 1, 0x00, 0x60]);
    reads(&mut bench, at(0x1A00, 2), false, &[7, 0, 0, 0]);
    let name = ObjectDescription {
        index: ObjectIndex(0x1A01),
        data_type: DataType::UINT,
        max_subindex: 1,
        object_code: ObjectCode::Record,
        name: b"Channel 2",
    };
    let mut told = [0; 64];
    let len = name.write(&mut told).unwrap();
    for fragment in info::Fragments::new(Answer::Object, &told[..len], 32) {
        bench.told(MailboxType::Coe, false, |body| Message::Information(fragment).write(body));
    }
    let unnamed = String::new;
    let channel = (0x1A01, "Channel 2".to_owned(), vec![(0x6010, 0x11, 16, unnamed())]);
    let bits = vec![(0x6000, 1, 1, unnamed()), (0, 0, 7, unnamed())];
    assert_eq!(assigned(&bench), Some(vec![channel, (0x1A00, unnamed(), bits)]));
}

#[test]
fn assignment_that_is_written_holds_from_then_on() {
    let mut bench = Bench::new();
    reads(&mut bench, ObjectAddress::new(0x1C13, 0), true, &[1, 0, 0x00, 0x1A]);
    reads(&mut bench, ObjectAddress::new(0x1A02, 0), true, &[1, 0, 8, 1, 0x20, 0x60]);
    for (subindex, data) in [(0, &[0][..]), (1, &[0x02, 0x1A][..]), (0, &[1][..])] {
        let object = ObjectAddress::new(0x1C13, subindex);
        let initial = Initial::Expedited(Expedited::new(data).unwrap());
        bench.asks(Request::Download { object, complete: false, initial });
        bench.answers(Response::Download { object, complete: false });
    }
    let entry = (0x6020, 1, 8, String::new());
    assert_eq!(assigned(&bench), Some(vec![(0x1A02, String::new(), vec![entry])]));
}
