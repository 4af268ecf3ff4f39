//! Capture files that are one recording: those of a ring of files, as dumpcap and tcpdump write them, and those that were
//! recorded side by side, as at both cards of a ring.

use std::path::{Path, PathBuf};

use linesman_link::input::is_capture_name;
use linesman_runtime::selector::Selector;

use super::{Arguments, DiagnosisRun, capture, earlier_look, line_access, refuse_misplaced};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files::{self, Planned};
use crate::output::Output;

/// True if the names are those of files of one ring: alike but for a number (`trace_00001_20260301101650.pcapng` by
/// dumpcap, `trace.pcap1` by tcpdump), each another one.
pub(crate) fn is_ring(places: &[String]) -> bool {
    let mut stems = places.iter().map(|place| stem(place));
    let Some(Some(first)) = stems.next() else { return false };
    let mut sorted: Vec<&String> = places.iter().collect();
    sorted.sort();
    let is_repeated = sorted.windows(2).any(|two| two[0] == two[1]);
    places.len() > 1 && !is_repeated && stems.all(|other| other.as_ref() == Some(&first))
}

/// The part that all names of a ring share; `None` for a name that no ring has.
fn stem(place: &str) -> Option<String> {
    let path = Path::new(place);
    let (parent, name) = (path.parent()?, path.file_name()?.to_str()?);
    let all_digits =
        |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let stem = if is_capture_name(name) {
        let (base, ending) = name.split_once(".pcap").or_else(|| name.split_once(".cap"))?;
        let (head, last) = base.rsplit_once('_')?;
        // The date comes behind the number.
        let (head, number) = match head.rsplit_once('_') {
            Some((head, number)) if all_digits(number) && last.len() == 14 => (head, number),
            Some(_) | None => (head, last),
        };
        let is_number = all_digits(number) && number.len() >= 5 && all_digits(last);
        is_number.then(|| format!("{head}_{ending}"))?
    } else {
        let (base, number) = name.rsplit_once(".pcap")?;
        all_digits(number).then(|| format!("{base}.pcap"))?
    };
    Some(parent.join(stem).display().to_string())
}

/// Judges the files as one capture.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let paths: Vec<PathBuf> = arguments.places.iter().map(PathBuf::from).collect();
    files::refuse_what_is_no_file(&paths)?;
    let selector = Selector::File(paths[0].clone());
    refuse_misplaced(arguments, &selector)?;
    for path in [&arguments.html, &arguments.svg].into_iter().flatten() {
        files::refuse_to_overwrite(path)?;
    }
    let project = arguments.project.as_deref().map(Planned::open).transpose()?;
    let earlier = arguments.after.as_deref().map(earlier_look).transpose()?;
    let stop = line_access::stop()?;
    let mut session = DiagnosisRun::new(arguments, &selector, project, earlier);
    let judged = capture::judge_files(&paths, arguments.together, &stop, &mut session, output)?;
    Ok(session.answer(&judged.engine, &judged.names, judged.at, output))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_one_ring_are_told_from_others() {
        let is_ring = |names: &[&str]| {
            is_ring(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>())
        };
        assert!(is_ring(&["a_00001_20260301101650.pcapng", "a_00002_20260301101700.pcapng"]));
        assert!(is_ring(&["d/a_00001.pcapng", "d/a_00002.pcapng", "d/a_00003.pcapng"]));
        assert!(is_ring(&["a.pcap1", "a.pcap2"]));
        assert!(!is_ring(&["a_00001.pcapng"]));
        assert!(!is_ring(&["a_00001.pcapng", "a_00001.pcapng"]), "one file twice");
        assert!(!is_ring(&["a_00001.pcapng", "b_00002.pcapng"]));
        assert!(!is_ring(&["c/a_00001.pcapng", "d/a_00002.pcapng"]));
        assert!(!is_ring(&["before.pcapng", "after.pcapng"]));
        assert!(!is_ring(&["run_1.pcapng", "run_2.pcapng"]), "numbers of a person, not of a ring");
    }
}
