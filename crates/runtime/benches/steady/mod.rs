//! A MainDevice in OP, brought there in virtual time, and the answers that its cyclic frames get.

#![allow(
    clippy::unwrap_used,
    unreachable_pub,
    dead_code,
    reason = "shared by benches, which may panic"
)]

use linesman_config::plan::{Plan, PlanOptions, Role};
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::Network;
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, DATAGRAM_OVERHEAD};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

/// Nothing but the cycle: watching the SubDevices in between is measured by itself.
const NEVER: Span = Span::s(1_000_000);

/// Terminals behind a coupler, so many of each type.
fn file(counts: &[(&str, usize)]) -> SegmentFile {
    let mut text = "name = \"cost\"\nseed = 1\n[[device]]\nname = \"K\"\ntype = \"EK1100\"\n\
                    on = \"maindevice\"\n"
        .to_owned();
    let (mut before, mut number) = ("K".to_owned(), 0);
    for (kind, count) in counts {
        for _ in 0..*count {
            number += 1;
            let name = format!("T{number}");
            text +=
                &format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{before}.B\"\n");
            before = name;
        }
    }
    SegmentFile::parse(&text).expect("a segment file")
}

/// A MainDevice that has brought its line to OP.
pub struct Running {
    pub main: MainDevice,
    /// When it had.
    pub now: Instant,
    pub plan: Plan,
}

/// Brings a line of so many devices to OP; with `monitor` the broadcast read is in the frame.
pub fn running(counts: &[(&str, usize)], monitor: bool, cycle: Span) -> Running {
    let file = file(counts);
    let mut segment = Segment::build(&file).expect("a segment");
    let options = Options {
        watch_interval: NEVER,
        mailbox_interval: NEVER,
        allowed_misses: Some(0),
        ..Options::default()
    };
    let mut main = MainDevice::new(Network(0), options);
    let mut now = Instant::ZERO;
    main.scan(now);
    let scanned =
        run(&mut main, &mut segment, &mut now, |event| matches!(event, Event::Scanned(_)));
    let Event::Scanned(inventory) = scanned else { panic!("{scanned:?}") };
    let options = PlanOptions { cycle, ..PlanOptions::default() };
    let planned = inventory.planned(AlState::Op);
    let mut plan = Plan::build(&planned, inventory.tree().clone(), &options).expect("a plan");
    if !monitor {
        for frame in &mut plan.tasks[0].frames {
            frame.datagrams.retain(|datagram| datagram.role != Role::Presence);
        }
        plan.tasks[0].frames.retain(|frame| !frame.datagrams.is_empty());
    }
    main.start(now, plan.clone());
    run(&mut main, &mut segment, &mut now, |event| matches!(event, Event::AllReached));
    // What is looked at once in OP has been looked at.
    let settled = now + Span::ms(200);
    drive(&mut main, &mut segment, &mut now, settled, |_| false);
    Running { main, now, plan }
}

/// What comes back of a frame.
pub struct Answer {
    /// All of it, as the cards receive it.
    pub bytes: Vec<u8>,
    /// Where index bytes are: with each cycle they are others.
    pub indices: Vec<usize>,
}

/// What comes back of a frame: as the one before it, with the marks of this one.
#[inline]
pub fn scripted<'a>(answers: &'a mut [Answer], frame: &[u8]) -> &'a [u8] {
    let Some(answer) = answers.iter_mut().find(|one| one.bytes.len() == frame.len()) else {
        return &[];
    };
    for at in &answer.indices {
        answer.bytes[*at] = frame[*at];
    }
    &answer.bytes
}

/// What a card does with a frame that it receives: it puts it where it is wanted. Gives its length.
#[inline]
pub fn received(frame: &[u8], room: &mut [u8]) -> usize {
    room[..frame.len()].copy_from_slice(frame);
    frame.len()
}

pub fn answers(plan: &Plan) -> Vec<Answer> {
    use linesman_config::plan::expect::{PathView, Presence, expect};
    use linesman_proto::frame::FrameBuilder;
    let all = Presence::full(plan.devices.len());
    let source = Options::default().sources[0];
    let answer = |frame: &linesman_config::plan::FramePlan| {
        let mut bytes = vec![0; 1_514];
        let mut builder = FrameBuilder::new(&mut bytes, source);
        for one in &frame.datagrams {
            builder.push(one.command, 0, one.address, one.len).expect("the planned frame");
        }
        let len = builder.finish();
        bytes.truncate(len);
        bytes[6] |= linesman_proto::ethernet::SOURCE_MARK;
        let (mut at, mut indices) = (16, Vec::new());
        for datagram in &frame.datagrams {
            let wkc = expect(datagram, &all, PathView::Merged).0;
            let data_at = at + DATAGRAM_HEADER_LEN;
            if datagram.role == Role::Presence {
                bytes[data_at] = 8;
            }
            let wkc_at = data_at + datagram.len;
            bytes[wkc_at..wkc_at + 2].copy_from_slice(&wkc.to_le_bytes());
            if datagram.role == Role::ProcessData {
                // Inputs, at the end.
                bytes[wkc_at - 1] = 0x5A;
            }
            indices.push(at + 1);
            at += datagram.len + DATAGRAM_OVERHEAD;
        }
        Answer { bytes, indices }
    };
    plan.tasks[0].frames.iter().map(answer).collect()
}

/// Runs both in virtual time until an event, for a minute at most.
fn run(
    main: &mut MainDevice,
    segment: &mut Segment,
    now: &mut Instant,
    done: impl Fn(&Event) -> bool,
) -> Event {
    let end = *now + Span::s(60);
    drive(main, segment, now, end, done).expect("it takes too long")
}

/// Runs both in virtual time until an event, or until `end`.
fn drive(
    main: &mut MainDevice,
    segment: &mut Segment,
    now: &mut Instant,
    end: Instant,
    done: impl Fn(&Event) -> bool,
) -> Option<Event> {
    let (mut buffer, mut arrival) = (vec![0; 1514], Vec::new());
    loop {
        while let Some(transmit) = main.poll_transmit(*now, &mut buffer) {
            segment.handle_frame(*now, transmit.path, &buffer[..transmit.len]);
        }
        while let Some(event) = main.poll_event() {
            if done(&event) {
                return Some(event);
            }
        }
        let due = [main.poll_timeout(), segment.poll_timeout()].into_iter().flatten().min();
        *now = due.unwrap_or(end).max(*now);
        if *now >= end {
            return None;
        }
        segment.advance(*now);
        while let Some(came) = segment.poll_arrival(&mut arrival) {
            main.handle_frame(came.at.max(*now), came.path, &arrival);
        }
        main.handle_timeout(*now);
    }
}
