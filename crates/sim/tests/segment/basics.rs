//! Basics of a line: ports, loops, the place of the processing unit, addresses, working counters;
//! with frames from outside, as a MainDevice sees it.

use std::fmt::Write as _;

use linesman_proto::address::{LogicalAddress, Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::FrameView;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::port::Port;
use linesman_proto::register::{DlControl, DlStatus, EscInformation, FmmuConfig, LoopMode};
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

use super::rig::{Bench, answer, at, frame};
use linesman_config::fault::FaultName;

/// User RAM, which nothing guards.
const RAM: u16 = 0x0F80;

fn device(name: &str, kind: &str, on: &str, more: &str) -> String {
    format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n{more}\n")
}

/// A coupler and so many terminals in a row, without the coupler if there are none.
fn row(terminals: usize) -> Bench {
    let mut text = device("K0", "EK1100", "maindevice", "");
    for number in 1..=terminals {
        let on = format!("{}{}.B", if number == 1 { "K" } else { "T" }, number - 1);
        text += &device(&format!("T{number}"), "EL2008", &on, "");
    }
    Bench::new(&text)
}

/// Gives every controller the station address 0x1000 and its place.
fn addressed(mut bench: Bench) -> Bench {
    for position in 0..bench.count().unwrap() {
        let station = (0x1000 + position).to_le_bytes();
        let place = at(0u16.wrapping_sub(position), 0x0010);
        assert_eq!(bench.send(Command::Apwr, place, &station).unwrap().1, 1);
    }
    bench
}

/// The station address of a device, by name.
fn station(bench: &Bench, name: &str) -> u16 {
    bench.segment.controller(bench.id(name)).unwrap().station_address().0
}

fn set_loop(bench: &mut Bench, name: &str, ports: &[Port], mode: LoopMode) {
    let address = at(station(bench, name), 0x0100);
    let read = bench.send(Command::Fprd, address, &[0; 4]).unwrap().0;
    let mut control = DlControl(u32::from_le_bytes(read.try_into().unwrap()));
    for port in ports {
        control = control.with_loop_mode(*port, mode);
    }
    assert!(
        bench.send(Command::Fpwr, address, &control.to_bytes()).is_none_or(|(_, wkc)| wkc == 1)
    );
    bench.wait(Span::ms(1));
}

/// Names in the order in which frames are processed.
fn order(bench: &Bench) -> Vec<&str> {
    let mut all: Vec<_> = bench.segment.devices().map(|id| bench.segment.name(id)).collect();
    all.sort_by_key(|name| station(bench, name));
    all
}

// S0 L44-49: two to four ports, and A is the one that leads to the MainDevice.
// proves: ESC-02
#[test]
fn controllers_have_two_to_four_ports_and_are_entered_by_port_a() {
    let text = device("C", "CU1124", "maindevice", "")
        + &device("K", "EK1100", "C.B", "")
        + &device("T", "EL1008", "K.B", "");
    let mut bench = addressed(Bench::new(&text));
    for (name, letters) in [("C", "ABCD"), ("K", "ABC"), ("T", "AB")] {
        let address = station(&bench, name);
        let bytes = bench.send(Command::Fprd, at(address, 0x0000), &[0; EscInformation::LEN]);
        let information = EscInformation::from_bytes(bytes.unwrap().0.try_into().unwrap());
        let ports: String = information.ports.implemented().map(|port| port.letter()).collect();
        assert_eq!(ports, letters, "{name}");
        let status = bench.send(Command::Fprd, at(address, 0x0110), &[0; 2]).unwrap().0;
        let status = DlStatus(u16::from_le_bytes(status.try_into().unwrap()));
        assert!(status.port_state(Port::A).is_active(), "{name}");
        for port in Port::ALL.into_iter().filter(|port| !letters.contains(port.letter())) {
            assert!(!status.port_state(port).link, "{name} has no port {port}");
        }
    }
}

// S0 L83-99, S4 L17-36: terminals have two ports, couplers three, a junction for terminals four; a large junction
// is three controllers with eight sockets.
// proves: ESC-11
#[test]
fn known_devices_have_their_shape() {
    let ports = |bench: &mut Bench, place: u16| {
        let read = |bench: &mut Bench, ado: u16, len: usize| {
            bench.send(Command::Fprd, at(0x1000 + place, ado), &vec![0; len]).unwrap().0
        };
        let bytes: [u8; EscInformation::LEN] =
            read(bench, 0x0000, EscInformation::LEN).try_into().unwrap();
        let status = DlStatus(u16::from_le_bytes(read(bench, 0x0110, 2).try_into().unwrap()));
        let implemented: Vec<Port> =
            EscInformation::from_bytes(bytes).ports.implemented().collect();
        (implemented.len(), status.active_ports().count())
    };
    for (kind, expected) in
        [("EL1008", 2), ("EL2008", 2), ("EL3104", 2), ("EL6601", 2), ("EL7041", 2), ("EK1122", 4)]
    {
        let text = device("K", "EK1100", "maindevice", "") + &device("X", kind, "K.B", "");
        let mut bench = addressed(Bench::new(&text));
        assert_eq!(ports(&mut bench, 0).0, 3, "a coupler");
        assert_eq!(ports(&mut bench, 1).0, expected, "{kind}");
    }
    let mut bench = addressed(Bench::new(&device("K", "EK1101", "maindevice", "")));
    assert_eq!(ports(&mut bench, 0), (3, 1));
    let mut bench = addressed(Bench::new(&device("J", "CU1128", "maindevice", "")));
    assert_eq!(bench.count(), Some(3));
    let (all, active) = (0..3).fold((0, 0), |(all, active), place| {
        let (ports, open) = ports(&mut bench, place);
        (all + ports, active + open)
    });
    // Of those with somebody at the other end all but the one to the MainDevice are inside the housing.
    assert_eq!((all, all - (active - 1)), (12, 8));
}

// S0 L49: when every other port is closed, even A itself, frames go out by A.
// proves: ESC-03
#[test]
fn with_all_ports_closed_frames_still_go_back_by_port_a() {
    for closed in [&[Port::B, Port::C, Port::D][..], &Port::ALL] {
        let mut bench = addressed(Bench::plant());
        set_loop(&mut bench, "T3", closed, LoopMode::Closed);
        // K1, T2, T3; what is behind T3 is cut off, and behind T2 comes the other branch of K1.
        let (_, wkc) = bench.broadcast(0x0000, 1).unwrap();
        assert_eq!(wkc, 6, "K1 to T3, and K6 to K8");
        assert_eq!(
            bench.send(Command::Fprd, at(station(&bench, "T3"), 0x0000), &[0]).unwrap().1,
            1
        );
        assert_eq!(
            bench.send(Command::Fprd, at(station(&bench, "T4"), 0x0000), &[0]).unwrap().1,
            0
        );
    }
    // The first of all: everything is cut off, and the frame is back all the same.
    let mut bench = addressed(Bench::plant());
    set_loop(&mut bench, "K1", &Port::ALL, LoopMode::Closed);
    assert_eq!(bench.count(), Some(1));
}

// S0 L53-56: an open port sends the frame out and takes it back there; a closed one hands it to the next port
// inside.
// proves: ESC-04
#[test]
fn an_open_port_sends_the_frame_out_and_a_closed_one_hands_it_on_inside() {
    let mut bench = addressed(Bench::plant());
    let before = bench.now;
    let whole = bench.send_by(Path::A, &frame(Command::Brd, at(0, 0), &[0]));
    assert_eq!(answer(&whole[0].1).1, 8);
    set_loop(&mut bench, "K1", &[Port::C], LoopMode::Closed);
    let sent = bench.now;
    let short = bench.send_by(Path::A, &frame(Command::Brd, at(0, 0), &[0]));
    assert_eq!(answer(&short[0].1).1, 5, "the branch at port C is passed by");
    let took = [whole[0].0.at.since(before), short[0].0.at.since(sent)];
    assert!(took[1] < took[0], "and the way is shorter: {took:?}");
    // With C closed, what is at B is still reached; then the other way round.
    set_loop(&mut bench, "K1", &[Port::C], LoopMode::Auto);
    assert_eq!(bench.count(), Some(8));
    set_loop(&mut bench, "K1", &[Port::B], LoopMode::Closed);
    assert_eq!(bench.count(), Some(4));
    // Both closed: the coupler alone.
    set_loop(&mut bench, "K1", &[Port::B, Port::C], LoopMode::Closed);
    assert_eq!(bench.count(), Some(1));
}

// S0 L59, S4 L50.
// proves: ESC-06
#[test]
fn ports_are_forced_open_or_closed_or_wait_for_the_main_device_before_they_reopen() {
    let cut = |bench: &mut Bench| {
        let fault = bench.inject(&FaultEntry::new(FaultName::LinkOpen).at("K1.C-K6.A"));
        bench.wait(Span::s(1));
        assert_eq!(bench.count(), Some(5));
        bench.heal(fault);
        // As long as the two ends take to agree.
        bench.wait(Span::s(5));
    };
    // Automatic: it opens with the link.
    let mut bench = addressed(Bench::plant());
    cut(&mut bench);
    assert_eq!(bench.count(), Some(8));
    // It waits until the MainDevice opens it, however long the link has been there.
    set_loop(&mut bench, "K1", &[Port::C], LoopMode::AutoClose);
    assert_eq!(bench.count(), Some(8), "that alone closes nothing");
    cut(&mut bench);
    assert_eq!(bench.count(), Some(5));
    bench.wait(Span::s(10));
    assert_eq!(bench.count(), Some(5), "still closed");
    set_loop(&mut bench, "K1", &[Port::C], LoopMode::AutoClose);
    assert_eq!(bench.count(), Some(8), "opened by order");
    // Closed by hand, link or not.
    set_loop(&mut bench, "K1", &[Port::C], LoopMode::Closed);
    assert_eq!(bench.count(), Some(5));
    bench.wait(Span::s(1));
    assert_eq!(bench.count(), Some(5));
    set_loop(&mut bench, "K1", &[Port::C], LoopMode::Auto);
    assert_eq!(bench.count(), Some(8));
    // Open by hand without a link: frames go out there and do not come back.
    set_loop(&mut bench, "K8", &[Port::C], LoopMode::Open);
    assert_eq!(bench.count(), None);
}

/// How long frames of so many bytes of data take beyond their own length on the wire.
fn delay(terminals: usize, len: usize) -> Span {
    let mut bench = row(terminals);
    let bytes = frame(Command::Brd, at(0, RAM), &vec![0; len]);
    let sent = bench.now;
    let arrived = bench.send_by(Path::A, &bytes);
    assert_eq!(answer(&arrived[0].1).1, terminals as u16 + 1);
    // Preamble and check sequence are 12 bytes more; a byte takes 80 ns.
    let on_wire = Span::ns((bytes.len() as u64 + 12) * 80);
    Span::ns(arrived[0].0.at.since(sent).as_nanos() - on_wire.as_nanos())
}

// S0 L38-40, L101-104: on the fly, with a delay that is the same for every frame.
// proves: ESC-08
#[test]
fn the_processing_unit_sits_behind_port_a_and_delays_every_frame_by_the_same() {
    let delays: Vec<Span> = (0..6).map(|terminals| delay(terminals, 46)).collect();
    for (terminals, expected) in delays.iter().enumerate() {
        for len in [46, 128, 700, 1_400] {
            assert_eq!(delay(terminals, len), *expected, "{terminals} terminals, {len} bytes");
        }
    }
    // Each more takes as long as the one before, and far less than a stored frame would: 1,400 bytes are 114 µs.
    let steps: Vec<u64> =
        delays.windows(2).map(|pair| pair[1].saturating_sub(pair[0]).as_nanos()).collect();
    assert!(steps[1..].iter().all(|step| *step == steps[1]), "{steps:?}");
    assert!((100..2_000).contains(&steps[1]), "{steps:?}");
    // Entered by B, the frame leaves by A first, and is processed when it comes back there: the one behind
    // it comes first.
    let line = |entry: &str, out: &str| {
        let text = device("K", "EK1100", "maindevice", "")
            + &device("X", "EL2008", "K.B", &format!("entry = \"{entry}\""))
            + &device("Y", "EL2008", &format!("X.{out}"), "");
        addressed(Bench::new(&text))
    };
    assert_eq!(order(&line("A", "B")), ["K", "X", "Y"]);
    assert_eq!(order(&line("B", "A")), ["K", "Y", "X"]);
}

// S4 L14-21: A, then D, B, C.
// proves: ESC-09
#[test]
fn inside_a_controller_frames_go_from_a_to_d_then_b_then_c() {
    let branch = |port: &str| {
        device(&format!("at {port}"), "EK1100", &format!("J.{port}"), "")
            + &device(&format!("behind {port}"), "EL2008", &format!("at {port}.B"), "")
    };
    // In whatever order they are written down.
    for ports in [["B", "C", "D"], ["D", "C", "B"], ["C", "B", "D"]] {
        let text = device("J", "CU1124", "maindevice", "")
            + &ports.iter().fold(String::new(), |text, port| text + &branch(port));
        let bench = addressed(Bench::new(&text));
        let expected = ["J", "at D", "behind D", "at B", "behind B", "at C", "behind C"];
        assert_eq!(order(&bench), expected);
    }
}

/// A line of 46 SubDevices, as in the capture of the sources.
fn forty_six() -> Bench {
    addressed(row(45))
}

/// Address, data and working counter of the first datagram of what came back.
fn returned(bench: &mut Bench, bytes: &[u8]) -> (u16, Vec<u8>, u16) {
    let arrived = bench.send_by(Path::A, bytes);
    let view = FrameView::parse(&arrived[0].1).unwrap();
    let datagram = view.datagrams().next().unwrap().unwrap();
    (datagram.adp(), datagram.data().to_vec(), datagram.wkc().value())
}

// S0 L2736: a BRD comes back with Adp 0x2E, which is 46; S1 L1483, L1492: an ARMW sent to 0xFFED comes back
// with 0x1B.
// proves: FRM-03
#[test]
fn auto_increment_and_broadcast_addresses_grow_by_one_at_each_of_forty_six() {
    let mut bench = forty_six();
    let (adp, _, wkc) = returned(&mut bench, &frame(Command::Brd, at(0, 0x0130), &[0; 2]));
    assert_eq!((adp, wkc), (0x2E, 46));
    let (adp, _, wkc) = returned(&mut bench, &frame(Command::Armw, at(0xFFED, RAM), &[0; 4]));
    assert_eq!((adp, wkc), (0x1B, 46));
    for command in [Command::Aprd, Command::Apwr, Command::Aprw, Command::Bwr, Command::Brw] {
        let (adp, ..) = returned(&mut bench, &frame(command, at(0xFFFD, RAM), &[0]));
        assert_eq!(adp, 0xFFFDu16.wrapping_add(46), "{command:?}");
    }
    // Who finds 0 is meant: 0xFFFD is the fourth.
    let (_, data, wkc) = returned(&mut bench, &frame(Command::Aprd, at(0xFFFD, 0x0010), &[0; 2]));
    assert_eq!((data.as_slice(), wkc), (&[0x03, 0x10][..], 1));
    // A station address does not change on the way.
    let (adp, _, wkc) = returned(&mut bench, &frame(Command::Fprd, at(0x1003, 0x0010), &[0; 2]));
    assert_eq!((adp, wkc), (0x1003, 1));
}

/// An address in logical space.
fn logical(address: u32) -> DatagramAddress {
    DatagramAddress::Logical(LogicalAddress(address))
}

fn map(bench: &mut Bench, name: &str, fmmu: FmmuConfig) {
    let address = at(station(bench, name), 0x0600);
    assert_eq!(bench.send(Command::Fpwr, address, &fmmu.to_bytes()).unwrap().1, 1);
}

/// A terminal that takes a byte at a logical address into its RAM, and one that gives one.
fn mapped() -> Bench {
    let mut bench = addressed(Bench::plant());
    let (out, inward) = (RegisterAddress(RAM), RegisterAddress(RAM + 8));
    map(&mut bench, "T3", FmmuConfig::outputs(LogicalAddress(0x0001_0000), 1, out));
    map(&mut bench, "T4", FmmuConfig::outputs(LogicalAddress(0x0001_0001), 1, out));
    map(&mut bench, "T5", FmmuConfig::inputs(LogicalAddress(0x0001_0000), 1, inward));
    let both =
        FmmuConfig { reads: true, ..FmmuConfig::outputs(LogicalAddress(0x0001_0002), 1, out) };
    map(&mut bench, "T7", both);
    let address = at(station(&bench, "T5"), RAM + 8);
    assert_eq!(bench.send(Command::Fpwr, address, &[0xA5]).unwrap().1, 1);
    bench
}

fn ram(bench: &mut Bench, name: &str) -> u8 {
    let address = at(station(bench, name), RAM);
    bench.send(Command::Fprd, address, &[0]).unwrap().0[0]
}

// S3 L30-38.
// proves: FRM-04
#[test]
fn subdevices_are_addressed_by_station_and_by_logical_bytes_of_their_fmmus() {
    let mut bench = mapped();
    // By station: one of all, and nobody where the address is nobody's.
    let address = station(&bench, "T4");
    assert_eq!(bench.send(Command::Fpwr, at(address, RAM + 16), &[7]).unwrap().1, 1);
    let (data, wkc) = bench.send(Command::Fprd, at(address, RAM + 16), &[0]).unwrap();
    assert_eq!((data[0], wkc), (7, 1));
    let others = ["K1", "T2", "T3", "T5", "K6", "T7", "K8"];
    for name in others {
        let address = at(station(&bench, name), RAM + 16);
        assert_eq!(bench.send(Command::Fprd, address, &[9]).unwrap().0[0], 0, "{name}");
    }
    assert_eq!(bench.send(Command::Fpwr, at(0x2222, RAM), &[1]).unwrap().1, 0);
    // By logical bytes: one datagram reaches two of them, each its own byte.
    assert_eq!(bench.send(Command::Lwr, logical(0x0001_0000), &[0x11, 0x22]).unwrap().1, 2);
    assert_eq!(
        (ram(&mut bench, "T3"), ram(&mut bench, "T4"), ram(&mut bench, "T2")),
        (0x11, 0x22, 0)
    );
    let (data, wkc) = bench.send(Command::Lrd, logical(0x0001_0000), &[0; 2]).unwrap();
    assert_eq!((data.as_slice(), wkc), (&[0xA5, 0][..], 1));
    // Where nothing is mapped nobody answers.
    assert_eq!(bench.send(Command::Lwr, logical(0x0002_0000), &[1]).unwrap().1, 0);
}

// S0 L2731: ARMW with working counter 46 of 46; S3 L39-44.
// proves: FRM-05
#[test]
fn one_supplies_and_all_others_take() {
    for by_station in [false, true] {
        let mut bench = forty_six();
        for place in 0..46_u16 {
            let address = at(0x1000 + place, RAM);
            bench.send(Command::Fpwr, address, &[place as u8, 0xEE]).unwrap();
        }
        // The twentieth.
        let (command, address) = match by_station {
            false => (Command::Armw, at(0xFFED, RAM)),
            true => (Command::Frmw, at(0x1013, RAM)),
        };
        let (data, wkc) = bench.send(command, address, &[0x77, 0x77]).unwrap();
        assert_eq!((data.as_slice(), wkc), (&[19, 0xEE][..], 46));
        for place in 0..46_u16 {
            let read = bench.send(Command::Fprd, at(0x1000 + place, RAM), &[0]).unwrap();
            // Who comes before the one that supplies has taken what the frame brought.
            let expected = if place < 19 { 0x77 } else { 19 };
            assert_eq!(read, (vec![expected], 1), "{place}");
        }
    }
}

// S0 L1376-1378; S3 L50-75.
// proves: FRM-15
#[test]
fn a_read_counts_1_a_write_1_and_the_write_of_a_read_write_2() {
    let mut bench = mapped();
    let t3 = station(&bench, "T3");
    let third = 0u16.wrapping_sub(2);
    let mut table = String::new();
    for (command, address, expected) in [
        (Command::Fprd, at(t3, RAM), 1),
        (Command::Fpwr, at(t3, RAM), 1),
        (Command::Fprw, at(t3, RAM), 3),
        (Command::Aprd, at(third, RAM), 1),
        (Command::Apwr, at(third, RAM), 1),
        (Command::Aprw, at(third, RAM), 3),
        // Eight of them.
        (Command::Brd, at(0, RAM), 8),
        (Command::Bwr, at(0, RAM), 8),
        (Command::Brw, at(0, RAM), 24),
        (Command::Armw, at(third, RAM), 8),
        (Command::Frmw, at(t3, RAM), 8),
        // One that gives, one that takes, one that does both.
        (Command::Lrd, logical(0x0001_0002), 1),
        (Command::Lwr, logical(0x0001_0002), 1),
        (Command::Lrw, logical(0x0001_0002), 3),
        (Command::Lrw, logical(0x0001_0001), 2),
        // Not addressed: nothing.
        (Command::Nop, at(t3, RAM), 0),
        (Command::Fprw, at(0x2222, RAM), 0),
        (Command::Aprd, at(1, RAM), 0),
        (Command::Lrw, logical(0x0002_0000), 0),
        // What cannot be written counts its read alone.
        (Command::Fpwr, at(t3, 0x0130), 0),
        (Command::Fprw, at(t3, 0x0130), 1),
    ] {
        let (_, wkc) = bench.send(command, address, &[0]).unwrap();
        if wkc != expected {
            writeln!(table, "{command:?} {address:?}: {wkc}, expected {expected}").unwrap();
        }
    }
    assert!(table.is_empty(), "{table}");
    // All of the mapped bytes at once: T5 reads, T3 and T4 write, T7 does both.
    let (data, wkc) = bench.send(Command::Lrw, logical(0x0001_0000), &[1, 2, 3]).unwrap();
    assert_eq!((data[0], wkc), (0xA5, 1 + 2 + 2 + 3));
}

// S0 L108-113: registers up to 0x0FFF, process data and mailboxes from 0x1000, for MainDevice and SubDevice.
// proves: ESC-10 partial: the side of the MainDevice; that of the SubDevice is in a run
#[test]
fn registers_end_where_process_data_begin() {
    let mut bench = addressed(Bench::plant());
    bench.wait(Span::s(1));
    let t3 = station(&bench, "T3");
    // What the controller is cannot be written.
    assert_eq!(bench.send(Command::Fpwr, at(t3, 0x0000), &[0xFF]).unwrap().1, 0);
    // The whole memory behind 0x1000 can: 1 KiB and more, byte by byte.
    for address in (0x1000..0x1400).step_by(64) {
        let pattern: Vec<u8> = (0..64).map(|byte| (address as u8) ^ byte).collect();
        assert_eq!(
            bench.send(Command::Fpwr, at(t3, address), &pattern).unwrap().1,
            1,
            "0x{address:04X}"
        );
        let read = bench.send(Command::Fprd, at(t3, address), &[0; 64]).unwrap();
        assert_eq!(read, (pattern, 1), "0x{address:04X}");
    }
    // One datagram may reach over the border.
    let read = bench.send(Command::Fprd, at(t3, 0x0FF0), &[0; 32]).unwrap();
    assert_eq!((read.0[16], read.1), (0x00, 1), "{:02X?}", read.0);
}
