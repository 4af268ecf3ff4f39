//! Slots against frames made by hand: an answering line of a few bytes.

use linesman_proto::address::{DeviceId, LogicalAddress, RegisterAddress, StationAddress};
use linesman_proto::ethernet::SOURCE_MARK;

use linesman_config::plan::{DatagramPlan, Ownership, Role};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::sii::Direction;
use proptest::prelude::*;

use super::*;

const SOURCES: [MacAddress; 2] =
    [MacAddress([0x00, 1, 2, 3, 4, 0xA]), MacAddress([0x00, 1, 2, 3, 4, 0xB])];
const NOW: Instant = Instant::ZERO;

fn exchange(ring: bool) -> Exchange {
    Exchange::new(SOURCES, ring, Span::ms(10))
}

fn queued(ticket: u64, request: Request) -> Queued {
    Queued { ticket: Ticket(ticket), request, frames: 0 }
}

fn read(station: u16, repeats: u8) -> Request {
    let target = Target::Station(StationAddress(station));
    Request::read(target, RegisterAddress(0x0130), 2).repeated(repeats)
}

/// Sends all that is queued and gives the frames by card.
fn transmit(exchange: &mut Exchange) -> Vec<(Path, Vec<u8>)> {
    exchange.send_acyclic(NOW, MAX_LEN);
    let mut buffer = vec![0; MAX_LEN];
    let mut frames = Vec::new();
    while let Some((Transmit { path, len, .. }, _)) = exchange.poll_transmit(NOW, &mut buffer) {
        frames.push((path, buffer[..len].to_vec()));
    }
    frames
}

/// A frame as it comes back: marked, with data and working counter at the first datagram.
fn answered(frame: &[u8], data: [u8; 2], wkc: u8) -> Vec<u8> {
    let mut back = frame.to_vec();
    back[6] |= SOURCE_MARK;
    back[26..28].copy_from_slice(&data);
    back[28] = wkc;
    back
}

fn reply_of(exchange: &Exchange, slot: u8) -> ([u8; 2], u8) {
    let reply = &exchange.slot(slot).reply;
    ([reply[26], reply[27]], reply[28])
}

// S1 9.1.2: controllers of the first generation and ET1200 take the next frame that comes in for the one that latches.
#[test]
fn request_for_a_quiet_line_waits_until_all_frames_are_back() {
    let mut exchange = exchange(false);
    exchange.submit(queued(1, read(0x1001, 0))).unwrap();
    let before = transmit(&mut exchange);
    exchange.submit(queued(2, read(0x1002, 0).on_quiet_line())).unwrap();
    exchange.submit(queued(3, read(0x1003, 0))).unwrap();
    assert_eq!(transmit(&mut exchange), [], "one is out");
    exchange.receive(NOW, Path::A, &answered(&before[0].1, [8, 0], 1));
    // It has a frame of its own; who came later goes after it.
    let quiet = transmit(&mut exchange);
    assert_eq!(quiet.len(), 1);
    assert_eq!(&quiet[0].1[18..20], &0x1002_u16.to_le_bytes());
    assert_eq!(transmit(&mut exchange).len(), 1);
    // Where the line is never quiet it leaves all the same.
    exchange.submit(queued(4, read(0x1004, 0).on_quiet_line())).unwrap();
    assert_eq!(transmit(&mut exchange), []);
    assert!(exchange.send_acyclic(NOW + request::QUIET_WITHIN, MAX_LEN));
}

#[test]
fn datagrams_of_many_share_a_frame() {
    let mut exchange = exchange(false);
    for ticket in 0..20 {
        exchange.submit(queued(ticket, read(0x1001, 0))).unwrap();
    }
    let frames = transmit(&mut exchange);
    assert_eq!(frames.len(), 1);
    // 14 + 2 + 15 x (10 + 2 + 2) bytes.
    assert_eq!(frames[0].1.len(), 16 + 15 * 14);
    assert!(exchange.has_queued());
    let Received::Complete(slot) =
        exchange.receive(NOW, Path::A, &answered(&frames[0].1, [8, 0], 1))
    else {
        panic!()
    };
    let tickets: Vec<u64> = exchange.take_requests(slot).iter().map(|it| it.ticket.0).collect();
    assert_eq!(tickets, (0..15).collect::<Vec<_>>());
}

