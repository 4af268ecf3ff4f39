//! Properties for any input: no panic, no change of length, the same bytes again, and no
//! allocation.

use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::FrameView;
use linesman_proto::port::Port;
use linesman_proto::register::{FmmuConfig, SmControl};
use linesman_proto::time::Span;
use proptest::prelude::*;

use super::rig::{self, Bench, STATION, at, frame, logical};
use crate::controller::{CountKind, Forwarding, PortEvent};
use crate::device::{DigitalArea, Emulated, SignalId};
use crate::frame::{Damage, WireFrame};

/// A command, an address, data: most of them aimed at something.
#[derive(Clone, Debug)]
struct Shot {
    code: u8,
    adp: u16,
    ado: u16,
    data: Vec<u8>,
}

/// A frame with its damage, and how long after the one before.
#[derive(Clone, Debug)]
struct Round {
    shots: Vec<Shot>,
    damage: Damage,
    cut: Option<usize>,
    gap: u64,
    port_event: Option<(u8, u8)>,
}

fn any_shot() -> impl Strategy<Value = Shot> {
    let ado = prop_oneof![
        0u16..0x1000,
        Just(0x0100),
        Just(0x0120),
        Just(0x0502),
        (0u16..0x80).prop_map(|offset| 0x0600 + offset),
        (0u16..0x40).prop_map(|offset| 0x0800 + offset),
        Just(0x0900),
        Just(0x0910),
        (0u16..0x20).prop_map(|offset| 0x0F00 + offset),
        0x1000u16..0x1040,
        any::<u16>(),
    ];
    let adp = prop_oneof![Just(0), Just(STATION), any::<u16>()];
    let data = prop::collection::vec(any::<u8>(), 0..48);
    (prop_oneof![0u8..15, any::<u8>()], adp, ado, data).prop_map(|(code, adp, ado, data)| Shot {
        code,
        adp,
        ado,
        data,
    })
}

fn any_round() -> impl Strategy<Value = Round> {
    let damage = prop_oneof![
        8 => Just((false, false)),
        1 => Just((true, false)),
        1 => Just((true, true)),
    ];
    let shots = prop::collection::vec(any_shot(), 1..6);
    let cut = prop::option::weighted(0.1, 0usize..200);
    let port_event = prop::option::weighted(0.3, (0u8..4, 0u8..7));
    (shots, damage, cut, 1_000u64..3_000_000, port_event).prop_map(
        |(shots, (fcs_bad, marked), cut, gap, port_event)| Round {
            shots,
            damage: Damage { fcs_bad, marked, cut_off: cut.is_some() },
            cut,
            gap,
            port_event,
        },
    )
}

fn build(round: &Round) -> WireFrame {
    let datagrams: Vec<_> = round
        .shots
        .iter()
        .map(|shot| (Command::Nop, at(shot.adp, shot.ado), shot.data.as_slice()))
        .collect();
    let mut frame = frame(&datagrams);
    let offsets: Vec<usize> = FrameView::parse(&frame.bytes)
        .unwrap()
        .datagrams()
        .map(|datagram| datagram.unwrap().offset())
        .collect();
    for (offset, shot) in offsets.into_iter().zip(&round.shots) {
        frame.bytes[offset] = shot.code;
    }
    frame.damage = round.damage;
    if let Some(cut) = round.cut {
        frame.bytes.truncate(cut.min(frame.bytes.len()));
    }
    frame
}

fn event((port, kind): (u8, u8)) -> PortEvent {
    let port = Port::from_index(usize::from(port)).unwrap();
    let count = |kind| PortEvent::Count { port, kind };
    match kind {
        0 => PortEvent::Link { port, up: true },
        1 => PortEvent::Link { port, up: false },
        2 => count(CountKind::SymbolError),
        3 => count(CountKind::InvalidFrame),
        4 => count(CountKind::ForwardedError),
        5 => count(CountKind::ProcessingUnitError),
        _ => count(CountKind::LostLink),
    }
}

