//! Recorder of frames and host observations, as a capture file that other tools read too.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path as FilePath;

use linesman_diagnosis::{Direction, FrameSeen};
use linesman_link::capture::{
    CaptureInterfaceId, CaptureWriteError, FrameDirection, FrameToWrite, InterfaceToWrite,
    LinkType, PcapngWriter,
};
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

use crate::watched_file::WatchedFile;

/// That the file is still there is looked up this often.
const LOOK_EVERY: Span = Span::s(1);

/// A capture that is being written.
pub struct Recorder {
    writer: PcapngWriter<BufWriter<File>>,
    start: UnixTime,
    cards: [Option<CaptureInterfaceId>; 2],
    names: Vec<String>,
    /// Frames that were written, and those that passed and were not shown.
    written: [u64; 2],
    missed: u64,
    /// The first thing that went wrong; nothing is written after it.
    fault: Option<CaptureWriteError>,
    file: WatchedFile,
    look_at: Instant,
}

impl Recorder {
    /// Begins a file, which must not be there yet. `start` is the date of the run's time 0; `names`
    /// are those of card A and card B, where they have any.
    ///
    /// # Errors
    /// When the file is there already, or cannot be written.
    pub fn create(
        path: &FilePath,
        application: &str,
        start: UnixTime,
        names: &[String],
    ) -> Result<Self, CaptureWriteError> {
        let file = BufWriter::new(File::create_new(path)?);
        let writer = PcapngWriter::new(file, application)?;
        let (names, file) = (names.to_vec(), WatchedFile::at(path));
        let look_at = Instant::ZERO;
        let (written, missed) = ([0; 2], 0);
        Ok(Self {
            writer,
            start,
            cards: [None; 2],
            names,
            written,
            missed,
            fault: None,
            file,
            look_at,
        })
    }

    /// Writes a frame. What goes wrong is told by [`fault`](Self::fault).
    pub fn frame(&mut self, frame: &FrameSeen<'_>) {
        if self.fault.is_none() {
            self.fault = self.write(frame).err();
        }
        if self.fault.is_none() && frame.time >= self.look_at {
            self.look_at = frame.time + LOOK_EVERY;
            self.fault = self.file.check().err().map(Into::into);
        }
    }

    /// Notes frames that passed and were not shown; whoever reads the file is told of them.
    pub const fn missed(&mut self, count: u64) {
        self.missed = self.missed.saturating_add(count);
    }

    /// What went wrong first; nothing was written after it.
    #[must_use]
    pub const fn fault(&self) -> Option<&CaptureWriteError> {
        self.fault.as_ref()
    }

    fn write(&mut self, frame: &FrameSeen<'_>) -> Result<(), CaptureWriteError> {
        let path = frame.path.unwrap_or(Path::A);
        let interface = match self.cards[path.index()] {
            Some(interface) => interface,
            None => self.describe(path)?,
        };
        let direction = match frame.direction {
            Direction::Sent => FrameDirection::Outgoing,
            Direction::Received => FrameDirection::Incoming,
            Direction::Unknown => FrameDirection::Unknown,
        };
        let time = self.start + frame.time.since(Instant::ZERO);
        self.written[path.index()] += 1;
        self.writer.write_frame(&FrameToWrite::new(interface, time, direction, frame.bytes))
    }

    fn describe(&mut self, path: Path) -> Result<CaptureInterfaceId, CaptureWriteError> {
        let description = format!("card {path}");
        let interface = self.writer.add_interface(&InterfaceToWrite {
            name: self.names.get(path.index()).map_or("", String::as_str),
            description: &description,
            link_type: LinkType::Ethernet,
        })?;
        self.cards[path.index()] = Some(interface);
        Ok(interface)
    }

    /// Ends the file, with the time `until` which it was recorded, frames or not.
    ///
    /// # Errors
    /// What went wrong first.
    pub fn finish(mut self, until: Instant) -> Result<(), CaptureWriteError> {
        match self.fault {
            Some(fault) => Err(fault),
            None => {
                let until = self.start + until.since(Instant::ZERO);
                // Of which card the missed ones were is not known.
                let mut missed = self.missed;
                for (interface, written) in self.cards.into_iter().zip(self.written) {
                    let Some(interface) = interface else { continue };
                    let missed = std::mem::take(&mut missed);
                    self.writer.write_statistics(interface, until, written + missed, missed)?;
                }
                self.writer.finish()?;
                Ok(self.file.check()?)
            }
        }
    }
}
