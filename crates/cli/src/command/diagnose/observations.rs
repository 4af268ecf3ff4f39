//! A text: what was read with another tool, as an observation file or as other tools print it.

use std::path::Path;

use linesman_diagnosis::InputKind;
use linesman_diagnosis::observation_file::ObservationFile;
use linesman_diagnosis::pasted::{self, Pasted};
use linesman_diagnosis::report::Understood;
use linesman_link::input::Input;
use linesman_proto::address::Network;
use linesman_proto::time::Instant;

use super::{DiagnosisRun, Judged};
use crate::failure::Failure;
use crate::files;

/// Tables that only an observation file has, or a segment file that was named by mistake.
const TABLES: [&str; 9] = [
    "device",
    "reading",
    "maindevice",
    "working_counter",
    "exchange",
    "emergency",
    "abort",
    "ring",
    "fault",
];

/// Judges what the text says.
pub(super) fn judge(input: Input, session: &mut DiagnosisRun) -> Result<Judged, Failure> {
    let path = input.name().to_owned();
    let bytes = files::bytes_of(input, "observations, in TOML or as other tools print them")?;
    let (file, understood) = read(&path, &pasted::decode(&bytes))?;
    session.understood = understood;
    let setup = &mut session.setup;
    setup.clock = if file.has_times() { super::READINGS } else { super::NO_CLOCK }.to_owned();
    setup.start = file.start();
    setup.input = InputKind::Typed;
    let engine = file.judged(setup.clone());
    let names = super::names(&engine);
    let line = engine.model(Network(0)).filter(|_| file.has_times());
    let at = line.map_or(Instant::ZERO, |line| line.now);
    Ok(Judged { engine, names, at })
}

fn read(path: &Path, text: &str) -> Result<(ObservationFile, Option<Understood>), Failure> {
    let as_file = || {
        ObservationFile::parse(text).map(|file| (file, None)).map_err(|error| {
            files::in_file_of(
                path,
                &error,
                "see `linesman schema observations`; for a virtual segment say `sim:` in front of the \
                 file's name",
            )
        })
    };
    if is_observation_file(text) {
        return as_file();
    }
    match pasted::read(text) {
        Ok(Pasted { file, understood }) => Ok((file, Some(understood))),
        Err(_) if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("toml")) => as_file(),
        Err(error) => Err(Failure::new(
            format!("{}: {error}", path.display()),
            "paste the whole output of one of these, with its first lines, or type what you know into an \
             observation file: `linesman schema observations` lists its keys; for a capture say `capture:FILE`",
        )),
    }
}

/// Whether a text is TOML of an observation file, by one of its tables.
fn is_observation_file(text: &str) -> bool {
    text.lines().any(|line| {
        let line = line.trim();
        let inside = line.strip_prefix('[').map(|rest| rest.trim_start_matches('['));
        let name = inside.and_then(|inside| inside.split([']', '.']).next()).map(str::trim);
        let is_closed = line.split('#').next().is_some_and(|line| line.trim_end().ends_with(']'));
        is_closed && name.is_some_and(|name| TABLES.contains(&name))
    })
}
