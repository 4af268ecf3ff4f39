//! Every form of capture file that is read: byte orders, steps of time, kinds of blocks, link
//! types, check sequences, compression.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod support;

use std::io::Write as _;

use flate2::Compression;
use flate2::write::GzEncoder;
use linesman_link::capture::{
    CaptureFormat, CaptureReader, LinkType, RunClock, SkippedLinkType, TimeResolution,
};
use linesman_link::direction::FrameDirection;
use support::{Maker, drain, ethercat, read, tshark};

const BOTH: [Maker; 2] = [Maker { big: false }, Maker { big: true }];

#[test]
fn pcap_in_both_byte_orders_and_both_steps_of_time() {
    for maker in BOTH {
        for (magic, nanos) in [(0xA1B2_C3D4, 7_000), (0xA1B2_3C4D, 7)] {
            let mut file = maker.pcap_header(magic, 0, 1);
            file.extend(maker.pcap_frame(1_700_000_000, 7, 60, &ethercat(1, 60)));
            file.extend(maker.pcap_frame(u32::MAX, 999_999, 1514, &ethercat(2, 64)));
            let (frames, end) = read(&file).unwrap();
            assert!(end.complete(), "{end}");
            assert_eq!(end.offset, file.len() as u64);
            assert_eq!(frames.len(), 2);
            assert_eq!(frames[0].nanos, Some(1_700_000_000_000_000_000 + nanos));
            assert_eq!((frames[0].number, frames[1].number), (1, 2));
            assert_eq!((frames[0].truncated, frames[1].truncated), (false, true));
            assert_eq!(frames[1].original_len, 1514);
            assert_eq!(frames[0].bytes, ethercat(1, 60));
            assert_eq!(frames[0].direction, FrameDirection::Unknown);
        }
    }
}

#[test]
fn pcapng_with_sections_interfaces_and_all_packet_blocks() {
    for (maker, other) in [(BOTH[0], BOTH[1]), (BOTH[1], BOTH[0])] {
        let m = maker;
        let mut file = m.section();
        file.extend(m.interface(1, 0, &[m.option(2, b"eth0"), m.option(9, &[9])]));
        // Seconds since 2023 as offset, steps of 2^-10 s.
        let offset = m.option(14, &m.u64(1_700_000_000));
        file.extend(m.interface(1, 0, &[m.option(9, &[0x8A]), offset, m.option(2, b"eth1")]));
        file.extend(m.packet(0, 1_000_000_000_000, 60, &ethercat(1, 60), &[]));
        file.extend(m.packet(1, 512, 60, &ethercat(2, 60), &[m.option(2, &m.u32(2))]));
        // Obsolete packet block: 16 bits of interface, 16 of drops.
        let mut body = [m.u16(0), m.u16(7)].concat();
        body.extend([0, 5, 60, 61].map(|word| m.u32(word)).concat());
        body.extend(ethercat(3, 60));
        body.extend(m.option(2, &m.u32(1)));
        file.extend(m.block(2, &body));
        // Blocks without frames, one longer than the reader's buffer.
        file.extend(m.block(0x7777_7777, &vec![9; 1_000_000]));
        file.extend(m.block(0xA, b"secrets "));
        file.extend(m.block(4, &[0; 4]));
        // A journal entry and a custom block count as frames in Wireshark.
        file.extend(m.block(9, b"MESSAGE=hello"));
        file.extend(m.block(0xBAD, &[1, 2, 3, 4]));
        // Section 2, in the other byte order: its interface 0 is the third of the file.
        file.extend(other.section());
        file.extend(other.interface(1, 64, &[]));
        file.extend(other.block(3, &[&other.u32(100)[..], &ethercat(4, 64)].concat()));
        file.extend(other.packet(0, 3, 60, &ethercat(5, 60), &[]));

        let mut reader =
            CaptureReader::from_source("memory", std::io::Cursor::new(file.clone())).unwrap();
        assert_eq!(reader.format(), CaptureFormat::Pcapng);
        assert_eq!(reader.next_frame().unwrap().number.0, 1);
        assert_eq!(reader.interfaces().len(), 2);
        assert_eq!(reader.interfaces()[1].name.as_deref(), Some("eth1"));
        assert_eq!(reader.interfaces()[1].resolution, TimeResolution::Binary(10));
        while reader.next_frame().is_some() {}
        assert_eq!(reader.interfaces().len(), 3);
        assert_eq!(reader.interfaces()[0].drops, Some(7));
        assert_eq!(reader.interfaces()[2].snap_len, Some(64));

        let (frames, end) = read(&file).unwrap();
        assert!(end.complete(), "{end}");
        let column: Vec<_> =
            frames.iter().map(|f| (f.number, f.interface, f.nanos, f.bytes[11])).collect();
        let expected = [
            (1, 0, Some(1_000_000_000_000), 1),
            (2, 1, Some(1_700_000_000_500_000_000), 2),
            (3, 0, Some(5), 3),
            (6, 2, None, 4),
            (7, 2, Some(3_000), 5),
        ];
        assert_eq!(column, expected);
        assert_eq!(frames[1].direction, FrameDirection::Outgoing);
        assert_eq!(frames[2].direction, FrameDirection::Incoming);
        assert!(frames[2].truncated && frames[3].truncated);
        assert_eq!(frames[3].bytes, ethercat(4, 64));
        assert_eq!(end.frames, 7);
    }
}

