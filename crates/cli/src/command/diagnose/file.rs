//! A file, a pipe or standard input: a capture, a bundle, or a text with what was read.

use std::path::Path;

use linesman_link::capture::CaptureError;
use linesman_link::input::{Content, Input};
use linesman_runtime::stop::Stop;

use super::{DiagnosisRun, Judged, bundle, capture, observations};
use crate::failure::Failure;
use crate::output::Output;

/// Judges the file by what is in it.
pub(super) fn judge(
    path: &Path,
    stop: &Stop,
    session: &mut DiagnosisRun,
    output: &mut Output,
) -> Result<Judged, Failure> {
    let wish = stop.clone();
    let input = Input::open_until(path, move || wish.is_set()).map_err(CaptureError::from)?;
    let name = path.display().to_string();
    match input.content() {
        Content::Capture => {}
        Content::Archive => {
            session.tap.refuse(&name, "a bundle was recorded by the cards of the MainDevice")?
        }
        Content::Text => session.tap.refuse(&name, "this is a text")?,
    }
    match input.content() {
        Content::Capture => {
            session.setup.source = format!("capture:{}", path.display());
            capture::judge(input, stop, session, output)
        }
        Content::Archive => bundle::judge(input, session, output),
        Content::Text => {
            session.setup.source = path.display().to_string();
            observations::judge(input, session)
        }
    }
}
