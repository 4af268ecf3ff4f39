//! Recording of a capture probe on a virtual segment, with the record that a probe adds to each frame (ESL).

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use linesman_lab::lab::Lab;
use linesman_link::capture::{
    CaptureInterfaceId, CaptureWriteError, FrameDirection, FrameToWrite, InterfaceToWrite,
    LinkType, PcapWriter, PcapngWriter,
};
use linesman_link::unix_time::UnixTime;
use linesman_proto::time::Instant;

use crate::failure::Failure;
use crate::files;
use crate::version;

/// Where a capture probe is looped into a virtual segment, and where its frames go.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct ProbeArguments {
    /// On a virtual segment: loop a capture probe in, a channel at each of these plugs: K1.A, maindevice, or a link
    /// such as maindevice-K1.A, at its first end. A real probe has sockets for cables, none for the E-bus
    #[arg(long, value_name = "PLACE", value_delimiter = ',', requires = "probe_record")]
    probe_at: Vec<String>,
    /// Write what the capture probe sees, each frame with its record (ESL): port, errors, time
    #[arg(long, value_name = "FILE.pcap|FILE.pcapng", requires = "probe_at")]
    probe_record: Option<PathBuf>,
    /// Where the record stands
    #[arg(long, value_enum, value_name = "FORM", requires = "probe_at", default_value_t)]
    probe_form: RecordForm,
}

/// Place of the record of a probe.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, clap::ValueEnum)]
enum RecordForm {
    /// Behind the frame
    #[default]
    Behind,
    /// In front of it
    Front,
    /// No record, as the cards of a tap write: an interface for each port where the file is a pcapng, and no damaged
    /// frames, which cards drop
    Tap,
}

/// A recording that is being written.
pub(super) struct ProbeRecording {
    path: PathBuf,
    file: CaptureFile,
    form: RecordForm,
    frame: Vec<u8>,
    stored: Vec<u8>,
}

enum CaptureFile {
    Pcap(PcapWriter<BufWriter<File>>),
    /// With the interfaces: one for the probe, or one for each port of a tap.
    Pcapng(PcapngWriter<BufWriter<File>>, Vec<CaptureInterfaceId>),
}

impl ProbeArguments {
    /// Whether a probe is wanted.
    pub(super) fn is_wanted(&self) -> bool {
        !self.probe_at.is_empty()
    }

    /// Loops the probe into a segment, and begins its recording.
    pub(super) fn begin(
        &self,
        segment: &Path,
        lab: &mut Lab,
    ) -> Result<Option<ProbeRecording>, Failure> {
        let Some(path) = &self.probe_record else { return Ok(None) };
        lab.loop_in_probe(&self.probe_at).map_err(|error| {
            let advice = format!("name a plug of {}", segment.display());
            Failure::new(format!("--probe-at: {error}"), advice)
        })?;
        files::refuse_to_overwrite(path)?;
        let in_file = |error: CaptureWriteError| files::in_file(path, &error);
        let ports = match self.probe_form {
            RecordForm::Tap => 2 * self.probe_at.len(),
            RecordForm::Behind | RecordForm::Front => 0,
        };
        let file = CaptureFile::create(path, ports).map_err(in_file)?;
        let (frame, stored) = (Vec::new(), Vec::new());
        Ok(Some(ProbeRecording { path: path.clone(), file, form: self.probe_form, frame, stored }))
    }
}

impl ProbeRecording {
    /// Writes what the probe has seen.
    pub(super) fn take(&mut self, lab: &mut Lab) -> Result<(), Failure> {
        while let Some(seen) = lab.poll_probe_frame(&mut self.frame) {
            if self.form == RecordForm::Tap && seen.record.is_damaged() {
                continue;
            }
            let record = seen.record.to_bytes();
            self.stored.clear();
            if self.form == RecordForm::Front {
                self.stored.extend_from_slice(&record);
            }
            self.stored.extend_from_slice(&self.frame);
            if self.form == RecordForm::Behind {
                self.stored.extend_from_slice(&record);
            }
            // The clock of the probe: that of the file begins in 1970 as well.
            let at =
                UnixTime::EPOCH + Instant::from_nanos(seen.record.time_ns).since(Instant::ZERO);
            let port = seen.record.port.filter(|_| self.form == RecordForm::Tap);
            let written = self.file.write(at, port, &self.stored);
            written.map_err(|error| files::in_file(&self.path, &error))?;
        }
        Ok(())
    }

    /// Ends the file.
    pub(super) fn end(self) -> Result<(), Failure> {
        let ended = match self.file {
            CaptureFile::Pcap(writer) => writer.finish(),
            CaptureFile::Pcapng(writer, _) => writer.finish(),
        };
        ended.map(drop).map_err(|error| files::in_file(&self.path, &error))
    }
}

impl CaptureFile {
    /// A new file, with an interface for each of `ports`, or one for the probe.
    fn create(path: &Path, ports: usize) -> Result<Self, CaptureWriteError> {
        let file = BufWriter::new(File::create_new(path)?);
        if path.extension().is_some_and(|extension| extension == "pcap") {
            return PcapWriter::new(file, LinkType::Ethernet, false).map(Self::Pcap);
        }
        let mut writer = PcapngWriter::new(file, &version::tool())?;
        let names: Vec<(String, &str)> = match ports {
            0 => vec![("probe".to_owned(), "capture probe")],
            ports => (0..ports).map(|port| (format!("tap{port}"), "card of a tap")).collect(),
        };
        let mut interfaces = Vec::with_capacity(names.len());
        for (name, description) in &names {
            let interface = InterfaceToWrite { name, description, link_type: LinkType::Ethernet };
            interfaces.push(writer.add_interface(&interface)?);
        }
        Ok(Self::Pcapng(writer, interfaces))
    }

    /// Writes a frame, of this port of a tap or of the probe.
    fn write(
        &mut self,
        at: UnixTime,
        port: Option<u8>,
        stored: &[u8],
    ) -> Result<(), CaptureWriteError> {
        let unknown = FrameDirection::Unknown;
        match self {
            Self::Pcap(writer) => {
                writer.write_frame(&FrameToWrite::new(CaptureInterfaceId(0), at, unknown, stored))
            }
            Self::Pcapng(writer, interfaces) => {
                let interface = interfaces.get(usize::from(port.unwrap_or(0))).copied();
                let interface = interface.unwrap_or(CaptureInterfaceId(0));
                writer.write_frame(&FrameToWrite::new(interface, at, unknown, stored))
            }
        }
    }
}
