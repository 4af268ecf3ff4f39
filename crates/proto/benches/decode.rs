//! Time to decode a datagram: header, data and working counter, in frames of one and of fifteen
//! datagrams.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use linesman_proto::address::LogicalAddress;
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{FrameBuilder, FrameView};

fn frame(datagrams: u32, len: usize) -> Vec<u8> {
    let mut bytes = vec![0; 1_514];
    let mut builder = FrameBuilder::new(&mut bytes, MacAddress::default());
    for index in 0..datagrams {
        let address = DatagramAddress::Logical(LogicalAddress(0x0100_0000 + 64 * index));
        builder.push(Command::Lrw, index as u8, address, len).expect("the data fit").fill(0x5A);
    }
    let len = builder.finish();
    bytes.truncate(len);
    bytes
}

/// Everything that there is to know of a frame, so that nothing can be left out.
fn decode(frame: &[u8]) -> u32 {
    let view = FrameView::parse(black_box(frame)).expect("the frame is whole");
    let datagrams = view.datagrams().filter_map(Result::ok);
    datagrams.fold(0, |sum, datagram| {
        let head = u32::from(datagram.code()) + u32::from(datagram.index()) + datagram.logical().0;
        let data: u32 = datagram.data().first().copied().map_or(0, u32::from);
        sum.wrapping_add(head + data + u32::from(datagram.wkc().0))
    })
}

fn benchmark(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("decode");
    for (count, len) in [(1, 64), (15, 64)] {
        let frame = frame(count, len);
        group.throughput(Throughput::Elements(u64::from(count)));
        group.bench_function(format!("{count} datagrams"), |bencher| {
            bencher.iter(|| black_box(decode(&frame)));
        });
    }
    group.finish();
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
