//! Segment files: read, written, built, started.

use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;

use crate::frame::broadcast_read;

/// Any text may be given. What reads is written as what reads the same; what can be built carries a
/// frame, and no counter moves without a cause.
pub fn segment_file(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(file) = SegmentFile::parse(text) else { return };
    let written = file.to_toml();
    let again = SegmentFile::parse(&written).expect("what we write can be read");
    assert_eq!(again.to_toml(), written);
    let _ = file.project().expect("what was checked has a project");
    let Ok(mut segment) = Segment::build(&file) else { return };
    let mut buffer = Vec::new();
    let mut now = Instant::ZERO;
    for _ in 0..3 {
        now += Span::ms(1);
        segment.handle_frame(now, Path::A, &broadcast_read());
        now += Span::ms(1);
        segment.advance(now);
        while segment.poll_arrival(&mut buffer).is_some() {}
    }
    let unexplained = segment.audit();
    assert!(unexplained.is_empty(), "{unexplained:?}");
}
