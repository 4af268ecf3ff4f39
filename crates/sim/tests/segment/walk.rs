//! Behaviour of a healthy line.

use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::port::Port;
use linesman_proto::time::{Instant, Span};

use super::rig::{Bench, PLANT, at, frame};

#[test]
fn a_broadcast_counts_every_controller_once() {
    let mut bench = Bench::plant();
    assert_eq!(bench.count(), Some(8));
    assert_eq!(bench.counters(), [""; 0]);
    bench.assert_audit();
    assert_eq!(bench.segment.truth().entries(), []);
    let host = bench.segment.host(Path::A);
    assert!(host.carrier && host.tx_frames == 1 && host.rx_frames == 1 && host.rx_crc_errors == 0);
}

// proves: ESC-09 partial, JCT-03 partial
#[test]
fn positions_are_in_the_order_of_the_ports() {
    // Terminals on port B of a coupler come before what hangs on its port C.
    let mut bench = Bench::plant();
    let order = ["K1", "T2", "T3", "T4", "T5", "K6", "T7", "K8"];
    for (position, name) in order.iter().enumerate() {
        let adp = 0u16.wrapping_sub(position as u16);
        let station = 0x1000 + position as u16;
        let written = bench.send(Command::Apwr, at(adp, 0x0010), &station.to_le_bytes());
        assert_eq!(written.unwrap().1, 1);
        let controller = bench.segment.controller(bench.id(name)).unwrap();
        assert_eq!(controller.station_address().0, station, "{name}");
    }
    let read = bench.send(Command::Fprd, at(0x1005, 0x0110), &[0; 2]).unwrap();
    assert_eq!(read.1, 1);
    // K6: ports A, B and C in use: link, open, communication (S2 2.3.3).
    assert_eq!(read.0[0] & 0xF0, 0b0111_0000);
}

#[test]
fn short_frames_are_padded_and_long_ones_not_sent() {
    let mut bench = Bench::plant();
    // Ethernet header, EtherCAT header, one datagram of a byte: the rest is padding.
    let short = frame(Command::Brd, at(0, 0), &[0])[..14 + 2 + 13].to_vec();
    let arrived = bench.send_by(Path::A, &short);
    assert_eq!(arrived[0].1.len(), 60);
    assert_eq!(bench.send_by(Path::A, &[0; 1_515]), []);
    assert_eq!(bench.segment.host(Path::A).tx_dropped, 1);
}

// proves: ESC-08 partial
#[test]
fn a_frame_takes_its_time() {
    // One coupler alone, 10 m away. On the way out and back: card and port of the coupler (half of
    // 400 ns each and half of the coupler's crossing), 50 ns of cable, and the processing unit.
    let text =
        "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\ncable_m = 10.0\n";
    let mut bench = Bench::new(text);
    let timing = bench.segment.controller(bench.id("K1")).unwrap().hardware().timing;
    let arrived = bench.send_by(Path::A, &frame(Command::Brd, at(0, 0), &[0]));
    let crossing = (400 + timing.mii_crossing.as_nanos()) / 2 + 50;
    let on_wire = 72 * 80;
    let expected = 2 * crossing + timing.process.as_nanos() + on_wire;
    assert_eq!(arrived[0].0.at.as_nanos(), expected);
}

#[test]
fn frames_arrive_when_their_time_has_come() {
    let mut bench = Bench::plant();
    let mut buffer = Vec::new();
    bench.segment.handle_frame(Instant::ZERO, Path::A, &frame(Command::Brd, at(0, 0), &[0]));
    assert_eq!(bench.segment.poll_arrival(&mut buffer), None, "it is on its way");
    let due = bench.segment.poll_timeout().unwrap();
    bench.segment.advance(due - Span::ns(1));
    assert_eq!(bench.segment.poll_arrival(&mut buffer), None);
    bench.segment.advance(due);
    let arrival = bench.segment.poll_arrival(&mut buffer).unwrap();
    assert_eq!((arrival.at, arrival.path, arrival.intact), (due, Path::A, true));
    assert_eq!(bench.segment.poll_timeout(), None);
}

#[test]
fn many_frames_in_flight_do_not_disturb_each_other() {
    let mut bench = Bench::plant();
    let one = frame(Command::Brd, at(0, 0), &[0]);
    // A frame of 60 bytes holds the wire for 6.72 µs; the way through the plant takes longer.
    for number in 0..20 {
        bench.segment.handle_frame(Instant::from_nanos(number * 6_720), Path::A, &one);
    }
    let arrived = bench.wait(Span::ms(1));
    assert_eq!(arrived.len(), 20);
    let times: Vec<u64> = arrived.iter().map(|(arrival, _)| arrival.at.as_nanos()).collect();
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] == 6_720), "{times:?}");
    assert!(arrived.iter().all(|(_, bytes)| super::rig::answer(bytes).1 == 8));
}

// proves: RED-03 partial, RED-05 partial, JCT-02 partial
#[test]
fn a_ring_gives_each_cards_frame_to_the_other() {
    let mut bench = Bench::new(&format!("{PLANT}\n[ring]\ncloses_at = \"K8.C\"\n"));
    let probe = frame(Command::Brd, at(0, 0), &[0]);
    let arrived = bench.send_by(Path::A, &probe);
    assert_eq!(arrived.len(), 1);
    assert_eq!(arrived[0].0.path, Path::B);
    assert_eq!(super::rig::answer(&arrived[0].1).1, 8, "processed by all");
    let arrived = bench.send_by(Path::B, &probe);
    assert_eq!(arrived[0].0.path, Path::A);
    assert_eq!(arrived[0].1[..], [&probe[..], &[0; 60][probe.len()..]].concat()[..], "by none");
    assert_eq!(bench.counters(), [""; 0]);
}

#[test]
fn the_same_calls_give_the_same_bytes() {
    let text = format!(
        "{PLANT}\n[[fault]]\nkind = \"emc-noise\"\nat = [\"K1.C-K6.A\", \"K6.C-K8.A\"]\nhits_per_s = 20000.0\n"
    );
    let run = |seed: u64| {
        let mut bench = Bench::new(&text.replace("seed = 7", &format!("seed = {seed}")));
        let mut all = Vec::new();
        for _ in 0..200 {
            all.push(bench.send_by(Path::A, &frame(Command::Brd, at(0, 0x0300), &[0; 20])));
        }
        (all, bench.counters(), bench.segment.truth().entries().to_vec())
    };
    let first = run(7);
    assert_eq!(first, run(7));
    assert_ne!(first.0, run(8).0);
    assert!(first.0.iter().flatten().any(|(arrival, _)| !arrival.intact));
}

// proves: ESC-11 partial, JCT-10 partial
#[test]
fn a_large_junction_is_three_controllers() {
    let text = r#"
[[device]]
name = "J1"
type = "CU1128"
on = "maindevice"

[[device]]
name = "K4"
type = "EK1100"
on = "J1/3.B"
"#;
    let mut bench = Bench::new(text);
    assert_eq!(bench.count(), Some(4));
    assert_eq!(bench.segment.name(bench.id("J1/2")), "J1/2");
    let status = bench.segment.controller(bench.id("J1/3")).unwrap().dl_status();
    assert_eq!(status.active_ports().collect::<Vec<_>>(), [Port::A, Port::B]);
}
