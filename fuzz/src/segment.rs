//! Frames from anywhere into a virtual segment.

use linesman_proto::address::Path;
use linesman_proto::ethernet::MIN_LEN;
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

use crate::series::series;

/// One coupler, terminals, and a junction with something behind it.
const LINE: &str = r#"
name = "fuzz"
seed = 1
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "I1"
type = "EL1008"
on = "K1.B"
[[device]]
name = "O1"
type = "EL2008"
on = "I1.B"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
"#;

/// Whatever a MainDevice sends, an undisturbed segment gives every frame back at most once, in full
/// length and intact, and moves no counter without a cause.
pub fn segment(data: &[u8]) {
    let file = SegmentFile::parse(LINE).expect("the line is well described");
    let mut segment = Segment::build(&file).expect("the line can be built");
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
