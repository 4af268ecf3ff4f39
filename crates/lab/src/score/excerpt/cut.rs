//! Random cuts: the begin, the end, one direction, the length that is kept of each frame, and reads that the recorder
//! lost.

use std::fmt;

use linesman_proto::command::Addressing;
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::Stream;

use super::super::recorder::RecordedFrame;

/// Lengths that recorders are set to.
const SNAPS: [usize; 4] = [40, 64, 96, 128];

/// What was cut off a recording.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Cut {
    /// Time of the run at which the excerpt begins.
    pub from: Instant,
    /// Time at which it ends.
    pub to: Instant,
    /// Whether only frames on their way out, or only those on their way back, are left.
    pub one_way: Option<OneWay>,
    /// How many bytes are left of each frame.
    pub snap: Option<usize>,
    /// The share of exchanges that only read registers and that the recorder lost, from 0 to 1.
    pub lost_reads: f64,
}

/// A direction that is left.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OneWay {
    /// Requests.
    Out,
    /// Returns.
    Back,
}

/// What a request and its return have in common.
type Key = (u8, u16, usize);

/// What is not back by then never comes.
const RETURNS_WITHIN: Span = Span::ms(20);

/// Both cards of a ring send within this time.
const COPY: Span = Span::us(2);

impl Cut {
    /// One that leaves all of a recording.
    pub(super) fn none(frames: &[RecordedFrame]) -> Self {
        let time = |frame: Option<&RecordedFrame>| frame.map_or(Instant::ZERO, |frame| frame.time);
        let (from, to) = (time(frames.first()), time(frames.last()));
        Self { from, to, one_way: None, snap: None, lost_reads: 0.0 }
    }

    /// Draws one for a recording.
    pub(super) fn draw(frames: &[RecordedFrame], stream: &mut Stream) -> Self {
        let first = frames.first().map_or(Instant::ZERO, |frame| frame.time);
        let last = frames.last().map_or(Instant::ZERO, |frame| frame.time);
        let whole = last.since(first).as_nanos();
        let at = |stream: &mut Stream| first + Span::ns(stream.between(0, whole));
        let mut from = if stream.chance(0.35) { first } else { at(stream) };
        let mut to = if stream.chance(0.5) { last } else { at(stream) };
        if to < from {
            (from, to) = (to, from);
        }
        let one_way = match stream.below(100) {
            0..6 => Some(OneWay::Out),
            6..12 => Some(OneWay::Back),
            _ => None,
        };
        let snap = stream.chance(0.15).then(|| stream.pick(&SNAPS).copied()).flatten();
        let lost_reads = if stream.chance(0.3) {
            *stream.pick(&[0.2, 0.5, 0.9, 1.0]).unwrap_or(&0.5)
        } else {
            0.0
        };
        Self { from, to, one_way, snap, lost_reads }
    }

    /// The frames that are left.
    pub(super) fn apply(
        &self,
        frames: &[RecordedFrame],
        stream: &mut Stream,
    ) -> Vec<RecordedFrame> {
        let mut recorder =
            LostReads { stream, share: self.lost_reads, hidden: Vec::new(), latest: None };
        let mut left = Vec::new();
        for frame in frames.iter().filter(|one| self.from <= one.time && one.time <= self.to) {
            if self.lost_reads > 0.0 && recorder.loses(frame) {
                continue;
            }
            let is_left = match self.one_way {
                Some(OneWay::Out) => frame.is_sent,
                Some(OneWay::Back) => !frame.is_sent,
                None => true,
            };
            if is_left {
                left.push(frame.clone());
            }
        }
        left
    }
}

/// A recorder that loses exchanges which only read registers.
struct LostReads<'a> {
    stream: &'a mut Stream,
    share: f64,
    /// Requests that were lost, with the times at which they were sent.
    hidden: Vec<(Key, Instant)>,
    /// The latest request, when it was sent, and whether it was lost.
    latest: Option<(Key, Instant, bool)>,
}

impl LostReads<'_> {
    /// Whether an exchange is lost, with its request and its return.
    fn loses(&mut self, frame: &RecordedFrame) -> bool {
        let Ok(view) = FrameView::parse(&frame.bytes) else { return false };
        // What is written stays: a lost read is one of many, a lost order is what the line is told.
        let is_kept =
            view.datagrams().flatten().filter_map(|one| one.command()).any(|command| {
                command.addressing() == Addressing::Logical || command.effect().writes
            });
        let Some(Ok(first)) = view.datagrams().next() else { return false };
        let key = (first.index(), first.ado().0, frame.bytes.len());
        if is_kept {
            return false;
        }
        if !frame.is_sent {
            self.hidden.retain(|(_, sent)| frame.time.since(*sent) < RETURNS_WITHIN);
            let found = self.hidden.iter().position(|(known, _)| *known == key);
            return found.map(|at| self.hidden.remove(at)).is_some();
        }
        // In a ring both cards send it.
        let is_copy =
            self.latest.is_some_and(|(known, at, _)| known == key && frame.time.since(at) < COPY);
        let is_lost = match self.latest {
            Some((_, _, is_lost)) if is_copy => is_lost,
            Some(_) | None => self.stream.chance(self.share),
        };
        self.latest = Some((key, frame.time, is_lost));
        if is_lost {
            self.hidden.push((key, frame.time));
        }
        is_lost
    }
}

impl fmt::Display for Cut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.from.since(Instant::ZERO), self.to.since(Instant::ZERO))?;
        match self.one_way {
            Some(OneWay::Out) => f.write_str(", requests only")?,
            Some(OneWay::Back) => f.write_str(", returns only")?,
            None => {}
        }
        if let Some(snap) = self.snap {
            write!(f, ", {snap} bytes of each frame")?;
        }
        if self.lost_reads > 0.0 {
            write!(f, ", {:.0} % of the reads lost", self.lost_reads * 100.0)?;
        }
        Ok(())
    }
}