/// Gives one byte at a time, as a pipe may.
struct Dribble(std::io::Cursor<Vec<u8>>);

impl std::io::Read for Dribble {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let len = buffer.len().min(1);
        self.0.read(&mut buffer[..len])
    }
}

#[test]
fn a_source_that_gives_one_byte_at_a_time_gives_the_same_frames() {
    let m = BOTH[0];
    let mut pcapng = [m.section(), m.interface(1, 0, &[])].concat();
    let mut pcap = m.pcap_header(0xA1B2_C3D4, 0, 1);
    for seed in 0..5 {
        let flags = m.option(2, &m.u32(1));
        pcapng.extend(m.packet(0, seed.into(), 60, &ethercat(seed, 60), &[flags]));
        pcap.extend(m.pcap_frame(seed.into(), 0, 60, &ethercat(seed, 60)));
    }
    for file in [pcapng, pcap] {
        let source = Dribble(std::io::Cursor::new(file.clone()));
        let dribbled = drain(CaptureReader::from_source("pipe", source).unwrap());
        assert_eq!(dribbled, read(&file).unwrap());
        assert_eq!(dribbled.0.len(), 5);
    }
}

/// Some writers do not count the padding into the length of a block, and Wireshark takes it so.
#[test]
fn a_block_length_that_leaves_out_the_padding_is_taken() {
    for maker in BOTH {
        let mut file = [maker.section(), maker.interface(1, 0, &[])].concat();
        for seed in 0..4 {
            let bytes = ethercat(seed, 61 + usize::from(seed));
            let padded = maker.packet(0, seed.into(), bytes.len() as u32, &bytes, &[]);
            let len = maker.u32(32 + bytes.len() as u32);
            let last = padded.len() - 4;
            file.extend([&padded[..4], &len, &padded[8..last], &len].concat());
        }
        let (frames, end) = read(&file).unwrap();
        assert!(end.complete(), "{end}");
        assert_eq!(end.offset, file.len() as u64);
        let lengths: Vec<_> = frames.iter().map(|frame| frame.bytes.len()).collect();
        assert_eq!(lengths, [61, 62, 63, 64]);
        assert!((0..).zip(&frames).all(|(seed, frame)| frame.bytes[11] == seed));

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("unpadded.pcapng");
        std::fs::write(&path, &file).unwrap();
        let Some((lines, complaints)) = tshark(&path, &["frame.len"]) else { return };
        assert_eq!((lines.len(), complaints.as_str()), (4, ""));
    }
}

