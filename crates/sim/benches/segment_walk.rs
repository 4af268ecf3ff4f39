//! Time that a frame takes through a whole segment: controller visits per second.
//!
//! A plant of 60 controllers; throughput is counted in controllers passed (each once, both ways).

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use linesman_proto::address::{LogicalAddress, Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register as r;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::Seed;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{FaultEntry, PlantOptions, plant};

fn frame(command: Command, address: DatagramAddress, len: usize) -> Vec<u8> {
    let mut bytes = vec![0; 1_514];
    let mut builder = FrameBuilder::new(&mut bytes, MacAddress::default());
    builder.push(command, 0, address, len).expect("the data fit").fill(0);
    let len = builder.finish();
    bytes.truncate(len);
    bytes
}

fn segment(noisy: bool) -> Segment {
    let options = PlantOptions { min_devices: 60, max_devices: 60, ..PlantOptions::default() };
    let mut file = plant(Seed(1), &options);
    if noisy {
        let link = format!("maindevice-{}.A", file.devices[0].name);
        let noise = FaultEntry::new(linesman_config::fault::FaultName::EmcNoise).at(link);
        file.faults.push(noise.with("hits_per_s", 1_000.0));
    }
    Segment::build(&file).expect("a plant can be built")
}

fn segment_walk(criterion: &mut Criterion) {
    let status = DatagramAddress::Physical(0, RegisterAddress(r::AL_STATUS.address.0));
    let cyclic = DatagramAddress::Logical(LogicalAddress(0x1000));
    let mut group = criterion.benchmark_group("segment walk");
    group.throughput(Throughput::Elements(60));
    for (name, noisy, frame) in [
        ("BRD", false, frame(Command::Brd, status, 2)),
        ("LRW, 200 bytes", false, frame(Command::Lrw, cyclic, 200)),
        ("BRD, noise", true, frame(Command::Brd, status, 2)),
    ] {
        let mut segment = segment(noisy);
        let mut now = Instant::from_nanos(1_000_000);
        let mut buffer = Vec::new();
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                segment.handle_frame(now, Path::A, &frame);
                now += Span::us(500);
                segment.advance(now);
                black_box(segment.poll_arrival(&mut buffer))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, segment_walk);
criterion_main!(benches);
