//! SDO transfers against a SubDevice of a few lines: its mailbox is a buffer, its answers are bytes
//! written down by hand.

use std::pin::pin;
use std::sync::{Arc, Mutex};
use std::task::{Poll, Waker};

use linesman_config::identity::RevisionRule;
use linesman_config::plan::{DevicePlan, Plan};
use linesman_config::profile::Mailbox;
use linesman_proto::address::{Network, RegisterAddress, StationAddress, WorkingCounter};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::sii::{MailboxPair, Protocols};
use linesman_proto::state::AlState;
use linesman_proto::time::Instant;

use super::*;
use crate::event::Event;
use crate::exchange::{Reply, Request};
use crate::executor::Executor;
use crate::options::Options;
use crate::supervisor::Line;

const ID: DeviceId = DeviceId(4);
const OUT: u16 = 0x1000;
const IN: u16 = 0x1080;
const OUT_STATUS: u16 = 0x0805;
const IN_STATUS: u16 = 0x080D;
const FULL: u8 = 0x08;

/// A mailbox of 32 bytes each way: 16 bytes of SDO data in a first message, 23 in a segment.
fn device() -> DevicePlan {
    let areas = MailboxPair::from_words([OUT, 32, IN, 32]);
    let protocols = Protocols(Protocols::COE);
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
    /// What it says, in order; each begins behind the mailbox header.
    says: Vec<Vec<u8>>,
    /// What it was told, without mailbox headers.
    heard: Vec<Vec<u8>>,
    waiting: Option<Vec<u8>>,
    counter: u8,
}

impl Scripted {
    fn new(says: &[&[u8]]) -> Self {
        let says = says.iter().map(|message| message.to_vec()).collect();
        Self { says, heard: Vec::new(), waiting: None, counter: 0 }
    }

    fn answer(&mut self, request: &Request) -> Reply {
        let DatagramAddress::Physical(station, RegisterAddress(at)) = request.address else {
            panic!("{request:?}")
        };
        assert_eq!(station, 0x1005);
        let (wkc, data) = match (request.command, at) {
            (Command::Fprd, OUT_STATUS) => (1, vec![0]),
            (Command::Fprd, IN_STATUS) => (1, vec![if self.waiting.is_some() { FULL } else { 0 }]),
            (Command::Fpwr, OUT) => {
                assert_eq!(request.data.len(), 32, "the whole mailbox is written");
                let len = usize::from(request.data[0]);
                self.heard.push(request.data[6..6 + len].to_vec());
                if !self.says.is_empty() {
                    self.speak();
                }
                (1, request.data.clone())
            }
            (Command::Fprd, IN) => match self.waiting.take() {
                Some(message) => (1, message),
                None => (0, vec![0; 32]),
            },
            other => panic!("{other:?}"),
        };
        Reply { wkc: WorkingCounter(wkc), data }
    }

    fn speak(&mut self) {
        let body = self.says.remove(0);
        self.counter = self.counter % 7 + 1;
        let mut message = vec![body.len() as u8, 0, 0, 0, 0, 0x03 | self.counter << 4];
        message.extend(body);
        message.resize(32, 0);
        self.waiting = Some(message);
    }
}

/// Runs one errand to its end; gives what came of it, and what was told meanwhile.
fn run(scripted: &mut Scripted, request: MailboxRequest) -> (Outcome, Vec<Event>) {
    let mut executor = Executor::new();
    let wire = executor.group(0);
    let tree = linesman_proto::topology::derive(&[]).unwrap();
    let mut devices: Vec<DevicePlan> = (0..4).map(|_| device()).collect();
    devices.push(device());
    let plan = Plan { devices, ..Plan::empty(tree) };
    let mut line = Line::new(&plan);
    line.set_reached(ID, AlState::PreOp);
    let mailboxes = Queues::of([ID].into_iter());
    let context = Context {
        wire: wire.clone(),
        network: Network(0),
        plan: Arc::new(plan),
        line: Arc::new(Mutex::new(line)),
        options: Arc::new(Options::default()),
        mailboxes: mailboxes.clone(),
    };
    let mut pending = pin!(mailboxes.ask(ID, request));
    wire.spawn(serve_mailbox(context, ID));
    let mut now = Instant::ZERO;
    let mut events = Vec::new();
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
        if let Poll::Ready(outcome) = pending.as_mut().poll(&mut context) {
            return (outcome, events);
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
