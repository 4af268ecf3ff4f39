//! Conditions of a recording: which frames are written, and which one ends it.

use linesman_capture::expression::Expression;
use linesman_capture::knowledge::Knowledge;
use linesman_capture::row::{CaptureFrame, CaptureRow};
use linesman_diagnosis::{FrameSeen, InputKind, Setup};
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

use crate::failure::Failure;

/// Conditions on the frames of a recording.
pub(super) struct RecordConditions {
    /// Frames that are written; all without it.
    only: Option<Expression>,
    /// The frame that ends the recording.
    until: Option<Expression>,
    /// Knowledge of the frames before, where a condition asks for it.
    knowledge: Option<Box<Knowledge>>,
    /// The date of the run's time 0.
    start: UnixTime,
    /// When the frame before was seen.
    before: Option<Instant>,
}

/// Fate of a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct FrameDecision {
    /// It is written.
    pub(super) is_written: bool,
    /// It is one that the recording waits for.
    pub(super) is_awaited: bool,
}

impl RecordConditions {
    /// Takes conditions as somebody has written them.
    pub(super) fn parse(
        only: Option<&str>,
        until: Option<&str>,
        start: UnixTime,
    ) -> Result<Self, Failure> {
        let parse = |option: &str, text: Option<&str>| -> Result<Option<Expression>, Failure> {
            text.map(|text| condition(option, text)).transpose()
        };
        let (only, until) = (parse("--only", only)?, parse("--until", until)?);
        let mut both = only.iter().chain(&until);
        let knowledge = both.any(|one| one.needs().facts).then(|| {
            let clock = "host, monotonic".to_owned();
            Box::new(Knowledge::new(Setup {
                input: InputKind::Listened,
                clock,
                ..Setup::default()
            }))
        });
        Ok(Self { only, until, knowledge, start, before: None })
    }

    /// Judges a frame.
    pub(super) fn judge(&mut self, frame: &FrameSeen<'_>) -> FrameDecision {
        if self.only.is_none() && self.until.is_none() {
            return FrameDecision { is_written: true, is_awaited: false };
        }
        let since = self.before.map_or(Span::ZERO, |before| frame.time.since(before));
        self.before = Some(frame.time);
        let len = frame.bytes.len() as u32;
        let mut row = CaptureRow::of(CaptureFrame {
            number: frame.number,
            time: frame.time,
            date_ns: Some((self.start + frame.time.since(Instant::ZERO)).as_nanos()),
            since_previous_ns: i128::from(since.as_nanos()),
            interface: u32::from(frame.path == Some(Path::B)),
            direction: frame.direction,
            captured_len: len,
            original_len: len,
            truncated: frame.truncated,
            fcs: frame.fcs,
            probe: frame.probe,
            bytes: frame.bytes,
        });
        if let Some(knowledge) = &mut self.knowledge {
            knowledge.annotate(frame, &mut row);
        }
        FrameDecision {
            is_written: self.only.as_ref().is_none_or(|only| only.matches(&row, None)),
            is_awaited: self.until.as_ref().is_some_and(|until| until.matches(&row, None)),
        }
    }
}

