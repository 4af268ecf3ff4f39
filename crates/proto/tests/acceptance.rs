//! Acceptance cases of the requirements that are pure calculation or decoding, through what others
//! can call.

use linesman_proto::address::{DeviceId, LogicalAddress, Position, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::size::{frame_size, load_percent, wire_time};
use linesman_proto::frame::{FrameBuilder, FrameView};
use linesman_proto::port::Port;
use linesman_proto::register::{DlStatus, RxErrors, describe};
use linesman_proto::state::device_state::DeviceState;
use linesman_proto::state::status_code::lookup;
use linesman_proto::time::{DcTime, Span};

/// A frame whose datagrams carry this many bytes each.
fn frame(lens: &[usize]) -> Vec<u8> {
    let mut buffer = [0; 1514];
    let mut builder = FrameBuilder::new(&mut buffer, MacAddress([2, 0, 0, 0, 0, 1]));
    for len in lens {
        let address = DatagramAddress::Logical(LogicalAddress(0x0900_0000));
        builder.push(Command::Lrd, 0, address, *len).expect("it fits");
    }
    let len = builder.finish();
    buffer[..len].to_vec()
}

/// The address of a datagram, as it is read back from a frame.
fn sent_and_read(command: Command, address: DatagramAddress) -> DatagramAddress {
    let mut buffer = [0; 1514];
    let mut builder = FrameBuilder::new(&mut buffer, MacAddress([2, 0, 0, 0, 0, 1]));
    builder.push(command, 0, address, 2).expect("it fits");
    let len = builder.finish();
    let view = FrameView::parse(&buffer[..len]).expect("a frame");
    let datagram = view.datagrams().next().expect("a datagram").expect("a whole one");
    match address {
        DatagramAddress::Logical(_) => DatagramAddress::Logical(datagram.logical()),
        DatagramAddress::Physical(..) => DatagramAddress::Physical(datagram.adp(), datagram.ado()),
    }
}

// proves: ESC-01
#[test]
fn the_last_of_65_535_subdevices_is_reached_by_position_by_station_and_by_logical_address() {
    const COUNT: u32 = 65_535;
    let last = Position(u16::try_from(COUNT - 1).unwrap());
    let register = RegisterAddress(0x0130);
    let read =
        sent_and_read(Command::Aprd, DatagramAddress::Physical(last.auto_increment(), register));
    let DatagramAddress::Physical(adp, _) = read else { panic!("{read:?}") };
    // Each SubDevice adds 1; whoever sees 0 is meant.
    let reached = (0..u16::MAX).find(|passed| adp.wrapping_add(*passed) == 0);
    assert_eq!(reached, Some(last.0));
    // So many station addresses there are besides 0, which is that of nobody.
    let station = u16::try_from(COUNT).unwrap();
    let read = sent_and_read(Command::Fprd, DatagramAddress::Physical(station, register));
    assert_eq!(read, DatagramAddress::Physical(0xFFFF, register));
    // Each may have 65,537 bytes of the logical addresses for itself.
    let each = u32::MAX / COUNT;
    let begins = LogicalAddress((COUNT - 1) * each);
    assert_eq!(
        sent_and_read(Command::Lrd, DatagramAddress::Logical(begins)),
        DatagramAddress::Logical(begins)
    );
    assert!(each == 65_537 && begins.0.checked_add(each - 1).is_some());
    // And it has a number for people.
    assert_eq!(DeviceId(COUNT - 1).no(), COUNT);
}

// proves: FRM-01
#[test]
fn frames_are_ethernet_with_the_type_of_ethercat_and_padded_to_60_bytes() {
    for data in 0..=60 {
        let frame = frame(&[data]);
        assert_eq!(frame[12..14], [0x88, 0xA4]);
        // 14 and 2 bytes of headers, 12 around the data; the check sequence makes 60 to 64.
        let unpadded = 14 + 2 + 12 + data;
        assert_eq!(frame.len(), unpadded.max(60));
        assert!(frame[unpadded.min(frame.len())..].iter().all(|byte| *byte == 0));
        let datagrams: Vec<_> = FrameView::parse(&frame).unwrap().datagrams().collect();
        assert_eq!(datagrams.len(), 1, "padding is no datagram");
        assert_eq!(datagrams[0].unwrap().data_len(), data);
    }
}

/// Datagrams, sum of their data, times the frame is sent, its size, ns on the wire, cycle in ms,
/// load in percent.
type Planned = (usize, usize, u64, usize, u64, u64, f64);

const PLANNED: [Planned; 11] = [
    (7, 287, 1, 387, 32_880, 2, 1.64),
    (6, 364, 1, 452, 38_080, 2, 1.90),
    (4, 89, 1, 153, 14_160, 2, 0.70),
    (3, 6, 2, 58, 13_440, 2, 0.67),
    (7, 95, 1, 195, 17_520, 2, 0.87),
    (5, 34, 1, 110, 10_720, 4, 0.27),
    (2, 4, 1, 44, 6_720, 2, 0.33),
    (2, 9, 1, 49, 6_720, 2, 0.33),
    (1, 16, 1, 44, 6_720, 5, 0.13),
    (2, 10, 1, 50, 6_720, 10, 0.07),
    (7, 416, 1, 516, 43_200, 2, 2.16),
];

// proves: FRM-07, FRM-08, FRM-09, FRM-12
#[test]
fn the_eleven_planned_frames_have_their_size_time_and_load() {
    for (datagrams, sum, times, size, ns, cycle_ms, load) in PLANNED {
        // How the bytes are spread does not matter.
        let mut lens = vec![0; datagrams];
        lens[0] = sum;
        assert_eq!(frame_size(lens.iter().copied()), size);
        assert_eq!(frame(&lens).len(), size.max(60));
        assert_eq!(wire_time(size).as_nanos() * times, ns, "{size} bytes");
        let percent = load_percent(size, Span::ms(cycle_ms)) * times as f64;
        assert!((percent - load).abs() <= 0.01, "{size} bytes: {percent}, expected {load}");
    }
    let load = |size| load_percent(size, Span::ms(2));
    // One frame of 153 and two of 58 bytes.
    assert!((load(153) + 2.0 * load(58) - 1.38).abs() <= 0.01);
    assert!((load(195) - 0.88).abs() <= 0.01);
}

// proves: FRM-13
#[test]
fn the_header_word_of_the_frame_of_516_bytes() {
    let frame = frame(&[4, 4, 3, 150, 33, 220, 2]);
    assert_eq!(frame.len(), 516);
    assert_eq!(frame[14..16], [0xF4, 0x11]);
    assert_eq!(FrameView::parse(&frame).unwrap().announced_len(), 500);
}

// proves: FRM-14
#[test]
fn the_working_counter_is_the_last_word_of_its_datagram_and_starts_at_0() {
    let mut bytes = frame(&[4, 6]);
    let counters = |bytes: &[u8]| -> Vec<u16> {
        let view = FrameView::parse(bytes).unwrap();
        view.datagrams().map(|datagram| datagram.unwrap().wkc().value()).collect()
    };
    assert_eq!(counters(&bytes), [0, 0]);
    let first = 14 + 2 + 10 + 4;
    let second = first + 2 + 10 + 6;
    bytes[first..first + 2].copy_from_slice(&[0x34, 0x12]);
    bytes[second..second + 2].copy_from_slice(&[0xFF, 0xFF]);
    assert_eq!(counters(&bytes), [0x1234, 0xFFFF]);
}

// proves: ESC-14
#[test]
fn the_dl_status_tells_link_loop_and_communication_of_each_port() {
    let cases = [(0x5617, &[Port::A][..]), (0x5A37, &[Port::A, Port::B])];
    for (word, used) in cases {
        let status = DlStatus(word);
        for port in [Port::A, Port::B, Port::C, Port::D] {
            let state = status.port_state(port);
            let used = used.contains(&port);
            assert_eq!((state.link, state.closed), (used, !used), "{word:#06X}, port {port}");
            assert_eq!(state.communication, used, "{word:#06X}, port {port}");
        }
    }
}

// proves: HW-07
#[test]
fn ports_have_a_number_and_a_letter() {
    for (number, letter) in [(0, 'A'), (1, 'B'), (2, 'C'), (3, 'D')] {
        let port = Port::from_index(number).unwrap();
        assert_eq!((port.letter(), port.to_string()), (letter, letter.to_string()));
        assert_eq!((Port::from_letter(letter), port.index()), (Some(port), number));
    }
    assert_eq!((Port::from_index(4), Port::from_letter('E')), (None, None));
}

// proves: HW-13
#[test]
fn receive_errors_are_two_counters_in_a_word_for_each_port() {
    assert_eq!(RxErrors::from_word(0x0412), RxErrors { frames: 18, physical: 4 });
    let titles: Vec<String> = (0x0300..=0x0307)
        .map(|address| describe(RegisterAddress(address)).unwrap().title())
        .collect();
    for (port, pair) in ['A', 'B', 'C', 'D'].into_iter().zip(titles.chunks(2)) {
        for title in pair {
            assert!(title.starts_with("RX error") && title.ends_with(&format!("port {port}")));
        }
    }
    // The lower address of a pair counts frames, the higher one what the physical layer sees.
    let field = |address| {
        let described = describe(RegisterAddress(address)).unwrap();
        described.fields().map(|field| field.name.to_lowercase()).collect::<Vec<_>>().join(" ")
    };
    assert!(field(0x0300).contains("frame"), "{}", field(0x0300));
    assert!(field(0x0301).contains("physical"), "{}", field(0x0301));
}

// proves: HW-21
#[test]
fn the_other_counters_are_in_the_register_table() {
    let cases = [
        (0x030C, "processing unit"),
        (0x030D, "pdi"),
        (0x0400, "watchdog divider"),
        (0x0200, "event mask"),
        (0x0204, "event mask"),
    ];
    for (address, word) in cases {
        let title = describe(RegisterAddress(address)).unwrap().title().to_lowercase();
        assert!(title.contains(word), "{address:#06X} is {title:?}");
    }
}

/// Each code has a cause and advice in order.
fn is_explained(code: u16) {
    let meaning = lookup(code);
    assert!(meaning.is_error() && !meaning.name.is_empty(), "{code:#06X}");
    assert!(meaning.cause.len() > 20, "{code:#06X}: cause {:?}", meaning.cause);
    assert!(meaning.actions.len() >= 2, "{code:#06X}: {:?}", meaning.actions);
}

// proves: SW-04
#[test]
fn codes_of_start_up_and_running_are_explained() {
    let names = [
        (0x0003, "setup"),
        (0x001D, "output"),
        (0x001E, "input"),
        (0x0035, "cycle time"),
        (0x001A, "synchronization"),
        (0x001B, "watchdog"),
        (0x002C, "fatal sync"),
    ];
    for (code, word) in names {
        is_explained(code);
        assert!(lookup(code).name.contains(word), "{code:#06X} is {:?}", lookup(code).name);
    }
}

// proves: SYN-30 partial: that each code has both
#[test]
fn codes_of_lost_synchronisation_lead_to_cause_and_action() {
    for code in [0x2D, 0x30, 0x32, 0x1A, 0x33, 0x34, 0x35, 0x36, 0x37] {
        is_explained(code);
    }
}

// proves: PLC-05
#[test]
fn the_low_byte_of_the_state_word_is_the_software() {
    let cases = [
        (0x0001, "INIT"),
        (0x0002, "PREOP"),
        (0x0003, "BOOT"),
        (0x0004, "SAFEOP"),
        (0x0008, "OP"),
        (0x0012, "ERR PREOP"),
        (0x0021, "INIT VPRS"),
        (0x0041, "INIT INIT_ERR"),
        (0x0081, "INIT DISABLED"),
    ];
    for (word, text) in cases {
        assert_eq!(DeviceState(word).to_string(), text);
        assert_eq!(text.parse(), Ok(DeviceState(word)));
    }
}

// proves: PLC-06
#[test]
fn the_high_byte_of_the_state_word_is_the_wiring() {
    let cases = [
        (0x2408, "OP LNK_MIS B"),
        (0x4408, "OP LNK_MIS C"),
        (0x8408, "OP LNK_MIS D"),
        (0x0101, "INIT NO_COMM"),
        (0x4861, "INIT VPRS INIT_ERR LNK_ADD C"),
        (0x0071, "ERR INIT VPRS INIT_ERR"),
        (0x0014, "ERR SAFEOP"),
        (0x1208, "OP LNK_ERR A"),
    ];
    for (word, text) in cases {
        assert_eq!(DeviceState(word).to_string(), text);
        assert_eq!(text.parse(), Ok(DeviceState(word)));
    }
}

// proves: DC-02
#[test]
fn system_time_counts_from_2000_and_its_low_half_wraps_at_4_295_s() {
    // 30 years, of which 7 were leap years.
    assert_eq!(DcTime::UNIX_EPOCH_OFFSET_S, (30 * 365 + 7) * 86_400);
    let wrap = 4_294_967_296_u64;
    assert_eq!(DcTime(wrap).low(), DcTime(0).low());
    assert_eq!(DcTime(wrap + 5).low().delta(DcTime(wrap - 5).low()), 10);
    assert!((Span::ns(wrap).as_secs_f64() - 4.295).abs() < 0.0005);
}

#[test]
fn a_frame_without_room_for_a_header_takes_no_empty_datagram() {
    for left in 0..12 {
        let mut buffer = [0; 1514];
        let mut builder = FrameBuilder::new(&mut buffer, MacAddress([2, 0, 0, 0, 0, 1]));
        let address = DatagramAddress::Logical(LogicalAddress(0));
        // 16 bytes of headers, 12 around the data of the first datagram.
        let first = 1514 - 16 - 12 - left;
        builder.push(Command::Lrd, 0, address, first).unwrap();
        assert!(builder.push(Command::Nop, 1, address, 0).is_err(), "{left} bytes are left");
        assert_eq!(builder.finish(), 1514 - left);
    }
}

/// The frame of 516 bytes of the sources as it came back: each command, its address, length and working counter.
const SEVEN: [(Command, u32, usize, u16); 7] = [
    (Command::Nop, 0x0900_0000, 4, 0),
    (Command::Armw, 0x0910_001B, 4, 46),
    (Command::Lrd, 0x0900_0000, 3, 18),
    (Command::Lrw, 0x0100_0000, 150, 21),
    (Command::Lwr, 0x0100_0800, 33, 17),
    (Command::Lrd, 0x0100_1000, 220, 19),
    (Command::Brd, 0x0130_002E, 2, 46),
];

// S0 L2712-2751: NOP with Len 4, Adp 0, Ado 0x0900; not the last, never round the line, no interrupt.
// proves: FRM-06
#[test]
fn every_field_of_the_headers_of_the_frame_of_516_bytes_is_read() {
    // As the hex dump begins: Ethernet header, length 500 and type 1.
    let mut bytes = vec![2, 0, 0, 0, 0, 0, 1, 1, 5, 1, 0, 0, 0x88, 0xA4, 0xF4, 0x11];
    for (number, (command, address, len, wkc)) in SEVEN.into_iter().enumerate() {
        let is_last = number + 1 == SEVEN.len();
        // The last has been round the line once too often, and somebody asks for attention.
        let flags: u16 = if is_last { 0x4000 } else { 0x8000 };
        bytes.extend([command.code(), 0xB0 + number as u8]);
        bytes.extend(address.to_le_bytes());
        bytes.extend((len as u16 | flags).to_le_bytes());
        bytes.extend(if is_last { 0x1234_u16 } else { 0 }.to_le_bytes());
        bytes.extend((0..len).map(|byte| byte as u8));
        bytes.extend(wkc.to_le_bytes());
    }
    assert_eq!(bytes.len(), 516);
    let view = FrameView::parse(&bytes).unwrap();
    assert_eq!(view.announced_len(), 500);
    assert_eq!(view.source(), MacAddress([1, 1, 5, 1, 0, 0]));
    assert_eq!(view.destination(), MacAddress([2, 0, 0, 0, 0, 0]));
    let datagrams: Vec<_> = view.datagrams().map(Result::unwrap).collect();
    assert_eq!(datagrams.len(), 7);
    let mut offset = 16;
    for (number, (datagram, (command, address, len, wkc))) in
        datagrams.iter().zip(SEVEN).enumerate()
    {
        let is_last = number == 6;
        assert_eq!((datagram.command(), datagram.code()), (Some(command), command.code()));
        assert_eq!(datagram.index(), 0xB0 + number as u8);
        assert_eq!(datagram.logical(), LogicalAddress(address));
        assert_eq!((datagram.adp(), datagram.ado().0), (address as u16, (address >> 16) as u16));
        assert_eq!((datagram.data_len(), datagram.data().len()), (len, len));
        assert!(datagram.data().iter().enumerate().all(|(at, byte)| *byte == at as u8));
        assert_eq!((datagram.circulated(), datagram.more_follow()), (is_last, !is_last));
        assert_eq!(datagram.irq(), if is_last { 0x1234 } else { 0 });
        assert_eq!(datagram.wkc().0, wkc);
        assert_eq!(datagram.offset(), offset);
        assert_eq!(datagram.data_range(), offset + 10..offset + 10 + len);
        offset += 12 + len;
    }
    assert_eq!((datagrams[0].adp(), datagrams[0].ado()), (0, RegisterAddress(0x0900)));
    assert_eq!(datagrams.iter().map(|one| one.data_len()).sum::<usize>(), 416);
}
