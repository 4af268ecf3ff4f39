//! Capture files: pcap and pcapng, plain or packed.

use std::io::Cursor;

use linesman_link::capture::CaptureReader;
use linesman_proto::frame::FrameView;

/// Most frames that are read of one input: packed files can hold far more than their size.
const FRAMES_MAX: u64 = 100_000;

/// Any file may be given. Reading it ends, frames are numbered one by one, and at the end the
/// reader says how it ended.
pub fn capture(data: &[u8]) {
    let Ok(mut reader) = CaptureReader::from_source("fuzz", Cursor::new(data.to_vec())) else {
        return;
    };
    let mut number = 0;
    while let Some(frame) = reader.next_frame() {
        assert!(frame.number.0 > number, "frames are numbered upwards");
        number = frame.number.0;
        if let Ok(view) = FrameView::parse(frame.bytes) {
            let _ = view.datagrams().count();
        }
        if number > FRAMES_MAX {
            return;
        }
    }
    assert!(reader.end().is_some(), "the end is described");
    assert!(reader.next_frame().is_none(), "the end is the end");
}
