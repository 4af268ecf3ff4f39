//! Junctions as branch points, the shapes a line can have, a load of 50 µs, a port that is opened by
//! order.

use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::port::Port;
use linesman_proto::time::{Instant, Span};
use linesman_sim::hardware::PortKind;

use super::rig::{Bench, answer, at, frame};

fn device(name: &str, kind: &str, on: &str) -> String {
    format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n")
}

/// Names in the order in which frames are processed.
fn order(bench: &mut Bench) -> Vec<String> {
    let count = bench.count().unwrap();
    for position in 0..count {
        let station = (0x1001 + position).to_le_bytes();
        let address = at(0u16.wrapping_sub(position), 0x0010);
        assert_eq!(bench.send(Command::Apwr, address, &station).unwrap().1, 1, "{position}");
    }
    let segment = &bench.segment;
    let mut stations: Vec<(u16, String)> = segment
        .devices()
        .map(|id| {
            let controller = segment.controller(id).unwrap();
            (controller.station_address().0, segment.name(id).to_owned())
        })
        .collect();
    stations.sort();
    stations.into_iter().map(|(_, name)| name).collect()
}

/// A junction: its type, whether it hangs on E-bus, its controllers with their implemented ports,
/// and in which order frames take what hangs on its outgoing ports.
type Shape = (&'static str, bool, &'static [&'static [Port]], &'static [(usize, Port)]);

const ABC: &[Port] = &[Port::A, Port::B, Port::C];
const ABCD: &[Port] = &[Port::A, Port::B, Port::C, Port::D];

const SHAPES: [Shape; 9] = [
    ("EK1100", false, &[ABC], &[(0, Port::B), (0, Port::C)]),
    ("EK1121-0010", true, &[&[Port::A, Port::C, Port::D]], &[(0, Port::D), (0, Port::C)]),
    ("EK1521", true, &[&[Port::A, Port::C, Port::D]], &[(0, Port::D), (0, Port::C)]),
    ("EK1561", true, &[&[Port::A, Port::C, Port::D]], &[(0, Port::D), (0, Port::C)]),
    ("EK1122", true, &[ABCD], &[(0, Port::D), (0, Port::B), (0, Port::C)]),
    ("EP1122-0001", false, &[ABCD], &[(0, Port::D), (0, Port::B), (0, Port::C)]),
    ("CU1123", false, &[ABC], &[(0, Port::B), (0, Port::C)]),
    ("CU1124", false, &[ABCD], &[(0, Port::D), (0, Port::B), (0, Port::C)]),
    (
        "CU1128",
        false,
        &[ABCD, ABCD, ABCD],
        // The next controller hangs on port C of the one before; eight ports are outside, A of the
        // first among them.
        &[
            (0, Port::D),
            (0, Port::B),
            (1, Port::D),
            (1, Port::B),
            (2, Port::D),
            (2, Port::B),
            (2, Port::C),
        ],
    ),
];

// proves: JCT-01, JCT-10
#[test]
fn junctions_branch_by_all_their_ports_and_in_the_order_of_ports() {
    for (kind, is_terminal, controllers, outgoing) in SHAPES {
        let mut text = device("K0", "EK1100", "maindevice");
        text += &device("J", kind, if is_terminal { "K0.B" } else { "K0.C" });
        let name = |controller: usize| match controller {
            0 => "J".to_owned(),
            _ => format!("J/{}", controller + 1),
        };
        let mut bench = Bench::new(&text);
        let before = bench.count().unwrap();
        assert_eq!(usize::from(before), 1 + controllers.len(), "{kind}");
        let mut expected = vec!["K0".to_owned()];
        for (number, ports) in controllers.iter().enumerate() {
            let id = bench.id(&name(number));
            let hardware = bench.segment.controller(id).unwrap().hardware();
            let there: Vec<Port> = Port::ALL
                .into_iter()
                .filter(|port| hardware.ports[*port] != PortKind::Absent)
                .collect();
            assert_eq!(there, *ports, "{kind}, controller {number}");
            let has_data =
                !bench.segment.inputs(id).is_empty() || !bench.segment.outputs(id).is_empty();
            assert!(!has_data, "{kind}: process data");
            expected.push(name(number));
            for (of, port) in outgoing.iter().filter(|(of, _)| *of == number) {
                let end = format!("{}.{port}", name(*of));
                let is_ebus = hardware.ports[*port] == PortKind::Ebus;
                let next = format!("N{number}{port}");
                text += &device(&next, if is_ebus { "EL1008" } else { "EK1100" }, &end);
                expected.push(next);
            }
        }
        let mut bench = Bench::new(&text);
        assert_eq!(order(&mut bench), expected, "{kind}");
        assert_eq!(bench.counters(), [""; 0], "{kind}");
        bench.assert_audit();
    }
}

// proves: JCT-02, JCT-03
#[test]
fn line_star_tree_and_ring_are_passed_by_all_and_processed_once() {
    let line = (1..6).fold(device("D0", "EK1100", "maindevice"), |text, number| {
        text + &device(&format!("D{number}"), "EK1100", &format!("D{}.C", number - 1))
    });
    let star = [("S1", "D"), ("S2", "B"), ("S3", "C")]
        .iter()
        .fold(device("J", "CU1124", "maindevice"), |text, (name, port)| {
            text + &device(name, "EK1100", &format!("J.{port}"))
        });
    let tree = star.clone()
        + &device("S1T1", "EL1008", "S1.B")
        + &device("S1K2", "EK1100", "S1.C")
        + &device("S3T1", "EL2008", "S3.B");
    let ring = format!("{line}[ring]\ncloses_at = \"D5.C\"\n");
    for (shape, text, expected) in [
        ("line", &line, "D0 D1 D2 D3 D4 D5"),
        ("star", &star, "J S1 S2 S3"),
        ("tree", &tree, "J S1 S1T1 S1K2 S2 S3 S3T1"),
        ("ring", &ring, "D0 D1 D2 D3 D4 D5"),
    ] {
        let mut bench = Bench::new(text);
        assert_eq!(order(&mut bench).join(" "), expected, "{shape}");
        // On the way back nobody processes: each adds one to the position and to the counter, once.
        let sent = frame(Command::Brd, at(0, 0x0130), &[0; 2]);
        let arrived = bench.send_by(Path::A, &sent);
        assert_eq!(arrived.len(), 1, "{shape}");
        let back = if shape == "ring" { Path::B } else { Path::A };
        assert_eq!(arrived[0].0.path, back, "{shape}");
        let count = expected.split(' ').count() as u16;
        assert_eq!(answer(&arrived[0].1).1, count, "{shape}");
        let position = u16::from_le_bytes([arrived[0].1[18], arrived[0].1[19]]);
        assert_eq!(position, count, "{shape}");
        bench.assert_audit();
    }
    // Whoever is last turns the frame: without the devices behind D2, D2 does.
    let mut bench = Bench::new(&line);
    bench.segment.unplug(bench.now, "D3").unwrap();
    bench.wait(Span::ms(100));
    assert_eq!(bench.count(), Some(3));
}

// proves: JCT-04
#[test]
fn twenty_thousand_cycles_a_second_and_acyclic_frames_beside_them() {
    let mut bench = Bench::plant();
    let cyclic = frame(Command::Brd, at(0, 0x0130), &[0; 40]);
    let acyclic = frame(Command::Fprd, at(0, 0x0110), &[0; 2]);
    let cycle = Span::us(50);
    let (mut cyclic_back, mut acyclic_back, mut slowest) = (0, 0, Span::ZERO);
    let mut sent = 0;
    for number in 0..20_000_u64 {
        let start = Instant::ZERO + Span::ns(number * cycle.as_nanos());
        bench.segment.handle_frame(start, Path::A, &cyclic);
        sent += 1;
        // 77 a second, in the gap behind the cyclic frame.
        if number % 260 == 0 {
            bench.segment.handle_frame(start + Span::us(20), Path::A, &acyclic);
            sent += 1;
        }
        for (arrival, bytes) in bench.wait(cycle) {
            assert!(arrival.intact);
            match answer(&bytes) {
                (data, 8) if data.len() == 40 => {
                    cyclic_back += 1;
                    let behind = arrival.at.as_nanos() % cycle.as_nanos();
                    slowest = slowest.max(Span::ns(behind));
                }
                (data, _) if data.len() == 2 => acyclic_back += 1,
                other => panic!("{other:?}"),
            }
        }
    }
    for (_, bytes) in bench.wait(Span::ms(1)) {
        let (data, _) = answer(&bytes);
        *(if data.len() == 40 { &mut cyclic_back } else { &mut acyclic_back }) += 1;
    }
    assert_eq!((cyclic_back, acyclic_back, sent), (20_000, 77, 20_077));
    assert!(slowest < cycle, "{slowest}: each is back before the next leaves");
    assert_eq!(bench.counters(), [""; 0]);
    bench.assert_audit();
}

/// In which order the ports of a terminal are used, whatever hangs on its exit, and that it turns frames when
/// nothing does.
fn passes_and_ends(terminal: &str, exit: Port) {
    let on = |what: &str| device("K", "EK1100", "maindevice") + &device("T", terminal, what);
    let next = if exit == Port::B { "EL1008" } else { "EK1100" };
    let mut bench = Bench::new(&(on("K.B") + &device("N", next, &format!("T.{exit}"))));
    assert_eq!(order(&mut bench), ["K", "T", "N"], "{terminal}");
    let mut last = Bench::new(&on("K.B"));
    assert_eq!(order(&mut last), ["K", "T"], "{terminal}");
    let at_t = last.segment.controller(last.id("T")).unwrap();
    let open: Vec<Port> = Port::ALL.into_iter().filter(|port| at_t.is_open(*port)).collect();
    assert_eq!(open, [Port::A], "{terminal} turns the frame");
}

// proves: JCT-09 partial: one with a single port is in files.rs
#[test]
fn terminals_take_frames_by_port_0_and_pass_them_on_by_1_or_3_or_turn_them() {
    passes_and_ends("EL2008", Port::B);
    passes_and_ends("EL3102", Port::B);
    passes_and_ends("EK1122", Port::D);
}

// proves: JCT-12 partial: as the controller does it
#[test]
fn a_port_that_closes_by_itself_opens_by_order_when_the_rest_is_ready() {
    let mut bench = Bench::plant();
    // K6: port C closes by itself when its link is lost, and opens when it is told to.
    let k6 = 0u16.wrapping_sub(5);
    let auto_close = |bench: &mut Bench| {
        assert_eq!(bench.send(Command::Apwr, at(k6, 0x0101), &[0b01 << 4]).unwrap().1, 1);
    };
    auto_close(&mut bench);
    let stands = |bench: &Bench| {
        let controller = bench.segment.controller(bench.id("K6")).unwrap();
        (controller.dl_status().port_state(Port::C).link, controller.is_open(Port::C))
    };
    assert_eq!((stands(&bench), bench.count()), ((true, true), Some(8)));
    bench.segment.unplug(bench.now, "K8").unwrap();
    bench.wait(Span::s(1));
    assert_eq!((stands(&bench), bench.count()), ((false, false), Some(7)));
    bench.segment.plug(bench.now, "K8", None).unwrap();
    bench.wait(Span::s(5));
    // The link is back and told of; no frame goes there before the MainDevice wants it.
    assert_eq!((stands(&bench), bench.count()), ((true, false), Some(7)));
    auto_close(&mut bench);
    bench.wait(Span::ms(1));
    assert_eq!((stands(&bench), bench.count()), ((true, true), Some(8)));
    bench.assert_audit();
}
