//! Reader that reads ahead in a thread of its own, so that a file is read and taken apart while its frames are judged.
//!
//! Frames go over in batches, whose memory goes back to be filled again: what is kept at a time is a few megabytes,
//! however long the file is. The same thread prepares each frame: it works out what the frame tells without those before it.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread;

use super::end::{CaptureEnd, Damage};
use super::frame::{CaptureInterface, CapturedFrame, SkippedLinkType};
use super::reader::CaptureReader;
use crate::input::Progress;

/// Bytes of frames after which a batch is handed over.
const BATCH_BYTES: usize = 256 * 1024;
/// Frames after which it is.
const BATCH_FRAMES: usize = 2_048;
/// Batches that wait to be taken, at most.
const WAITING: usize = 4;

/// A capture that a thread of its own reads ahead, with the result `P` of the preparation of each frame.
pub struct ReadAhead<P = ()> {
    filled: Receiver<ReadBatch<P>>,
    empty: Sender<ReadBatch<P>>,
    batch: ReadBatch<P>,
    /// Frames of the batch that were gone to.
    taken: usize,
    frames: u64,
    progress: Progress,
}

/// Frames that were read, and what the file had told by then.
struct ReadBatch<P> {
    frames: Vec<ReadFrame<P>>,
    bytes: Vec<u8>,
    interfaces: Vec<CaptureInterface>,
    skipped: Vec<SkippedLinkType>,
    end: Option<CaptureEnd>,
}

/// A frame but for its bytes, and where in the batch they are.
struct ReadFrame<P> {
    frame: CapturedFrame<'static>,
    prepared: P,
    at: usize,
    stored_len: usize,
    /// Offset of the Ethernet frame within what was stored.
    start: usize,
    len: usize,
}

impl<P: Send + 'static> ReadAhead<P> {
    /// Begins to read ahead, and to `prepare` each frame.
    ///
    /// # Errors
    /// The reader, when the system gives no thread.
    pub fn start(
        reader: CaptureReader,
        prepare: fn(&CapturedFrame<'_>) -> P,
    ) -> Result<Self, Box<CaptureReader>> {
        let (fill, filled) = sync_channel(WAITING);
        let (empty, emptied) = channel();
        let (hand_over, handed_over) = channel();
        let thread = thread::Builder::new().name("capture".to_owned());
        let started = thread.spawn(move || {
            // It comes once the thread is there.
            if let Ok(reader) = handed_over.recv() {
                read(reader, prepare, &fill, &emptied);
            }
        });
        if started.is_err() {
            return Err(Box::new(reader));
        }
        let progress = reader.progress_handle();
        let interfaces = reader.interfaces().to_vec();
        if let Err(refused) = hand_over.send(reader) {
            return Err(Box::new(refused.0));
        }
        let batch = ReadBatch { interfaces, ..ReadBatch::default() };
        Ok(Self { filled, empty, batch, taken: 0, frames: 0, progress })
    }

    /// Goes to the next frame; `false` at the end.
    #[inline]
    pub fn advance(&mut self) -> bool {
        if self.taken < self.batch.frames.len() || self.fetch() {
            self.taken += 1;
            return true;
        }
        false
    }

    /// Takes the next batch; `false` at the end.
    #[cold]
    fn fetch(&mut self) -> bool {
        loop {
            if self.batch.end.is_some() {
                // Nothing is behind the last frame.
                self.batch.frames.clear();
                self.taken = 0;
                return false;
            }
            if let Some(last) = self.batch.frames.last() {
                self.frames = last.frame.number.0;
            }
            match self.filled.recv() {
                Ok(batch) => {
                    // Once the thread has ended it takes nothing back.
                    let _ = self.empty.send(std::mem::replace(&mut self.batch, batch));
                }
                Err(_) => {
                    let text = "the thread that reads it has failed".to_owned();
                    let damage = Some(Damage::Unreadable { text });
                    self.batch.end = Some(CaptureEnd { damage, offset: 0, frames: self.frames });
                    continue;
                }
            }
            self.taken = 0;
            if !self.batch.frames.is_empty() {
                return true;
            }
        }
    }

    /// The frame that [`advance`](Self::advance) went to.
    #[must_use]
    #[inline]
    pub fn frame(&self) -> Option<CapturedFrame<'_>> {
        let read = self.batch.frames.get(self.taken.checked_sub(1)?)?;
        let stored = self.batch.bytes.get(read.at..read.at + read.stored_len)?;
        let bytes = stored.get(read.start..read.start + read.len)?;
        Some(with_bytes(&read.frame, stored, bytes))
    }

    /// Result of the preparation of the frame that [`advance`](Self::advance) went to.
    #[must_use]
    #[inline]
    pub fn prepared(&self) -> Option<&P> {
        Some(&self.batch.frames.get(self.taken.checked_sub(1)?)?.prepared)
    }

    /// The interfaces that were described so far.
    #[must_use]
    pub fn interfaces(&self) -> &[CaptureInterface] {
        &self.batch.interfaces
    }

    /// As [`CaptureReader::skipped`].
    #[must_use]
    pub fn skipped(&self) -> &[SkippedLinkType] {
        &self.batch.skipped
    }

    /// The share of the file that has been read, 0 to 1; `None` where nobody knows the whole.
    #[must_use]
    pub fn progress(&self) -> Option<f64> {
        self.progress.share()
    }

    /// The end of the capture; `None` before [`advance`](Self::advance) was `false`.
    #[must_use]
    pub fn end(&self) -> Option<&CaptureEnd> {
        self.batch.end.as_ref().filter(|_| self.taken >= self.batch.frames.len())
    }
}

