//! History of a diagnosis: the frames that it was shown, in chunks, in bounded memory.
//!
//! Three stretches stay: the opening of the run, with which states, addresses and wiring become known; the recent
//! past; and of the time between what lies around earlier findings. All else gives way, and is counted.

use std::collections::VecDeque;
use std::sync::Arc;

use linesman_diagnosis::{Direction, FrameSeen, HostObservation};
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

/// Bytes of a chunk.
const CHUNK: usize = 64 * 1024;
/// A chunk lasts no longer, so that what is old can give way.
pub(super) const CHUNK_LASTS: Span = Span::ms(200);
/// Bytes that a frame takes beside its own.
const BESIDE_FRAME: usize = size_of::<KeptFrame>();
/// Most observations of the host that are kept.
const MOST_NOTES: usize = 20_000;
/// Empty chunks that are kept for reuse.
const MOST_SPARE: usize = 16;
/// So long before a finding opened its frames are kept on.
const MARK_BEFORE: Span = Span::s(1);
/// So long after something happened to it.
const MARK_AFTER: Span = Span::ms(300);

/// A frame of the one network that commands look at, without its bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct KeptFrame {
    pub(super) path: Option<Path>,
    pub(super) direction: Direction,
    pub(super) time: Instant,
    pub(super) fcs: Option<bool>,
    pub(super) truncated: bool,
    /// End of its bytes in those of the chunk.
    end: usize,
}

/// Frames that follow each other.
#[derive(Default, Debug)]
pub(super) struct Chunk {
    /// Frames of the run before these.
    pub(super) first: u64,
    frames: Vec<KeptFrame>,
    bytes: Vec<u8>,
    /// The earliest and the latest time.
    pub(super) from: Instant,
    pub(super) to: Instant,
}

impl Chunk {
    fn len(&self) -> usize {
        self.bytes.len() + self.frames.len() * BESIDE_FRAME
    }

    fn push(&mut self, frame: &FrameSeen<'_>) {
        self.from = if self.frames.is_empty() { frame.time } else { self.from.min(frame.time) };
        self.to = if self.frames.is_empty() { frame.time } else { self.to.max(frame.time) };
        self.bytes.extend_from_slice(frame.bytes);
        self.frames.push(KeptFrame {
            path: frame.path,
            direction: frame.direction,
            time: frame.time,
            fcs: frame.fcs,
            truncated: frame.truncated,
            end: self.bytes.len(),
        });
    }

    /// The frames of the run up to its end.
    pub(super) fn end(&self) -> u64 {
        self.first + self.frames.len() as u64
    }

    /// The frames with their bytes.
    pub(super) fn frames(&self) -> impl Iterator<Item = (&KeptFrame, &[u8])> {
        let starts = std::iter::once(0).chain(self.frames.iter().map(|frame| frame.end));
        let bytes = |(frame, start)| -> (&KeptFrame, &[u8]) {
            let frame: &KeptFrame = frame;
            (frame, self.bytes.get(start..frame.end).unwrap_or_default())
        };
        self.frames.iter().zip(starts).map(bytes)
    }
}

/// Something beside the frames.
#[derive(Clone, Copy, Debug)]
pub(super) enum KeptNote {
    /// The host noticed something.
    Host(HostObservation),
    /// Frames passed that the diagnosis was not shown.
    NotShown(u64, Instant),
}

/// Kept frames and notes at some moment.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    /// The chunks, oldest first.
    pub(super) chunks: Vec<Arc<Chunk>>,
    /// Notes, each with the number of frames of the run before it.
    pub(super) notes: Vec<(u64, KeptNote)>,
    /// Notes that gave way.
    pub(super) notes_left_out: u64,
}

impl Kept {
    /// The beginning of the last stretch, where frames before it are left out.
    pub(super) fn recent_from(&self) -> Option<Instant> {
        let gap = |pair: &[Arc<Chunk>]| pair[0].end() != pair[1].first;
        let last = self.chunks.windows(2).rposition(gap)?;
        self.chunks.get(last + 1).map(|chunk| chunk.from)
    }
}