#[test]
fn a_check_sequence_is_checked_and_taken_off() {
    let m = BOTH[0];
    let good = {
        let mut frame = ethercat(1, 60);
        frame.extend(crc32fast::hash(&frame).to_le_bytes());
        frame
    };
    let mut bad = good.clone();
    bad[20] ^= 1;
    let fcs_flag = m.option(2, &m.u32(4 << 5));
    let crc_error = m.option(2, &m.u32(1 << 24));
    for length_option in [4, 32] {
        let mut file = m.section();
        file.extend(m.interface(1, 0, &[m.option(13, &[length_option])]));
        file.extend(m.interface(1, 0, &[]));
        file.extend(m.packet(0, 0, 64, &good, &[]));
        file.extend(m.packet(0, 0, 64, &bad, &[]));
        file.extend(m.packet(1, 0, 64, &good, std::slice::from_ref(&fcs_flag)));
        file.extend(m.packet(1, 0, 60, &good[..60], std::slice::from_ref(&crc_error)));
        // Cut inside the check sequence, and before it.
        file.extend(m.packet(0, 0, 64, &good[..62], &[]));
        file.extend(m.packet(0, 0, 64, &good[..50], &[]));
        let (frames, _) = read(&file).unwrap();
        let column: Vec<_> = frames.iter().map(|f| (f.fcs, f.bytes.len(), f.truncated)).collect();
        let expected = [
            (Some(true), 60, false),
            (Some(false), 60, false),
            (Some(true), 60, false),
            (Some(false), 60, false),
            (None, 60, true),
            (None, 50, true),
        ];
        assert_eq!(column, expected);
    }
    // The pcap header has a place for it too: bit 26, and the length in units of 16 bits.
    let mut file = m.pcap_header(0xA1B2_C3D4, 0, 1 | 1 << 26 | 2 << 28);
    file.extend(m.pcap_frame(0, 0, 64, &good));
    let (frames, _) = read(&file).unwrap();
    assert_eq!((frames[0].fcs, frames[0].bytes.len()), (Some(true), 60));
}

#[test]
fn cooked_frames_are_rebuilt_and_other_link_types_counted() {
    let m = BOTH[0];
    let payload = &ethercat(1, 60)[14..];
    let sll = [&[0, 4, 0, 1, 0, 6, 2, 1, 5, 0x10, 0x11, 0x12, 0, 0, 0x88, 0xA4], payload].concat();
    let not_ethernet = [&[0, 0, 0, 1, 0, 6, 2, 1, 5, 0x10, 0x11, 0x12, 0, 0, 0, 4], payload];
    let head2 = [0x88, 0xA4, 0, 0, 0, 0, 0, 9, 0, 1, 1, 6, 0, 1, 2, 3, 4, 5, 0, 0];
    let sll2 = [&head2, payload].concat();
    let mut file = m.section();
    for link_type in [113, 276, 105, 1] {
        file.extend(m.interface(link_type, 0, &[]));
    }
    file.extend(m.packet(0, 0, sll.len() as u32, &sll, &[]));
    file.extend(m.packet(2, 0, 60, &[0; 60], &[]));
    file.extend(m.packet(1, 0, sll2.len() as u32, &sll2, &[]));
    file.extend(m.packet(2, 0, 60, &[0; 60], &[]));
    file.extend(m.packet(0, 0, 62, &not_ethernet.concat(), &[]));
    file.extend(m.packet(3, 0, 60, &ethercat(9, 60), &[]));

    let mut reader = CaptureReader::from_source("memory", std::io::Cursor::new(file)).unwrap();
    let frame = reader.next_frame().unwrap();
    assert_eq!(frame.link_type, LinkType::LinuxCooked);
    assert_eq!(frame.direction, FrameDirection::Outgoing);
    assert_eq!(frame.bytes[..14], [255, 255, 255, 255, 255, 255, 2, 1, 5, 16, 17, 18, 0x88, 0xA4]);
    assert_eq!(frame.bytes[14..], *payload);
    let frame = reader.next_frame().unwrap();
    assert_eq!((frame.number.0, frame.host_interface), (3, Some(9)));
    assert_eq!(frame.bytes[6..12], [0, 1, 2, 3, 4, 5]);
    assert_eq!(reader.next_frame().unwrap().number.0, 6);
    assert!(reader.next_frame().is_none());
    let skipped = [
        SkippedLinkType { link_type: LinkType::Other(105), frames: 2 },
        SkippedLinkType { link_type: LinkType::LinuxCooked, frames: 1 },
    ];
    assert_eq!(reader.skipped(), skipped);
}