fn emulated() -> Box<Emulated> {
    let area = |sync_manager, at, first: u32, count: u32| DigitalArea {
        sync_manager,
        at: RegisterAddress(at),
        signals: (first..first + count).map(SignalId).collect(),
    };
    Box::new(Emulated::new(vec![area(0, 0x0F00, 0, 8)], vec![area(1, 0x1000, 8, 12)]))
}

/// All that came of a run: frames, memory, time of the next event.
fn run(rounds: &[Round], polls: u64) -> (Vec<WireFrame>, Vec<u8>, String) {
    let mut bench = Bench::with(rig::hardware(), rig::sii(true), emulated());
    let mut frames = Vec::new();
    for round in rounds {
        let mut frame = build(round);
        if let Some(port_event) = round.port_event {
            bench.controller.post(bench.now + Span::us(7), event(port_event));
        }
        let len = frame.bytes.len();
        let verdict = bench.pass(&mut frame);
        assert!(verdict == Forwarding::Forward || verdict == Forwarding::Destroy);
        assert_eq!(frame.bytes.len(), len);
        for _ in 0..polls {
            bench.wait(Span::ns(round.gap / polls));
        }
        bench.wait(Span::ns(round.gap % polls));
        frames.push(frame);
    }
    let memory = (0..0x1100).map(|a| bench.controller.register(RegisterAddress(a))).collect();
    (frames, memory, format!("{:?} {:?}", bench.controller.next_event(), bench.signals))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn any_frames_at_any_time(rounds in prop::collection::vec(any_round(), 1..40)) {
        let once = run(&rounds, 1);
        let again = run(&rounds, 1);
        prop_assert_eq!(&once.1, &again.1);
        for (one, other) in once.0.iter().zip(&again.0) {
            prop_assert_eq!(&one.bytes, &other.bytes);
            prop_assert_eq!(one.damage, other.damage);
        }
        // However often time is told, the same happens.
        let slowly = run(&rounds, 13);
        prop_assert_eq!(&once.1, &slowly.1);
        prop_assert_eq!(&once.2, &slowly.2);
    }
}

/// After the first frames, a running controller allocates nothing.
#[test]
fn frames_cost_no_memory() {
    let mut bench = Bench::with(rig::hardware(), rig::sii(true), emulated());
    bench.link(Port::A, true);
    bench.guard(0, 0x0F00, 1, SmControl::OUTPUTS_WITHOUT_EVENT);
    bench.guard(1, 0x1000, 2, SmControl::INPUTS_WITHOUT_EVENT);
    let outputs = FmmuConfig::outputs(LogicalAddress(0x300), 1, RegisterAddress(0x0F00));
    let inputs = FmmuConfig::inputs(LogicalAddress(0x100), 2, RegisterAddress(0x1000));
    bench.map(0, &outputs);
    bench.map(1, &inputs);
    // One that shares logical bytes with the inputs, and one that maps bits.
    bench.map(2, &FmmuConfig::outputs(LogicalAddress(0x101), 2, RegisterAddress(0x1400)));
    bench.map(3, &FmmuConfig::mailbox_full(LogicalAddress(0x310), 2, 1).unwrap());
    bench.write(0x0120, &[8, 0]);
    let mut probe = frame(&[
        (Command::Lrw, logical(0), &[0xFF; 1_000]),
        (Command::Frmw, at(0x2222, 0x0910), &[0; 8]),
        (Command::Brd, at(0, 0x0130), &[0; 2]),
        (Command::Fprd, at(STATION, 0x0300), &[0; 8]),
        (Command::Bwr, at(0, 0x0300), &[0; 8]),
    ]);
    for _ in 0..3 {
        let _ = bench.pass(&mut probe);
    }
    let measured = allocation_counter::measure(|| {
        for _ in 0..100 {
            let _ = bench.pass(&mut probe);
        }
    });
    assert_eq!(measured.count_total, 0);
    assert!(bench.signals.is_high(SignalId(0)), "and it did something");
}
