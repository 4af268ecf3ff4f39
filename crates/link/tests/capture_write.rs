//! Written captures can be read again, here and by tshark, and are the same bytes each time.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod support;

use std::fs;

use linesman_link::capture::{
    CaptureInterfaceId, CaptureReader, CaptureWriteError, FrameToWrite, InterfaceToWrite, LinkType,
    PcapWriter, PcapngWriter, TimeResolution,
};
use linesman_link::direction::FrameDirection;
use linesman_link::unix_time::UnixTime;
use proptest::prelude::*;
use support::{drain, ethercat, read, tshark};

const START: i128 = 1_700_000_000_000_000_000;
const DIRECTIONS: [FrameDirection; 3] =
    [FrameDirection::Outgoing, FrameDirection::Incoming, FrameDirection::Unknown];

fn two_cards() -> Vec<u8> {
    let mut writer = PcapngWriter::new(Vec::new(), "linesman 0.1.0").unwrap();
    for (name, description) in [("eth0", "card A"), ("eth1", "")] {
        let link_type = LinkType::Ethernet;
        writer.add_interface(&InterfaceToWrite { name, description, link_type }).unwrap();
    }
    for seed in 0..9_u8 {
        let bytes = ethercat(seed, 60 + usize::from(seed));
        let mut frame = FrameToWrite::new(
            CaptureInterfaceId(u32::from(seed) % 2),
            UnixTime::from_nanos(START + i128::from(seed) * 1_001),
            DIRECTIONS[usize::from(seed) % 3],
            &bytes,
        );
        frame.original_len = (seed == 4).then_some(1514);
        writer.write_frame(&frame).unwrap();
    }
    let card = CaptureInterfaceId(1);
    writer.write_statistics(card, UnixTime::from_nanos(START), 10, 6).unwrap();
    let (card, end) = (CaptureInterfaceId(0), UnixTime::from_nanos(START + 2_000_000));
    writer.write_statistics(card, end, 5, 0).unwrap();
    writer.finish().unwrap()
}

#[test]
fn a_written_capture_reads_back_and_has_the_same_bytes_each_time() {
    let file = two_cards();
    assert_eq!(file, two_cards());
    // The section header, to the byte.
    let head = [0x0A, 0x0D, 0x0D, 0x0A, 52, 0, 0, 0, 0x4D, 0x3C, 0x2B, 0x1A, 1, 0, 0, 0];
    assert_eq!(file[..16], head);

    let mut reader =
        CaptureReader::from_source("memory", std::io::Cursor::new(file.clone())).unwrap();
    assert_eq!(reader.section().application.as_deref(), Some("linesman 0.1.0"));
    while reader.next_frame().is_some() {}
    let [first, second] = reader.interfaces() else { panic!("two interfaces") };
    assert_eq!(first.name.as_deref(), Some("eth0"));
    assert_eq!(first.description.as_deref(), Some("card A"));
    assert_eq!(first.resolution, TimeResolution::NANOSECOND);
    assert_eq!((second.description.as_deref(), second.drops), (None, Some(6)));
    let end = UnixTime::from_nanos(START + 2_000_000);
    assert_eq!((first.ended, second.ended), (Some(end), Some(UnixTime::from_nanos(START))));

    let (frames, end) = read(&file).unwrap();
    assert!(end.complete(), "{end}");
    assert_eq!(frames.len(), 9);
    for (seed, frame) in (0..).zip(&frames) {
        assert_eq!(frame.bytes, ethercat(seed, 60 + usize::from(seed)));
        assert_eq!(frame.nanos, Some(START + i128::from(seed) * 1_001));
        assert_eq!(frame.direction, DIRECTIONS[usize::from(seed) % 3]);
        assert_eq!(frame.truncated, seed == 4);
    }
}