#[test]
fn what_no_frame_can_carry_is_given_back() {
    let mut exchange = exchange(false);
    let target = Target::Station(StationAddress(1));
    let long = Request::read(target, RegisterAddress(0x1000), 1487);
    assert!(exchange.submit(queued(0, long)).is_err());
}

#[test]
fn lost_late_duplicate_foreign_and_echo() {
    let mut exchange = exchange(false);
    exchange.submit(queued(1, read(0x1001, 0))).unwrap();
    let (_, frame) = transmit(&mut exchange).remove(0);
    assert_eq!(exchange.receive(NOW, Path::A, &frame), Received::Echo);
    let good = answered(&frame, [8, 0], 1);
    let mut other_source = good.clone();
    other_source[11] = 0x77;
    assert_eq!(exchange.receive(NOW, Path::A, &other_source), Received::Foreign);
    let mut other_register = good.clone();
    other_register[20] = 0x34;
    assert_eq!(exchange.receive(NOW, Path::A, &other_register), Received::Stray);
    assert_eq!(exchange.receive(NOW, Path::A, &good[..27]), Received::Truncated);
    assert_eq!(exchange.receive(NOW, Path::A, &good), Received::Complete(0));
    assert_eq!(exchange.receive(NOW, Path::A, &good), Received::Duplicate);

    exchange.submit(queued(2, read(0x1001, 0))).unwrap();
    let (_, frame) = transmit(&mut exchange).remove(0);
    assert_eq!(exchange.earliest(), NOW + Span::ms(10));
    assert_eq!(exchange.expire(NOW + Span::ms(9)), None);
    assert_eq!(exchange.expire(NOW + Span::ms(10)), Some(1));
    assert_eq!(exchange.slot(1).state, SlotState::GivenUp);
    assert_eq!(exchange.receive(NOW, Path::A, &answered(&frame, [8, 0], 1)), Received::Late);
}

#[test]
fn a_lost_datagram_is_sent_as_often_as_it_may() {
    let mut exchange = exchange(false);
    exchange.submit(queued(1, read(0x1001, 2))).unwrap();
    for attempt in 1..=3 {
        assert_eq!(transmit(&mut exchange).len(), 1, "attempt {attempt}");
        let slot = exchange.expire(NOW + Span::ms(10)).unwrap();
        let queued = exchange.take_requests(slot).remove(0);
        assert_eq!(queued.frames, attempt);
        assert_eq!(exchange.again(queued).is_some(), attempt == 3);
    }
}

#[test]
fn a_slot_that_waits_is_passed_over() {
    let mut exchange = exchange(false);
    exchange.submit(queued(0, read(0x1001, 0))).unwrap();
    transmit(&mut exchange);
    for ticket in 1..300 {
        exchange.submit(queued(ticket, read(0x1001, 0))).unwrap();
        let (_, frame) = transmit(&mut exchange).remove(0);
        let back = answered(&frame, [8, 0], 1);
        let Received::Complete(slot) = exchange.receive(NOW, Path::A, &back) else { panic!() };
        assert_ne!(slot, 0);
    }
    assert_eq!(exchange.slot(0).state, SlotState::Waiting);
}

#[test]
fn two_copies_of_an_intact_ring() {
    let mut exchange = exchange(true);
    exchange.submit(queued(1, read(0x1001, 0))).unwrap();
    let frames = transmit(&mut exchange);
    assert_eq!(frames.iter().map(|(path, _)| *path).collect::<Vec<_>>(), [Path::A, Path::B]);
    assert_eq!(frames[1].1[6..12], SOURCES[1].0);
    // The copy of card A went through all and comes in at card B; the other one went by.
    let first = answered(&frames[0].1, [8, 0], 1);
    assert_eq!(exchange.receive(NOW, Path::B, &first), Received::FirstCopy);
    assert_eq!(exchange.receive(NOW, Path::A, &frames[1].1), Received::Complete(0));
    assert_eq!(reply_of(&exchange, 0), ([8, 0], 1));
}

#[test]
fn two_copies_of_a_broken_ring() {
    let mut exchange = exchange(true);
    let all = Request::read(Target::All, RegisterAddress(0x0130), 2);
    exchange.submit(queued(1, all)).unwrap();
    let frames = transmit(&mut exchange);
    // Three on the side of card A are in OP, two on the other one in SAFEOP.
    exchange.receive(NOW, Path::A, &answered(&frames[0].1, [8, 0], 3));
    assert_eq!(
        exchange.receive(NOW, Path::B, &answered(&frames[1].1, [4, 0], 2)),
        Received::Complete(0)
    );
    assert_eq!(reply_of(&exchange, 0), ([0x0C, 0], 5));
}

