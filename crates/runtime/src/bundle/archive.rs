//! Archive of a bundle: its members, written and read in bounded memory.

use std::fs::File;
use std::io::{Cursor, Read, Seek, Write};
use std::path::{Path as FilePath, PathBuf};

use linesman_config::project::Project;
use linesman_diagnosis::report::Number;
use linesman_diagnosis::{Diagnosis, Direction};
use linesman_link::capture::{
    CaptureInterfaceId, CaptureReader, CaptureWriteError, FrameDirection, FrameToWrite,
    InterfaceToWrite, LinkType, PcapngWriter,
};
use linesman_link::input::Input;
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::error::BundleError;
use super::history::{Kept, KeptFrame, KeptNote};
use super::manifest::{FrameStretch, Manifest, SCHEMA};
use super::observation::{Noticed, ObservationLine, letter};
use super::replay::card;

/// Names of the members.
pub const MEMBERS: [&str; 6] = [MANIFEST, FRAMES, OBSERVATIONS, PROJECT, DIAGNOSIS, REPORT];
const MANIFEST: &str = "manifest.json";
const FRAMES: &str = "frames.pcapng";
const OBSERVATIONS: &str = "observations.jsonl";
const PROJECT: &str = "project.toml";
const DIAGNOSIS: &str = "diagnosis.json";
const REPORT: &str = "report.txt";

/// Longest archive that is read, in bytes.
const MOST: u64 = 256 * 1024 * 1024;
/// Most bytes of frames that are unpacked.
const MOST_FRAMES: u64 = 512 * 1024 * 1024;
/// Most bytes of another member.
const MOST_TEXT: u64 = 32 * 1024 * 1024;
/// Most members of an archive.
const MOST_MEMBERS: u16 = 64;

/// A bundle that was read.
pub struct Bundle {
    /// Its name.
    pub name: PathBuf,
    /// Its manifest.
    pub manifest: Manifest,
    /// Plan of the line.
    pub project: Option<Project>,
    /// Diagnosis as it stood when it was written.
    pub diagnosis: Option<Diagnosis>,
    /// Observations between the frames.
    pub observations: Vec<ObservationLine>,
    /// `frames.pcapng`.
    pub frames: Vec<u8>,
}

impl Bundle {
    /// Reads a bundle. Nothing is unpacked to a disk, and members of other names are passed over.
    ///
    /// # Errors
    /// [`BundleError`].
    pub fn of(input: Input) -> Result<Self, BundleError> {
        let (name, stream) = (input.name().to_owned(), input.into_stream());
        let mut members = ArchiveReader::of(name, stream)?;
        let manifest: Manifest = members.manifest()?;
        let project = members.text(PROJECT)?;
        let project = project
            .map(|text| Project::parse(&text).map_err(|error| members.damaged(PROJECT, &error)))
            .transpose()?;
        let diagnosis = members.text(DIAGNOSIS)?;
        let diagnosis = diagnosis
            .map(|text| serde_json::from_str(&text))
            .transpose()
            .map_err(|error| members.damaged(DIAGNOSIS, &error))?;
        let text = members.text(OBSERVATIONS)?.unwrap_or_default();
        let observations = text
            .lines()
            .map(serde_json::from_str)
            .collect::<Result<_, _>>()
            .map_err(|error| members.damaged(OBSERVATIONS, &error))?;
        let frames = members.required(FRAMES, MOST_FRAMES)?;
        let name = members.name;
        Ok(Self { name, manifest, project, diagnosis, observations, frames })
    }

    /// Reads the frames of a bundle alone, as a capture of its name.
    ///
    /// # Errors
    /// [`BundleError`].
    pub fn frames_of(input: Input) -> Result<Input, BundleError> {
        let (name, stream) = (input.name().to_owned(), input.into_stream());
        let mut members = ArchiveReader::of(name.clone(), stream)?;
        members.manifest()?;
        let frames = members.required(FRAMES, MOST_FRAMES)?;
        Ok(Input::of(name, Cursor::new(frames)))
    }

