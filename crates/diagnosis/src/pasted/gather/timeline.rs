//! Times of all blocks on one scale, which ends with the latest text.
//!
//! A log ends shortly before the lists that were printed with it. Of lists of one kind that are there several
//! times, the last is the latest, and each of the others a minute earlier. Logs with different clocks end together.

use std::collections::BTreeMap;

use jiff::SignedDuration;

use super::super::fact::{Block, Format};
use super::super::stamp::Stamp;
use super::ReadTime;
use crate::observation_file::Date;

/// Between the last line of a log and the end, in seconds.
const BEFORE_END_S: f64 = 1.0;
/// Between two lists of one kind, in seconds.
const APART_S: f64 = 60.0;
/// Between two lines of a log without times, in seconds.
const LINE_S: f64 = 0.001;
/// The longest log, in seconds.
const LONGEST_S: f64 = 1e8;
/// Room before the first reading, in seconds.
const ROOM_S: f64 = 60.0;

/// The clocks of a text.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum TextClock {
    Date,
    Uptime,
    Yearless,
}

const fn clock_of(stamp: Stamp) -> TextClock {
    match stamp {
        Stamp::Date(_) => TextClock::Date,
        Stamp::Uptime(_) => TextClock::Uptime,
        Stamp::Yearless(_) => TextClock::Yearless,
    }
}

/// When what of a text was.
#[derive(Clone, Debug)]
pub(super) struct Timeline {
    /// The latest time of each clock.
    last: BTreeMap<TextClock, Stamp>,
    /// The time of each fact of each block. A line without one was written with the one before it.
    stamps: Vec<Vec<Option<Stamp>>>,
    /// What the times of the file are: a date, or seconds.
    end: TimelineEnd,
}

#[derive(Clone, Copy, Debug)]
enum TimelineEnd {
    Date(Date),
    Seconds(f64),
}

impl Timeline {
    pub(super) fn of(blocks: &[Block], assumed: &mut Vec<String>) -> Self {
        let mut last: BTreeMap<TextClock, Stamp> = BTreeMap::new();
        let stamps = blocks.iter().flat_map(|block| &block.facts).filter_map(|fact| fact.stamp);
        for stamp in stamps {
            let latest = last.entry(clock_of(stamp)).or_insert(stamp);
            if stamp.since(*latest).is_some_and(|seconds| seconds > 0.0) {
                *latest = stamp;
            }
        }
        if last.len() > 1 {
            assumed.push(
                "the logs have times of different clocks: assumed that they end together"
                    .to_owned(),
            );
        }
        let of_block = |block: &Block| {
            let mut latest = None;
            let facts = block.facts.iter();
            let stamps = facts.map(|fact| {
                latest = fact.stamp.or(latest);
                latest
            });
            stamps.collect()
        };
        let stamps = blocks.iter().map(of_block).collect();
        let mut line = Self { last, stamps, end: TimelineEnd::Seconds(0.0) };
        let mut longest: f64 = 0.0;
        for (index, block) in blocks.iter().enumerate() {
            for number in 0..block.facts.len() {
                if let ReadTime::Before(seconds) = line.when(blocks, index, number) {
                    longest = longest.max(seconds);
                }
            }
        }
        let shift = SignedDuration::from_secs(1);
        let date = match line.last.get(&TextClock::Date) {
            Some(Stamp::Date(Date(last))) => last.checked_add(shift).ok(),
            Some(_) | None => None,
        };
        line.end = match (date, line.last.get(&TextClock::Uptime)) {
            (Some(date), _) => TimelineEnd::Date(Date(date)),
            (None, Some(Stamp::Uptime(last))) if last + BEFORE_END_S >= longest => {
                TimelineEnd::Seconds(last + BEFORE_END_S)
            }
            (None, _) => TimelineEnd::Seconds(longest + ROOM_S),
        };
        line
    }