/// The thread: fills batches until the file ends, or nobody wants more.
fn read<P>(
    mut reader: CaptureReader,
    prepare: fn(&CapturedFrame<'_>) -> P,
    fill: &SyncSender<ReadBatch<P>>,
    emptied: &Receiver<ReadBatch<P>>,
) {
    loop {
        let mut batch = emptied.try_recv().unwrap_or_default();
        batch.fill(&mut reader, prepare);
        let is_last = batch.end.is_some();
        if fill.send(batch).is_err() || is_last {
            return;
        }
    }
}

impl<P> Default for ReadBatch<P> {
    fn default() -> Self {
        Self {
            frames: Vec::new(),
            bytes: Vec::new(),
            interfaces: Vec::new(),
            skipped: Vec::new(),
            end: None,
        }
    }
}

impl<P> ReadBatch<P> {
    fn fill(&mut self, reader: &mut CaptureReader, prepare: fn(&CapturedFrame<'_>) -> P) {
        self.frames.clear();
        self.bytes.clear();
        let mut is_ended = false;
        while self.frames.len() < BATCH_FRAMES && self.bytes.len() < BATCH_BYTES {
            let Some(frame) = reader.next_frame() else {
                is_ended = true;
                break;
            };
            let at = self.bytes.len();
            self.bytes.extend_from_slice(frame.stored);
            // The frame is a part of what was stored.
            let start = frame.bytes.as_ptr().addr().saturating_sub(frame.stored.as_ptr().addr());
            let (stored_len, len) = (frame.stored.len(), frame.bytes.len());
            let prepared = prepare(&frame);
            let frame = with_bytes(&frame, &[], &[]);
            self.frames.push(ReadFrame { frame, prepared, at, stored_len, start, len });
        }
        self.interfaces = reader.interfaces().to_vec();
        self.skipped = reader.skipped().to_vec();
        self.end = reader.end().filter(|_| is_ended).cloned();
    }
}

/// The same frame with bytes that lie elsewhere.
#[inline]
fn with_bytes<'b>(
    frame: &CapturedFrame<'_>,
    stored: &'b [u8],
    bytes: &'b [u8],
) -> CapturedFrame<'b> {
    CapturedFrame {
        number: frame.number,
        time: frame.time,
        interface: frame.interface,
        host_interface: frame.host_interface,
        link_type: frame.link_type,
        direction: frame.direction,
        original_len: frame.original_len,
        truncated: frame.truncated,
        fcs: frame.fcs,
        probe: frame.probe,
        stored,
        bytes,
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::super::{
        CaptureInterfaceId, FrameDirection, FrameToWrite, InterfaceToWrite, LinkType, PcapngWriter,
    };
    use super::*;
    use crate::unix_time::UnixTime;

    /// A capture of so many frames, each of another length and content.
    fn capture(frames: u32) -> Vec<u8> {
        let mut writer = PcapngWriter::new(Vec::new(), "test").unwrap();
        for name in ["card A", "card B"] {
            let interface =
                InterfaceToWrite { name, description: "", link_type: LinkType::Ethernet };
            writer.add_interface(&interface).unwrap();
        }
        for number in 0..frames {
            let bytes = vec![number as u8; 60 + number as usize % 300];
            let time = UnixTime::from_nanos(i128::from(number) * 1_000);
            let interface = CaptureInterfaceId(number % 2);
            let frame = FrameToWrite::new(interface, time, FrameDirection::Outgoing, &bytes);
            writer.write_frame(&frame).unwrap();
        }
        writer.finish().unwrap()
    }

    fn reader(file: &[u8]) -> CaptureReader {
        CaptureReader::from_source("test", Cursor::new(file.to_vec())).unwrap()
    }

    #[test]
    fn frames_read_ahead_are_those_of_the_file_and_so_is_its_end() {
        for frames in [0, 1, BATCH_FRAMES as u32, 9_001] {
            let whole = capture(frames);
            for file in [&whole[..], &whole[..whole.len() - 2]] {
                let mut direct = reader(file);
                let len = |frame: &CapturedFrame<'_>| frame.bytes.len();
                let mut ahead = ReadAhead::start(reader(file), len).ok().unwrap();
                while ahead.advance() {
                    assert_eq!(ahead.frame(), direct.next_frame());
                    assert_eq!(ahead.prepared().copied(), ahead.frame().map(|one| len(&one)));
                }
                assert_eq!(direct.next_frame(), None);
                assert_eq!(ahead.frame(), None, "there is none behind the last one");
                assert_eq!(ahead.end(), direct.end());
                assert_eq!(ahead.interfaces(), direct.interfaces());
                assert!(!ahead.advance(), "the end is the end");
            }
        }
    }
}
