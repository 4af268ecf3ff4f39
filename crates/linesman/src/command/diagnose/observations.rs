//! An observation file: what was read with another tool.

use std::path::Path;

use linesman_diagnosis::observation_file::ObservationFile;
use linesman_proto::time::Instant;

use super::Session;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::names::Names;

/// Judges what the file says.
pub(super) fn run(path: &Path, session: Session, output: &mut Output) -> Result<Status, Failure> {
    let text = files::text(path, "observations")?;
    let file = ObservationFile::parse(&text).map_err(|error| {
        files::in_file_of(
            path,
            &error,
            "see `linesman schema observations`; for a virtual segment say `sim:` in front of the \
             file's name",
        )
    })?;
    let mut setup = session.setup.clone();
    setup.clock = super::NO_CLOCK.to_owned();
    let named = file.project();
    let names = Names::new(named.devices.iter().map(|device| device.name.clone()));
    Ok(session.answer(&file.judged(setup), &names, Instant::ZERO, output))
}