    /// Shows the bytes of each frame to `replace`, which may change them. Cards lose their names.
    ///
    /// # Errors
    /// When `frames.pcapng` is no capture, or its frames cannot be written again.
    pub fn replace_frames(
        &mut self,
        mut replace: impl FnMut(&mut [u8]),
    ) -> Result<(), BundleError> {
        let frames = std::mem::take(&mut self.frames);
        let mut reader = CaptureReader::from_source(self.name.clone(), Cursor::new(frames))?;
        let failed = |name: &FilePath, error: &CaptureWriteError| BundleError::Damaged {
            name: name.to_owned(),
            member: FRAMES,
            why: error.to_string(),
        };
        let mut writer = FrameWriter::new(Vec::new(), &self.manifest.tool, &[])
            .map_err(|error| failed(&self.name, &error))?;
        let mut bytes = Vec::new();
        while reader.advance() {
            let path = reader.frame().and_then(|frame| card(&reader, &frame));
            let Some(frame) = reader.frame() else { break };
            bytes.clear();
            bytes.extend_from_slice(frame.bytes);
            replace(&mut bytes);
            let frame = FrameToWrite {
                crc_error: frame.fcs == Some(false),
                original_len: frame.truncated.then_some(frame.original_len),
                ..FrameToWrite::new(
                    writer.interface(path),
                    frame.time.unwrap_or(UnixTime::EPOCH),
                    frame.direction,
                    &bytes,
                )
            };
            writer.writer.write_frame(&frame).map_err(|error| failed(&self.name, &error))?;
        }
        self.frames = writer.writer.finish().map_err(|error| failed(&self.name, &error))?;
        Ok(())
    }

    /// Writes it to a new file.
    ///
    /// # Errors
    /// When the file is there already or cannot be written.
    pub fn write(&self, path: &FilePath, report: &str) -> Result<(), CaptureWriteError> {
        let file = File::create_new(path)?;
        let members = Members {
            manifest: self.manifest.clone(),
            project: self.project.as_ref().map(Project::to_toml),
            diagnosis: self.diagnosis.as_ref(),
            report: Some(report),
        };
        let mut archive = ZipWriter::new(file);
        write_members(&mut archive, &members)?;
        begin(&mut archive, FRAMES)?;
        archive.write_all(&self.frames)?;
        write_observations(&mut archive, &self.observations)?;
        archive.finish().map_err(zip_failed)?;
        Ok(())
    }
}

/// An archive that is being read.
struct ArchiveReader {
    name: PathBuf,
    archive: ZipArchive<Cursor<Vec<u8>>>,
}

impl ArchiveReader {
    fn of(name: PathBuf, stream: impl Read) -> Result<Self, BundleError> {
        let mut bytes = Vec::new();
        match stream.take(MOST + 1).read_to_end(&mut bytes) {
            Ok(len) if len as u64 > MOST => return Err(BundleError::TooLarge { name, most: MOST }),
            Ok(_) => {}
            Err(error) => return Err(BundleError::Read { name, error }),
        }
        if let Some(members) = members(&bytes).filter(|members| *members > MOST_MEMBERS) {
            let why = format!("it says that it has {members} members");
            return Err(BundleError::Archive { name, why });
        }
        match ZipArchive::new(Cursor::new(bytes)) {
            Ok(archive) => Ok(Self { name, archive }),
            Err(error) => Err(BundleError::Archive { name, why: error.to_string() }),
        }
    }

    fn manifest(&mut self) -> Result<Manifest, BundleError> {
        let bytes = self.required(MANIFEST, MOST_TEXT)?;
        // What another version has written is told by its schema first.
        let value: serde_json::Value =
            serde_json::from_slice(&bytes).map_err(|error| self.damaged(MANIFEST, &error))?;
        let text = |key: &str| {
            value.get(key).and_then(serde_json::Value::as_str).unwrap_or_default().to_owned()
        };
        let (schema, tool) = (text("schema"), text("tool"));
        if schema != SCHEMA {
            return Err(BundleError::Schema { name: self.name.clone(), schema, tool });
        }
        serde_json::from_value(value).map_err(|error| self.damaged(MANIFEST, &error))
    }

    fn required(&mut self, member: &'static str, most: u64) -> Result<Vec<u8>, BundleError> {
        let missing = BundleError::Missing { name: self.name.clone(), member };
        self.member(member, most)?.ok_or(missing)
    }

    fn text(&mut self, member: &'static str) -> Result<Option<String>, BundleError> {
        let bytes = self.member(member, MOST_TEXT)?;
        let text = bytes.map(String::from_utf8).transpose();
        text.map_err(|error| self.damaged(member, &error))
    }

    /// The bytes of a member, whatever length it claims to have.
    fn member(&mut self, member: &'static str, most: u64) -> Result<Option<Vec<u8>>, BundleError> {
        let mut bytes = Vec::new();
        let read = match self.archive.by_name(member) {
            Ok(file) => file.take(most + 1).read_to_end(&mut bytes).map_err(|why| why.to_string()),
            Err(ZipError::FileNotFound) => return Ok(None),
            Err(error) => Err(error.to_string()),
        };
        match read {
            Ok(len) if len as u64 > most => {
                Err(BundleError::MemberTooLarge { name: self.name.clone(), member, most })
            }
            Ok(_) => Ok(Some(bytes)),
            Err(why) => Err(self.damaged(member, &why)),
        }
    }

