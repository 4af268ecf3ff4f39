//! Frames from anywhere into a virtual segment.

use linesman_config::attachment::Attachment;
use linesman_proto::address::Path;
use linesman_proto::ethernet::MIN_LEN;
use linesman_proto::frame::FrameView;
use linesman_proto::port::Port;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{SegmentDevice, SegmentFile};

use crate::series::series;

/// One coupler, terminals, and a junction with something behind it.
fn line() -> SegmentFile {
    let row = [("K1", "EK1100"), ("I1", "EL1008"), ("O1", "EL2008")];
    let mut file = SegmentFile::in_a_row("fuzz", 1, &row);
    let on = Attachment::Device { name: "K1".to_owned(), port: Port::C };
    file.devices.push(SegmentDevice::new("K2", "EK1100", on));
    file
}

/// Whatever a MainDevice sends, an undisturbed segment gives every frame back at most once, in full
/// length and intact, and moves no counter without a cause.
pub fn segment(data: &[u8]) {
    let mut segment = Segment::build(&line()).expect("the line can be built");
    let mut now = Instant::ZERO + Span::ms(1);
    let mut buffer = Vec::new();
    let mut sent = Vec::new();
    let mut wire_time = Span::ZERO;
    let mut broken = false;
    for item in series(data) {
        // A card sends one frame after the other.
        now += Span::us(item.pause_us) + wire_time;
        segment.handle_frame(now, Path::A, item.bytes);
        // A frame that ends within a datagram is marked as bad by the first controller.
        broken |= FrameView::parse(item.bytes)
            .is_ok_and(|view| view.datagrams().any(|datagram| datagram.is_err()));
        let len = item.bytes.len().max(MIN_LEN);
        wire_time = Span::ns((len as u64 + 24) * 80);
        sent.push(len);
    }
    segment.advance(now + Span::ms(10));
    // What is too long never leaves the card. What is not EtherCAT may be destroyed by a segment,
    // and so may what has gone round once.
    let mut back = 0;
    while let Some(arrival) = segment.poll_arrival(&mut buffer) {
        assert!(arrival.intact || broken, "an undisturbed line damages nothing");
        assert!(
            sent.contains(&buffer.len()),
            "a frame of {} bytes came from nowhere",
            buffer.len()
        );
        back += 1;
    }
    assert!(back <= sent.len(), "{back} frames came back of {}", sent.len());
    let unexplained = segment.audit();
    assert!(unexplained.is_empty(), "{unexplained:?}");
}