/// A capture of several blocks of zstd, 128 KiB each, that does not shrink to nothing.
fn long_capture() -> Vec<u8> {
    let m = BOTH[0];
    let mut file = m.pcap_header(0xA1B2_C3D4, 0, 1);
    for seed in 0..2_400_u32 {
        let noise = |(i, byte): (u32, &u8)| {
            byte ^ (seed * 200 + i).wrapping_mul(2_654_435_761).to_be_bytes()[1]
        };
        let bytes: Vec<u8> = (0..).zip(&ethercat(seed as u8, 200)).map(noise).collect();
        file.extend(m.pcap_frame(seed, 0, 200, &bytes));
    }
    file
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn xz(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = liblzma::write::XzEncoder::new(Vec::new(), 1);
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn zst(bytes: &[u8]) -> Vec<u8> {
    zstd::encode_all(bytes, 3).unwrap()
}

#[test]
fn packed_captures_are_known_by_their_bytes_and_damage_ends_them() {
    let file = long_capture();
    let (plain, _) = read(&file).unwrap();
    type Pack = fn(&[u8]) -> Vec<u8>;
    let packers: [(&str, Pack); 3] = [("gzip", gzip), ("xz", xz), ("zstd", zst)];
    for (name, pack) in packers {
        let whole = pack(&file);
        let (packed, end) = read(&whole).unwrap();
        assert_eq!(packed, plain, "{name}");
        assert!(end.complete(), "{name}: {end}");
        assert_eq!(end.offset, file.len() as u64, "{name}: counts what was unpacked");

        // Two parts, as `cat a.gz b.gz` makes them.
        let parts = [pack(&file[..1000]), pack(&file[1000..])].concat();
        assert_eq!(read(&parts).unwrap().0, plain, "{name}");

        // Most of what comes before a cut is there.
        for cut in [1, whole.len() / 3] {
            let (some, end) = read(&whole[..whole.len() - cut]).unwrap();
            assert!(!end.complete(), "{name}, {cut} bytes cut off");
            assert_eq!(some[..], plain[..some.len()], "{name}, {cut} bytes cut off");
            assert!(some.len() > 600, "{name}, {cut} bytes cut off: {} frames", some.len());
        }
        let mut damaged = whole.clone();
        let middle = damaged.len() * 2 / 3;
        damaged[middle] ^= 0x55;
        damaged.truncate(middle + 20);
        let (some, end) = read(&damaged).unwrap();
        assert!(!end.complete() && !some.is_empty(), "{name}: {end}");
        for (other, again) in packers {
            let twice = read(&again(&whole)).unwrap_err();
            assert!(twice.to_string().contains("compressed twice"), "{name}, {other}: {twice}");
        }
    }
}

#[test]
fn a_packed_file_that_asks_for_much_memory_is_refused() {
    // A dictionary of 1.5 GiB, and a window of 1 GiB.
    let mut greedy = xz(&long_capture());
    // Block header: size, flags, filter 0x21, one byte of properties, then padding and CRC32.
    assert_eq!(greedy[14..16], [0x21, 0x01]);
    greedy[16] = 39;
    let crc = crc32fast::hash(&greedy[12..20]).to_le_bytes();
    greedy[20..24].copy_from_slice(&crc);
    let error = read(&greedy).unwrap_err();
    assert!(error.to_string().contains("reading failed"), "{error}");
    let error = read(b"\x28\xB5\x2F\xFD\x00\xA0rest of a frame").unwrap_err();
    assert!(error.to_string().contains("reading failed"), "{error}");
}

#[test]
fn the_run_begins_with_the_earliest_of_the_first_frames() {
    let m = BOTH[0];
    let mut file = m.section();
    file.extend(m.interface(1, 0, &[]));
    file.extend(m.interface(1, 0, &[]));
    for (interface, micros) in [(0, 5_000), (0, 6_000), (1, 4_000), (0, 3_000)] {
        file.extend(m.packet(interface, micros, 60, &ethercat(1, 60), &[]));
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two-cards.pcapng");
    std::fs::write(&path, &file).unwrap();

    let mut clock = RunClock::for_file(&path).unwrap();
    assert_eq!(clock.origin().unwrap().as_nanos(), 4_000_000);
    let mut reader = CaptureReader::open(&path).unwrap();
    let mut at = Vec::new();
    while let Some(frame) = reader.next_frame() {
        at.push(clock.place(frame.interface, frame.time).at.as_nanos());
    }
    assert_eq!(at, [1_000_000, 2_000_000, 0, 0]);
    assert_eq!(clock.backward().0, 2);
    assert_eq!(drain(reader).0.len(), 0);
}