    fn damaged(&self, member: &'static str, why: &impl ToString) -> BundleError {
        BundleError::Damaged { name: self.name.clone(), member, why: why.to_string() }
    }
}

/// The number of members that the end of an archive states (APPNOTE 4.3.16).
fn members(bytes: &[u8]) -> Option<u16> {
    const END: &[u8] = b"PK\x05\x06";
    let at = bytes.windows(END.len()).rposition(|window| window == END)?;
    let total = bytes.get(at + 10..at + 12)?.first_chunk()?;
    Some(u16::from_le_bytes(*total))
}

/// Members beside the frames.
pub(super) struct Members<'a> {
    pub(super) manifest: Manifest,
    pub(super) project: Option<String>,
    pub(super) diagnosis: Option<&'a Diagnosis>,
    pub(super) report: Option<&'a str>,
}

/// The frames of a history, as they are written.
pub(super) struct KeptFrames<'a> {
    kept: &'a Kept,
    start: UnixTime,
    cards: &'a [String],
}

impl<'a> KeptFrames<'a> {
    /// The frames of a run whose time 0 has this date, seen by cards of these names.
    pub(super) const fn of(kept: &'a Kept, start: UnixTime, cards: &'a [String]) -> Self {
        Self { kept, start, cards }
    }

    /// The stretches, and what was noticed between the frames, by their numbers in the file.
    fn places(&self) -> (Vec<FrameStretch>, Vec<ObservationLine>) {
        let mut stretches: Vec<FrameStretch> = Vec::new();
        let mut lines = Vec::new();
        let mut notes = self.kept.notes.iter().peekable();
        let (mut passed, mut written) = (0, 0);
        let mut last = Instant::ZERO;
        for chunk in &self.kept.chunks {
            let left_out = chunk.first.saturating_sub(passed);
            let mut tell = |up_to: u64, lines: &mut Vec<ObservationLine>| {
                while let Some((after, note)) = notes.next_if(|(after, _)| *after <= up_to) {
                    lines.push(line(written + after.saturating_sub(passed), note));
                }
            };
            if left_out > 0 || stretches.is_empty() {
                tell(passed, &mut lines);
                if left_out > 0 {
                    let noticed = Noticed::LeftOut { frames: Number(left_out) };
                    let (after_frame, at_ns) = (Number(written), Number(last.as_nanos()));
                    lines.push(ObservationLine { after_frame, at_ns, network: 0, noticed });
                }
                stretches.push(FrameStretch {
                    from_ns: Number(chunk.from.as_nanos()),
                    to_ns: Number(chunk.to.as_nanos()),
                    frames: Number(0),
                    left_out_before: Number(left_out),
                });
                // Of the time between: all of it stands behind the last frame before.
                while let Some((_, note)) = notes.next_if(|(after, _)| *after < chunk.first) {
                    lines.push(line(written, note));
                }
                passed = chunk.first;
            }
            let frames = chunk.end() - chunk.first;
            while let Some((after, note)) = notes.next_if(|(after, _)| *after < chunk.end()) {
                lines.push(line(written + after.saturating_sub(passed), note));
            }
            if let Some(stretch) = stretches.last_mut() {
                stretch.frames.0 += frames;
                stretch.to_ns = Number(chunk.to.as_nanos());
            }
            (passed, written, last) = (chunk.end(), written + frames, chunk.to);
        }
        lines.extend(notes.map(|(_, note)| line(written, note)));
        (stretches, lines)
    }
}

fn line(after_frame: u64, note: &KeptNote) -> ObservationLine {
    match note {
        KeptNote::Host(seen) => ObservationLine::of_host(after_frame, seen),
        KeptNote::NotShown(frames, at) => ObservationLine {
            after_frame: Number(after_frame),
            at_ns: Number(at.as_nanos()),
            network: 0,
            noticed: Noticed::NotShown { frames: Number(*frames) },
        },
    }
}

/// Writes an archive.
pub(super) fn write(
    sink: impl Write + Seek,
    mut members: Members<'_>,
    frames: &KeptFrames<'_>,
) -> Result<(), CaptureWriteError> {
    let (stretches, lines) = frames.places();
    let left_out: u64 = stretches.iter().map(|stretch| stretch.left_out_before.0).sum();
    if left_out > 0 {
        members.manifest.left_out.push(format!(
            "{left_out} frames between the stretches: the memory of the recorder holds the opening of the run, what lies \
             around findings, and the time before the last one"
        ));
    }
    if frames.kept.notes_left_out > 0 {
        let count = frames.kept.notes_left_out;
        members.manifest.left_out.push(format!("the {count} oldest observations of the host"));
    }
    members.manifest.stretches = stretches;
    let mut archive = ZipWriter::new(sink);
    write_members(&mut archive, &members)?;
    begin(&mut archive, FRAMES)?;
    let tool = members.manifest.tool.as_str();
    FrameWriter::new(&mut archive, tool, frames.cards)?.write(frames)?;
    write_observations(&mut archive, &lines)?;
    archive.finish().map_err(zip_failed)?;
    Ok(())
}