#[test]
fn one_copy_is_enough_when_the_other_does_not_come() {
    let mut exchange = exchange(true);
    exchange.submit(queued(1, read(0x1001, 0))).unwrap();
    let frames = transmit(&mut exchange);
    exchange.receive(NOW, Path::A, &answered(&frames[0].1, [4, 0], 1));
    assert_eq!(exchange.expire(NOW + Span::ms(10)), Some(0));
    assert_eq!(exchange.slot(0).state, SlotState::Answered);
    assert_eq!(reply_of(&exchange, 0), ([4, 0], 1));
}

#[test]
fn card_b_asks_nobody_by_position() {
    let mut exchange = exchange(true);
    let target = Target::Position(linesman_proto::address::Position(2));
    exchange.submit(queued(1, Request::read(target, RegisterAddress(0x0130), 2))).unwrap();
    let frames = transmit(&mut exchange);
    assert_eq!((frames[0].1[16], frames[1].1[16]), (1, 0), "APRD and NOP");
    exchange.receive(NOW, Path::B, &frames[1].1);
    let back = answered(&frames[0].1, [2, 0], 1);
    assert_eq!(exchange.receive(NOW, Path::A, &back), Received::Complete(0));
    assert_eq!(reply_of(&exchange, 0), ([2, 0], 1));
}

#[test]
fn in_a_broken_ring_each_card_has_positions_of_its_own() {
    let mut exchange = exchange(true);
    let first = linesman_proto::address::Position(0);
    for (ticket, target) in [(1, Target::Position(first)), (2, Target::PositionOnB(first))] {
        let request = Request::read(target, RegisterAddress(0x0130), 2);
        exchange.submit(queued(ticket, request)).unwrap();
    }
    let frames = transmit(&mut exchange);
    assert_eq!((frames[0].1[16], frames[0].1[30]), (1, 0));
    assert_eq!((frames[1].1[16], frames[1].1[30]), (0, 1));
    exchange.receive(NOW, Path::A, &answered(&frames[0].1, [2, 0], 1));
    let mut back = frames[1].1.clone();
    back[6] |= SOURCE_MARK;
    back[40..43].copy_from_slice(&[4, 0, 1]);
    assert_eq!(exchange.receive(NOW, Path::B, &back), Received::Complete(0));
    let reply = &exchange.slot(0).reply;
    assert_eq!((reply[26], reply[28], reply[40], reply[42]), (2, 1, 4, 1));
    assert_eq!(exchange.ring_intact(), Some(false));
}

/// Takes a cyclic frame the short way.
fn receive_usual(exchange: &mut Exchange, frames: &[Prebuilt], back: &[u8]) -> Option<u32> {
    let awaited = exchange.awaited(back)?;
    let prebuilt = frames.get(awaited.frame as usize)?;
    prebuilt.is_like(back, awaited.number, awaited.withheld).then(|| {
        exchange.answered(awaited.slot);
        awaited.frame
    })
}

/// An exchange with one cyclic frame on its way, and that frame, prebuilt and sent: an LRW and a
/// broadcast read.
fn with_cyclic(number: u32) -> (Exchange, Vec<Prebuilt>, Vec<u8>) {
    let mut exchange = exchange(false);
    exchange.number = number;
    let datagram = |command, address, len, role| DatagramPlan {
        command,
        address,
        len,
        role,
        sync_unit: None,
        ownership: Vec::new(),
    };
    let logical = DatagramAddress::Logical(LogicalAddress(0x1_0000));
    let status = DatagramAddress::Physical(0, RegisterAddress(0x0130));
    let mut datagrams = vec![
        datagram(Command::Lrw, logical, 12, Role::ProcessData),
        datagram(Command::Brd, status, 2, Role::Presence),
    ];
    datagrams[0].ownership.push(Ownership {
        device: DeviceId(0),
        direction: Direction::Outputs,
        range: 0..4,
        image_at: 0,
        masks: Ownership::WHOLE,
    });
    let mut frames = exchange.prebuild(std::iter::once(FramePlan::new(datagrams)));
    let order = Order { frame: 0, deadline: NOW + Span::ms(1), withheld: false };
    let number = exchange.begin_cyclic(order, &frames[0]);
    let mut sent = vec![0xEE; frames[0].len()];
    frames[0].write(number, &mut sent);
    sent[26..30].copy_from_slice(&[1, 2, 3, 4]);
    (exchange, frames, sent)
}

