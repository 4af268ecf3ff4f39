//! Captures that were recorded at the same time, such as at both cards of a ring, as one: frames in the order of their times.

use std::path::PathBuf;

use super::end::CaptureEnd;
use super::error::CaptureError;
use super::frame::{
    CaptureInterface, CaptureInterfaceId, CapturedFrame, FrameNumber, SkippedLinkType,
};
use super::reader::CaptureReader;
use crate::unix_time::UnixTime;

/// Several captures that are read side by side. Frames are numbered through in the order in which they come; interfaces too.
pub struct MergedCaptures {
    sources: Vec<MergedSource>,
    /// The one whose frame is the present one.
    current: Option<usize>,
    frames: u64,
    interfaces: Vec<CaptureInterface>,
    skipped: Vec<SkippedLinkType>,
    end: Option<CaptureEnd>,
}

/// One of them.
struct MergedSource {
    reader: CaptureReader,
    /// True if the reader stands at a frame that was not given yet.
    is_waiting: bool,
    /// The time of that frame; one without a time takes that of the frame before it.
    time: UnixTime,
    /// Numbers of its interfaces among those of all.
    numbers: Vec<u32>,
}

impl MergedCaptures {
    /// Opens captures to be read as one.
    ///
    /// # Errors
    /// When one of them is no capture, or is damaged in its first block.
    pub fn open(paths: &[PathBuf]) -> Result<Self, CaptureError> {
        let readers = paths.iter().map(CaptureReader::open);
        Ok(Self::of(readers.collect::<Result<_, _>>()?))
    }

    /// Reads captures as one.
    #[must_use]
    pub fn of(readers: Vec<CaptureReader>) -> Self {
        let source = |reader| MergedSource {
            reader,
            is_waiting: false,
            time: UnixTime::EPOCH,
            numbers: Vec::new(),
        };
        let sources = readers.into_iter().map(source).collect();
        let (interfaces, skipped) = (Vec::new(), Vec::new());
        Self { sources, current: None, frames: 0, interfaces, skipped, end: None }
    }

    /// Goes to the next frame; `false` at the end of all.
    pub fn advance(&mut self) -> bool {
        let mut next: Option<(usize, UnixTime)> = None;
        for (index, source) in self.sources.iter_mut().enumerate() {
            // At the beginning all are to be moved, later on the one whose frame was given.
            if !source.is_waiting && (self.current.is_none() || self.current == Some(index)) {
                source.go_on(&mut self.interfaces);
            }
            if source.is_waiting && next.is_none_or(|(_, earliest)| source.time < earliest) {
                next = Some((index, source.time));
            }
        }
        let Some((index, _)) = next else {
            self.finish();
            return false;
        };
        self.sources[index].is_waiting = false;
        self.current = Some(index);
        self.frames += 1;
        true
    }

    /// The frame that [`advance`](Self::advance) went to.
    #[must_use]
    pub fn frame(&self) -> Option<CapturedFrame<'_>> {
        let source = self.sources.get(self.current?).filter(|_| self.end.is_none())?;
        let mut frame = source.reader.frame()?;
        frame.number = FrameNumber(self.frames);
        let number = source.numbers.get(frame.interface.0 as usize)?;
        frame.interface = CaptureInterfaceId(*number);
        Some(frame)
    }

    /// The interfaces that were described so far, of all captures.
    #[must_use]
    pub fn interfaces(&self) -> &[CaptureInterface] {
        &self.interfaces
    }

    /// Frames of link types that cannot carry EtherCAT; known at the end.
    #[must_use]
    pub fn skipped(&self) -> &[SkippedLinkType] {
        &self.skipped
    }

    /// The share that has been read, 0 to 1; `None` where nobody knows the whole.
    #[must_use]
    pub fn progress(&self) -> Option<f64> {
        let shares = self.sources.iter().map(|source| source.reader.progress());
        Some(shares.sum::<Option<f64>>()? / self.sources.len() as f64)
    }

    /// Their end: that of the first that could not be read whole, if any; `None` before all have ended.
    #[must_use]
    pub const fn end(&self) -> Option<&CaptureEnd> {
        self.end.as_ref()
    }

    #[cold]
    fn finish(&mut self) {
        let ends: Vec<&CaptureEnd> =
            self.sources.iter().filter_map(|source| source.reader.end()).collect();
        let early = ends.iter().find(|end| !end.complete());
        self.end = Some(CaptureEnd {
            damage: early.and_then(|end| end.damage.clone()),
            offset: early.map_or_else(|| ends.iter().map(|end| end.offset).sum(), |it| it.offset),
            frames: self.frames,
        });
        for source in &self.sources {
            // Statistics at the end of a file tell of its drops, and until when it was recorded.
            for (told, number) in source.reader.interfaces().iter().zip(&source.numbers) {
                if let Some(known) = self.interfaces.get_mut(*number as usize) {
                    known.clone_from(told);
                }
            }
            self.skipped.extend_from_slice(source.reader.skipped());
        }
    }
}

impl MergedSource {
    /// Goes to its next frame.
    fn go_on(&mut self, all: &mut Vec<CaptureInterface>) {
        self.is_waiting = self.reader.advance();
        for interface in &self.reader.interfaces()[self.numbers.len()..] {
            self.numbers.push(all.len() as u32);
            all.push(interface.clone());
        }
        self.time = self.reader.frame().and_then(|frame| frame.time).unwrap_or(self.time);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::super::{FrameDirection, FrameToWrite, InterfaceToWrite, LinkType, PcapngWriter};
    use super::*;

    fn reader(name: &str, times: &[i128]) -> CaptureReader {
        let mut writer = PcapngWriter::new(Vec::new(), "test").unwrap();
        let interface = InterfaceToWrite { name, description: "", link_type: LinkType::Ethernet };
        let id = writer.add_interface(&interface).unwrap();
        for time in times {
            let at = UnixTime::from_nanos(*time);
            let bytes = [*time as u8; 60];
            let frame = FrameToWrite::new(id, at, FrameDirection::Unknown, &bytes);
            writer.write_frame(&frame).unwrap();
        }
        CaptureReader::from_source(name, Cursor::new(writer.finish().unwrap())).unwrap()
    }

    #[test]
    fn frames_of_two_captures_come_in_the_order_of_their_times() {
        let readers = vec![reader("left", &[10, 40, 45]), reader("right", &[20, 30, 40, 50])];
        let mut merged = MergedCaptures::of(readers);
        let mut given = Vec::new();
        while merged.advance() {
            let frame = merged.frame().unwrap();
            given.push((frame.number.0, frame.interface.0, frame.time.unwrap().as_nanos()));
            assert_eq!(merged.end(), None);
        }
        let expected =
            [(1, 0, 10), (2, 1, 20), (3, 1, 30), (4, 0, 40), (5, 1, 40), (6, 0, 45), (7, 1, 50)];
        assert_eq!(given, expected);
        let names: Vec<_> = merged.interfaces().iter().map(|one| one.name.clone()).collect();
        assert_eq!(names, [Some("left".to_owned()), Some("right".to_owned())]);
        let end = merged.end().unwrap();
        assert!(end.complete() && end.frames == 7, "{end}");
        assert!(!merged.advance(), "the end is the end");
        assert_eq!(merged.frame(), None);
    }

    #[test]
    fn captures_without_frames_end_at_once() {
        let mut merged = MergedCaptures::of(vec![reader("left", &[]), reader("right", &[])]);
        assert!(!merged.advance());
        assert_eq!(merged.end().map(|end| end.frames), Some(0));
    }
}
