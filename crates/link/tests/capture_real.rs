//! Captures of real hardware: as many frames, and the same frames, as tshark finds.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod support;

use linesman_link::capture::CaptureReader;
use linesman_proto::frame::FrameView;
use support::{drain, real_captures, tshark};

/// Frames of each capture, in the order of `ls`, as tshark counts them.
const COUNTS: [(&str, usize); 17] = [
    ("ec-replay-ek1100-alias-address", 1300),
    ("ec-replay-ek1100-el2828-el2889", 3578),
    ("ec-replay-ek1914-el3004-configure", 1104),
    ("ec-replay-ek1914-el3004-mailbox", 994),
    ("ec-replay-ek1914-segmented-upload", 964),
    ("ec-rs-detect-slaves-ek1100-el1004", 2),
    ("ec-soem-sdinfo-ek1100-el1004", 580),
    ("ec-soem-sdinfo-ek1100-only", 188),
    ("ec-soem-sdinfo-no-slaves", 19),
    ("ec-soem-single-lan9252", 998),
    ("ec-twincat-run-ek1100-el1004", 553),
    ("ec-twincat-scan-devices-2", 10),
    ("echist-no-reborrow-202307", 5700),
    ("echist-replay-el2828-el2889-202405", 19964),
    ("echist-replay-mailbox-el3004", 1792),
    ("echist-replay-no-complete-access-202308", 3992),
    ("echist-replay-segmented-upload-202401", 624),
];

#[test]
fn every_real_capture_has_the_frames_that_tshark_counts() {
    let Some(folder) = real_captures() else { return };
    for (name, count) in COUNTS {
        let path = folder.join(format!("{name}.pcapng"));
        let (frames, end) = drain(CaptureReader::open(&path).unwrap());
        assert_eq!(frames.len(), count, "{name}");
        assert!(end.complete(), "{name}: {end}");
        assert_eq!(end.offset, std::fs::metadata(&path).unwrap().len(), "{name}");
        // The other frame there is of type 7, in UDP: EtherCAT without datagrams.
        let ethercat = frames.iter().filter(|frame| FrameView::parse(&frame.bytes).is_ok());
        let expected = if name == "ec-twincat-scan-devices-2" { 9 } else { count };
        assert_eq!(ethercat.count(), expected, "{name}: frames with datagrams");
    }
}

#[test]
fn number_time_length_and_interface_are_those_of_tshark() {
    let Some(folder) = real_captures() else { return };
    for (name, _) in COUNTS {
        let path = folder.join(format!("{name}.pcapng"));
        let fields =
            ["frame.number", "frame.time_epoch", "frame.len", "frame.interface_id", "eth.src"];
        let Some((lines, _)) = tshark(&path, &fields) else { return };
        let (frames, _) = drain(CaptureReader::open(&path).unwrap());
        assert_eq!(lines.len(), frames.len(), "{name}");
        for (line, frame) in lines.iter().zip(&frames) {
            let nanos = frame.nanos.unwrap();
            let time = format!("{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000);
            let source = linesman_proto::ethernet::source(&frame.bytes).unwrap();
            let ours = [
                frame.number.to_string(),
                time,
                frame.original_len.to_string(),
                frame.interface.to_string(),
                source.to_string(),
            ];
            assert_eq!(line[..], ours, "{name}, frame {}", frame.number);
        }
    }
}
