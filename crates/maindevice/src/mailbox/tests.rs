//! SDO transfers against a SubDevice of a few lines: its mailbox is a buffer, its answers are bytes
//! written down by hand.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::task::{Poll, Waker};

use linesman_config::identity::RevisionRule;
use linesman_config::plan::{DevicePlan, Plan};
use linesman_config::profile::Mailbox;
use linesman_proto::address::{Network, RegisterAddress, StationAddress, WorkingCounter};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::mailbox::coe::information::ListKind;
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::mailbox::foe::FoeErrorCode;
use linesman_proto::sii::{MailboxPair, Protocols};
use linesman_proto::state::AlState;
use linesman_proto::time::Instant;
use proptest::collection::vec;
use proptest::prelude::*;

use super::*;
use crate::event::Event;
use crate::exchange::{Reply, Request};
use crate::executor::Executor;
use crate::options::Options;
use crate::supervisor::DeviceTable;

mod ads;
mod drive_numbers;
mod fragments;

const ID: DeviceId = DeviceId(4);
const OUT: u16 = 0x1000;
const IN: u16 = 0x1080;
const OUT_STATUS: u16 = 0x0805;
const IN_STATUS: u16 = 0x080D;
const FULL: u8 = 0x08;

const EOE: u8 = 2;
const COE: u8 = 3;
const FOE: u8 = 4;

/// A message of the SubDevice.
#[derive(Clone, Debug)]
enum Said {
    /// What is behind the mailbox header.
    Body(Vec<u8>),
    /// The whole mailbox.
    Raw(Vec<u8>),
    /// More than one message: the others follow when the first was fetched.
    Several(Vec<(u8, Vec<u8>)>),
}

/// A mailbox of so many bytes each way. Of 32: 16 bytes of SDO data in a first message, 23 in a segment.
fn device(size: u16) -> DevicePlan {
    let areas = MailboxPair::from_words([OUT, size, IN, size]);
    let protocols = Protocols(Protocols::COE | Protocols::EOE | Protocols::FOE | Protocols::SOE);
    DevicePlan {
        name: "5".to_owned(),
        station: StationAddress(0x1005),
        revision_rule: RevisionRule::Any,
        mailbox: Some(Mailbox { areas, bootstrap: None, protocols, complete_access: false }),
        target: AlState::PreOp,
        ..DevicePlan::bare(ID)
    }
}

/// A SubDevice that answers each message with the next of its messages.
struct Scripted {
    /// What it says, in order, with the code of the protocol.
    says: Vec<(u8, Said)>,
    /// It does not fetch what is written to it.
    deaf: bool,
    /// Its counter stays at 1.
    stuck_counter: bool,
    /// What it was told, without mailbox headers.
    heard: Vec<Vec<u8>>,
    waiting: Option<Vec<u8>>,
    /// What follows it.
    behind: VecDeque<(u8, Vec<u8>)>,
    counter: u8,
    /// Bytes of its mailbox, each way.
    size: u16,
}

impl Scripted {
    /// One that speaks CoE.
    fn new(says: &[&[u8]]) -> Self {
        Self::with(says.iter().map(|message| (COE, Said::Body(message.to_vec()))).collect())
    }

    /// One that speaks FoE.
    fn of_files(says: &[&[u8]]) -> Self {
        Self::with(says.iter().map(|message| (FOE, Said::Body(message.to_vec()))).collect())
    }

    fn with(says: Vec<(u8, Said)>) -> Self {
        let (deaf, stuck_counter) = (false, false);
        Self {
            says,
            deaf,
            stuck_counter,
            heard: Vec::new(),
            waiting: None,
            behind: VecDeque::new(),
            counter: 0,
            size: 32,
        }
    }

    fn answer(&mut self, request: &Request) -> Reply {
        let DatagramAddress::Physical(station, RegisterAddress(at)) = request.address else {
            panic!("{request:?}")
        };
        assert_eq!(station, 0x1005);
        let (wkc, data) = match (request.command, at) {
            (Command::Fprd, OUT_STATUS) => (1, vec![if self.deaf { FULL } else { 0 }]),
            (Command::Fpwr, OUT) if self.deaf => (0, request.data.to_vec()),
            (Command::Fprd, IN_STATUS) => (1, vec![if self.waiting.is_some() { FULL } else { 0 }]),
            (Command::Fpwr, OUT) => {
                assert_eq!(
                    request.data.len(),
                    usize::from(self.size),
                    "the whole mailbox is written"
                );
                let len = usize::from(request.data[0]);
                self.heard.push(request.data[6..6 + len].to_vec());
                if !self.says.is_empty() {
                    self.speak();
                }
                (1, request.data.to_vec())
            }
            (Command::Fprd, IN) => match self.waiting.take() {
                Some(message) => {
                    if let Some((kind, body)) = self.behind.pop_front() {
                        self.put(kind, &body);
                    }
                    (1, message)
                }
                None => (0, vec![0; self.size.into()]),
            },
            other => panic!("{other:?}"),
        };
        Reply { wkc: WorkingCounter(wkc), data: data.into() }
    }