#[test]
fn tshark_reads_what_is_written_without_complaint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two-cards.pcapng");
    fs::write(&path, two_cards()).unwrap();
    let fields = [
        "frame.number",
        "frame.time_epoch",
        "frame.len",
        "frame.interface_name",
        "frame.packet_flags_direction",
        "ecatf.length",
    ];
    let Some((lines, complaints)) = tshark(&path, &fields) else { return };
    assert_eq!(complaints, "");
    assert_eq!(lines.len(), 9);
    for (seed, line) in lines.iter().enumerate() {
        assert_eq!(line[0], (seed + 1).to_string());
        assert_eq!(line[1], format!("1700000000.{:09}", seed * 1_001));
        assert_eq!(line[2], if seed == 4 { "1514".to_owned() } else { (60 + seed).to_string() });
        assert_eq!(line[3], ["eth0", "eth1"][seed % 2]);
        assert_eq!(line[4], ["0x00000002", "0x00000001", ""][seed % 3], "frame {}", seed + 1);
        assert!(!line[5].is_empty(), "tshark sees EtherCAT");
    }

    let path = folder.path().join("fcs.pcap");
    let mut writer = PcapWriter::new(Vec::new(), LinkType::Ethernet, true).unwrap();
    for seed in 0..3 {
        let mut bytes = ethercat(seed, 60);
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes[20] ^= u8::from(seed == 2);
        let time = UnixTime::from_nanos(START + 123_456_789);
        let card = CaptureInterfaceId(0);
        let frame = FrameToWrite::new(card, time, FrameDirection::Unknown, &bytes);
        writer.write_frame(&frame).unwrap();
    }
    fs::write(&path, writer.finish().unwrap()).unwrap();
    let (frames, end) = drain(CaptureReader::open(&path).unwrap());
    assert!(end.complete(), "{end}");
    let fcs: Vec<_> = frames.iter().map(|frame| frame.fcs).collect();
    assert_eq!(fcs, [Some(true), Some(true), Some(false)]);
    let fields = ["frame.time_epoch", "frame.len", "eth.fcs"];
    let Some((lines, complaints)) = tshark(&path, &fields) else { return };
    assert_eq!(complaints, "");
    assert_eq!(lines.len(), 3);
    for line in lines {
        assert_eq!(line[..2], ["1700000000.123456789", "64"]);
        assert!(line[2].starts_with("0x"), "tshark sees the check sequence: {line:?}");
    }
}

#[test]
fn what_does_not_fit_is_refused_and_leaves_the_file_whole() {
    let mut writer = PcapngWriter::new(Vec::new(), "").unwrap();
    let interface = InterfaceToWrite { name: "x", description: "", link_type: LinkType::Ethernet };
    let card = writer.add_interface(&interface).unwrap();
    let bytes = ethercat(1, 60);
    let time = UnixTime::from_nanos(START);
    let good = FrameToWrite::new(card, time, FrameDirection::Unknown, &bytes);
    let long = vec![0; 300_000];
    let unknown = FrameToWrite { interface: CaptureInterfaceId(1), ..good };
    let early = FrameToWrite { time: UnixTime::from_nanos(-1), ..good };
    let late = FrameToWrite { time: UnixTime::from_nanos(i128::from(u64::MAX) + 1), ..good };
    let long = FrameToWrite { bytes: &long, ..good };
    use CaptureWriteError as E;
    assert!(matches!(writer.write_frame(&unknown), Err(E::UnknownInterface { .. })));
    assert!(matches!(writer.write_frame(&early), Err(E::Time { .. })));
    assert!(matches!(writer.write_frame(&late), Err(E::Time { .. })));
    assert!(matches!(writer.write_frame(&long), Err(E::FrameLength { len: 300_000, .. })));
    writer.write_frame(&good).unwrap();
    let (frames, end) = read(&writer.finish().unwrap()).unwrap();
    assert_eq!((frames.len(), end.complete()), (1, true));

    let mut pcap = PcapWriter::new(Vec::new(), LinkType::Ethernet, false).unwrap();
    assert!(matches!(pcap.write_frame(&early), Err(E::Time { .. })));
    assert!(matches!(pcap.write_frame(&late), Err(E::Time { .. })));
    pcap.write_frame(&good).unwrap();
    assert_eq!(read(&pcap.finish().unwrap()).unwrap().0.len(), 1);
}

proptest! {
    #[test]
    fn any_frames_survive_writing_and_reading(
        frames in proptest::collection::vec(
            (
                0..3_u32,
                0..u64::MAX,
                0..3_usize,
                proptest::collection::vec(any::<u8>(), 0..100),
                any::<bool>(),
            ),
            0..20,
        ),
        names in proptest::array::uniform3(".{0,12}"),
    ) {
        let mut writer = PcapngWriter::new(Vec::new(), "t").unwrap();
        for name in &names {
            let link_type = LinkType::Ethernet;
            writer.add_interface(&InterfaceToWrite { name, description: "", link_type }).unwrap();
        }
        for (interface, nanos, direction, bytes, crc_error) in &frames {
            let interface = CaptureInterfaceId(*interface);
            let time = UnixTime::from_nanos((*nanos).into());
            let mut frame = FrameToWrite::new(interface, time, DIRECTIONS[*direction], bytes);
            frame.crc_error = *crc_error;
            writer.write_frame(&frame).unwrap();
        }
        let (kept, end) = read(&writer.finish().unwrap()).unwrap();
        prop_assert!(end.complete());
        prop_assert_eq!(kept.len(), frames.len());
        for (kept, (interface, nanos, direction, bytes, crc_error)) in kept.iter().zip(&frames) {
            prop_assert_eq!(kept.interface, *interface);
            prop_assert_eq!(kept.nanos, Some((*nanos).into()));
            prop_assert_eq!(kept.direction, DIRECTIONS[*direction]);
            prop_assert_eq!(&kept.bytes, bytes);
            prop_assert_eq!(kept.fcs, crc_error.then_some(false));
        }
    }
}
