//! Capture probe on links: ports, times and errors of what passes it.

use linesman_config::fault::FaultName;
use linesman_proto::frame::FrameView;
use linesman_proto::time::Span;
use linesman_sim::segment::{ProbeFrame, ProbePlaceError};
use linesman_sim::segment_file::FaultEntry;

use super::rig::Bench;

/// The plant with channels of a probe at these plugs.
fn probed(places: &[&str]) -> Bench {
    let mut bench = Bench::plant();
    let places: Vec<String> = places.iter().map(|place| (*place).to_owned()).collect();
    bench.segment.loop_in_probe(&places).unwrap();
    bench
}

fn seen(bench: &mut Bench) -> Vec<(ProbeFrame, Vec<u8>)> {
    let mut bytes = Vec::new();
    std::iter::from_fn(|| {
        bench.segment.poll_probe_frame(&mut bytes).map(|seen| (seen, bytes.clone()))
    })
    .collect()
}

/// The port of each copy, with the damage that it shows: of the check sequence, and of an odd nibble.
fn marks(bench: &mut Bench) -> Vec<(u8, bool, bool)> {
    let record = |(seen, _): &(ProbeFrame, Vec<u8>)| seen.record;
    let records: Vec<_> = seen(bench).iter().map(record).collect();
    let mark = |record: &linesman_proto::esl::EslRecord| {
        (record.port.unwrap(), record.crc_error, record.alignment_error)
    };
    records.iter().map(mark).collect()
}

/// The marks of the first frame that is damaged anywhere.
fn first_damaged(bench: &mut Bench) -> Vec<(u8, bool, bool)> {
    let is_damaged = |marks: &Vec<(u8, bool, bool)>| marks.iter().any(|mark| mark.1);
    let mut frames = (0..2_000).map(|_| {
        let _ = bench.count();
        marks(bench)
    });
    frames.find(is_damaged).unwrap()
}

// proves: WS-02
#[test]
fn frame_comes_to_each_channel_out_and_back_as_it_is_there() {
    let mut bench = probed(&["maindevice", "K6.A"]);
    assert_eq!(bench.count(), Some(8));
    let copies = seen(&mut bench);
    let ports: Vec<u8> = copies.iter().filter_map(|(seen, _)| seen.record.port).collect();
    assert_eq!(ports, [0, 2, 3, 1]);
    // K1 and its four terminals have counted up the address when the frame comes to K6.
    let before = |bytes: &Vec<u8>| {
        let view = FrameView::parse(bytes).unwrap();
        let datagram = view.datagrams().next().unwrap().unwrap();
        (datagram.logical().0 as u16, datagram.wkc().0)
    };
    let all: Vec<_> = copies.iter().map(|(_, bytes)| before(bytes)).collect();
    assert_eq!(all, [(0, 0), (5, 5), (8, 8), (8, 8)]);
    for (seen, _) in &copies {
        let late = seen.record.time_ns - seen.at.as_nanos();
        assert!(late <= 40, "{late} ns");
    }
    assert!(copies.windows(2).all(|pair| pair[0].0.at < pair[1].0.at));
}

// proves: WS-02
#[test]
fn damage_of_the_cable_is_seen_behind_it_and_marked_after_a_controller() {
    let mut bench = probed(&["K1.C", "T2.A", "maindevice"]);
    let _ = marks(&mut bench);
    bench.inject(
        &FaultEntry::new(FaultName::CableDegraded).at("K1.C>K6.A").with("hits_per_s", 2_000.0),
    );
    bench.wait(Span::ms(1));
    let seen = first_damaged(&mut bench);
    assert_eq!(seen[0], (4, false, false));
    assert!(seen.contains(&(0, false, false)), "before the cable: {seen:?}");
    assert!(seen.contains(&(1, true, true)), "on its way back, found bad by K6: {seen:?}");
    assert!(seen.contains(&(5, true, true)), "{seen:?}");
}

// proves: WS-02
#[test]
fn damage_before_any_controller_has_found_it_carries_no_odd_nibble() {
    let mut bench = probed(&["K6.A"]);
    bench.inject(
        &FaultEntry::new(FaultName::CableDegraded).at("K1.C>K6.A").with("hits_per_s", 2_000.0),
    );
    bench.wait(Span::ms(1));
    assert_eq!(first_damaged(&mut bench), [(0, true, false), (1, true, true)]);
}

#[test]
fn receiver_behind_the_probe_damages_what_it_does_not_see() {
    let mut bench = probed(&["K6.A"]);
    bench.inject(
        &FaultEntry::new(FaultName::ReceiverDamaged).at("K1.C>K6.A").with("hits_per_s", 2_000.0),
    );
    bench.wait(Span::ms(1));
    assert_eq!(first_damaged(&mut bench), [(0, false, false), (1, true, true)]);
}

#[test]
fn probe_is_refused_where_no_link_is_and_twice_on_one() {
    let mut bench = Bench::plant();
    let mut loop_in = |place: &str| bench.segment.loop_in_probe(&[place.to_owned()]);
    assert_eq!(loop_in("K8.C"), Err(ProbePlaceError::NoLink("K8.C".to_owned())));
    assert_eq!(loop_in("X1.A"), Err(ProbePlaceError::NoLink("X1.A".to_owned())));
    assert_eq!(loop_in("maindevice-K1.A"), Ok(()));
    assert_eq!(loop_in("K1.A"), Err(ProbePlaceError::Taken("K1.A".to_owned())));
}

#[test]
fn same_seed_gives_the_same_recording() {
    let play = || {
        let mut bench = probed(&["K1.A", "T4.A"]);
        bench.inject(
            &FaultEntry::new(FaultName::EmcNoise).at("T3.B>T4.A").with("hits_per_s", 4_000.0),
        );
        for _ in 0..50 {
            let _ = bench.count();
        }
        seen(&mut bench)
    };
    let (one, other) = (play(), play());
    assert_eq!(one, other);
    assert!(one.iter().any(|(seen, _)| seen.record.crc_error));
}