/// Frames that were seen.
pub(super) struct FrameHistory {
    memory: usize,
    before: Span,
    opening: VecDeque<Arc<Chunk>>,
    opening_bytes: usize,
    is_opening_over: bool,
    earlier: VecDeque<Arc<Chunk>>,
    earlier_bytes: usize,
    recent: VecDeque<Arc<Chunk>>,
    recent_bytes: usize,
    current: Chunk,
    spare: Vec<Chunk>,
    /// Times around findings, oldest first.
    marks: VecDeque<(Instant, Instant)>,
    notes: VecDeque<(u64, KeptNote)>,
    notes_left_out: u64,
    frames: u64,
}

impl FrameHistory {
    /// Room for so many bytes, of which a quarter each is for the opening and for earlier findings.
    pub(super) fn new(memory: usize, before: Span) -> Self {
        Self {
            memory,
            before,
            opening: VecDeque::new(),
            opening_bytes: 0,
            is_opening_over: false,
            earlier: VecDeque::new(),
            earlier_bytes: 0,
            recent: VecDeque::new(),
            recent_bytes: 0,
            current: Chunk::default(),
            spare: Vec::new(),
            marks: VecDeque::new(),
            notes: VecDeque::new(),
            notes_left_out: 0,
            frames: 0,
        }
    }

    /// Keeps a frame.
    pub(super) fn frame(&mut self, frame: &FrameSeen<'_>) {
        let is_full = self.current.len() + frame.bytes.len() + BESIDE_FRAME > CHUNK
            || frame.time.since(self.current.from) >= CHUNK_LASTS;
        if !self.current.frames.is_empty() && is_full {
            self.turn_over(frame.time);
        }
        self.current.push(frame);
        self.frames += 1;
    }

    /// Keeps what was noticed beside the frames.
    pub(super) fn note(&mut self, note: KeptNote) {
        if self.notes.len() >= MOST_NOTES {
            self.notes.pop_front();
            self.notes_left_out += 1;
        }
        self.notes.push_back((self.frames, note));
    }

    /// Something happened to a finding: what lies around it stays.
    pub(super) fn mark(&mut self, opened: Instant, at: Instant) {
        let mark = (opened - MARK_BEFORE, at + MARK_AFTER);
        match self.marks.back_mut().filter(|last| mark.0 <= last.1) {
            Some(last) => *last = (last.0.min(mark.0), last.1.max(mark.1)),
            None => self.marks.push_back(mark),
        }
        // Marks without frames are of no use.
        if self.marks.len() > MOST_NOTES {
            self.marks.pop_front();
        }
    }

    /// All that is there.
    pub(super) fn keep(&mut self) -> Kept {
        let now = self.current.to;
        self.turn_over(now);
        let chunks = [&self.opening, &self.earlier, &self.recent].into_iter().flatten();
        Kept {
            chunks: chunks.cloned().collect(),
            notes: self.notes.iter().copied().collect(),
            notes_left_out: self.notes_left_out,
        }
    }

    /// Ends the present chunk and lets go what is too old or too much.
    fn turn_over(&mut self, now: Instant) {
        if self.current.frames.is_empty() {
            return;
        }
        let next = self.spare.pop().unwrap_or_default();
        let mut chunk = std::mem::replace(&mut self.current, next);
        self.current.first = self.frames;
        let len = chunk.len();
        if !self.is_opening_over && self.opening_bytes + len <= self.memory / 4 {
            chunk.frames.shrink_to_fit();
            chunk.bytes.shrink_to_fit();
            self.opening_bytes += len;
            self.opening.push_back(Arc::new(chunk));
            return;
        }
        self.is_opening_over = true;
        self.recent_bytes += len;
        self.recent.push_back(Arc::new(chunk));
        while let Some(oldest) = self.recent.front() {
            let is_old = now.since(oldest.to) > self.before + CHUNK_LASTS;
            if !is_old && self.recent_bytes <= self.memory / 2 {
                break;
            }
            let Some(oldest) = self.recent.pop_front() else { break };
            self.recent_bytes -= oldest.len();
            self.retire(oldest);
        }
    }