/// A condition that can be judged while frames come.
fn condition(option: &str, text: &str) -> Result<Expression, Failure> {
    let expression = Expression::parse(text).map_err(|error| {
        let (column, reason) = (error.at.start + 1, &error.reason);
        let pointer = error.pointer(text);
        Failure::new(format!("{option}, column {column}: {reason}\n{pointer}"), error.next_step)
    })?;
    if expression.needs().whole {
        return Err(Failure::new(
            format!("{option} `{text}`: SubDevices and findings are known at the end alone"),
            "name a SubDevice by its address (`ecat.adp == 0x1003`); --until-finding waits for a finding",
        ));
    }
    Ok(expression)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use linesman_diagnosis::observe::Direction;
    use linesman_link::capture::CaptureReader;
    use linesman_proto::address::{LogicalAddress, Network, RegisterAddress};
    use linesman_proto::command::Command;
    use linesman_proto::ethernet::MacAddress;
    use linesman_proto::frame::FrameBuilder;
    use linesman_proto::frame::builder::DatagramAddress;
    use linesman_runtime::ring_recorder::{RingLimits, RingRecorder};
    use tempfile::TempDir;

    use super::*;

    const START: UnixTime = UnixTime::from_nanos(1_700_000_000_000_000_000);

    /// Process data, or the states of all, that came back with a working counter.
    fn frame(is_process_data: bool, wkc: u16) -> Vec<u8> {
        let (command, address) = match is_process_data {
            true => (Command::Lrw, DatagramAddress::Logical(LogicalAddress(0x0100_0000))),
            false => (Command::Brd, DatagramAddress::Physical(0, RegisterAddress(0x0130))),
        };
        let mut bytes = vec![0; 128];
        let mut builder = FrameBuilder::new(&mut bytes, MacAddress::default());
        builder.push(command, 1, address, 2).unwrap();
        let len = builder.finish();
        bytes.truncate(len);
        // Behind the headers and two bytes of data.
        bytes[28..30].copy_from_slice(&wkc.to_le_bytes());
        bytes
    }

    fn seen(number: u64, at: Instant, bytes: &[u8]) -> FrameSeen<'_> {
        FrameSeen {
            network: Network::default(),
            path: Some(Path::A),
            direction: Direction::Received,
            time: at,
            number,
            fcs: None,
            truncated: false,
            probe: None,
            bytes,
        }
    }

    // proves: WS-12 (U)
    #[test]
    fn ring_holds_the_last_minutes_and_of_them_the_frames_that_meet_a_condition() {
        let folder = TempDir::new().unwrap();
        let limits = RingLimits { bytes: u64::MAX, lasts: Span::s(60), files: 3 };
        let base = folder.path().join("night.pcapng");
        let mut ring = RingRecorder::new(&base, "test", START, &["eth0".to_owned()], limits);
        let only = Some("ecat.cmd == \"LRW\" && ecat.cnt < 3");
        let mut conditions = RecordConditions::parse(only, None, START).unwrap();
        let (mut number, end_s) = (0, 10 * 60);
        // Two frames a second for ten minutes; of the process data each fourth has a wrong counter.
        for second in 0..end_s {
            let at = Instant::from_nanos(second * 1_000_000_000);
            let wkc = if second % 4 == 0 { 2 } else { 3 };
            for bytes in [frame(true, wkc), frame(false, 2)] {
                number += 1;
                let shown = seen(number, at, &bytes);
                if conditions.judge(&shown).is_written {
                    ring.frame(&shown);
                }
            }
        }
        assert_eq!(ring.removed(), 7);
        let files: Vec<PathBuf> = ring.files().into_iter().map(ToOwned::to_owned).collect();
        ring.finish(Instant::from_nanos(end_s * 1_000_000_000)).unwrap();
        let (mut kept, wrong) = (Vec::new(), frame(true, 2));
        for file in files {
            let mut reader = CaptureReader::open(file).unwrap();
            while let Some(frame) = reader.next_frame() {
                assert_eq!(frame.bytes, wrong, "others are left out");
                let since = frame.time.unwrap().since(START).unwrap();
                kept.push(since.as_nanos() / 1_000_000_000);
            }
        }
        // The last three minutes, each fourth second of them.
        let expected: Vec<u64> = (420..600).step_by(4).collect();
        assert_eq!(kept, expected);
    }

    #[test]
    fn frame_that_is_waited_for_is_known_when_it_comes() {
        let mut conditions =
            RecordConditions::parse(None, Some("ecat.cmd == \"BRD\" && ecat.cnt == 0"), START)
                .unwrap();
        let is_awaited = |conditions: &mut RecordConditions, bytes: &[u8]| {
            let decision = conditions.judge(&seen(1, Instant::ZERO, bytes));
            assert!(decision.is_written, "what is waited for decides nothing else");
            decision.is_awaited
        };
        assert!(!is_awaited(&mut conditions, &frame(false, 1)));
        assert!(!is_awaited(&mut conditions, &frame(true, 0)));
        assert!(is_awaited(&mut conditions, &frame(false, 0)));
    }

    #[test]
    fn condition_that_needs_the_whole_capture_is_refused() {
        for text in ["subdevice == \"K1\"", "around(F1, 5ms)"] {
            let Err(failure) = RecordConditions::parse(None, Some(text), START) else {
                panic!("{text} was taken");
            };
            assert!(failure.reason.contains("known at the end alone"), "{}", failure.reason);
        }
        let Err(failure) = RecordConditions::parse(Some("ecat.cnt = (3"), None, START) else {
            panic!("it was taken");
        };
        assert!(failure.reason.starts_with("--only, column"), "{}", failure.reason);
    }
}
