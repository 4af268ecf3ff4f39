//! A complete virtual device behind its mailbox: states, queue, AoE, CoE, EoE, FoE, VoE, BOOT.

use linesman_proto::address::{Path, RegisterAddress};
use linesman_proto::ads::AmsHeader;
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{FrameBuilder, FrameView};
use linesman_proto::mailbox::{Message, coe, eoe, foe};
use linesman_proto::register::{SmControl, SyncManagerConfig};
use linesman_proto::sii::{Image, MailboxPair};
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

use crate::series::series;

/// More steps bring nothing new.
const MOST_STEPS: usize = 96;

/// A coupler, and a terminal of this type.
fn plant(type_name: &str) -> String {
    format!(
        "[[device]]\nname = \"D1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
         [[device]]\nname = \"D2\"\ntype = \"{type_name}\"\non = \"D1.B\"\n"
    )
}

struct Rig {
    segment: Segment,
    now: Instant,
    buffer: Vec<u8>,
    standard: MailboxPair,
    bootstrap: MailboxPair,
    areas: MailboxPair,
}

impl Rig {
    fn new(type_name: &str) -> Self {
        let file = SegmentFile::parse(&plant(type_name)).expect("a segment");
        let segment = Segment::build(&file).expect("a segment");
        let last = segment.devices().last().expect("two devices");
        let sii = segment.controller(last).expect("it is there").sii().to_vec();
        let image = Image::parse(&sii).expect("an SII");
        let (standard, bootstrap) = (image.standard_mailbox, image.bootstrap_mailbox);
        let now = Instant::ZERO;
        Self { segment, now, buffer: Vec::new(), standard, bootstrap, areas: standard }
    }

    fn wait(&mut self, span: Span) {
        self.now += span;
        self.segment.advance(self.now);
    }

    /// One datagram to the second device: its data and working counter.
    fn exchange(&mut self, command: Command, at: u16, data: &[u8]) -> (Vec<u8>, u16) {
        let mut frame = vec![0; 1_514];
        let mut builder = FrameBuilder::new(&mut frame, MacAddress([0, 1, 2, 3, 4, 5]));
        let address = DatagramAddress::Physical(0xFFFF, RegisterAddress(at));
        builder.push(command, 0, address, data.len()).expect("it fits").copy_from_slice(data);
        let len = builder.finish();
        self.segment.handle_frame(self.now, Path::A, &frame[..len]);
        self.wait(Span::us(300));
        let mut answer = (Vec::new(), 0);
        while let Some(arrival) = self.segment.poll_arrival(&mut self.buffer) {
            assert!(arrival.intact);
            let view = FrameView::parse(&self.buffer).expect("a frame");
            let datagram = view.datagrams().next().expect("one").expect("whole");
            answer = (datagram.data().to_vec(), datagram.wkc().value());
        }
        answer
    }

    fn write(&mut self, at: u16, data: &[u8]) -> u16 {
        self.exchange(Command::Apwr, at, data).1
    }

    fn set_up(&mut self, areas: MailboxPair) {
        self.areas = areas;
        for (index, area, control) in
            [(0, areas.receive, SmControl::MAILBOX_OUT), (1, areas.send, SmControl::MAILBOX_IN)]
        {
            self.write(0x0806 + 8 * index, &[0]);
            let config = SyncManagerConfig::enabled(area.offset, area.size, control);
            self.write(0x0800 + 8 * index, &config.to_bytes());
        }
    }

    fn request(&mut self, control: u8) {
        self.write(0x0120, &[control, 0]);
        self.wait(Span::ms(50));
    }

    fn post(&mut self, message: &[u8]) {
        let mut data = message.to_vec();
        data.resize(usize::from(self.areas.receive.size), 0);
        self.write(self.areas.receive.offset.0, &data);
    }

    /// Fetches an answer, if there is one: it is a message of a kind that devices send.
    fn fetch(&mut self) -> Option<Vec<u8>> {
        // Switched off, the SyncManager guards nothing: what is read is memory, no message.
        let (activate, _) = self.exchange(Command::Aprd, 0x080E, &[0]);
        if activate.first().is_none_or(|byte| byte & 1 == 0) {
            return None;
        }
        let empty = vec![0; usize::from(self.areas.send.size)];
        let (data, wkc) = self.exchange(Command::Aprd, self.areas.send.offset.0, &empty);
        if wkc == 0 {
            return None;
        }
        let message = Message::parse(&data).expect("an answer is a message");
        match message.header.kind.code() {
            0 => assert!(message.data.len() == 4),
            1 => {
                let parsed = AmsHeader::parse(message.data);
                assert!(
                    parsed.is_ok_and(|(header, _)| header.is_answer()),
                    "{:02X?}",
                    message.data
                );
            }
            // What a vendor says means nothing to others.
            15 => {}
            3 => assert!(coe::Message::parse(message.data).is_ok(), "{:02X?}", message.data),
            2 => assert!(eoe::Message::parse(message.data).is_ok(), "{:02X?}", message.data),
            4 => assert!(foe::Message::parse(message.data).is_ok(), "{:02X?}", message.data),
            other => panic!("a message of type {other}"),
        }
        Some(data)
    }
}

/// Whatever is put into its mailbox, and whatever state is asked for, a device answers with messages,
/// and after INIT it works again.
pub fn drive(type_name: &str, data: &[u8]) {
    let mut rig = Rig::new(type_name);
    rig.set_up(rig.standard);
    rig.request(2);
    for step in series(data).take(MOST_STEPS) {
        match step.flags & 0x0F {
            0..=7 => rig.post(step.bytes),
            8 => {
                rig.fetch();
            }
            9 => rig.request(step.bytes.first().copied().unwrap_or(1)),
            10 => {
                rig.request(0x11);
                rig.set_up(rig.bootstrap);
                rig.request(3);
            }
            11 => {
                rig.request(0x11);
                rig.set_up(rig.standard);
                rig.request(2);
            }
            12 => {
                // The repeat request of SyncManager 1.
                let toggle = step.bytes.first().map_or(3, |byte| byte & 2 | 1);
                rig.write(0x080E, &[toggle]);
            }
            13 => {
                let at = step.bytes.first().map_or(0x0800, |byte| 0x0800 + u16::from(byte & 0x0F));
                rig.write(at, step.bytes.get(1..3).unwrap_or(&[0]));
            }
            _ => rig.wait(Span::us(step.pause_us)),
        }
        if step.flags & 0x80 != 0 {
            rig.wait(Span::ms(1));
            rig.fetch();
        }
    }
    // What waits comes to an end: queues are bounded.
    let waiting = std::iter::from_fn(|| {
        rig.wait(Span::ms(5));
        rig.fetch()
    });
    assert!(waiting.count() < 4_000, "answers without end");
    // The way out of BOOT may end with an error of its own, which is to be acknowledged.
    rig.request(0x11);
    rig.wait(Span::ms(500));
    rig.request(0x11);
    rig.set_up(rig.standard);
    rig.request(2);
    rig.post(&[10, 0, 0, 0, 0, 0x03, 0, 0x20, 0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    rig.wait(Span::ms(5));
    let answer = rig.fetch().expect("after INIT it answers again");
    assert_eq!(answer[6..16], [0, 0x30, 0x43, 0x18, 0x10, 1, 2, 0, 0, 0]);
}