    /// When a fact of a block was.
    pub(super) fn when(&self, blocks: &[Block], index: usize, number: usize) -> ReadTime {
        let block = &blocks[index];
        if !block.format.is_log() {
            let later = blocks[index + 1..]
                .iter()
                .filter(|other| is_same(other.format, block.format))
                .count();
            return match later {
                0 => ReadTime::Last,
                later => ReadTime::Before(APART_S * later as f64),
            };
        }
        let since_last = self.stamps[index][number].and_then(|stamp| {
            let last = self.last.get(&clock_of(stamp))?;
            last.since(stamp)
        });
        let seconds = match since_last {
            Some(seconds) => seconds.clamp(0.0, LONGEST_S),
            None => LINE_S * (block.facts.len() - 1 - number) as f64,
        };
        ReadTime::Before(BEFORE_END_S + seconds)
    }

    /// Whether its times are made up: no line has one that says more than its distance from others.
    pub(super) fn is_assumed(&self) -> bool {
        !self.last.contains_key(&TextClock::Date) && !self.last.contains_key(&TextClock::Uptime)
    }

    /// The time as a file gives it.
    pub(super) fn time(&self, when: ReadTime) -> (Option<Date>, Option<f64>) {
        let before = match when {
            ReadTime::Last => 0.0,
            ReadTime::Before(seconds) => seconds,
        };
        match self.end {
            TimelineEnd::Seconds(end) => (None, Some((end - before).max(0.0))),
            TimelineEnd::Date(Date(end)) => {
                let before = SignedDuration::from_nanos((before * 1e9).round() as i64);
                (Some(Date(end.checked_sub(before).unwrap_or(end))), None)
            }
        }
    }
}

/// Whether two formats tell of the same things, so that the later one is a later reading.
fn is_same(one: Format, other: Format) -> bool {
    one == other
}

#[cfg(test)]
mod tests {
    use super::super::super::fact::FactKind;
    use super::*;

    fn log(stamps: &[Option<Stamp>]) -> Block {
        let mut block = Block::new(Format::KernelLog);
        for stamp in stamps {
            block.tell_at(*stamp, FactKind::Added(Box::default()));
        }
        block
    }

    #[test]
    fn uptimes_stay_as_they_are_and_lists_come_after_logs() {
        let mut list = Block::new(Format::Online);
        list.tell(FactKind::Added(Box::default()));
        let blocks = [
            list.clone(),
            log(&[Some(Stamp::Uptime(100.5)), None, Some(Stamp::Uptime(200.0))]),
            list,
        ];
        let line = Timeline::of(&blocks, &mut Vec::new());
        let at = |index, number| line.time(line.when(&blocks, index, number)).1.unwrap();
        assert!((at(1, 0) - 100.5).abs() < 1e-9 && (at(1, 1) - 100.5).abs() < 1e-9);
        assert!((at(1, 2) - 200.0).abs() < 1e-9 && (at(2, 0) - 201.0).abs() < 1e-9);
        assert!(
            (at(0, 0) - 141.0).abs() < 1e-9,
            "the first list is a minute older than the second"
        );
    }

    #[test]
    fn logs_of_different_clocks_end_together() {
        let date = |text| Some(Stamp::Date(Date::read(text).unwrap()));
        let blocks = [
            log(&[Some(Stamp::Uptime(50.0)), Some(Stamp::Uptime(60.0))]),
            log(&[date("2026-11-20T10:00:00"), date("2026-11-20T11:00:00")]),
        ];
        let mut assumed = Vec::new();
        let line = Timeline::of(&blocks, &mut assumed);
        assert_eq!(assumed.len(), 1);
        let at = |index, number| line.time(line.when(&blocks, index, number)).0;
        assert_eq!(at(1, 1), Date::read("2026-11-20T11:00:00"));
        assert_eq!(at(0, 0), Date::read("2026-11-20T10:59:50"));
    }
}