fn write_members<W: Write + Seek>(
    archive: &mut ZipWriter<W>,
    members: &Members<'_>,
) -> Result<(), CaptureWriteError> {
    begin(archive, MANIFEST)?;
    json(archive, &members.manifest)?;
    if let Some(project) = &members.project {
        begin(archive, PROJECT)?;
        archive.write_all(project.as_bytes())?;
    }
    if let Some(diagnosis) = members.diagnosis {
        begin(archive, DIAGNOSIS)?;
        json(archive, diagnosis)?;
    }
    if let Some(report) = members.report {
        begin(archive, REPORT)?;
        archive.write_all(report.as_bytes())?;
    }
    Ok(())
}

fn write_observations<W: Write + Seek>(
    archive: &mut ZipWriter<W>,
    lines: &[ObservationLine],
) -> Result<(), CaptureWriteError> {
    begin(archive, OBSERVATIONS)?;
    for line in lines {
        serde_json::to_writer(&mut *archive, line).map_err(std::io::Error::from)?;
        archive.write_all(b"\n")?;
    }
    Ok(())
}

fn json<W: Write + Seek>(
    archive: &mut ZipWriter<W>,
    value: &impl serde::Serialize,
) -> Result<(), CaptureWriteError> {
    serde_json::to_writer_pretty(&mut *archive, value).map_err(std::io::Error::from)?;
    archive.write_all(b"\n")?;
    Ok(())
}

/// Begins a member. Its date is that of the format's beginning: the same bundle has the same bytes.
fn begin<W: Write + Seek>(archive: &mut ZipWriter<W>, name: &str) -> Result<(), CaptureWriteError> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .large_file(false);
    archive.start_file(name, options).map_err(zip_failed)
}

fn zip_failed(error: ZipError) -> CaptureWriteError {
    std::io::Error::from(error).into()
}

/// Writer of `frames.pcapng`.
struct FrameWriter<W: Write> {
    writer: PcapngWriter<W>,
    /// Card A, card B, and one that nobody names.
    interfaces: [CaptureInterfaceId; 3],
}

impl<W: Write> FrameWriter<W> {
    fn new(sink: W, tool: &str, cards: &[String]) -> Result<Self, CaptureWriteError> {
        let mut writer = PcapngWriter::new(sink, tool)?;
        let mut add = |name: &str, description: &str| {
            let link_type = LinkType::Ethernet;
            writer.add_interface(&InterfaceToWrite { name, description, link_type })
        };
        let name = |path: Path| cards.get(path.index()).map_or("", String::as_str);
        let interfaces = [
            add(name(Path::A), &format!("card {}", letter(Path::A)))?,
            add(name(Path::B), &format!("card {}", letter(Path::B)))?,
            add("", "a card")?,
        ];
        Ok(Self { writer, interfaces })
    }

    /// The interface of a card.
    fn interface(&self, path: Option<Path>) -> CaptureInterfaceId {
        self.interfaces[path.map_or(2, Path::index)]
    }

    fn write(mut self, frames: &KeptFrames<'_>) -> Result<(), CaptureWriteError> {
        for (frame, bytes) in frames.kept.chunks.iter().flat_map(|chunk| chunk.frames()) {
            self.frame(frame, bytes, frames.start)?;
        }
        self.writer.finish()?;
        Ok(())
    }

    fn frame(
        &mut self,
        frame: &KeptFrame,
        bytes: &[u8],
        start: UnixTime,
    ) -> Result<(), CaptureWriteError> {
        let interface = self.interface(frame.path);
        let direction = match frame.direction {
            Direction::Sent => FrameDirection::Outgoing,
            Direction::Received => FrameDirection::Incoming,
            Direction::Unknown => FrameDirection::Unknown,
        };
        let time = start + frame.time.since(Instant::ZERO);
        let original_len =
            frame.truncated.then(|| u32::try_from(bytes.len() + 1).unwrap_or(u32::MAX));
        self.writer.write_frame(&FrameToWrite {
            crc_error: frame.fcs == Some(false),
            original_len,
            ..FrameToWrite::new(interface, time, direction, bytes)
        })
    }
}

/// The time of a frame in a run that began then.
pub(super) fn since(start: UnixTime, time: Option<UnixTime>) -> Instant {
    let since = time.and_then(|time| time.since(start)).unwrap_or(Span::ZERO);
    Instant::ZERO + since
}
