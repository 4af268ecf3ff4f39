//! A MainDevice whose SubDevice answers mailbox requests with whatever is in the input.
//!
//! The line is a real one up to PREOP; then each mailbox answer that the MainDevice fetches is replaced,
//! as a whole or behind its header. However hostile the answers: every request ends within its time,
//! with a value or with a reason, and nothing panics.

use linesman_config::plan::{Plan, PlanOptions};
use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::Service;
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::{DeviceId, Network, RegisterAddress};
use linesman_proto::ads::{AdsCommand, AdsRequest, index};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MAX_LEN;
use linesman_proto::frame::FrameView;
use linesman_proto::mailbox::coe::information::{ListKind, ValueInfo};
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

use crate::series::series;

/// More answers bring nothing new.
const MOST_ANSWERS: usize = 32;
/// No request takes longer, however it is answered.
const PATIENCE: Span = Span::s(120);

const FILE: &str = r#"
[[device]]
name = "D1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "D2"
type = "EL7041"
on = "D1.B"
"#;
const DEVICE: DeviceId = DeviceId(1);

/// The first byte says what is asked, the rest is a series of answers.
pub fn mailbox_client(data: &[u8]) {
    let Some((choice, data)) = data.split_first() else { return };
    let answers: Vec<Answer> = series(data)
        .take(MOST_ANSWERS)
        .map(|item| Answer { flags: item.flags, bytes: item.bytes.to_vec() })
        .collect();
    let mut rig = Rig::up();
    rig.answers = answers;
    for at in 0..2_u8 {
        let request = request(choice >> (4 * at) & 0x0F);
        rig.main.serve(rig.now, DEVICE, Service::Mailbox(request));
        let end = rig.now + PATIENCE;
        assert!(rig.run(end, |event| matches!(event, Event::Served { .. })), "it never ends");
    }
    // The MainDevice goes on: with honest answers again, what is asked is answered.
    rig.answers.clear();
    rig.main.request_state(rig.now, Some(DEVICE), AlState::Init);
    rig.run(rig.now + Span::s(1), |_| false);
    rig.main.request_state(rig.now, Some(DEVICE), AlState::PreOp);
    rig.run(rig.now + Span::s(3), |_| false);
    let vendor = MailboxRequest::Upload { object: ObjectAddress::new(0x1018, 1), complete: false };
    rig.main.serve(rig.now, DEVICE, Service::Mailbox(vendor));
    let mut good = false;
    rig.run(rig.now + PATIENCE, |event| {
        let Event::Served { result, .. } = event else { return false };
        good = result.is_ok();
        true
    });
    assert!(good, "it does not recover");
}

/// What is put in the place of an answer.
struct Answer {
    /// Bit 0: behind the header only. Bit 1: behind the CoE header, too.
    flags: u8,
    bytes: Vec<u8>,
}

fn request(choice: u8) -> MailboxRequest {
    let object = ObjectAddress::new(0x1018, 1);
    let whole = ObjectAddress::new(0x1C12, 0);
    let name = || "file.bin".to_owned();
    match choice % 12 {
        0 => MailboxRequest::Upload { object, complete: false },
        1 => MailboxRequest::Upload { object: whole, complete: true },
        2 => MailboxRequest::Download { object, complete: false, data: vec![1, 2] },
        3 => MailboxRequest::Download { object: whole, complete: true, data: vec![7; 600] },
        4 => MailboxRequest::ObjectList { list: ListKind::All },
        5 => MailboxRequest::DescribeObject { index: ObjectIndex(0x1018) },
        6 => MailboxRequest::DescribeEntry { object, values: ValueInfo(0) },
        7 => MailboxRequest::ReadFile { name: name(), password: 0 },
        9 => ads(&AdsRequest::Read { group: index::SDO, offset: 0x1018_0001, len: 4 }),
        10 => ads(&AdsRequest::DeviceInfo),
        11 => MailboxRequest::SendVendorMessage {
            data: vec![2, 0, 0, 0, 1, 0],
            answer_within: Span::ms(50),
        },
        _ => MailboxRequest::WriteFile { name: name(), password: 0, data: vec![9; 400] },
    }
}

