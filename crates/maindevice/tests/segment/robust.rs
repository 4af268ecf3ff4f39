//! Hostile frames, two networks, the same run twice, and no allocation in the cycle.

use crate::bench::{Bench, Fate};
use linesman_maindevice::{MainDevice, Options};
use linesman_proto::address::{Network, Path};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::Seed;
use proptest::prelude::*;

const SMALL: &str = r#"
name = "small"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T1"
type = "EL1008"
on = "K1.B"
[[device]]
name = "T2"
type = "EL2008"
on = "T1.B"
"#;

const SMART: &str = r#"
name = "smart"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "A1"
type = "EL3102"
on = "K1.B"
[[device]]
name = "M1"
type = "EL7041"
on = "A1.B"
"#;

/// A MainDevice in the middle of a scan, and the frames it has sent.
fn scanning() -> (MainDevice, Vec<Vec<u8>>) {
    let mut device = MainDevice::new(Network(0), Options::default());
    device.scan(Instant::ZERO);
    (device, Vec::new())
}

fn fetch(device: &mut MainDevice, now: Instant, sent: &mut Vec<Vec<u8>>) {
    let mut buffer = vec![0; 1514];
    while let Some(transmit) = device.poll_transmit(now, &mut buffer) {
        sent.push(buffer[..transmit.len].to_vec());
    }
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic(frames in prop::collection::vec(
        prop::collection::vec(any::<u8>(), 0..200), 1..40)) {
        let (mut device, mut sent) = scanning();
        for (at, frame) in (1..).zip(&frames) {
            let now = Instant::from_nanos(at * 1_000_000);
            device.handle_frame(now, Path::A, frame);
            fetch(&mut device, now, &mut sent);
        }
    }

    /// Its own frames come back with bytes changed at will: answers that lie.
    #[test]
    fn lying_answers_do_not_make_it_panic(
        changes in prop::collection::vec((16usize..200, any::<u8>()), 0..60),
        cuts in prop::collection::vec(14usize..1514, 1..30),
    ) {
        let (mut device, mut sent) = scanning();
        let mut changes = changes.iter().cycle();
        for (step, cut) in (1u64..).zip(&cuts) {
            let now = Instant::from_nanos(step * 20_000);
            fetch(&mut device, now, &mut sent);
            let Some(frame) = sent.pop() else {
                device.handle_timeout(now + Span::ms(20));
                continue;
            };
            let mut frame = frame;
            frame[6] |= 0x02;
            let len = frame.len();
            if let Some((at, byte)) = changes.next() {
                if let Some(slot) = frame.get_mut(at % len.max(1)) {
                    *slot = *byte;
                }
                // A working counter of some number, wherever the first datagram ends.
                let end = len.min(28);
                frame[end - 2] = byte % 9;
            }
            frame.truncate((*cut).max(20));
            device.handle_frame(now, Path::A, &frame);
            while device.poll_event().is_some() {}
        }
    }
}

/// A running plant whose answers lie every now and then, in whatever place: nothing panics, and when
/// they tell the truth again all is well.
#[test]
fn a_running_plant_survives_lying_answers() {
    for seed in 0..4 {
        let mut bench = Bench::new(SMART);
        bench.start(AlState::Op);
        let mut stream = Seed(seed).stream("lies");
        bench.tamper = Some(Box::new(move |_| {
            if !stream.chance(0.1) {
                return Fate::Arrives;
            }
            // Most lies are in the first datagrams, where they hit something.
            let at = stream.between(14, 120) as usize;
            Fate::Garbled { at, byte: stream.between(0, 255) as u8 }
        }));
        for _ in 0..20 {
            let id = bench.id("M1");
            bench.device.sdo_upload(bench.now, id, ObjectAddress::new(0x1008, 0), false);
            bench.run_for(Span::ms(100));
        }
        bench.tamper = None;
        let until = bench.now + Span::s(60);
        while !bench.device.is_settled() && bench.now < until {
            bench.run_for(Span::ms(100));
        }
        assert!(
            bench.device.is_settled(),
            "seed {seed}: {:#?}",
            bench.events.split_off(bench.events.len().saturating_sub(30))
        );
        for name in ["K1", "A1", "M1"] {
            assert_eq!(bench.state(name), "OP", "seed {seed}, {name}");
        }
    }
}

#[test]
fn two_networks_in_one_process_do_not_meet() {
    let (mut first, mut second) = (Bench::new(SMALL), Bench::new(SMALL));
    first.start(AlState::Op);
    second.start(AlState::PreOp);
    first.run_for(Span::ms(50));
    second.run_for(Span::ms(50));
    assert_eq!((first.state("T2"), second.state("T2")), ("OP".to_owned(), "PREOP".to_owned()));
}

#[test]
fn the_same_run_twice_is_the_same() {
    let run = || {
        let mut bench = Bench::new(SMALL);
        bench.start(AlState::Op);
        bench.run_for(Span::ms(100));
        (format!("{:?}", bench.events), bench.device.statistics())
    };
    assert_eq!(run(), run());
}

/// Not a single allocation in any of 2,000 cycles after the start, with all that a running MainDevice
/// does beside them: states, links and error counters of each SubDevice are read ten times a second,
/// and mailboxes looked into. Lists take the size they need in the first second.
#[test]
fn the_cycle_allocates_nothing() {
    let mut bench = Bench::new(SMART);
    bench.start(AlState::Op);
    bench.run_for(Span::s(1));
    let before = bench.device.statistics();
    let mut buffer = vec![0; 1514];
    let mut arrival = Vec::with_capacity(2048);
    let (mut allocations, mut first) = (0, None);
    let until = before.cycles + 2_000;
    while bench.device.statistics().cycles < until {
        let due = [bench.device.poll_timeout(), bench.segment.poll_timeout()];
        bench.now = bench.now.max(due.into_iter().flatten().min().unwrap());
        let now = bench.now;
        let mut count = |work: &mut dyn FnMut()| {
            let counted = allocation_counter::measure(work).count_total;
            allocations += counted;
            if counted > 0 {
                first.get_or_insert((now, counted));
            }
        };
        bench.segment.advance(now);
        while bench.segment.poll_arrival(&mut arrival).is_some() {
            count(&mut || bench.device.handle_frame(now, Path::A, &arrival));
        }
        count(&mut || bench.device.handle_timeout(now));
        count(&mut || bench.device.outputs_mut().fill(1));
        loop {
            let mut transmit = None;
            count(&mut || transmit = bench.device.poll_transmit(now, &mut buffer));
            let Some(transmit) = transmit else { break };
            bench.segment.handle_frame(transmit.at, transmit.path, &buffer[..transmit.len]);
        }
        count(&mut || assert!(bench.device.poll_event().is_none(), "nothing happens"));
    }
    let after = bench.device.statistics();
    let beside = after.frames_sent - after.cyclic_sent - (before.frames_sent - before.cyclic_sent);
    assert!(beside >= 20, "{beside} frames beside the cycle");
    assert_eq!(allocations, 0, "the first at {first:?} of {:?}", bench.now);
}
