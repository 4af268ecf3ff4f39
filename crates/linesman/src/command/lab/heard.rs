//! What the listeners of a score heard, as capture files that `linesman diagnose` and other tools read.

use std::path::Path as FilePath;

use linesman_lab::habit::Habit;
use linesman_lab::score::listen::Heard;
use linesman_lab::score::{CaseReport, TapedFrame};
use linesman_link::capture::{
    CaptureInterfaceId, CaptureWriteError, FrameDirection, FrameToWrite, InterfaceToWrite,
    LinkType, PcapngWriter,
};
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::Path;
use linesman_proto::time::Instant;

use crate::failure::Failure;
use crate::files;

/// Makes the directory, which must not be there yet.
pub(super) fn create(directory: &FilePath, habit: Habit) -> Result<(), Failure> {
    if habit == Habit::Own {
        return Err(Failure::new(
            "--record writes what listeners heard, and nobody listens beside the habit `own`",
            "give another habit, such as `--habit states`",
        ));
    }
    std::fs::create_dir(directory).map_err(|error| files::in_file(directory, &error))
}

/// Writes the recordings of a case.
pub(super) fn write(directory: &FilePath, case: &CaseReport) -> Result<(), Failure> {
    if let Some(project) = &case.project {
        let path = directory.join(format!("{}.toml", case.seed));
        files::write_new_bytes(&path, "the project", project.as_bytes())?;
    }
    for heard in &case.heard {
        let path = directory.join(format!("{}-{}.pcapng", case.seed, heard.joined));
        let bytes = pcapng(heard).map_err(|error| files::in_file(&path, &error))?;
        files::write_new_bytes(&path, "what was heard", &bytes)?;
    }
    Ok(())
}

fn pcapng(heard: &Heard) -> Result<Vec<u8>, CaptureWriteError> {
    let mut writer = PcapngWriter::new(Vec::new(), "linesman lab score")?;
    let mut cards = [None; 2];
    for frame in &heard.frames {
        let path = frame.path.unwrap_or(Path::A);
        let interface = match cards[path.index()] {
            Some(interface) => interface,
            None => describe(&mut writer, path)?,
        };
        cards[path.index()] = Some(interface);
        writer.write_frame(&to_write(frame, interface))?;
    }
    writer.finish()
}

fn describe(
    writer: &mut PcapngWriter<Vec<u8>>,
    path: Path,
) -> Result<CaptureInterfaceId, CaptureWriteError> {
    let (name, description) = (format!("card-{path}"), format!("card {path}"));
    let (name, description) = (name.as_str(), description.as_str());
    writer.add_interface(&InterfaceToWrite { name, description, link_type: LinkType::Ethernet })
}

fn to_write(frame: &TapedFrame, interface: CaptureInterfaceId) -> FrameToWrite<'_> {
    let direction = if frame.is_sent { FrameDirection::Outgoing } else { FrameDirection::Incoming };
    let time = UnixTime::EPOCH + frame.time.since(Instant::ZERO);
    FrameToWrite::new(interface, time, direction, &frame.bytes)
}
