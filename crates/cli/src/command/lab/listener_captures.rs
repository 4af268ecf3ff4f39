//! Frames that the listeners of a score heard, as capture files that `linesman diagnose` and other
//! tools read.

use std::path::Path as FilePath;

use linesman_diagnosis::{Direction, FrameSeen};
use linesman_lab::habit::Habit;
use linesman_lab::score::listen::Heard;
use linesman_lab::score::{CaseReport, RecordedFrame};
use linesman_link::unix_time::UnixTime;
use linesman_proto::address::Network;
use linesman_proto::time::Instant;
use linesman_runtime::record::Recorder;

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

/// Writes the recordings of a case, and its project.
pub(super) fn write(directory: &FilePath, case: &CaseReport) -> Result<(), Failure> {
    if let Some(project) = &case.project {
        let path = directory.join(format!("{}.toml", case.seed));
        files::write_new_bytes(&path, "the project", project.as_bytes())?;
    }
    for heard in &case.heard {
        record(&directory.join(format!("{}-{}.pcapng", case.seed, heard.joined)), heard)?;
    }
    Ok(())
}

fn record(path: &FilePath, heard: &Heard) -> Result<(), Failure> {
    let names = ["card-A", "card-B"].map(str::to_owned);
    let mut recorder = Recorder::create(path, "linesman lab score", UnixTime::EPOCH, &names)
        .map_err(|error| files::in_file(path, &error))?;
    for (frame, number) in heard.frames.iter().zip(1..) {
        recorder.frame(&seen(frame, number));
    }
    let last = heard.frames.last().map_or(Instant::ZERO, |frame| frame.time);
    recorder.finish(last).map_err(|error| files::in_file(path, &error))
}

fn seen(frame: &RecordedFrame, number: u64) -> FrameSeen<'_> {
    FrameSeen {
        network: Network::default(),
        path: frame.path,
        direction: if frame.is_sent { Direction::Sent } else { Direction::Received },
        time: frame.time,
        number,
        fcs: frame.fcs,
        truncated: false,
        probe: None,
        bytes: &frame.bytes,
    }
}
