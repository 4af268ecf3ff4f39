//! Writer of selected frames: pcapng or pcap, with the interfaces of the capture that they come from.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use linesman_link::capture::{
    CaptureInterface, CaptureInterfaceId, CaptureWriteError, CapturedFrame, FrameToWrite,
    InterfaceToWrite, LinkType, PcapWriter, PcapngWriter,
};
use linesman_link::input::STANDARD_INPUT;
use linesman_link::unix_time::UnixTime;
use linesman_runtime::capture::CaptureItem;

use crate::failure::Failure;
use crate::files;
use crate::version;

/// A capture that is being written.
pub(super) struct CaptureSink {
    path: PathBuf,
    format: SinkFormat,
    /// Number of each interface in the new file.
    numbers: Vec<Option<CaptureInterfaceId>>,
}

enum SinkFormat {
    Pcapng(PcapngWriter<BufWriter<Box<dyn Write>>>),
    Pcap(PcapWriter<BufWriter<Box<dyn Write>>>),
}

impl CaptureSink {
    /// Begins a capture, which must not be there yet; `-` is standard output.
    pub(super) fn create(path: &Path) -> Result<Self, Failure> {
        let is_standard = path.as_os_str() == STANDARD_INPUT;
        let name = path.to_string_lossy().to_ascii_lowercase();
        if [".gz", ".xz", ".zst"].iter().any(|end| name.ends_with(end)) {
            let reason = format!("{}: captures are written unpacked", path.display());
            return Err(Failure::new(reason, "name it .pcapng, and pack it afterwards"));
        }
        let sink: Box<dyn Write> = match is_standard {
            true => Box::new(io::stdout()),
            false => {
                files::refuse_to_overwrite(path)?;
                Box::new(File::create_new(path).map_err(|error| unwritten(path, &error))?)
            }
        };
        let sink = BufWriter::new(sink);
        let format = match name.ends_with(".pcap") || name.ends_with(".cap") {
            true => PcapWriter::new(sink, LinkType::Ethernet, false).map(SinkFormat::Pcap),
            false => PcapngWriter::new(sink, &version::tool()).map(SinkFormat::Pcapng),
        };
        let format = format.map_err(|error| unwritten(path, &error))?;
        Ok(Self { path: path.to_owned(), format, numbers: Vec::new() })
    }

    /// True if it goes to standard output.
    pub(super) fn is_standard_output(&self) -> bool {
        self.path.as_os_str() == STANDARD_INPUT
    }

    /// Writes a frame as it was stored, with a comment; empty for none.
    pub(super) fn write(&mut self, item: &CaptureItem<'_>, comment: &str) -> Result<(), Failure> {
        let written = self.put(&item.captured, item.interface, comment);
        written.map_err(|error| unwritten(&self.path, &error))
    }

    fn put(
        &mut self,
        frame: &CapturedFrame<'_>,
        interface: &CaptureInterface,
        comment: &str,
    ) -> Result<(), CaptureWriteError> {
        let number = match &mut self.format {
            SinkFormat::Pcap(_) => frame.interface,
            SinkFormat::Pcapng(writer) => {
                let index = frame.interface.0 as usize;
                if self.numbers.len() <= index {
                    self.numbers.resize(index + 1, None);
                }
                match self.numbers[index] {
                    Some(number) => number,
                    None => {
                        let number = writer.add_interface(&InterfaceToWrite {
                            name: interface.name.as_deref().unwrap_or_default(),
                            description: interface.description.as_deref().unwrap_or_default(),
                            link_type: LinkType::Ethernet,
                        })?;
                        self.numbers[index] = Some(number);
                        number
                    }
                }
            }
        };
        let frame = FrameToWrite {
            interface: number,
            time: frame.time.unwrap_or(UnixTime::EPOCH),
            direction: frame.direction,
            with_fcs: false,
            crc_error: frame.fcs == Some(false) && frame.probe.is_none(),
            original_len: frame.truncated.then_some(frame.original_len),
            bytes: frame.stored,
        };
        match &mut self.format {
            SinkFormat::Pcapng(writer) => writer.write_commented(&frame, comment),
            SinkFormat::Pcap(writer) => writer.write_frame(&frame),
        }
    }

    /// Ends the capture.
    pub(super) fn finish(self) -> Result<(), Failure> {
        let ended = match self.format {
            SinkFormat::Pcapng(writer) => writer.finish().map(drop),
            SinkFormat::Pcap(writer) => writer.finish().map(drop),
        };
        ended.map_err(|error| unwritten(&self.path, &error))
    }
}

/// Why a capture is not whole.
fn unwritten(path: &Path, error: &dyn std::error::Error) -> Failure {
    let reason = format!("{}: writing the capture: {error}", path.display());
    Failure::new(reason, "make room there or name another place, and repeat the command")
}
