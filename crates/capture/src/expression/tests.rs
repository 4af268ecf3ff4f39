//! Expressions on frames made by hand; `tests/command_line/capture_filter.rs` of the command line compares with tshark.

use linesman_diagnosis::Direction;
use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::time::Instant;
use proptest::prelude::*;

use super::Expression;
use crate::knowledge::FindingTimes;
use crate::row::{CaptureFrame, CaptureRow};

/// A frame with FPRD of AL status, working counter 0, and LRW at 0x10000, working counter 3.
fn bytes() -> Vec<u8> {
    let mut buffer = [0; 1514];
    let mut builder = FrameBuilder::new(&mut buffer, MacAddress([2, 0, 0, 0, 0, 1]));
    let status = DatagramAddress::Physical(0x1001, RegisterAddress(0x0130));
    builder.push(Command::Fprd, 7, status, 2).unwrap();
    let logical = DatagramAddress::Logical(LogicalAddress(0x10000));
    builder.push(Command::Lrw, 8, logical, 4).unwrap();
    let len = builder.finish();
    let mut frame = buffer[..len].to_vec();
    let counter = 14 + 2 + 14 + 10 + 4;
    frame[counter] = 3;
    frame
}

fn recorded(bytes: &[u8]) -> CaptureFrame<'_> {
    CaptureFrame {
        number: 12,
        time: Instant::from_nanos(1_500_000_000),
        date_ns: None,
        since_previous_ns: -3,
        interface: 0,
        direction: Direction::Unknown,
        captured_len: bytes.len() as u32,
        original_len: bytes.len() as u32,
        truncated: false,
        fcs: None,
        probe: None,
        bytes,
    }
}

fn holds(text: &str) -> bool {
    let bytes = bytes();
    let row = CaptureRow::of(recorded(&bytes));
    Expression::parse(text).unwrap_or_else(|error| panic!("{text}: {error}")).matches(&row, None)
}

// proves: WS-09
#[test]
fn operators_mean_what_they_mean_in_wireshark() {
    for (text, expected) in [
        ("ecat.cmd == 4 && ecat.cnt == 3", true),
        ("datagram(ecat.cmd == 4 && ecat.cnt == 3)", false),
        ("datagram(ecat.cmd == 12 && ecat.cnt == 3)", true),
        ("ecat.cmd != 4", false),
        ("any ecat.cmd != 4", true),
        ("all ecat.cmd in {4, 12}", true),
        ("ecat.cmd === 4", false),
        ("ecat.cmd !== 4", true),
        ("ecat.cnt > 3", false),
        ("3 <= ecat.cnt", true),
        ("ecat.cnt & 2", true),
        ("ecat.cnt & 2 == 0", true),
        ("ecat.cnt & 4", false),
        ("cyclic ^^ ecat_mailbox", true),
        ("cyclic xor ecat", false),
        ("ecat_mailbox or not ecat_mailbox and cyclic", true),
        ("!(cyclic || ecat_mailbox)", false),
        ("not not cyclic", true),
        ("register == 0x0131", true),
        ("register in {0x0132..0x0140}", false),
        ("ecat.lad == 65536", true),
        ("ecat.sub2.lad", true),
        ("ecat.sub1.lad", false),
        ("frame.time_relative == 1500ms", true),
        ("frame.time_relative > 1.5", false),
        ("frame.time_delta == -3ns", true),
        ("esl || vlan || udp || fcs.wrong", false),
        ("subdevice == 1", false),
    ] {
        assert_eq!(holds(text), expected, "{text}");
    }
}

#[test]
fn nesting_is_bounded() {
    let deep = format!("{}frame{}", "(".repeat(1000), ")".repeat(1000));
    assert!(Expression::parse(&deep).is_err());
    assert!(Expression::parse(&"!".repeat(100_000)).is_err());
    let wide = vec!["frame"; 10_000].join(" && ");
    assert!(holds(&wide), "many conditions side by side are no nesting");
}

#[test]
fn around_a_finding_picks_the_time_before_and_after() {
    let bytes = bytes();
    let row = CaptureRow::of(recorded(&bytes));
    let finding = |at_ms: u64| FindingTimes {
        id: "F1".to_owned(),
        code: "H110".to_owned(),
        name: "frame errors".to_owned(),
        times: vec![Instant::from_nanos(at_ms * 1_000_000)],
    };
    let is_near = |text: &str, at_ms: u64| {
        let mut expression = Expression::parse(text).unwrap();
        assert!(expression.needs().whole);
        expression
            .resolve(|_| Ok(Vec::new()), &[finding(at_ms)])
            .map(|()| expression.matches(&row, None))
    };
    assert_eq!(is_near("around(F1, 10ms)", 1_491), Ok(true));
    assert_eq!(is_near("around(h110, 10ms)", 1_509), Ok(true));
    assert_eq!(is_near("around(any, 10ms)", 1_511), Ok(false));
    assert_eq!(is_near("around('frame errors', 0.02)", 1_511), Ok(true));
    let missing = is_near("cyclic && around(F2, 1s)", 1_500).unwrap_err();
    assert_eq!(missing.at, 17..19);
    assert!(missing.next_step.contains("F1 (H110 frame errors)"));
}

#[test]
fn error_points_at_its_place() {
    let error = Expression::parse("ecat.cnt == \"ä\" && ecat.nix").unwrap_err();
    assert_eq!(error.at, 12..16);
    assert_eq!(
        error.pointer("ecat.cnt == \"ä\" && ecat.nix"),
        "  ecat.cnt == \"ä\" && ecat.nix\n              ^^^"
    );
}

proptest! {
    #[test]
    fn any_text_is_parsed_without_panic(text in "\\PC{0,60}") {
        let bytes = bytes();
        let row = CaptureRow::of(recorded(&bytes));
        match Expression::parse(&text) {
            Ok(expression) => assert!([true, false].contains(&expression.matches(&row, None))),
            Err(error) => drop(error.pointer(&text)),
        }
    }

    #[test]
    fn any_words_are_parsed_without_panic(
        words in prop::collection::vec(prop::sample::select(vec![
            "ecat.cmd", "==", "!", "(", ")", "{", "}", ",", "..", "4", "\"LRW\"", "in", "not", "and",
            "||", "xor", "&", "datagram", "around", "any", "all", "subdevice", "frame", "5ms",
        ]), 0..30)
    ) {
        let bytes = bytes();
        let row = CaptureRow::of(recorded(&bytes));
        if let Ok(expression) = Expression::parse(&words.join(" ")) {
            let _ = expression.matches(&row, None);
        }
    }
}