proptest! {
    /// What the short way takes the long way takes too, as the same; and what it does not take it
    /// leaves as it was.
    #[test]
    fn the_short_way_takes_only_what_the_long_way_takes(
        number: u32,
        changes in prop::collection::vec((0_usize..62, any::<u8>()), 0..3),
        marked in prop::bool::weighted(0.9),
        len in prop_oneof![3 => Just(60_usize), 1 => 0_usize..1_600],
    ) {
        let (mut short, frames, sent) = with_cyclic(number);
        let (mut long, ..) = with_cyclic(number);
        let mut back = sent;
        back[6] |= if marked { SOURCE_MARK } else { 0 };
        back.resize(len, 0);
        for (at, byte) in changes {
            if let Some(place) = back.get_mut(at) {
                *place = byte;
            }
        }
        let usual = receive_usual(&mut short, &frames, &back);
        let told = long.receive(NOW, Path::A, &back);
        let [at, ..] = number.to_le_bytes();
        if usual.is_some() {
            prop_assert_eq!((usual, told), (Some(0), Received::Complete(at)));
            prop_assert_eq!(short.slot(at).state, SlotState::Answered);
            prop_assert_eq!(short.earliest(), Instant::MAX);
            prop_assert_eq!(receive_usual(&mut short, &frames, &back), None, "once only");
            prop_assert_eq!(short.receive(NOW, Path::A, &back), Received::Duplicate);
        } else {
            prop_assert_eq!(short.slot(at).state, SlotState::Waiting);
            prop_assert_eq!(short.receive(NOW, Path::A, &back), told);
        }
    }
}

#[test]
fn an_answer_with_data_and_counters_goes_the_short_way() {
    let (mut exchange, frames, mut back) = with_cyclic(0x0305);
    back[6] |= SOURCE_MARK;
    back[32..40].copy_from_slice(&[0x55; 8]);
    // Logical data end at 38; position counters of broadcasts and the round-trip bit change too.
    back[42] = 7;
    assert_eq!(receive_usual(&mut exchange, &frames, &back), Some(0));
}

#[test]
fn long_outputs_are_left_to_who_fills_them_and_all_else_is_as_planned() {
    let datagram = |command, address, len, role, outputs: Vec<Ownership>| DatagramPlan {
        command,
        address,
        len,
        role,
        sync_unit: None,
        ownership: outputs,
    };
    let outputs = |range: std::ops::Range<usize>| Ownership {
        device: DeviceId(0),
        direction: Direction::Outputs,
        image_at: range.start,
        range,
        masks: Ownership::WHOLE,
    };
    let logical = |at| DatagramAddress::Logical(LogicalAddress(at));
    let status = DatagramAddress::Physical(0, RegisterAddress(0x0130));
    // Where long outputs begin the data, and where they do not; data behind them, and none.
    for (first, second) in [(0..200, 0..300), (40..240, 300..440), (0..440, 10..150)] {
        let (one, two) = (vec![outputs(first.clone())], vec![outputs(second.clone())]);
        let plan = FramePlan::new(vec![
            datagram(Command::Lrw, logical(0x1_0000), 440, Role::ProcessData, one),
            datagram(Command::Lrw, logical(0x2_0000), 440, Role::ProcessData, two),
            datagram(Command::Brd, status, 2, Role::Presence, Vec::new()),
        ]);
        let mut frame = Prebuilt::new(0, &plan, SOURCES[0], false);
        let at = prebuilt::data_offsets(&plan).collect::<Vec<_>>();
        for (number, withheld) in [(0x0201, false), (0x0403, true), (0x0605, false)] {
            let mut planned = vec![0; MAX_LEN];
            let mut builder = FrameBuilder::new(&mut planned, SOURCES[0]);
            for (place, one) in plan.datagrams.iter().enumerate() {
                let index = if place == 0 { number as u8 } else { (number >> 8) as u8 };
                let command = if withheld { prebuilt::withheld(one.command) } else { one.command };
                builder.push(command, index, one.address, one.len).unwrap();
            }
            let len = builder.finish();
            let mut sent = vec![0xEE; frame.len()];
            frame.withhold(withheld);
            frame.write(number, &mut sent);
            for (data, range) in at.iter().zip([&first, &second]) {
                sent[data + range.start..data + range.end].fill(0);
            }
            assert_eq!(sent, planned[..len]);
        }
    }
}