    fn speak(&mut self) {
        match self.says.remove(0) {
            (kind, Said::Body(body)) => self.put(kind, &body),
            (_, Said::Raw(message)) => self.waiting = Some(message),
            (_, Said::Several(messages)) => {
                self.behind.extend(messages);
                if let Some((kind, body)) = self.behind.pop_front() {
                    self.put(kind, &body);
                }
            }
        }
    }

    fn put(&mut self, kind: u8, body: &[u8]) {
        if !self.stuck_counter || self.counter == 0 {
            self.counter = self.counter % 7 + 1;
        }
        let mut message = vec![body.len() as u8, 0, 0, 0, 0, kind | self.counter << 4];
        message.extend(body);
        message.resize(self.size.into(), 0);
        self.waiting = Some(message);
    }
}

/// Runs one operation to its end; gives what came of it, and what was told meanwhile.
fn run(scripted: &mut Scripted, request: MailboxRequest) -> (Outcome, Vec<Event>) {
    let (mut outcomes, events) = run_all(scripted, vec![request]);
    (outcomes.remove(0), events)
}

/// Runs operations that are asked for at once to their end; gives what came of each, and what was told meanwhile.
fn run_all(scripted: &mut Scripted, requests: Vec<MailboxRequest>) -> (Vec<Outcome>, Vec<Event>) {
    let mut executor = Executor::new();
    let wire = executor.group(0);
    let tree = linesman_proto::topology::derive(&[]).unwrap();
    let mut devices: Vec<DevicePlan> = (0..4).map(|_| device(scripted.size)).collect();
    devices.push(device(scripted.size));
    let plan = Plan { devices, ..Plan::empty(tree) };
    let mut device_table = DeviceTable::new(&plan);
    device_table.set_reached(ID, AlState::PreOp);
    let mailboxes = MailboxQueues::of([ID].into_iter());
    let context = Context {
        wire: wire.clone(),
        network: Network(0),
        plan: Arc::new(plan),
        device_table: Arc::new(Mutex::new(device_table)),
        options: Arc::new(Options::default()),
        mailboxes: mailboxes.clone(),
        bad_rounds: Arc::default(),
        follows: None,
    };
    let mut pending: VecDeque<_> =
        requests.into_iter().map(|request| Box::pin(mailboxes.ask(ID, request))).collect();
    wire.spawn(serve_mailbox(context, ID));
    let mut now = Instant::ZERO;
    let (mut outcomes, mut events) = (Vec::new(), Vec::new());
    for _ in 0..100_000 {
        executor.run();
        let submitted = std::mem::take(&mut executor.shared().submitted);
        for (ticket, request) in submitted {
            let reply = scripted.answer(&request);
            executor.answer(ticket, Ok(reply));
        }
        executor.run();
        events.extend(executor.shared().events.drain(..));
        let mut context = std::task::Context::from_waker(Waker::noop());
        while let Some(first) = pending.front_mut()
            && let Poll::Ready(outcome) = first.as_mut().poll(&mut context)
        {
            outcomes.push(outcome);
            pending.pop_front();
        }
        if pending.is_empty() {
            return (outcomes, events);
        }
        if executor.shared().submitted.is_empty() {
            now = executor.first_timer().max(now);
            executor.advance(now);
        }
    }
    panic!("no end")
}

fn upload(scripted: &mut Scripted, index: u16) -> Outcome {
    let object = ObjectAddress::new(index, 1);
    run(scripted, MailboxRequest::Upload { object, complete: false }).0
}