    /// A chunk is not recent any more.
    fn retire(&mut self, chunk: Arc<Chunk>) {
        while self.marks.front().is_some_and(|(_, to)| *to < chunk.from) {
            self.marks.pop_front();
        }
        if self.marks.front().is_none_or(|(from, _)| *from > chunk.to) {
            self.reuse(chunk);
            return;
        }
        self.earlier_bytes += chunk.len();
        self.earlier.push_back(chunk);
        while self.earlier_bytes > self.memory / 4 {
            let Some(oldest) = self.earlier.pop_front() else { break };
            self.earlier_bytes -= oldest.len();
            self.reuse(oldest);
        }
    }

    fn reuse(&mut self, chunk: Arc<Chunk>) {
        if let Ok(mut chunk) = Arc::try_unwrap(chunk)
            && self.spare.len() < MOST_SPARE
        {
            chunk.frames.clear();
            chunk.bytes.clear();
            self.spare.push(chunk);
        }
    }

    /// Changes how far back the recent past reaches.
    pub(super) fn reach_back(&mut self, before: Span) {
        self.before = before;
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::address::Network;

    use super::*;

    fn frame(number: u64, time: Instant, bytes: &[u8]) -> FrameSeen<'_> {
        FrameSeen {
            network: Network::default(),
            path: Some(Path::A),
            direction: Direction::Sent,
            time,
            number,
            fcs: None,
            probe: None,
            truncated: false,
            bytes,
        }
    }

    /// A millisecond each.
    fn fill(history: &mut FrameHistory, from: u64, to: u64) {
        for number in from..to {
            history.frame(&frame(number, Instant::from_nanos(number * 1_000_000), &[7; 60]));
        }
    }

    fn bytes(kept: &Kept) -> usize {
        kept.chunks.iter().map(|chunk| chunk.len()).sum()
    }

    #[test]
    fn opening_marks_and_recent_past_stay_and_the_rest_gives_way() {
        let mut history = FrameHistory::new(4_000_000, Span::s(2));
        fill(&mut history, 0, 20_000);
        history.mark(Instant::from_nanos(20_000_000_000), Instant::from_nanos(20_000_000_000));
        fill(&mut history, 20_000, 60_000);
        let kept = history.keep();
        let gaps: Vec<(u64, u64)> = kept
            .chunks
            .windows(2)
            .filter(|pair| pair[0].end() != pair[1].first)
            .map(|pair| (pair[0].end(), pair[1].first))
            .collect();
        assert_eq!(gaps.len(), 2, "{gaps:?}");
        assert!(gaps[0].1 > 18_000 && gaps[0].1 <= 19_000, "{gaps:?}");
        assert!(gaps[1].0 >= 20_300 && gaps[1].0 < 21_000, "{gaps:?}");
        assert!(gaps[1].1 > 57_000 && gaps[1].1 <= 58_000, "{gaps:?}");
        assert_eq!(kept.chunks.last().unwrap().end(), 60_000);
    }

    #[test]
    fn memory_stays_within_its_bound_however_much_passes() {
        let mut history = FrameHistory::new(1_000_000, Span::s(3_600));
        for second in 0..200 {
            fill(&mut history, second * 1_000, (second + 1) * 1_000);
            let at = Instant::from_nanos(second * 1_000_000_000);
            history.mark(at, at);
        }
        let kept = history.keep();
        assert!(bytes(&kept) <= 1_000_000 + CHUNK, "{}", bytes(&kept));
    }

    #[test]
    fn frames_come_back_with_their_bytes() {
        let mut history = FrameHistory::new(1_000_000, Span::s(1));
        history.frame(&frame(1, Instant::from_nanos(5), &[1, 2]));
        history.frame(&frame(2, Instant::from_nanos(6), &[3]));
        let kept = history.keep();
        let all: Vec<&[u8]> = kept.chunks[0].frames().map(|(_, bytes)| bytes).collect();
        assert_eq!(all, [&[1, 2][..], &[3]]);
    }
}
