//! Frames a second that the capture reader delivers: small frames, the hardest case.
//!
//! `cargo bench -p linesman-link --features packed-input`. The goal is well over 5 million frames a
//! second, so that reading is a small part of judging a capture 20 times as fast as tshark dissects
//! it (42,000 frames/s).

#![allow(clippy::unwrap_used, reason = "a benchmark that fails may panic")]

use std::hint::black_box;
use std::io::Write as _;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use linesman_link::capture::{
    CaptureInterfaceId, CaptureReader, FrameToWrite, InterfaceToWrite, LinkType, PcapWriter,
    PcapngWriter,
};
use linesman_link::direction::FrameDirection;
use linesman_link::unix_time::UnixTime;

const FRAMES: u64 = 500_000;

fn frames(mut write: impl FnMut(FrameToWrite<'_>)) {
    let mut bytes = [0xFF; 60];
    bytes[12..14].copy_from_slice(&[0x88, 0xA4]);
    for number in 0..FRAMES {
        bytes[16..24].copy_from_slice(&number.to_le_bytes());
        let time = UnixTime::from_nanos(1_700_000_000_000_000_000 + i128::from(number) * 10_000);
        let direction = match number % 2 {
            0 => FrameDirection::Outgoing,
            _ => FrameDirection::Incoming,
        };
        write(FrameToWrite::new(CaptureInterfaceId(0), time, direction, &bytes));
    }
}

fn pcapng(with_flags: bool) -> Vec<u8> {
    let mut writer = PcapngWriter::new(Vec::new(), "bench").unwrap();
    let link_type = LinkType::Ethernet;
    writer.add_interface(&InterfaceToWrite { name: "eth0", description: "", link_type }).unwrap();
    frames(|mut frame| {
        if !with_flags {
            frame.direction = FrameDirection::Unknown;
        }
        writer.write_frame(&frame).unwrap();
    });
    writer.finish().unwrap()
}

fn pcap() -> Vec<u8> {
    let mut writer = PcapWriter::new(Vec::new(), LinkType::Ethernet, false).unwrap();
    frames(|frame| writer.write_frame(&frame).unwrap());
    writer.finish().unwrap()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let level = flate2::Compression::default();
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), level);
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn read(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let mut group = criterion.benchmark_group("capture_read");
    group.throughput(Throughput::Elements(FRAMES)).sample_size(10);
    let files = [
        ("pcap", pcap()),
        ("pcapng", pcapng(false)),
        ("pcapng with flags", pcapng(true)),
        ("pcapng.gz", gzip(&pcapng(true))),
    ];
    for (name, bytes) in files {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut reader = CaptureReader::open(&path).unwrap();
                let mut sum = 0_u64;
                while let Some(frame) = reader.next_frame() {
                    sum = sum.wrapping_add(u64::from(frame.bytes[16]) + frame.number.0);
                }
                assert!(reader.end().unwrap().complete());
                black_box(sum)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, read);
criterion_main!(benches);