#[test]
fn an_upload_in_segments() {
    // 50 bytes: 16 in the first message, 23 in a segment, 11 in the last.
    let whole: Vec<u8> = (1..=50).collect();
    let first = [&[0x00, 0x30, 0x41, 0x00, 0x20, 1, 50, 0, 0, 0][..], &whole[..16]].concat();
    let second = [&[0x00, 0x30, 0x00][..], &whole[16..39]].concat();
    let last = [&[0x00, 0x30, 0x11][..], &whole[39..50]].concat();
    let mut scripted = Scripted::new(&[&first, &second, &last]);
    assert_eq!(upload(&mut scripted, 0x2000).unwrap(), whole);
    assert_eq!(scripted.heard.len(), 3);
    assert_eq!(scripted.heard[0][..6], [0x00, 0x20, 0x40, 0x00, 0x20, 1]);
    assert_eq!(scripted.heard[1][..3], [0x00, 0x20, 0x60]);
    assert_eq!(scripted.heard[2][..3], [0x00, 0x20, 0x70], "the toggle bit turns");
}

#[test]
fn a_download_in_segments() {
    let whole: Vec<u8> = (0..40).collect();
    let mut scripted = Scripted::new(&[
        &[0x00, 0x30, 0x60, 0x00, 0x20, 1, 0, 0, 0, 0],
        &[0x00, 0x30, 0x20, 0, 0, 0, 0, 0, 0, 0],
        &[0x00, 0x30, 0x30, 0, 0, 0, 0, 0, 0, 0],
    ]);
    let object = ObjectAddress::new(0x2000, 1);
    let request = MailboxRequest::Download { object, complete: false, data: whole.clone() };
    run(&mut scripted, request).0.unwrap();
    // 32 - 6 - 2 - 8 = 16 bytes in the first message, the other 24 need 23 + 1.
    assert_eq!(scripted.heard[0][..10], [0x00, 0x20, 0x21, 0x00, 0x20, 1, 40, 0, 0, 0]);
    assert_eq!(scripted.heard[0][10..], whole[..16]);
    assert_eq!(scripted.heard[1][..3], [0x00, 0x20, 0x00]);
    assert_eq!(scripted.heard[1][3..], whole[16..39]);
    // One byte, six of seven unused, toggle bit, last.
    assert_eq!(scripted.heard[2], [0x00, 0x20, 0x1D, 39, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn a_wrong_toggle_bit_ends_the_transfer() {
    let first = [&[0x00, 0x30, 0x41, 0x00, 0x20, 1, 50, 0, 0, 0][..], &[7; 16]].concat();
    let second = [&[0x00, 0x30, 0x10][..], &[7; 23]].concat();
    let error = upload(&mut Scripted::new(&[&first, &second]), 0x2000).unwrap_err();
    assert!(matches!(error.why, Why::Protocol { .. }), "{error}");
}

#[test]
fn an_emergency_in_between_becomes_an_event() {
    let emergency = [0x00, 0x10, 0x10, 0x43, 0x08, 1, 2, 3, 4, 5];
    let mut scripted = Scripted::new(&[&emergency]);
    let object = ObjectAddress::new(0x2000, 1);
    let (_, events) = run(&mut scripted, MailboxRequest::Upload { object, complete: false });
    let [Event::Emergency { id, emergency }] = &events[..] else { panic!("{events:?}") };
    assert_eq!((*id, emergency.code, emergency.register.0), (ID, 0x4310, 8));
}

#[test]
fn the_late_answer_to_another_question_is_not_taken() {
    // About 0x3000, although 0x2000 was asked for; then nothing.
    let other = [0x00, 0x30, 0x43, 0x00, 0x30, 1, 1, 2, 3, 4];
    let error = upload(&mut Scripted::new(&[&other]), 0x2000).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error.why, Why::NoAnswer { .. }), "{text}");
    assert!(
        text.contains("SubDevice 5") && text.contains("0x2000:01") && text.contains("2 s"),
        "{text}"
    );
}

#[test]
fn an_abort_carries_its_code() {
    let abort = [0x00, 0x20, 0x80, 0x00, 0x20, 1, 0x00, 0x00, 0x02, 0x06];
    let error = upload(&mut Scripted::new(&[&abort]), 0x2000).unwrap_err();
    let Why::Aborted { code } = error.why else { panic!("{error}") };
    assert_eq!(code.value(), 0x0602_0000);
}

/// The first message of an upload of 50 bytes, with 16 of them.
fn first_of_50() -> Vec<u8> {
    [&[0x00, 0x30, 0x41, 0x00, 0x20, 1, 50, 0, 0, 0][..], &[7; 16]].concat()
}

#[test]
fn a_transfer_that_is_cut_off_or_too_long_is_refused_and_ended() {
    // The last segment comes too early; one more than was announced.
    let early = [&[0x00, 0x30, 0x01][..], &[7; 11]].concat();
    let full = [&[0x00, 0x30, 0x00][..], &[7; 23]].concat();
    let more = [&[0x00, 0x30, 0x11][..], &[7; 23]].concat();
    for (rest, words) in [
        (vec![&early[..]], "the end after 27 of 50 bytes"),
        (vec![&full[..], &more], "62 bytes, although 50 were announced"),
    ] {
        let mut scripted = Scripted::new(&[&[&first_of_50()[..]], &rest[..]].concat());
        let text = upload(&mut scripted, 0x2000).unwrap_err().to_string();
        assert!(text.contains(words) && text.contains("segment"), "{text}");
        // It is told so: abort, general error.
        let abort = [0x00, 0x20, 0x80, 0x00, 0x20, 1, 0, 0, 0, 8];
        assert_eq!(scripted.heard.last().unwrap()[..], abort, "{words}");
    }
}

#[test]
fn rubbish_is_told_when_no_answer_comes() {
    let mut raw = vec![0xFF; 32];
    raw[5] = 0x13;
    let mut scripted = Scripted::with(vec![(COE, Said::Raw(raw))]);
    let failure = upload(&mut scripted, 0x2000).unwrap_err();
    let text = failure.to_string();
    assert!(matches!(failure.why, Why::NoAnswer { .. }), "{text}");
    assert!(text.contains("announces 65535 bytes") && text.contains("0x2000:01"), "{text}");
}

#[test]
fn messages_of_other_protocols_are_handed_on_and_the_answer_is_found() {
    let answer = vec![0x00, 0x30, 0x4B, 0x00, 0x20, 1, 0x2A, 0, 0, 0];
    let several = Said::Several(vec![
        (2, vec![1, 2, 3, 4]),
        (FOE, vec![4, 0, 0, 0, 0, 0]),
        (COE, vec![0x00, 0x10, 0x10, 0x43, 0x08, 1, 2, 3, 4, 5]),
        (COE, answer),
    ]);
    let mut scripted = Scripted::with(vec![(COE, several)]);
    let object = ObjectAddress::new(0x2000, 1);
    let (outcome, events) = run(&mut scripted, MailboxRequest::Upload { object, complete: false });
    assert_eq!(outcome.unwrap(), [0x2A, 0], "two of the four bytes count");
    let kinds: Vec<&str> = (events.iter())
        .map(|event| if matches!(event, Event::Emergency { .. }) { "emergency" } else { "other" })
        .collect();
    assert_eq!(kinds, ["other", "other", "emergency"]);
}

#[test]
fn a_counter_that_stays_is_understood_as_nothing_was_asked_for_again() {
    let second = [&[0x00, 0x30, 0x00][..], &[7; 23]].concat();
    let last = [&[0x00, 0x30, 0x11][..], &[7; 11]].concat();
    let mut scripted = Scripted::new(&[&first_of_50(), &second, &last]);
    scripted.stuck_counter = true;
    assert_eq!(upload(&mut scripted, 0x2000).unwrap(), [7; 50]);
}

#[test]
fn a_mailbox_that_nobody_reads_is_told_so() {
    let mut scripted = Scripted::new(&[]);
    scripted.deaf = true;
    let failure = upload(&mut scripted, 0x2000).unwrap_err();
    assert!(matches!(failure.why, Why::MailboxFull { .. }), "{failure}");
}

#[test]
fn a_list_comes_in_fragments() {
    let head = |left: u8| [0x00, 0x80, 2 | if left > 0 { 0x80 } else { 0 }, 0, left, 0];
    let first = [&head(1)[..], &[1, 0, 0x00, 0x10, 0x18, 0x10]].concat();
    let second = [&head(0)[..], &[0x08, 0x10]].concat();
    let several = Said::Several(vec![(COE, first.clone()), (COE, second)]);
    let mut scripted = Scripted::with(vec![(COE, several)]);
    let list = ListKind::All;
    let (outcome, _) = run(&mut scripted, MailboxRequest::ObjectList { list });
    assert_eq!(outcome.unwrap(), [1, 0, 0x00, 0x10, 0x18, 0x10, 0x08, 0x10]);
    assert_eq!(scripted.heard[0], [0x00, 0x80, 1, 0, 0, 0, 1, 0]);
    // The second fragment does not come.
    let (outcome, _) = run(&mut Scripted::new(&[&first]), MailboxRequest::ObjectList { list });
    let text = outcome.unwrap_err().to_string();
    assert!(text.contains("object list 1") && text.contains("fragment 1"), "{text}");
}

#[test]
fn a_description_of_something_else_or_none_is_told() {
    let index = ObjectIndex(0x2000);
    let ask = |says: &[u8]| {
        run(&mut Scripted::new(&[says]), MailboxRequest::DescribeObject { index }).0.unwrap_err()
    };
    let other = [0x00, 0x80, 4, 0, 0, 0, 0x18, 0x10, 7, 0, 4, 9, b'I'];
    assert!(matches!(ask(&other).why, Why::Protocol { .. }));
    let short = [0x00, 0x80, 4, 0, 0, 0, 0x00];
    assert!(matches!(ask(&short).why, Why::Protocol { .. }));
    let refused = ask(&[0x00, 0x80, 7, 0, 0, 0, 0, 0, 2, 6]);
    assert!(refused.to_string().contains("0x06020000"), "{refused}");
}

/// A packet of a file: 20 bytes fill the mailbox of 32.
fn packet(number: u8, data: &[u8]) -> Vec<u8> {
    [&[3, 0, number, 0, 0, 0][..], data].concat()
}

fn ack(number: u8) -> Vec<u8> {
    vec![4, 0, number, 0, 0, 0]
}

fn read_file(scripted: &mut Scripted) -> Outcome {
    run(scripted, MailboxRequest::ReadFile { name: "log".to_owned(), password: 0x1234 }).0
}

fn write_file(scripted: &mut Scripted, data: &[u8]) -> Outcome {
    let request =
        MailboxRequest::WriteFile { name: "a".to_owned(), password: 0, data: data.to_vec() };
    run(scripted, request).0
}

#[test]
fn a_file_is_read_packet_by_packet() {
    let whole: Vec<u8> = (0..40).collect();
    let mut scripted = Scripted::of_files(&[
        // Not yet: the request is sent again.
        &[6, 0, 1, 0, 2, 0],
        &packet(1, &whole[..20]),
        &packet(2, &whole[20..]),
        &packet(3, &[]),
    ]);
    assert_eq!(read_file(&mut scripted).unwrap(), whole);
    let request = [&[1, 0, 0x34, 0x12, 0, 0][..], b"log"].concat();
    assert_eq!(scripted.heard[..2], [request.clone(), request]);
    assert_eq!(scripted.heard[2..], [ack(1), ack(2), ack(3)]);
}

#[test]
fn a_file_is_written_and_an_empty_packet_ends_it() {
    let whole: Vec<u8> = (0..40).collect();
    let mut scripted =
        Scripted::of_files(&[&ack(0), &[6, 0, 0, 0, 0, 0], &ack(1), &ack(2), &ack(3)]);
    write_file(&mut scripted, &whole).unwrap();
    assert_eq!(scripted.heard[0], [2, 0, 0, 0, 0, 0, b'a']);
    let sent = [packet(1, &whole[..20]), packet(1, &whole[..20]), packet(2, &whole[20..])];
    assert_eq!(scripted.heard[1..4], sent, "the busy one is sent again");
    assert_eq!(scripted.heard[4], packet(3, &[]), "the others filled the mailbox");
}

#[test]
fn progress_of_a_file_is_told_and_where_it_broke_off() {
    let whole: Vec<u8> = (0..50).collect();
    let busy = [&[6, 0, 1, 0, 4, 0][..], b"erasing"].concat();
    let mut scripted = Scripted::of_files(&[&ack(0), &busy, &ack(1), &busy, &busy, &ack(2)]);
    let request = MailboxRequest::WriteFile { name: "a".to_owned(), password: 0, data: whole };
    let (outcome, events) = run(&mut scripted, request);
    // Told ten times a second at most: the first packet, then what the SubDevice is busy with is too soon.
    let told: Vec<String> = events
        .iter()
        .filter_map(|event| {
            let Event::FileProgress { progress, .. } = event else { return None };
            Some(progress.to_string())
        })
        .collect();
    assert_eq!(told, ["0 of 50 bytes"]);
    let failure = outcome.unwrap_err().to_string();
    assert!(failure.contains("packet 3, 40 of 50 bytes through: no answer"), "{failure}");
    // Busy for ever: told again and again with how far that is, and given up in the end.
    let again: Vec<&[u8]> = std::iter::repeat_n(&busy[..], 7_000).collect();
    let mut scripted = Scripted::of_files(&again);
    let request = MailboxRequest::ReadFile { name: "log".to_owned(), password: 0 };
    let (outcome, events) = run(&mut scripted, request);
    let failure = outcome.unwrap_err().to_string();
    assert!(failure.contains("busy for 120 s: erasing, 25 %"), "{failure}");
    let busy = "0 bytes, the SubDevice is busy: erasing, 25 %";
    let told = events.iter().filter(
        |event| matches!(event, Event::FileProgress { progress, .. } if progress.to_string() == busy),
    );
    assert!((1_000..=1_201).contains(&told.count()), "ten times a second at most");
}

// proves: SW-11 partial: texts and codes; the segment has them on a public surface
#[test]
fn files_that_are_refused_say_why() {
    for (code, words) in [
        (FoeErrorCode::NOT_FOUND, "no file of this name"),
        (FoeErrorCode::DISK_FULL, "no room left"),
        (FoeErrorCode::NOT_IN_BOOTSTRAP, "BOOT"),
        (FoeErrorCode::NO_RIGHTS, "password"),
    ] {
        let number = code.0.to_le_bytes();
        let error = [&[5, 0][..], &number, b"no\0"].concat();
        let failure = write_file(&mut Scripted::of_files(&[&error]), &[1]).unwrap_err();
        assert_eq!(failure.why, Why::File { code, text: "no".to_owned() });
        let text = failure.to_string();
        assert!(text.contains(words) && text.contains("writing file `a`"), "{text}");
    }
    let failure = read_file(&mut Scripted::of_files(&[&packet(2, &[1])])).unwrap_err();
    assert!(failure.to_string().contains("packet 2 instead of 1"), "{failure}");
    let mut silent = Scripted::of_files(&[&ack(0)]);
    let failure = write_file(&mut silent, &[1; 30]).unwrap_err();
    let text = failure.to_string();
    assert!(text.contains("packet 1, 0 of 30 bytes through: no answer within 10 s"), "{text}");
    assert!(text.contains("FoE cannot go on where it stopped"), "{text}");
    let name = "a name that does not fit into a mailbox".to_owned();
    let request = MailboxRequest::ReadFile { name, password: 0 };
    let failure = run(&mut Scripted::of_files(&[]), request).0.unwrap_err();
    assert!(matches!(failure.why, Why::TooSmall(_)), "{failure}");
}

/// Something that may come: mostly with a header that can be read.
fn anything() -> impl Strategy<Value = (u8, Said)> {
    let raw = vec(any::<u8>(), 32).prop_map(|bytes| (COE, Said::Raw(bytes)));
    let coe = (vec(prop::sample::select(vec![0x10, 0x20, 0x30, 0x80]), 1), vec(any::<u8>(), 0..25))
        .prop_map(|(service, rest)| (COE, Said::Body([&[0], &service[..], &rest].concat())));
    // A response about the object that is asked for.
    let about = (prop::sample::select(vec![0x41, 0x43, 0x4F, 0x60, 0x00, 0x01, 0x11, 0x20, 0x80]))
        .prop_flat_map(|command| {
            vec(any::<u8>(), 0..20).prop_map(move |rest| {
                let head = [0x00, 0x30, command, 0x00, 0x20, 1];
                (COE, Said::Body([&head[..], &rest].concat()))
            })
        });
    let foe = (1_u8..8, 0_u8..4, vec(any::<u8>(), 0..20)).prop_map(|(opcode, number, rest)| {
        (FOE, Said::Body([&[opcode, 0, number, 0, 0, 0][..], &rest].concat()))
    });
    let error = vec(any::<u8>(), 0..6).prop_map(|body| (0, Said::Body(body)));
    prop_oneof![raw, coe, about, foe, error]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn operation_ends_whatever_the_mailbox_answers(said in vec(anything(), 0..10), which in 0..6_usize) {
        let object = ObjectAddress::new(0x2000, 1);
        let name = "file".to_owned();
        let request = match which {
            0 => MailboxRequest::Upload { object, complete: false },
            1 => MailboxRequest::Download { object, complete: true, data: vec![7; 60] },
            2 => MailboxRequest::ObjectList { list: ListKind::All },
            3 => MailboxRequest::DescribeEntry { object, values: Default::default() },
            4 => MailboxRequest::ReadFile { name, password: 0 },
            _ => MailboxRequest::WriteFile { name, password: 0, data: vec![7; 60] },
        };
        let (outcome, _) = run(&mut Scripted::with(said), request);
        if let Err(failure) = outcome {
            prop_assert!(failure.to_string().starts_with("SubDevice 5, "));
        }
    }
}