fn ads(request: &AdsRequest<'_>) -> MailboxRequest {
    let (number, data) = request.to_bytes();
    let command = AdsCommand::from_number(number).expect("it is known");
    MailboxRequest::Ads { net_id: None, port: 0xFFFF, source: None, command, data }
}

struct Rig {
    now: Instant,
    main: MainDevice,
    segment: Segment,
    /// Where answers are fetched.
    answers_at: RegisterAddress,
    answers: Vec<Answer>,
    next: usize,
}

impl Rig {
    /// A line in PREOP.
    fn up() -> Self {
        let file = SegmentFile::parse(FILE).expect("it is right");
        let mut rig = Self {
            now: Instant::ZERO,
            main: MainDevice::new(Network(0), Options::default()),
            segment: Segment::build(&file).expect("it can be built"),
            answers_at: RegisterAddress(0),
            answers: Vec::new(),
            next: 0,
        };
        rig.main.scan(rig.now);
        let mut found = None;
        rig.run(Instant::ZERO + Span::s(5), |event| {
            let Event::Scanned(inventory) = event else { return false };
            found = Some(inventory.clone());
            true
        });
        let found = found.expect("it was scanned");
        let options = PlanOptions { cycle: Span::ms(20), ..PlanOptions::default() };
        let plan = Plan::build(&found.planned(AlState::PreOp), found.tree().clone(), &options);
        let plan = plan.expect("a plan");
        let mailbox = plan.devices[DEVICE.index()].mailbox.as_ref().expect("it has a mailbox");
        rig.answers_at = mailbox.areas.send.offset;
        rig.main.start(rig.now, plan);
        let up = rig.run(rig.now + Span::s(10), |event| matches!(event, Event::AllReached));
        assert!(up, "it comes up");
        rig
    }

    /// Lets time pass until an event is the one.
    fn run(&mut self, end: Instant, mut done: impl FnMut(&Event) -> bool) -> bool {
        let mut buffer = vec![0; MAX_LEN];
        let mut arrival = Vec::new();
        loop {
            while let Some(sent) = self.main.poll_transmit(self.now, &mut buffer) {
                self.segment.handle_frame(sent.at, sent.path, &buffer[..sent.len]);
            }
            while let Some(event) = self.main.poll_event() {
                if done(&event) {
                    return true;
                }
            }
            let due = [self.main.poll_timeout(), self.segment.poll_timeout()];
            let next = due.into_iter().flatten().min().unwrap_or(Instant::MAX);
            if next > end {
                self.now = end;
                self.segment.advance(end);
                return false;
            }
            self.now = self.now.max(next);
            self.segment.advance(self.now);
            while let Some(came) = self.segment.poll_arrival(&mut arrival) {
                self.falsify(&mut arrival);
                self.main.handle_frame(self.now, came.path, &arrival);
            }
            if self.main.poll_timeout().is_some_and(|at| at <= self.now) {
                self.main.handle_timeout(self.now);
            }
        }
    }

    /// Puts the next hostile answer in the place of each honest one.
    fn falsify(&mut self, frame: &mut [u8]) {
        let Ok(view) = FrameView::parse(frame) else { return };
        let fetched: Vec<_> = view
            .datagrams()
            .flatten()
            .filter(|one| {
                one.command() == Some(Command::Fprd)
                    && one.ado() == self.answers_at
                    && one.wkc().value() == 1
            })
            .map(|one| one.data_range())
            .collect();
        for range in fetched {
            let Some(answer) = self.answers.get(self.next) else { return };
            self.next += 1;
            let skip = match answer.flags & 3 {
                0 => 0,
                1 => 6,
                _ => 8,
            };
            let place = frame.get_mut(range.start + skip..range.end).unwrap_or_default();
            let len = place.len().min(answer.bytes.len());
            place[..len].copy_from_slice(&answer.bytes[..len]);
        }
    }
}
