//! Conditions on frames, and records of capture probes, from anywhere.

use linesman_capture::expression::{Expression, FIELDS, FieldReference, like, like_datagrams};
use linesman_capture::row::{CaptureFrame, CaptureRow};
use linesman_diagnosis::Direction;
use linesman_proto::esl::{EslRecord, RECORD_LEN};
use linesman_proto::time::Instant;

/// A condition up to the first line end, then what was captured of a frame. A fault points into the text; a field of the
/// frame becomes a condition that the frame meets; a record that is written is read back.
pub fn capture_filter(data: &[u8]) {
    let end = data.iter().position(|byte| *byte == b'\n').unwrap_or(data.len());
    let text = String::from_utf8_lossy(&data[..end]);
    let captured = data.get(end + 1..).unwrap_or_default();
    let found = EslRecord::find(captured);
    let bytes = found.map_or(captured, |(_, _, frame)| frame);
    let probe = found.map(|(record, ..)| record);
    if let Some((record, _, frame)) = found {
        assert_eq!(frame.len() + RECORD_LEN, captured.len());
        assert_eq!(EslRecord::from_bytes(&record.to_bytes()), Some(record));
    }
    let row = CaptureRow::of(CaptureFrame {
        number: 1,
        time: Instant::ZERO,
        date_ns: None,
        since_previous_ns: 0,
        interface: 0,
        direction: Direction::Unknown,
        captured_len: captured.len() as u32,
        original_len: captured.len() as u32,
        truncated: false,
        fcs: None,
        probe,
        bytes,
    });
    match Expression::parse(&text) {
        Ok(expression) => {
            let is_met = expression.matches(&row, None);
            let negated = Expression::parse(&format!("!({text})"));
            // One bracket more may be one too many.
            assert!(negated.is_err() || negated.is_ok_and(|not| not.matches(&row, None) != is_met));
        }
        Err(error) => assert!(text.get(error.at.clone()).is_some(), "{error}: {text:?}"),
    }
    let all = FIELDS.iter().map(|field| FieldReference { field, datagram: None });
    let conditions = all.filter_map(|reference| like(&row, reference, None));
    for condition in conditions.chain(like_datagrams(&row)) {
        let expression = Expression::parse(&condition);
        assert!(expression.is_ok_and(|one| one.matches(&row, None)), "{condition}");
    }
}
